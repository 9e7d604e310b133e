// What the parts of the multi-session system tell each other, and what the database keeps (MS Fig. 1 and 3).
//
// Sessions are numbered from 1 in the order in which they began, keyframes from 0 within their session; both numbers
// are never used again. Frames: `session` is the left camera of a session's first keyframe, and stays the session's
// own; `camera` the rectified left camera of a keyframe; `global` that of all sessions that have met, which is the
// frame of the earliest of them (MS §4.2). Metres, seconds. Covariances are of a left increment, translation first.
// Plain values, safe to hand from thread to thread.
#pragma once

#include <compare>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "core/image.h"
#include "core/se3.h"
#include "core/stereo_camera.h"
#include "core/time.h"
#include "map/stereo_messages.h"
#include "place/place_features.h"

namespace parallax {

// A keyframe of a session.
struct PoseKey {
  int session = 0, keyframe = 0;
  auto operator<=>(const PoseKey&) const = default;
};

// A front end has begun.
struct SessionStart {
  std::string name;    // unique in a database, which appends "-2", "-3"... when it is not
  std::string source;  // as the user named it
  StereoCamera camera;
  RigidTransform rectified_from_left;  // of the left camera as calibrated
  double frames_per_second = 0;
};

// Front end to back end, as soon as a keyframe has been smoothed the first time: for place recognition.
struct SessionKeyframe {
  int index = 0, frame = 0;
  Timestamp time{0};
  bool after_failure = false;
  RigidTransform session_from_camera;  // as the front end has it now
  GreyImage left, right;               // rectified; shared
};

// A point of the feature map, told from the keyframe that it follows.
struct SessionPoint {
  int keyframe = 0;
  Eigen::Vector3f camera = Eigen::Vector3f::Zero();
  int poses = 0;  // that saw it
};

// Front end to back end, when a window is handed over (MS §3.2): constraints between consecutive keyframes.
struct SessionWindow {
  std::vector<StereoConstraint> constraints;
  std::vector<SessionPoint> points;
};

// What place recognition has found: the provenance of an edge between two keyframes (MS Eq. 4 to 6).
enum class EncounterState {
  waiting,  // geometrically sound, not yet confirmed by another
  active,   // in the pose graph
  refused,  // disagrees with those that are active
  off       // switched off by the user
};
struct Encounter {
  std::int64_t id = 0;  // unique in a database
  PoseKey found, query;
  RigidTransform found_from_query;
  Matrix6d covariance = Matrix6d::Identity();
  double bow = 0;                                              // Eq. 4
  double crf_near = std::numeric_limits<double>::quiet_NaN();  // Eq. 5; NaN: was not asked
  double crf_far = std::numeric_limits<double>::quiet_NaN();
  int matches = 0, inliers = 0;
  EncounterState state = EncounterState::waiting;
  bool within_session() const { return found.session == query.session; }
};

// Features of a keyframe, as the database keeps them.
struct SessionFeatures {
  std::vector<PlaceFeature> features;
  std::vector<float> right_px;  // u in the right image, NaN: none
};

// A session as it stands.
struct SessionState {
  int id = 0;
  SessionStart start;
  bool ended = false;
  // Sessions that have met share a component, named after the earliest; anchors tell their place in it (Eq. 6).
  int component = 0;
  RigidTransform global_from_session;
  Matrix6d anchor_covariance = Matrix6d::Zero();
};

// A keyframe as it stands.
struct SessionPose {
  PoseKey key;
  int frame = 0;
  Timestamp time{0};
  bool after_failure = false;
  RigidTransform session_from_camera;
};

// Milliseconds that a module spent on a keyframe or window (MS Table 2, Fig. 8).
enum class SessionModule { feature_tracking, stereo_odometry, window, place_recognition, pose_graph };
struct SessionTiming {
  PoseKey key;  // the keyframe, the last keyframe of the window; of feature tracking and odometry: the frame
  SessionModule module = SessionModule::window;
  double ms = 0;
  bool loop = false;  // pose graph: a loop was closed
};

// A monocular map that hangs on a session, with its own scale.
struct AttachedMap {
  std::int64_t id = 0;
  std::string name, path;         // the map file
  int session = 0, keyframe = 0;  // that it follows
  SimilarityTransform keyframe_from_map;
  int agreements = 0;  // of keyframes
};

}  // namespace parallax
