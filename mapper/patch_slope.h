// The slope of the surface under a map point, from what several views show (where PTAM §6.5 and §8.2 say it is weak).
//
// The surface is a plane in the source camera's frame. On it, inverse depth is linear over the image: at an offset (dx,
// dy), in source-level pixels, from the patch's centre it is the centre's times (1 + slope . (dx, dy)). A slope moves
// what a view shows along its epipolar line, in proportion to the offset: the patch's affine image derivatives are made
// once, and a Gauss-Newton step (inverse composition, Baker and Matthews 2001) over the slope, and over each view's own
// shift, gain and mean, costs one sampling of each view. Plain values; safe from any thread.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "core/camera_model.h"
#include "core/image.h"
#include "core/se3.h"
#include "map/entities.h"

namespace parallax {

// Slope of the plane with this normal (source camera frame) through rays.col(0), and back: unit, towards the camera.
// `rays` as MapPoint::source_rays.
Eigen::Vector2d slope_of_normal(const Eigen::Matrix3d& rays, const Eigen::Vector3d& normal);
Eigen::Vector3d normal_of_slope(const Eigen::Matrix3d& rays, const Eigen::Vector2d& slope);

// Pixels of a view, as the slope estimate needs them.
struct SlopeView {
  RigidTransform view_from_source;
  const ImagePyramid* pyramid = nullptr;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // measured, level 0
};

class PatchSlope {
 public:
  static constexpr int kRadius = 7;  // source-level pixels
  static constexpr int kSize = 2 * kRadius + 1;
  static constexpr int kRow = 16;  // floats a row: the last is padding
  static constexpr int kSamples = kSize * kRow;

  // Takes the source's pixels. `depth` is the point's along z in the source camera. ok() is false when the window
  // leaves the image or has too little texture.
  PatchSlope(const ImagePyramid& source, int source_level, const Eigen::Vector2d& source_pixel,
             const Eigen::Matrix3d& rays, double depth);
  bool ok() const { return ok_; }

  // Adds a view; false when the point is not in front of it or is seen much too large or too small there.
  bool add(const CameraModel& camera, const SlopeView& view, const Eigen::Vector2d& slope);
  int views() const { return static_cast<int>(views_.size()); }

  // The part of each view's contrast that the source's patch, warped with this slope and aligned, leaves unexplained (1
  // where it cannot be seen): the mean over the views, the worst of four or more left out.
  double score(const Eigen::Vector2d& slope);

  struct Refinement {
    Eigen::Vector2d slope = Eigen::Vector2d::Zero();
    double sigma =
        1;  // standard deviation of the slope in its worst direction, in units of `prior_sigma`: 1 is nothing learnt
    bool ok = false;
  };
  // Gauss-Newton from `start`, which is also the mean of a prior with standard deviation `prior_sigma` in both
  // directions.
  Refinement refine(const Eigen::Vector2d& start, double prior_sigma);

 private:
  using Samples = Eigen::Array<float, kSamples, 1>;
  // d/dx and d/dy of the patch; each times dx and dy; the patch itself (its mean removed); ones.
  static constexpr int kBasis = 8;
  using Gram = Eigen::Matrix<double, kBasis, kBasis>;
  using Moments = Eigen::Matrix<double, kBasis, 1>;

  struct View {
    Eigen::Matrix3d h;               // columns: q(0), dq/dx, dq/dy at no slope
    Eigen::Vector3d t;               // dq/d(relative inverse depth)
    Eigen::Matrix2d pixel_from_ray;  // level pixels per unit of q.xy / q.z
    Eigen::Vector2d centre;          // where the point is seen, level pixels
    const GreyImage* image = nullptr;
  };
  // A view sampled with a slope: its moments with the basis, its own energy, and the way back from its pixels.
  struct Sampled {
    Moments moments = Moments::Zero();
    double energy = 0;
    Eigen::Matrix2d affine = Eigen::Matrix2d::Identity();  // view-level pixels per source-level pixel
    Eigen::Vector2d epipolar = Eigen::Vector2d::Zero();    // source-level pixels per unit of relative inverse depth
  };
  bool sample(const View& view, const Eigen::Vector2d& slope, Sampled* out);
  double unexplained(const Sampled& s, double* gain) const;
  // Moves the view's centre to where the patch fits best with this slope; the unexplained part.
  double align(View* view, const Eigen::Vector2d& slope);

  bool ok_ = false;
  std::array<Samples, kBasis> weighted_;  // the basis times the window's weights
  Samples weight_, warped_;
  Gram gram_ = Gram::Zero();
  Eigen::Matrix3d rays_;
  double inverse_depth_ = 0;
  std::vector<View> views_;
};

}  // namespace parallax
