#include "mapper/loop_detection.h"

#include <algorithm>
#include <iterator>

#include "core/error.h"
#include "core/log.h"

namespace parallax {
namespace {

std::vector<KeyframeId> connected_to(const Map& map, KeyframeId keyframe, int connected_points) {
  const std::vector<int> shared = shared_points(map, keyframe);
  std::vector<KeyframeId> out;
  for (const Keyframe& kf : map.keyframes)
    if (kf.id == keyframe || shared[static_cast<std::size_t>(kf.id.index)] >= connected_points) out.push_back(kf.id);
  return out;
}

bool intersect(const std::vector<KeyframeId>& a, const std::vector<KeyframeId>& b) {
  std::vector<KeyframeId> both;
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
  return !both.empty();
}

void require_loop_option(bool ok, const char* what) {
  if (!ok) throw InputError(std::string("loop detection: ") + what);
}

}  // namespace

void LoopDetectionOptions::validate() const {
  require_loop_option(connected_points > 0, "connected_points must be positive");
  require_loop_option(min_similarity_part >= 0 && min_similarity_part <= 1, "min_similarity_part must lie in 0 to 1");
  require_loop_option(min_similarity >= 0 && min_similarity <= 1, "min_similarity must lie in 0 to 1");
  require_loop_option(candidates > 0 && consistent > 0 && comparisons > 0 && min_pairs > 0, "counts must be positive");
  require_loop_option(max_sigma_px > 0, "max_sigma_px must be positive");
  alignment.validate();
}

std::vector<int> shared_points(const Map& map, KeyframeId keyframe) {
  std::vector<int> out(static_cast<std::size_t>(map.keyframes.capacity()), 0);
  for (const Measurement& m : map.keyframes.at(keyframe).measurements)
    for (KeyframeId id : map.points.at(m.point).observers) ++out[static_cast<std::size_t>(id.index)];
  return out;
}

LoopDetection::LoopDetection(std::shared_ptr<const Vocabulary> vocabulary, const CameraModel& camera,
                             const LoopDetectionOptions& options, std::uint64_t seed)
    : vocabulary_(std::move(vocabulary)), camera_(camera), options_(options), rng_(seed), memory_(vocabulary_) {
  options.validate();
}

void LoopDetection::forget() {
  memory_ = PlaceMemory(vocabulary_);
  remembered_.clear();
  waiting_.clear();
  suspicions_.clear();
}

// Which keyframes there are: what is gone is forgotten, what is not remembered yet is noted.
void LoopDetection::follow(const SharedMap& map) {
  const auto snapshot = map.snapshot();
  if (snapshot->map_version != map_version_) {
    map_version_ = snapshot->map_version;
    const std::vector<KeyframeId> waiting = std::move(waiting_);
    forget();
    waiting_ = waiting;
  }
  std::vector<KeyframeId> present, gone;
  for (const SnapshotKeyframe& kf : snapshot->keyframes) present.push_back(kf.id);
  std::set_difference(remembered_.begin(), remembered_.end(), present.begin(), present.end(), std::back_inserter(gone));
  for (KeyframeId id : gone) memory_.erase(id.index);
  missing_.clear();
  std::erase_if(remembered_, [&](KeyframeId id) { return std::binary_search(gone.begin(), gone.end(), id); });
  std::set_difference(present.begin(), present.end(), remembered_.begin(), remembered_.end(),
                      std::back_inserter(missing_));
  std::erase_if(waiting_, [&](KeyframeId id) { return !std::binary_search(present.begin(), present.end(), id); });
}

void LoopDetection::remember(const SharedMap& map, KeyframeId keyframe) {
  const auto images = map.read([&](const Map& m) { return m.keyframes.at(keyframe).images; });
  memory_.add(keyframe.index, memory_.bag_of(images->pyramid));
  remembered_.insert(std::upper_bound(remembered_.begin(), remembered_.end(), keyframe), keyframe);
}

std::optional<LoopCandidate> LoopDetection::step(const SharedMap& map, bool* idle) {
  follow(map);
  *idle = waiting_.empty() && missing_.empty();
  if (*idle) return std::nullopt;
  // Those that nobody asked about first: they are what is looked among.
  for (KeyframeId id : missing_) {
    if (std::find(waiting_.begin(), waiting_.end(), id) != waiting_.end()) continue;
    remember(map, id);
    return std::nullopt;
  }
  const KeyframeId next = waiting_.front();
  waiting_.erase(waiting_.begin());
  return look_up(map, next);
}

std::optional<LoopCandidate> LoopDetection::look_up(const SharedMap& map, KeyframeId keyframe) {
  const auto start = SteadyClock::now();
  // Whoever is within two steps, and what the candidates would stand for.
  struct Around {
    std::shared_ptr<const FrameImages> images;
    std::vector<KeyframeId> connected;
    std::vector<std::uint8_t> near;
  };
  const Around around = map.read([&](const Map& m) {
    Around out{m.keyframes.at(keyframe).images, connected_to(m, keyframe, options_.connected_points), {}};
    out.near.resize(static_cast<std::size_t>(m.keyframes.capacity()), 0);
    for (KeyframeId id : out.connected)
      for (KeyframeId next : connected_to(m, id, options_.connected_points))
        out.near[static_cast<std::size_t>(next.index)] = 1;
    return out;
  });
  const WordBag bag = memory_.bag_of(around.images->pyramid);
  std::vector<double> connected;
  for (KeyframeId id : around.connected)
    if (id != keyframe) connected.push_back(memory_.similarity_to(id.index, bag));
  std::sort(connected.begin(), connected.end());
  const double alike = connected.empty() ? 0 : connected[connected.size() / 2];
  const std::vector<PlaceMatch> matches = memory_.query(
      bag, options_.candidates, [&](int entry) { return around.near[static_cast<std::size_t>(entry)] != 0; });
  if (!memory_.contains(keyframe.index)) {
    memory_.add(keyframe.index, bag);
    remembered_.insert(std::upper_bound(remembered_.begin(), remembered_.end(), keyframe), keyframe);
  }
  ++statistics_.words;

  struct Suspect {
    KeyframeId keyframe;
    int count;
  };
  std::vector<Suspect> suspects;
  std::vector<Suspicion> now;
  const double least = std::max(options_.min_similarity, options_.min_similarity_part * alike);
  for (const PlaceMatch& match : matches) {
    if (match.score < least) continue;
    Suspicion suspicion;
    KeyframeId id;
    map.read([&](const Map& m) {
      for (const Keyframe& kf : m.keyframes)
        if (kf.id.index == match.entry) id = kf.id;
      suspicion.group = connected_to(m, id, options_.connected_points);
    });
    for (const Suspicion& before : suspicions_)
      if (intersect(before.group, suspicion.group)) suspicion.count = std::max(suspicion.count, before.count);
    ++suspicion.count;
    suspects.push_back({id, suspicion.count});
    now.push_back(std::move(suspicion));
  }
  suspicions_ = std::move(now);
  if (!suspects.empty()) ++statistics_.alike;
  statistics_.words_ms += milliseconds_since(start);

  std::erase_if(suspects, [&](const Suspect& s) { return s.count < options_.consistent; });
  if (suspects.empty()) return std::nullopt;
  const auto compared = SteadyClock::now();
  const Map copy = map.copy().map;
  if (static_cast<int>(suspects.size()) > options_.comparisons)
    suspects.resize(static_cast<std::size_t>(options_.comparisons));
  std::optional<LoopCandidate> best;
  for (const Suspect& suspect : suspects) {
    ++statistics_.compared;
    auto alignment = align_places(copy, suspect.keyframe, copy, keyframe, camera_, options_.alignment, &rng_);
    log::debug("loop: keyframe ", keyframe.index, " against ", suspect.keyframe.index, ": ",
               alignment ? alignment->inliers : 0, " pairs, sigma ", alignment ? alignment->sigma_px : 0.0, " px");
    if (!alignment || alignment->inliers < options_.min_pairs || alignment->sigma_px > options_.max_sigma_px) continue;
    if (best && best->alignment.inliers >= alignment->inliers) continue;
    best = LoopCandidate{suspect.keyframe, keyframe, std::move(*alignment)};
  }
  statistics_.compare_ms += milliseconds_since(compared);
  if (best) {
    ++statistics_.found;
    suspicions_.clear();
  }
  return best;
}

}  // namespace parallax
