#include "tracker/stereo_flow.h"

#include "core/patch.h"

namespace parallax {
namespace {

constexpr float kMaxResidual = 18;    // grey levels, rms over the window at level 0
constexpr double kMaxShift_px = 3.0;  // at every level

// One way. Levels on which the window does not settle are passed over, but for the last.
std::optional<Eigen::Vector2d> track(const ImagePyramid& last, const ImagePyramid& next, const Eigen::Vector2d& from,
                                     Eigen::Vector2d at, int coarsest) {
  AlignmentTemplate window;
  for (int level = coarsest; level >= 0; --level) {
    const auto l = static_cast<std::size_t>(level);
    if (!warp_alignment_template(last.level[l], level0_to_level(from, level), Eigen::Matrix2d::Identity(), &window) ||
        !window.valid) {
      if (level == 0) return std::nullopt;
      continue;
    }
    const AlignmentResult found = align_patch(window, next.level[l], level0_to_level(at, level), 10, kMaxShift_px);
    if (found.converged && (level > 0 || found.rms_residual < kMaxResidual))
      at = level_to_level0(found.position, level);
    else if (level == 0)
      return std::nullopt;
  }
  return at;
}

}  // namespace

std::optional<Eigen::Vector2d> track_forward_backward(const ImagePyramid& last, const ImagePyramid& next,
                                                      const Eigen::Vector2d& from, const Eigen::Vector2d& guess,
                                                      const FlowOptions& options) {
  const auto there = track(last, next, from, guess, options.coarsest_level);
  if (!there) return std::nullopt;
  // Back, from where it began: what has changed on the way does not find its place again. A repeated pattern does.
  const auto back = track(next, last, *there, from, std::min(1, options.coarsest_level));
  if (!back || (*back - from).norm() > options.max_round_trip_px) return std::nullopt;
  return there;
}

}  // namespace parallax
