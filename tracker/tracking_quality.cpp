#include "tracker/tracking_quality.h"

#include <algorithm>
#include <numeric>

namespace parallax {
namespace {

// Fewer attempts on the coarse levels than this say nothing.
constexpr int kMinCoarseAttempts = 10;
// Part of the matches that must agree with the pose.
constexpr double kMinInlierPart = 0.5;
// Cells of 4 x 4 over the image that inliers must be in: a wrong pose finds its support in one textured corner.
constexpr int kMinCells = 4;
// Where much has been moved since the map was made, fewer of the points are found. Then they must agree with each other
// better than chance or a single thing that was moved can make them.
constexpr int kChangedMinInliers = 100, kChangedMinCells = 7;
constexpr double kChangedMinFraction = 0.18, kChangedMinAgreement = 0.9, kChangedMaxSigma = 0.6;
// Below this part, a pose that is right agrees with what was found to about a standard deviation. One on a place that
// has only its furniture in common with the map (a keyboard and a screen that stand alike) does not.
constexpr double kSureFraction = 0.5, kUnsureMaxSigma = 1.5;

struct Fractions {
  double all = 0, coarse = 0;
};

Fractions found_fractions(const TwoStageResult& r) {
  const int attempted = std::accumulate(r.attempted.begin(), r.attempted.end(), 0);
  const int found = std::accumulate(r.found.begin(), r.found.end(), 0);
  const int coarse_attempted = r.attempted[2] + r.attempted[3], coarse_found = r.found[2] + r.found[3];
  Fractions f;
  if (attempted == 0) return f;
  // Matches that the pose contradicts were not found.
  const double agree = found > 0 ? static_cast<double>(r.inliers) / found : 0.0;
  f.all = agree * found / attempted;
  f.coarse = coarse_attempted > kMinCoarseAttempts ? static_cast<double>(coarse_found) / coarse_attempted : f.all;
  return f;
}

}  // namespace

TrackingQuality assess_quality(const TwoStageResult& result, const TrackerOptions& options) {
  if (!result.ok || result.inliers < options.min_inliers || result.sigma > options.max_sigma)
    return TrackingQuality::lost;
  const int found = std::accumulate(result.found.begin(), result.found.end(), 0);
  if (result.inliers < kMinInlierPart * found) return TrackingQuality::lost;
  const Fractions f = found_fractions(result);
  if (f.all > options.good_fraction) return TrackingQuality::good;
  if (std::max(f.coarse, f.all) < options.lost_fraction) return TrackingQuality::lost;
  return TrackingQuality::poor;
}

bool accept_recovery(const TwoStageResult& result, const CameraModel& camera, const TrackerOptions& options) {
  if (assess_quality(result, options) == TrackingQuality::lost) return false;
  if (result.inliers < options.recovery_min_inliers) return false;
  std::array<bool, 16> cell{};
  for (const MatchedPoint& m : result.matches) {
    if (m.weight <= 0) continue;
    const int cx = std::clamp(static_cast<int>(m.pixel.x() * 4 / camera.width()), 0, 3);
    const int cy = std::clamp(static_cast<int>(m.pixel.y() * 4 / camera.height()), 0, 3);
    cell[cy * 4 + cx] = true;
  }
  const auto cells = std::count(cell.begin(), cell.end(), true);
  const double fraction = found_fractions(result).all;
  if (fraction < kSureFraction && result.sigma > kUnsureMaxSigma) return false;
  if (fraction >= options.recovery_min_fraction) return cells >= kMinCells;
  const int found = std::accumulate(result.found.begin(), result.found.end(), 0);
  return fraction >= kChangedMinFraction && cells >= kChangedMinCells && result.inliers >= kChangedMinInliers &&
         result.inliers >= kChangedMinAgreement * found && result.sigma <= kChangedMaxSigma;
}

}  // namespace parallax
