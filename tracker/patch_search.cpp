#include "tracker/patch_search.h"

#include <algorithm>

namespace parallax {
namespace {

// A sub-pixel match whose residual is above this (grey levels rms), and above its share of the template's contrast, is
// something else.
constexpr ResemblanceLimits kResemblance = {.max_rms = 22.0f, .part = 0.6f, .noise_rms = 7.0f};

// Templates of points that are gone are freed when there are more of them than a quarter of the points, and than this.
constexpr std::size_t kGoneKept = 256;

}  // namespace

void PatchSearch::clear() {
  cache_.clear();
  entries_ = 0;
}

void PatchSearch::forget_absent(const TrackingSnapshot& map) {
  std::vector<std::unique_ptr<Entry>> kept(cache_.size());
  entries_ = 0;
  for (const PointId id : map.id) {
    const auto index = static_cast<std::size_t>(id.index);
    if (index >= cache_.size() || !cache_[index]) continue;
    kept[index] = std::move(cache_[index]);
    ++entries_;
  }
  cache_ = std::move(kept);
}

const WarpedPatch& PatchSearch::warped(const TrackingSnapshot& map, const Candidate& candidate) {
  const auto index = static_cast<std::size_t>(map.id[candidate.row].index);
  if (index >= cache_.size()) cache_.resize(std::max(index + 1, 2 * cache_.size()));
  if (!cache_[index]) {
    if (entries_ > map.id.size() + map.id.size() / 4 + kGoneKept) forget_absent(map);
    cache_[index] = std::make_unique<Entry>();
    ++entries_;
  }
  auto& entry = cache_[index];
  const SnapshotKeyframe& source = map.keyframes[map.source[candidate.row]];
  const Eigen::Vector2f source_pixel = map.source_pixel[candidate.row];
  // How far a corner of the patch (half a patch from the centre) moves in the target level between the two warps.
  const double change =
      (candidate.warp - entry->patch.warp).cwiseAbs().sum() * (kPatchSize / 2) / level_scale(candidate.level);
  const bool same = entry->patch.level == candidate.level && entry->source == source.id &&
                    entry->source_pixel == source_pixel && change < options_.template_reuse_px;
  if (!same) {
    warp_source_patch_for_alignment(source.images->pyramid, map.source_level[candidate.row],
                                    source_pixel.cast<double>(), candidate.warp, candidate.level, &entry->patch);
    entry->source = source.id;
    entry->source_pixel = source_pixel;
  }
  return entry->patch;
}

PatchMatch PatchSearch::find(const TrackingSnapshot& map, const Candidate& candidate, const FrameImages& frame,
                             double radius_px, bool align_directly) {
  PatchMatch match;
  const WarpedPatch& patch = warped(map, candidate);
  if (!patch.ok || !patch.alignment.valid) return match;
  const int level = candidate.level;
  const Eigen::Vector2d centre = level0_to_level(candidate.pixel, level);
  const double radius = radius_px / level_scale(level) + 1.0;
  const int threshold = zmssd_threshold(patch.search);
  int x = 0, y = 0;
  const int score = best_zmssd(patch.search, frame.pyramid.level[level], frame.corners[level], centre.x(), centre.y(),
                               radius, threshold, &x, &y);
  AlignmentResult result;
  if (score <= threshold) {
    result = align_patch(patch.alignment, frame.pyramid.level[level], Eigen::Vector2d(x, y));
  } else if (align_directly) {
    result = align_patch(patch.alignment, frame.pyramid.level[level], centre);
  }
  if (!result.converged || !resembles(result, patch.search, kResemblance)) return match;
  match.pixel = level_to_level0(result.position, level);
  match.sigma_px = level_scale(level);
  match.found = (match.pixel - candidate.pixel).norm() <= radius_px + 2 * level_scale(level);
  return match;
}

}  // namespace parallax
