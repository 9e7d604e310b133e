// The patch of a map point: its source pixels, and the affine warp that takes them into another view (PTAM §5.3, Eq.
// 7).
#pragma once

#include <Eigen/Core>

#include "core/camera_model.h"
#include "core/image.h"
#include "core/patch.h"
#include "core/se3.h"
#include "map/entities.h"

namespace parallax {

// Fills the point's source fields for a patch at `pixel` of pyramid level `level` (level pixels) in a keyframe; false
// when a neighbouring pixel has no ray.
bool set_source(MapPoint* point, KeyframeId keyframe, int level, const Eigen::Vector2d& pixel,
                const CameraModel& camera);

// World displacement of one source-level pixel to the right (column 0) and down (column 1) on the patch's plane: rays
// through neighbouring pixels intersected with it. False when the plane is seen nearly edge-on from the source.
bool patch_axes(const MapPoint& point, const RigidTransform& source_from_world, Eigen::Matrix<double, 3, 2>* axes);

// A of Eq. 7: level-0 pixels in the target view per source-level pixel.
inline Eigen::Matrix2d warp_matrix(const Eigen::Matrix<double, 2, 3>& d_pixel_d_point,
                                   const Eigen::Matrix3d& camera_from_world_R,
                                   const Eigen::Matrix<double, 3, 2>& axes) {
  return d_pixel_d_point * (camera_from_world_R * axes);
}

// The pyramid level whose det(A) / 4^l is closest to one (in ratio); -1 when even the best is off by more than a factor
// of `max_ratio`: the patch would be seen much too large or too small.
int target_level(double det_A, double max_ratio = 3.5);

// A patch warped for one view: the template that is searched with and, made on demand, the one that is aligned with.
struct WarpedPatch {
  PatchTemplate search;
  AlignmentTemplate alignment;
  Eigen::Matrix2d warp = Eigen::Matrix2d::Zero();  // A it was made for
  int level = -1;                                  // of the target view
  bool ok = false;
  bool alignment_ready = false;
};

// Makes the search template at `level` of the target view from the source pyramid. False (and ok = false) when the
// patch leaves the source image.
bool warp_source_patch(const ImagePyramid& source, int source_level, const Eigen::Vector2d& source_pixel,
                       const Eigen::Matrix2d& A, int level, WarpedPatch* out);
// Makes the alignment template (floating point, for sub-pixel measurement).
void prepare_alignment(const ImagePyramid& source, int source_level, const Eigen::Vector2d& source_pixel,
                       WarpedPatch* patch);

// Both templates at once, sampled once: for who will need both. False (and ok = false) when the patch leaves the source
// image.
bool warp_source_patch_for_alignment(const ImagePyramid& source, int source_level, const Eigen::Vector2d& source_pixel,
                                     const Eigen::Matrix2d& A, int level, WarpedPatch* out);

// The patch as it looks in another light: contrast times `gain` about its mean (clamped to what pixels hold in the
// search template). The alignment template has to be ready.
WarpedPatch with_gain(const WarpedPatch& patch, double gain);

// By what the contrast of the 8x8 block around (x, y) differs from the template's, wherever in it the corner lies; 0
// when the block leaves the image or the template is flat.
double contrast_ratio(const PatchTemplate& t, const GreyImage& image, int x, int y);

// What zero-mean SSD a match may have: a fixed part for noise and a part of the template's own contrast, so that a flat
// template does not match everything and a strong one survives blur and gain.
int zmssd_threshold(const PatchTemplate& t);

// How alike an aligned match must be: its residual (grey levels rms) is below `noise_rms`, or below `part` of the
// template's contrast, and never above `max_rms`.
struct ResemblanceLimits {
  float max_rms, part, noise_rms;
};
bool resembles(const AlignmentResult& match, const PatchTemplate& t, const ResemblanceLimits& limits);

}  // namespace parallax
