// Where a calibration starts: a rough lens found from the views alone, by trying.
#pragma once

#include <span>
#include <vector>

#include "calib/lens.h"
#include "calib/target_detection.h"

namespace parallax {

// A view of a target, as points and pixels.
struct ViewPoints {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> pixels;
};
ViewPoints view_points(const std::vector<Eigen::Vector3d>& target, const std::vector<TargetCorner>& corners);

// A lens with how well it explains the views: the median over the views of the rms residual in pixels.
struct LensGuess {
  CameraModel camera;
  double score_px = 0;
};

// Guesses, best first: a focal length in closed form from the homographies with the principal point in the middle
// (Zhang 2000, section 3.1), and a range of pinhole, wide-angle (FOV) and equidistant lenses; each is judged by how
// well the target can be posed in (at most twelve of) the views. The first is the best of all, the second the best
// pinhole. Empty when no lens explains any view.
std::vector<LensGuess> guess_lenses(std::span<const ViewPoints> views, int width, int height);

}  // namespace parallax
