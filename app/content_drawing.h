// What the user has placed, as things to draw: the same in the AR view and in the map view. Text is drawn by the
// interface, at label_anchor().
#pragma once

#include <optional>

#include "map/content.h"
#include "render/draw_list.h"

namespace parallax {

// Models, the feet and stems of labels, and lines. `selected`: the item that is highlighted.
void draw_content(const Content& content, std::optional<int> selected, DrawList* out);

// Where the text of an item is: above a label's foot, at the middle of a line; world.
Eigen::Vector3d label_anchor(const ContentItem& item);

// A circle around the origin of a frame, on its z = 0 (a little above, so that it shows on a surface).
void add_ring(const RigidTransform& world_from_ring, double radius_m, const DrawColour& colour, float width_px,
              DrawList* out);

}  // namespace parallax
