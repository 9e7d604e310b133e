// Place recognition for stereo sessions (MS §4.1, §4.2): every keyframe is asked for among all before it, of its own
// session and of others. Words propose (Eq. 4), CRF-Matching verifies (Eq. 5), geometry decides and measures.
//
// s(t, t-1) of Eq. 4 and Lambda(t, t-1) of Eq. 5 are those of the session's newest keyframe that is at least a second
// older, or of its oldest one. Without one, or after a turn so quick that the two have little in common, s(t, t-1)
// counts as options.usual_similarity: a small s does not make everything acceptable. A graph of which t-1 explains too
// few features is not asked (crf_eta); where neither can be, geometry alone decides.
//
// Not thread-safe. The same calls give the same answers: generators are seeded from the keys.
#pragma once

#include <compare>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "core/se3.h"
#include "core/stereo_camera.h"
#include "core/time.h"
#include "place/crf_matching.h"
#include "place/loop_geometry.h"
#include "place/place_index.h"
#include "place/stereo_scene.h"

namespace parallax {

struct SceneKey {
  int session = 0, keyframe = 0;
  auto operator<=>(const SceneKey&) const = default;
};

struct PlaceEncounter {
  SceneKey query, found;
  double bow = 0;  // eta_c, Eq. 4
  // eta of Eq. 5; NaN: not asked.
  double crf_near = std::numeric_limits<double>::quiet_NaN(), crf_far = std::numeric_limits<double>::quiet_NaN();
  bool accepted_by_bow = false;
  int matches = 0, inliers = 0;
  double seen_share = 0;    // of what geometry says should be seen
  double silent_share = 0;  // of the parts of the images that should show something, and do not
  RigidTransform found_from_query;
  Matrix6d covariance = Matrix6d::Zero();  // left increment of found_from_query, translation first
  std::string refused;                     // empty: accepted
};

struct PlaceRecogniserOptions {
  double alpha_minus = 0.15, alpha_plus = 0.8;  // of eta_c, MS §4.1
  double beta_near = 2, beta_far = 2;           // of eta_3D and eta_Im, MS §4.1
  bool use_crf = true;                          // false: words and geometry alone
  double usual_similarity = 0.05;               // the least that s(t, t-1) counts as
  int candidates = 10;                          // the most alike, each asked for by CRF-Matching
  int verified = 4;    // of them whose geometry is looked at, those with the most features associated first
  int of_a_group = 3;  // of them that are neighbours in time, at most
  double group_s = 3;  // neighbours in time: nearer than this
  int accepted = 2;    // encounters of a query, at most, of different groups
  // Of its own session, keyframes nearer than these in time or in number are not asked.
  double min_gap_s = 15;
  int min_gap_keyframes = 30;
  std::uint64_t seed = 1;
  StereoSceneOptions scene;
  LoopGeometryOptions geometry;

  void validate() const;  // throws InputError naming the field
};

// What the last add() took, milliseconds of the calling thread's processor time.
struct RecognitionTimes {
  double words_ms = 0, crf_ms = 0, geometry_ms = 0;
};

class PlaceRecogniser {
 public:
  // The vocabulary is not empty. Throws InputError for options out of range.
  PlaceRecogniser(std::shared_ptr<const Vocabulary> vocabulary, const CrfModel& model,
                  const PlaceRecogniserOptions& options = {});

  // Before the first scene of a session. Again with the same camera: nothing happens.
  void begin_session(int session, const StereoCamera& camera);

  // Asks for the scene among all before it, then adds it. Accepted encounters first, then the refused candidates that
  // were asked (for curves and logs). A scene that only has features and right_px is completed. Within a session
  // keyframes come in order of time and number, each once.
  std::vector<PlaceEncounter> add(const SceneKey& key, Timestamp time, StereoScene scene);
  // The same without asking: from the database.
  void restore(const SceneKey& key, Timestamp time, StereoScene scene);
  // All of its scenes.
  void forget_session(int session);

  int size() const { return index_.size(); }
  const RecognitionTimes& times() const { return times_; }

 private:
  // Trees and points are built again when a scene becomes a candidate: they are most of what it weighs.
  struct Entry {
    SceneKey key;
    Timestamp time{0};
    std::vector<PlaceFeature> features;
    std::vector<float> right_px;
  };
  struct Session {
    StereoCamera camera;
    std::vector<int> entries;  // in order of time
  };

  struct Proposal {
    int entry = 0;
    double rank = 0;  // less is more promising
    StereoScene scene;
    std::vector<std::pair<int, int>> associations;
    PlaceEncounter encounter;
  };

  Session& session_of(const SceneKey& key);
  void keep(const SceneKey& key, Timestamp time, StereoScene scene);
  StereoScene scene_of(int entry) const;
  Timestamp time_of(const SceneKey& key) const;
  std::vector<Proposal> propose(const StereoScene& scene, int before, const std::vector<PlaceMatch>& candidates,
                                double similarity_before) const;
  int entry_before(const SceneKey& key, Timestamp time) const;
  std::vector<PlaceMatch> candidates_of(const SceneKey& key, Timestamp time, const WordBag& bag) const;
  static bool verify_graph(const CrfMatch& match, const CrfMatch& before, const CrfGraphModel& model, double beta,
                           double* eta);

  std::shared_ptr<const Vocabulary> vocabulary_;
  CrfModel model_;
  PlaceRecogniserOptions options_;
  PlaceIndex index_;
  std::unordered_map<int, Entry> entries_;
  std::map<int, Session> sessions_;
  int next_entry_ = 0;
  RecognitionTimes times_;
};

}  // namespace parallax
