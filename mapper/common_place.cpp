#include "mapper/common_place.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>
#include <utility>

#include "core/error.h"
#include "place/place_memory.h"

namespace parallax {
namespace {

struct Candidate {
  double score;
  KeyframeId in_a, in_b;
};

struct Found {
  PlaceAlignment alignment;
  KeyframeId in_a, in_b;
};

// Likeliest first.
std::vector<Candidate> candidates(const Map& a, const Map& b, std::shared_ptr<const Vocabulary> vocabulary,
                                  const CommonPlaceOptions& options, const Interruption& stop) {
  PlaceMemory memory(std::move(vocabulary));
  for (const Keyframe& kf : a.keyframes) {
    if (stop.requested()) return {};
    memory.add(kf.id.index, memory.bag_of(kf.images->pyramid));
  }
  std::vector<Candidate> out;
  for (const Keyframe& kf : b.keyframes) {
    if (stop.requested()) return {};
    for (const PlaceMatch& match :
         memory.query(memory.bag_of(kf.images->pyramid), options.candidates_per_keyframe, [](int) { return false; }))
      out.push_back({match.score, {kf.id.session, match.entry}, kf.id});
  }
  std::sort(out.begin(), out.end(), [](const Candidate& p, const Candidate& q) {
    return std::tuple(-p.score, p.in_b, p.in_a) < std::tuple(-q.score, q.in_b, q.in_a);
  });
  return out;
}

// Where the second one's points lie, the first says the same.
bool agree(const Map& a, const Map& b, const Found& first, const Found& second, double limit) {
  if (std::abs(std::log(first.alignment.a_from_b.s / second.alignment.a_from_b.s)) > 2 * limit) return false;
  const Eigen::Vector3d viewer = a.keyframes.at(second.in_a).centre();
  std::vector<double> off;
  for (const PointPair& pair : second.alignment.pairs) {
    const Eigen::Vector3d p = second.alignment.a_from_b * b.points.at(pair.b).position;
    off.push_back((first.alignment.a_from_b * b.points.at(pair.b).position - p).norm() / (p - viewer).norm());
  }
  std::nth_element(off.begin(), off.begin() + static_cast<std::ptrdiff_t>(off.size() / 2), off.end());
  return off[off.size() / 2] < limit;
}

std::string refusal(const std::vector<Found>& found) {
  if (found.empty()) return "no place was found that both maps show";
  return "one common view is too little: expected another that says the same";
}

void check_place_option(bool ok, const char* what) {
  if (!ok) throw InputError(std::string("common place: ") + what);
}

}  // namespace

void CommonPlaceOptions::validate() const {
  alignment.validate();
  check_place_option(candidates_per_keyframe > 0, "candidates_per_keyframe must be positive");
  check_place_option(max_tries > 0 && enough_alignments > 0, "max_tries and enough_alignments must be positive");
  check_place_option(agreeing_keyframes > 0, "agreeing_keyframes must be positive");
  check_place_option(max_disagreement > 0, "max_disagreement must be positive");
  check_place_option(max_contradiction >= 0, "max_contradiction must not be negative");
}

CommonPlace find_common_place(const Map& a, const Map& b, const CameraModel& camera,
                              std::shared_ptr<const Vocabulary> vocabulary, const CommonPlaceOptions& options,
                              std::mt19937_64* rng, const Interruption& stop) {
  options.validate();
  CommonPlace out;
  std::vector<Found> found;
  for (const Candidate& c : candidates(a, b, std::move(vocabulary), options, stop)) {
    if (out.tries >= options.max_tries || static_cast<int>(found.size()) >= options.enough_alignments) break;
    if (stop.requested()) break;
    ++out.tries;
    auto alignment = align_places(a, c.in_a, b, c.in_b, camera, options.alignment, rng);
    if (alignment) found.push_back({std::move(*alignment), c.in_a, c.in_b});
  }
  if (stop.requested()) {
    out.reason = "interrupted";
    return out;
  }
  // The one that most agree with.
  std::vector<const Found*> best;
  const Found* centre = nullptr;
  int best_pairs = 0, all_pairs = 0;
  for (const Found& one : found) {
    std::vector<const Found*> agreeing;
    int pairs = 0;
    for (const Found& other : found) {
      if (!agree(a, b, one, other, options.max_disagreement)) continue;
      agreeing.push_back(&other);
      pairs += other.alignment.inliers;
    }
    all_pairs += one.alignment.inliers;
    const bool better =
        pairs > best_pairs || (pairs == best_pairs && centre && one.alignment.inliers > centre->alignment.inliers);
    if (!better) continue;
    best = std::move(agreeing);
    best_pairs = pairs;
    centre = &one;
  }
  std::set<KeyframeId> keyframes;
  int strongest = 0;
  for (const Found* f : best) {
    keyframes.insert(f->in_b);
    strongest = std::max(strongest, f->alignment.inliers);
  }
  if (static_cast<int>(keyframes.size()) < options.agreeing_keyframes && strongest < options.strong_inliers) {
    out.reason = refusal(found);
    return out;
  }
  if (all_pairs - best_pairs > options.max_contradiction * best_pairs) {
    out.reason = "the common views contradict each other";
    return out;
  }
  out.found = true;
  out.a_from_b = centre->alignment.a_from_b;
  out.alignments = static_cast<int>(best.size());
  std::set<PointId> used;
  std::sort(best.begin(), best.end(),
            [](const Found* p, const Found* q) { return p->alignment.inliers > q->alignment.inliers; });
  for (const Found* f : best)
    for (const PointPair& pair : f->alignment.pairs)
      if (used.insert(pair.b).second) out.pairs.push_back(pair);
  return out;
}

}  // namespace parallax
