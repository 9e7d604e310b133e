// What there is to see of sessions, as pictures, reports and the live view draw it: ways, links, uncertainty, points.
//
// Frames: `global` is that of a component, the sessions that have met; each component has its own. Metres, seconds of
// session time (from a session's first keyframe). Plain values and pure functions, safe from any thread.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "app/eval_canvas.h"
#include "core/point_cloud.h"
#include "sessions/back_end.h"

namespace parallax {

struct ScenePose {
  int keyframe = 0, frame = 0;
  double seconds = 0;
  bool after_failure = false;
  RigidTransform global_from_camera;
};

struct SceneSession {
  int id = 0, component = 0;
  std::string name;
  CanvasColour colour;
  std::vector<ScenePose> poses;       // by keyframe
  std::vector<ColouredPoint> points;  // global
  bool textured = false;              // points carry the colours of images; else they are features

  double seconds() const { return poses.empty() ? 0 : poses.back().seconds; }
  // Session time of a frame, between those of the keyframes about it.
  double seconds_of_frame(int frame) const;
  double path_m() const;
};

// An encounter that is in the pose graph.
struct SceneLink {
  PoseKey found, query;
  bool within_session() const { return found.session == query.session; }
};

// How sure the place of a keyframe is.
struct SceneSpread {
  PoseKey key;
  Eigen::Matrix3d covariance;  // of the camera's place, global, square metres
};

struct SessionScene {
  std::vector<SceneSession> sessions;  // by id
  std::vector<SceneLink> links;
  std::vector<SceneSpread> spreads;

  const SceneSession* session(int id) const;
  const ScenePose* pose(const PoseKey& key) const;  // null: not there
  // The scene of each component, the earliest session's first. Sessions without a pose are left out.
  std::vector<SessionScene> components() const;
  // The scene of one session alone.
  SessionScene only(int id) const;
};

// All of it but points and spreads.
SessionScene make_session_scene(const BackEndView& view);

// Spreads of at most so many keyframes of a session, evenly spaced, the last among them.
void add_spreads(const SessionGraph& graph, int most_a_session, SessionScene* scene);

// Of the camera's place, when `covariance` is of a left increment of global_from_camera (translation first):
// p' = p + v + w x p.
Eigen::Matrix3d place_covariance(const Matrix6d& covariance, const Eigen::Vector3d& place);

// The feature map of a session, every so many-th point, at most `most`. Points of keyframes that are not there are
// passed over.
void add_feature_points(int session, const std::vector<SessionPoint>& points, std::size_t most, SessionScene* scene);

// Half axes of the ellipse that holds a plane normal distribution's mass of 95 % (columns, of its covariance's units'
// root).
Eigen::Matrix2d ellipse_95(const Eigen::Matrix2d& covariance);

// Colours after Okabe and Ito, which the colour-blind tell apart: of the nth session, and of links, which no session
// has.
CanvasColour session_colour(int n);
inline constexpr CanvasColour kWithinSessionColour{213, 94, 0}, kBetweenSessionsColour{204, 121, 167};

}  // namespace parallax
