#include "tracker/stereo_matching.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/patch.h"

namespace parallax {
namespace {

constexpr int kIterations = 8;
constexpr int kMaxMeanSquare = 20 * 20;  // grey levels, a pixel
constexpr double kSecondBest = 1.35;     // the next best place, not beside the best, differs so much more
constexpr int kBeside_px = 2;

}  // namespace

std::optional<double> search_row(const GreyImage& left, const GreyImage& right, const Eigen::Vector2d& corner,
                                 const RowSearch& search) {
  const int x = static_cast<int>(std::lround(corner.x())), y = static_cast<int>(std::lround(corner.y()));
  PatchTemplate block;
  if (y < kPatchSize / 2 || y > right.rows - kPatchSize / 2 || !copy_patch(left, x, y, &block)) return std::nullopt;
  const int first = std::max(kPatchSize / 2, x - static_cast<int>(search.max_disparity_px));
  const int last = std::min(right.cols - kPatchSize / 2, x + 1);
  int best = std::numeric_limits<int>::max(), best_x = -1;
  thread_local std::vector<int> scores;
  scores.assign(static_cast<std::size_t>(std::max(0, last - first + 1)), 0);
  for (int at = first; at <= last; ++at) {
    const int score = zmssd(block, right, at, y);
    scores[static_cast<std::size_t>(at - first)] = score;
    if (score < best) best = score, best_x = at;
  }
  if (best_x < 0 || best > kMaxMeanSquare * kPatchPixels) return std::nullopt;
  for (int at = first; at <= last; ++at)
    if (std::abs(at - best_x) > kBeside_px &&
        scores[static_cast<std::size_t>(at - first)] < kSecondBest * best + kPatchPixels)
      return std::nullopt;
  return best_x - x + corner.x();
}

std::optional<RightMatch> align_right(const AffineTemplate& window, const cv::Mat1f& right_smooth, double guess_x,
                                      double row, const Eigen::Matrix2d& linear, const RowSearch& search,
                                      const Eigen::Vector2d& perspective) {
  const AffineTemplate::Result found =
      window.align(right_smooth, {guess_x, row}, linear, true, kIterations, perspective);
  if (!found.converged || found.correlation < search.min_correlation ||
      std::abs(found.position.y() - row) > search.max_row_difference_px)
    return std::nullopt;
  return RightMatch{found.position.x(), found.linear};
}

}  // namespace parallax
