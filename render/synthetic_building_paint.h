// Pictures of a public building: walls, floors, ceilings, doors, windows, notice boards. As the painters of
// synthetic_paint.h: sizes are what texture_size() gives, and only the given generator is drawn from.
#pragma once

#include "render/synthetic_paint.h"

namespace parallax::paint {

// bare: painted plaster with next to nothing to see. dado: oil paint up to elbow height. panel: upright boards.
enum class WallKind { bare, plaster, dado, brick, panel, concrete };
inline constexpr int kWallKinds = 6;

// The whole height of a storey, skirting board included.
Picture corridor_wall(WallKind kind, cv::Size size, double px_per_metre, cv::RNG& rng);

enum class FloorKind { chequered, lino, carpet };
inline constexpr int kFloorKinds = 3;
// A square; `tiles` chequers along a side.
Picture corridor_floor(FloorKind kind, int side_px, int tiles, cv::RNG& rng);
// Panels in a grid of `panels` by `panels`.
Picture corridor_ceiling(int side_px, int panels, cv::RNG& rng);

Picture corridor_door(cv::Size size, const cv::Scalar& colour, cv::RNG& rng);
Picture name_plate(cv::Size size, const std::string& text, cv::RNG& rng);
Picture notice_board(cv::Size size, cv::RNG& rng);
Picture window_view(cv::Size size, cv::RNG& rng);
Picture radiator(cv::Size size, cv::RNG& rng);
Picture stair_tread(cv::Size size, cv::RNG& rng);

}  // namespace parallax::paint
