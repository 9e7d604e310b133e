// Everything that is compiled once for each instruction set, in the order it depends on one another.
// clang-format off
#include "solver/simd_lanes.inl"
#include "solver/lens_lanes.inl"
#include "solver/tile_kernels.inl"
#include "solver/bundle_kernels.inl"
#include "solver/pose_kernels.inl"
#include "solver/kernel_table.inl"
// clang-format on
