#include "place/place_recogniser.h"

#include <time.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <random>
#include <utility>

#include "core/check.h"
#include "core/error.h"

namespace parallax {
namespace {

constexpr double kSecondBefore_s = 1;  // MS Eq. 4
// Alike images come many from one place: so many are looked through for each candidate.
constexpr int kLookedThrough = 20;

double processor_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

double seconds_between(Timestamp a, Timestamp b) { return std::abs(to_seconds(a - b)); }

std::uint64_t mixed(std::uint64_t seed, std::initializer_list<int> values) {
  for (const int value : values) {
    // Steele, Lea, Flood: SplitMix64 (2014).
    seed += 0x9e3779b97f4a7c15U + static_cast<std::uint64_t>(static_cast<std::uint32_t>(value));
    seed = (seed ^ (seed >> 30U)) * 0xbf58476d1ce4e5b9U;
    seed = (seed ^ (seed >> 27U)) * 0x94d049bb133111ebU;
    seed ^= seed >> 31U;
  }
  return seed;
}

}  // namespace

void PlaceRecogniserOptions::validate() const {
  const auto expect = [](bool good, const char* text) {
    if (!good) throw InputError(std::string("place recognition: ") + text);
  };
  expect(alpha_minus >= 0 && alpha_minus <= alpha_plus, "alpha_minus: expected 0 to alpha_plus");
  expect(beta_near > 0 && beta_far > 0, "beta_near, beta_far: expected more than 0");
  expect(usual_similarity > 0, "usual_similarity: expected more than 0");
  expect(verified >= 1, "verified: expected at least 1");
  expect(candidates >= 1 && of_a_group >= 1 && accepted >= 1, "candidates, of_a_group, accepted: expected at least 1");
  expect(group_s >= 0 && min_gap_s >= 0 && min_gap_keyframes >= 0, "group_s, min_gap: expected 0 or more");
  scene.validate();
  geometry.validate();
}

PlaceRecogniser::PlaceRecogniser(std::shared_ptr<const Vocabulary> vocabulary, const CrfModel& model,
                                 const PlaceRecogniserOptions& options)
    : vocabulary_(std::move(vocabulary)), model_(model), options_(options) {
  PARALLAX_CHECK(vocabulary_ && !vocabulary_->empty(), "places are recognised by a vocabulary");
  options_.validate();
}

void PlaceRecogniser::begin_session(int session, const StereoCamera& camera) {
  const auto [it, is_new] = sessions_.try_emplace(session, Session{camera, {}});
  PARALLAX_CHECK(is_new || it->second.camera == camera, "one camera a session");
}

PlaceRecogniser::Session& PlaceRecogniser::session_of(const SceneKey& key) {
  const auto it = sessions_.find(key.session);
  PARALLAX_CHECK(it != sessions_.end(), "a scene of a session that has begun");
  return it->second;
}

void PlaceRecogniser::keep(const SceneKey& key, Timestamp time, StereoScene scene) {
  Session& session = session_of(key);
  if (!session.entries.empty()) {
    const Entry& last = entries_.at(session.entries.back());
    PARALLAX_CHECK(last.key < key && last.time <= time, "the keyframes of a session in order, each once");
  }
  const int entry = next_entry_++;
  index_.add(entry, scene.bag);
  session.entries.push_back(entry);
  entries_.emplace(entry, Entry{key, time, std::move(scene.features), std::move(scene.right_px)});
}

Timestamp PlaceRecogniser::time_of(const SceneKey& key) const {
  const std::vector<int>& entries = sessions_.at(key.session).entries;
  const auto at = std::lower_bound(entries.begin(), entries.end(), key,
                                   [&](int entry, const SceneKey& k) { return entries_.at(entry).key < k; });
  return entries_.at(*at).time;
}

StereoScene PlaceRecogniser::scene_of(int entry) const {
  const Entry& stored = entries_.at(entry);
  StereoScene scene;
  scene.features = stored.features;
  scene.right_px = stored.right_px;
  build_scene_trees(sessions_.at(stored.key.session).camera, options_.scene, &scene);
  return scene;
}

void PlaceRecogniser::restore(const SceneKey& key, Timestamp time, StereoScene scene) {
  if (!scene.is_complete()) scene.bag = vocabulary_->bag_of(descriptors_of(scene.features));
  keep(key, time, std::move(scene));
}

void PlaceRecogniser::forget_session(int session) {
  const auto it = sessions_.find(session);
  if (it == sessions_.end()) return;
  for (const int entry : it->second.entries) {
    index_.erase(entry);
    entries_.erase(entry);
  }
  sessions_.erase(it);
}

// The newest of the session that is at least a second older, else the oldest; -1: none.
int PlaceRecogniser::entry_before(const SceneKey& key, Timestamp time) const {
  const std::vector<int>& entries = sessions_.at(key.session).entries;
  if (entries.empty()) return -1;
  for (std::size_t i = entries.size(); i-- > 0;)
    if (to_seconds(time - entries_.at(entries[i]).time) >= kSecondBefore_s) return entries[i];
  return entries.front();
}

std::vector<PlaceMatch> PlaceRecogniser::candidates_of(const SceneKey& key, Timestamp time, const WordBag& bag) const {
  const auto is_too_close = [&](int entry) {
    const Entry& other = entries_.at(entry);
    return other.key.session == key.session && (key.keyframe - other.key.keyframe < options_.min_gap_keyframes ||
                                                seconds_between(time, other.time) < options_.min_gap_s);
  };
  std::vector<PlaceMatch> out;
  struct Group {
    int entry = 0, size = 0;
  };
  std::vector<Group> groups;
  for (const PlaceMatch& match : index_.query(bag, kLookedThrough * options_.candidates, is_too_close)) {
    if (static_cast<int>(out.size()) >= options_.candidates) break;
    const Entry& entry = entries_.at(match.entry);
    const auto group = std::find_if(groups.begin(), groups.end(), [&](const Group& g) {
      const Entry& first = entries_.at(g.entry);
      return first.key.session == entry.key.session && seconds_between(first.time, entry.time) < options_.group_s;
    });
    if (group == groups.end()) {
      groups.push_back({match.entry, 1});
    } else if (group->size++ >= options_.of_a_group) {
      continue;
    }
    out.push_back(match);
  }
  return out;
}

// Eq. 5; true where it cannot be asked.
bool PlaceRecogniser::verify_graph(const CrfMatch& match, const CrfMatch& before, const CrfGraphModel& model,
                                   double beta, double* eta) {
  *eta = crf_eta(match, before, model);
  return std::isnan(*eta) || *eta <= beta;
}

// The candidates with what the words and the field say of them, those that are not refused first, the most promising
// of these first.
std::vector<PlaceRecogniser::Proposal> PlaceRecogniser::propose(const StereoScene& scene, int before,
                                                                const std::vector<PlaceMatch>& candidates,
                                                                double similarity_before) const {
  std::vector<Proposal> out;
  std::array<std::optional<CrfMatch>, 2> earlier;  // near, far: against the scene a second before
  for (const PlaceMatch& match : candidates) {
    const double eta = match.score / similarity_before;
    if (eta <= options_.alpha_minus) break;
    Proposal one;
    one.entry = match.entry;
    one.scene = scene_of(match.entry);
    PlaceEncounter& encounter = one.encounter;
    encounter.bow = eta;
    encounter.accepted_by_bow = eta >= options_.alpha_plus;
    one.rank = -eta;
    if (options_.use_crf) {
      if (!earlier[0]) {
        StereoScene scene_before;
        if (before >= 0) scene_before = scene_of(before);
        earlier[0] = match_by_crf(scene, scene_before, SceneGraph::near, model_.near);
        earlier[1] = match_by_crf(scene, scene_before, SceneGraph::far, model_.far);
      }
      const CrfMatch near = match_by_crf(scene, one.scene, SceneGraph::near, model_.near);
      const CrfMatch far = match_by_crf(scene, one.scene, SceneGraph::far, model_.far);
      const bool near_good = verify_graph(near, *earlier[0], model_.near, options_.beta_near, &encounter.crf_near);
      const bool far_good = verify_graph(far, *earlier[1], model_.far, options_.beta_far, &encounter.crf_far);
      one.associations = near.pairs;
      one.associations.insert(one.associations.end(), far.pairs.begin(), far.pairs.end());
      if (!encounter.accepted_by_bow && !(near_good && far_good))
        encounter.refused = "the features do not match as those of one place do";
      // More that is explained is more promising, whether or not there was a scene before.
      one.rank = -static_cast<double>(one.associations.size());
    }
    out.push_back(std::move(one));
  }
  std::stable_sort(out.begin(), out.end(), [](const Proposal& a, const Proposal& b) {
    return std::pair(!a.encounter.refused.empty(), a.rank) < std::pair(!b.encounter.refused.empty(), b.rank);
  });
  return out;
}

std::vector<PlaceEncounter> PlaceRecogniser::add(const SceneKey& key, Timestamp time, StereoScene scene) {
  times_ = {};
  double start = processor_ms();
  const StereoCamera camera = session_of(key).camera;
  if (!scene.is_complete()) complete_stereo_scene(camera, *vocabulary_, options_.scene, &scene);
  const int before = entry_before(key, time);
  double similarity_before = options_.usual_similarity;
  if (before >= 0) similarity_before = std::max(similarity_before, similarity(*index_.find(before), scene.bag));
  const std::vector<PlaceMatch> candidates = candidates_of(key, time, scene.bag);
  times_.words_ms = processor_ms() - start;

  start = processor_ms();
  std::vector<Proposal> proposals = propose(scene, before, candidates, similarity_before);
  times_.crf_ms = processor_ms() - start;

  start = processor_ms();
  std::vector<PlaceEncounter> accepted, refused;
  int verified = 0;
  for (Proposal& proposal : proposals) {
    PlaceEncounter& encounter = proposal.encounter;
    const Entry& entry = entries_.at(proposal.entry);
    encounter.query = key;
    encounter.found = entry.key;
    if (encounter.refused.empty()) {
      if (static_cast<int>(accepted.size()) >= options_.accepted || verified >= options_.verified) continue;
      // A neighbour of it has been accepted: nothing new.
      if (std::any_of(accepted.begin(), accepted.end(), [&](const PlaceEncounter& other) {
            return other.found.session == entry.key.session &&
                   seconds_between(time_of(other.found), entry.time) < options_.group_s;
          }))
        continue;
      ++verified;
      std::mt19937_64 rng(mixed(options_.seed, {key.session, key.keyframe, entry.key.session, entry.key.keyframe}));
      LoopGeometry geometry = check_loop_geometry(camera, scene, sessions_.at(entry.key.session).camera, proposal.scene,
                                                  proposal.associations, options_.geometry, &rng);
      encounter.matches = geometry.matches;
      encounter.inliers = std::max(geometry.inliers, geometry.first_inliers);
      encounter.seen_share = geometry.seen_share;
      encounter.silent_share = geometry.silent_share;
      encounter.found_from_query = geometry.found_from_query;
      encounter.covariance = geometry.covariance;
      encounter.refused = std::move(geometry.refused);
    }
    (encounter.refused.empty() ? accepted : refused).push_back(std::move(encounter));
  }
  times_.geometry_ms = processor_ms() - start;
  keep(key, time, std::move(scene));
  accepted.insert(accepted.end(), std::make_move_iterator(refused.begin()), std::make_move_iterator(refused.end()));
  return accepted;
}

}  // namespace parallax
