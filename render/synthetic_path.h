// How the camera of a synthetic sequence moves, and what happens to it: smooth analytic motion, so that any moment of
// any frame's exposure has its exact pose, for sequences of any length.
//
// World frame, metres, seconds, radians; poses are camera to world. Values; safe from any thread.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/se3.h"

namespace parallax {

// What a test may want to know about a frame.
struct FrameLabel {
  bool covered = false;  // something is in front of part or all of the lens
  bool shaking = false;  // violent motion
  bool unseen = false;   // looking at a place the sequence shows nowhere else
  bool cut = false;      // the pose has jumped since the frame before
  bool light = false;    // the light has changed suddenly since the frame before
  bool operator==(const FrameLabel&) const = default;
};

// A sequence's script. All functions are pure.
struct SyntheticMotion {
  // Pose at `offset_s` from the middle of the exposure of a frame. Jumps happen only between frames.
  std::function<RigidTransform(int frame, double offset_s)> world_from_camera;
  std::function<FrameLabel(int frame)> label;
  // Brightness factor of the light, slow drift included; and how far the lens is covered, 0 (free) to 1.
  std::function<double(int frame)> gain;
  std::function<double(int frame)> cover;
};

inline constexpr double kSyntheticFps = 30;

// Camera at `eye` looking at `target`, turned about its axis by `roll`.
RigidTransform look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target, double roll = 0);

// Hand tremor and exploration differ with the seed; the script does not.
SyntheticMotion desk_motion(std::uint64_t seed);
// desk_motion with violent shaking, a covered lens, jumps to another view and to a place never seen, and sudden light
// changes. Scripted for the first 900 frames; calm afterwards.
SyntheticMotion shakes_motion(std::uint64_t seed);
// PTAM §7.3: sideways along one wall, around the corner, along the next, 18.2 m over `frames` frames at z = 3.
SyntheticMotion walls_motion(int frames);
// Turns on the spot above the desk, never moves.
SyntheticMotion rotation_motion(std::uint64_t seed);
// Sideways first, then circling the middle of the room, once around a minute and never twice on quite the same path.
SyntheticMotion room_motion(std::uint64_t seed);

}  // namespace parallax
