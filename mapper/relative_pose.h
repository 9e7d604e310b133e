// Scoring and refinement of two-view models over a set of matches, in level-0 pixels whatever the lens: residuals are
// formed on rays and scaled by each ray's own Jacobian of the projection (two_view.h, PTAM §6.1).
//
// Scores are truncated sums (MSAC; Torr and Zisserman 2000), abandoned as soon as they are worse than a limit; the
// error of the essential matrix is Sampson's first-order distance (Hartley and Zisserman §11.4.3). Vectorised, chosen
// at run time, with the same result on every machine. Not thread-safe while being filled; const functions are.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "core/camera_model.h"
#include "core/se3.h"

namespace parallax {

struct RayMatch {
  Eigen::Vector3d ray1, ray2;                  // (x, y, 1)
  Eigen::Matrix2d ray_from_px1, ray_from_px2;  // d (x, y) / d pixel at each ray
  Eigen::Matrix2d px_from_ray2;
};

class RayMatches {
 public:
  void reserve(std::size_t n);
  void clear();
  // Both rays (x, y, 1), and the 2x2 Jacobians d pixel / d (x, y) there (invertible).
  void add(const Eigen::Vector3d& ray1, const Eigen::Vector3d& ray2, const Eigen::Matrix2d& px_from_ray1,
           const Eigen::Matrix2d& px_from_ray2);
  void add(const RayMatch& match);

  std::size_t size() const { return matches_.size(); }
  const RayMatch& operator[](std::size_t i) const { return matches_[i]; }

  // Sum over the matches of min(error^2, truncation), px^2: Sampson errors of ray2^T E ray1, or the transfer error of
  // ray2 ~ H ray1 in view 2 over sqrt(2) (so that its standard deviation is a match's). Abandoned, with a value above
  // `limit`, once it exceeds that.
  double essential_cost(const Eigen::Matrix3d& E, double truncation_px2, double limit) const;
  double homography_cost(const Eigen::Matrix3d& H, double truncation_px2, double limit) const;

  // Squared errors, one a match.
  void essential_errors(const Eigen::Matrix3d& E, std::vector<float>* errors_px2) const;
  void homography_errors(const Eigen::Matrix3d& H, std::vector<float>* errors_px2) const;

 private:
  std::vector<RayMatch> matches_;
  std::vector<float> lanes_;  // blocks of kBlock matches, each a structure of arrays
};

// Iteratively reweighted Gauss-Newton steps on the first `n` matches with Tukey's biweight of the given width (px).
// Returns after `iterations` or when the step is below 1e-7.
void refine_relative_pose(const RayMatches& matches, std::size_t n, double width_px, int iterations,
                          RigidTransform* second_from_first);  // Sampson error, |t| = 1 kept
void refine_homography(const RayMatches& matches, std::size_t n, double width_px, int iterations, Eigen::Matrix3d* H);
void refine_rotation(const RayMatches& matches, std::size_t n, double width_px, int iterations, Eigen::Matrix3d* R);

}  // namespace parallax
