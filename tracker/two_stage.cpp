#include "tracker/two_stage.h"

#include <algorithm>

namespace parallax {
namespace {

// A point is where it should be within so many standard deviations.
constexpr double kAgreesSigmas = 4.0;

float lap(SteadyClock::time_point* mark) {
  const auto now = SteadyClock::now();
  const float ms = std::chrono::duration<float, std::milli>(now - *mark).count();
  *mark = now;
  return ms;
}

}  // namespace

TwoStageTracker::TwoStageTracker(const CameraModel& camera, const TrackerOptions& options)
    : camera_(camera),
      options_(options),
      projector_(camera, options.min_view_cosine, 3 * options.fine_points),
      search_(options) {}

void TwoStageTracker::try_candidate(const TrackingSnapshot& map, const FrameImages& frame, const Candidate& candidate,
                                    double radius_px, bool align_directly, TwoStageResult* out) {
  ++out->attempted[candidate.level];
  const PatchMatch match = search_.find(map, candidate, frame, radius_px, align_directly);
  if (!match.found) {
    out->missed.push_back(candidate);
    return;
  }
  ++out->found[candidate.level];
  out->matches.push_back({candidate.row, candidate.level, match.pixel, match.sigma_px, 1.0f});
}

void TwoStageTracker::refine(const TrackingSnapshot& map, TwoStageResult* out) {
  observations_.clear();
  for (const MatchedPoint& m : out->matches) observations_.push_back({map.position[m.row], m.pixel, m.sigma_px});
  const PoseSummary summary = refine_pose(camera_, observations_, PoseOptions{}, &out->camera_from_world, &weights_);
  out->ok = summary.ok;
  out->sigma = summary.sigma;
  out->inliers = summary.inliers;
  out->covariance = summary.covariance;
  for (std::size_t i = 0; i < out->matches.size() && i < weights_.size(); ++i) out->matches[i].weight = weights_[i];
}

bool TwoStageTracker::coarse_stage(const TrackingSnapshot& map, const FrameImages& frame, double radius_px,
                                   TwoStageResult* out) {
  auto mark = SteadyClock::now();
  // The highest levels first, until there are enough points (PTAM §5.5).
  std::vector<Candidate> coarse;
  for (int level = kPyramidLevels - 1; level >= 1 && static_cast<int>(coarse.size()) < options_.coarse_points;
       --level) {
    std::vector<Candidate> of_level;
    for (const Candidate& c : candidates_)
      if (c.level == level) of_level.push_back(c);
    choose_spread(of_level, map, camera_.width(), camera_.height(),
                  options_.coarse_points - static_cast<int>(coarse.size()), &chosen_);
    for (int i : chosen_) coarse.push_back(of_level[i]);
  }
  for (const Candidate& c : coarse) {
    tried_[c.row] = 1;
    try_candidate(map, frame, c, radius_px, false, out);
  }
  out->times.search += lap(&mark);
  const int found = static_cast<int>(out->matches.size());
  if (found < options_.coarse_min) return false;
  const RigidTransform before = out->camera_from_world;
  refine(map, out);
  out->times.pose += lap(&mark);
  // A coarse pose that most of its own matches contradict is worse than the prior.
  if (out->ok && out->inliers >= std::max(options_.coarse_min / 2, found / 2)) return true;
  out->camera_from_world = before;
  return false;
}

void TwoStageTracker::fine_stage(const TrackingSnapshot& map, const FrameImages& frame, double radius_px,
                                 int first_look_points, TwoStageResult* out) {
  auto mark = SteadyClock::now();
  const int points = first_look_points > 0 ? first_look_points : options_.fine_points;
  const bool align_directly = first_look_points == 0 && options_.align_without_corner;
  std::vector<Candidate>& fine = candidates_;
  std::erase_if(fine, [&](const Candidate& c) { return tried_[c.row] != 0; });
  choose_spread(fine, map, camera_.width(), camera_.height(),
                points - static_cast<int>(out->matches.size() + out->missed.size()), &chosen_);
  out->times.projection += lap(&mark);
  for (int i : chosen_) {
    Candidate candidate = fine[i];
    if (out->coarse_used && !projector_.project_one(map, candidate.row, out->camera_from_world, &candidate)) continue;
    try_candidate(map, frame, candidate, radius_px, align_directly, out);
  }
  out->times.search += lap(&mark);
}

// Candidates of sources that are out of place are taken out; some are kept to be probed.
void TwoStageTracker::set_aside(const TrackingSnapshot& map, const TwoStageRequest& request) {
  to_probe_.clear();
  if (request.out_of_place == nullptr) return;
  std::erase_if(candidates_, [&](const Candidate& c) {
    const auto row = static_cast<std::size_t>(c.row);
    if (!(*request.out_of_place)[static_cast<std::size_t>(map.source[row])]) return false;
    if ((map.id[row].index + request.turn) % kProbedOne == 0) to_probe_.push_back(c);
    return true;
  });
}

void TwoStageTracker::probe(const TrackingSnapshot& map, const FrameImages& frame, double radius_px,
                            TwoStageResult* out) {
  for (Candidate candidate : to_probe_) {
    if (!projector_.project_one(map, candidate.row, out->camera_from_world, &candidate)) continue;
    ProbedPoint probed{.row = candidate.row};
    const PatchMatch match = search_.find(map, candidate, frame, radius_px, false);
    if (match.found) {
      const double limit = kAgreesSigmas * std::max(1.0, out->sigma) * match.sigma_px;
      probed.found = true;
      probed.agrees = (match.pixel - candidate.pixel).norm() < limit;
    }
    out->probed.push_back(probed);
  }
}

void TwoStageTracker::track(const TrackingSnapshot& map, const FrameImages& frame, const TwoStageRequest& request,
                            TwoStageResult* out) {
  auto mark = SteadyClock::now();
  *out = TwoStageResult();
  out->camera_from_world = request.prior;
  projector_.project(map, request.prior, &candidates_);
  set_aside(map, request);
  tried_.assign(static_cast<std::size_t>(map.size()), 0);
  out->times.projection += lap(&mark);

  if (request.coarse) out->coarse_used = coarse_stage(map, frame, request.coarse_radius_px, out);
  if (request.needs_coarse && !out->coarse_used) {
    out->ok = false;
    return;
  }
  // Without a coarse pose the prior is only as good as the motion model.
  const double radius =
      out->coarse_used ? request.fine_radius_px : std::max(request.fine_radius_px, options_.fine_radius_no_coarse_px);
  fine_stage(map, frame, radius, request.first_look_points, out);
  mark = SteadyClock::now();
  refine(map, out);
  out->times.pose += lap(&mark);
  if (to_probe_.empty() || !out->ok) return;
  probe(map, frame, request.fine_radius_px, out);
  out->times.search += lap(&mark);
}

}  // namespace parallax
