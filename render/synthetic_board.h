// A calibration board that leans on a box on a table, and a camera that visits it the way a person does who calibrates:
// from many places, tilted, near and far, holding still at each of them.
//
// The board is what `parallax calibrate` expects when nothing is said: 9 x 6 points, 25 mm apart. Target frame: origin
// at the first point, x to the right, y down, z into the board (calib/target.h). World: that of the scene, z up,
// metres. Pure functions and values, safe from any thread.
#pragma once

#include <cstdint>

#include "core/camera_model.h"
#include "core/se3.h"
#include "render/synthetic_path.h"
#include "render/synthetic_scene.h"

namespace parallax {

inline constexpr int kSyntheticBoardColumns = 9, kSyntheticBoardRows = 6;
inline constexpr double kSyntheticBoardSquare_m = 0.025;

enum class SyntheticBoardKind {
  chessboard,  // inner corners
  circles,     // discs of half a square's diameter
};

// Where the board is. It faces the place from which a synthetic hand starts (render/synthetic_hand.h).
RigidTransform world_from_synthetic_board();

SyntheticScene build_board_scene(std::uint64_t seed, SyntheticBoardKind kind);

// One view of the board after another, kBoardViews in a round, with the tremor of a hand. A view shows the whole board
// wherever this lens can; later rounds differ a little from the first.
inline constexpr int kBoardViews = 20, kBoardStillFrames = 12, kBoardMovingFrames = 12;
SyntheticMotion board_motion(const CameraModel& camera, std::uint64_t seed);

}  // namespace parallax
