// The table of this instruction set's kernels, one row a lens. Included inside its namespace, last.

template <Lens kLens>
inline constexpr auto pose_project_for = pose_project<kLens>;
template <>
inline constexpr void (*pose_project_for<Lens::bal>)(const PoseJob&) = nullptr;  // no pose-only problem there

template <Lens kLens>
inline constexpr SolverKernels kernels_for = {evaluate<kLens>,
                                              linearise<kLens>,
                                              update<kLens>,
                                              cost,
                                              tile_multiply,
                                              tile_factor,
                                              tile_solve,
                                              tile_apply,
                                              tile_apply_transposed,
                                              pose_project_for<kLens>,
                                              pose_advance,
                                              pose_normal};

extern const SolverKernels kernels[kLensCount];
const SolverKernels kernels[kLensCount] = {kernels_for<Lens::pinhole>, kernels_for<Lens::radtan>,
                                           kernels_for<Lens::kannala_brandt>, kernels_for<Lens::fov>,
                                           kernels_for<Lens::bal>};
