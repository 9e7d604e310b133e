// What a session database holds, as other programs take it: trajectories, a pose graph, coloured points. Conversions
// only; files are written by app/sessions_export.
//
// Frames: `own` is the session's; `global` that of all sessions it has met, which for one that has met none is its own.
// Plain functions, safe from any thread.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/graph_file.h"
#include "core/trajectory.h"
#include "sessions/session_database.h"

namespace parallax {

enum class SessionFrame { own, global };

// Keyframes, of the left camera as calibrated, as `parallax slam --keyframes` writes them. A session that is not in the
// document has none.
Trajectory session_trajectory(const SessionDocument& document, int session, SessionFrame frame);

// Covariance of a left increment of a measurement to the information that g2o has of it: of a right increment, the
// rotation's part for the vector of a quaternion.
Matrix6d g2o_information(const RigidTransform& from_from_to, const Matrix6d& covariance);

// Poses of the sessions in the global frame, numbered from 0 in the order of sessions and keyframes, with the
// constraints and the active encounters between them. Information matrices are of a right increment, the rotation's
// part for the vector of a quaternion (half an angle), as g2o has them. The first pose of each component is fixed.
GraphFile session_graph_file(const SessionDocument& document, const std::vector<int>& sessions);

struct SessionCloudPoint {
  int session = 0, keyframe = 0, poses = 0;
  Eigen::Vector3d global = Eigen::Vector3d::Zero();
};
// The feature map of a session in the global frame. Points of keyframes that are not in the document are left out.
std::vector<SessionCloudPoint> session_cloud(const SessionDocument& document, int session,
                                             const std::vector<SessionPoint>& points);

// A session's colour in pictures and files, one of eight that differ.
std::array<std::uint8_t, 3> cloud_colour_of(int session);

// Length of the way over the keyframes, metres; a guess across a failure counts as none.
double session_path_m(const SessionDocument& document, int session);

// The state of a session that is in the document. CHECK otherwise.
const SessionState& session_state(const SessionDocument& document, int session);

}  // namespace parallax
