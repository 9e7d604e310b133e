#include "games/marbles_ramps.h"

#include <algorithm>
#include <cmath>

#include "games/marbles_level.h"
#include "games/marbles_walk.h"

namespace parallax {
namespace {

constexpr float kLanding = 1.75f;         // of a ramp, over the uneven edge of what it leads to
constexpr float kIntoTop = 1.5f;          // part of the landing that lies over the thing itself
constexpr float kHalfWidth = 1.6f;        // of a ramp
constexpr float kCentralHalf = 0.9f;      // of the part that a marble takes
constexpr float kHidden = 0.02f;          // what sticks out of a ramp less than this
constexpr float kAdapted = 0.25f;         // changes of a top that a ramp follows
constexpr float kSteepestAdapted = 0.2f;  // tangent
constexpr float kLeastTop = 3;            // square diameters a ramp must open up
constexpr float kLeastTopArea = 5;        // of a thing that is tried
constexpr float kLeastFreeShare = 0.75f;  // of the free area that has to be left by a ramp
constexpr int kCandidates = 150;          // places tried for a thing
constexpr int kChecked = 4;               // of them with a whole walk map
constexpr int kDirections = 16;

// Whether nothing stands in a ramp's way, and it ends on a top of its own height.
bool fits(const TableGround& ground, const TableRamp& ramp) {
  const TableGrid& grid = ground.grid;
  const Eigen::Vector2f across(-ramp.uphill.y(), ramp.uphill.x());
  const float end = ramp.length + ramp.landing, step = 0.5f * grid.cell;
  // Room for the marble before the foot.
  for (float along = -1.5f; along <= end + 0.9f; along += step)
    for (float side = -ramp.half_width; side <= ramp.half_width; side += step) {
      const Eigen::Vector2f place = ramp.foot + along * ramp.uphill + side * across;
      const Eigen::Vector2i cell = grid.cell_of(place);
      if (!grid.contains(cell.x(), cell.y())) return false;
      const float height = ground.height[grid.index(cell.x(), cell.y())];
      const bool central = std::abs(side) <= kCentralHalf;
      if (along < 0) {
        if (central && (height > 0 || distance_inside(ground.outline, place) < kMarbleRadius + 0.4f)) return false;
      } else if (along <= end) {
        if (height > ramp.height * std::min(1.0f, along / ramp.length) + kHidden) return false;
        if (distance_inside(ground.outline, place) < 0) return false;
        if (central && along >= end - 0.5f && height != ramp.height) return false;
      } else if (central && height != ramp.height) {
        return false;
      }
    }
  return true;
}

// Cells of the greatest area, on the table itself and on tops.
struct Reach {
  int low = 0, high = 0;
};
Reach reach_of(const TableGround& ground, const std::vector<TableRamp>& ramps) {
  const WalkMap walk = make_walk_map(ground, ramps);
  const int area = walk.greatest_area();
  Reach reach;
  for (std::size_t i = 0; i < walk.grid.size(); ++i) {
    if (area < 0 || walk.area[i] != area) continue;
    (ground.height[i] > 0 && ground.height[i] == walk.height[i] ? reach.high : reach.low) += 1;
  }
  return reach;
}

struct Top {
  float height = 0;
  std::vector<std::size_t> cells, edge;
};

std::vector<Top> low_tops(const TableGround& ground) {
  const TableGrid& grid = ground.grid;
  std::vector<Top> tops;
  std::vector<std::uint8_t> seen(grid.size(), 0);
  for (std::size_t first = 0; first < grid.size(); ++first) {
    const float height = ground.height[first];
    if (seen[first] || height <= 0 || height > kHighestRamp) continue;
    Top top;
    top.height = height;
    top.cells.assign(1, first);
    seen[first] = 1;
    for (std::size_t k = 0; k < top.cells.size(); ++k) {
      bool at_edge = false;
      for (int side = 0; side < 4; ++side) {
        const int column = grid.column_of(top.cells[k]) + (side == 0) - (side == 1);
        const int row = grid.row_of(top.cells[k]) + (side == 2) - (side == 3);
        if (!grid.contains(column, row)) continue;
        const std::size_t next = grid.index(column, row);
        at_edge = at_edge || ground.height[next] <= 0;
        if (seen[next] || ground.height[next] != height) continue;
        seen[next] = 1;
        top.cells.push_back(next);
      }
      if (at_edge) top.edge.push_back(top.cells[k]);
    }
    if (static_cast<float>(top.cells.size()) * grid.cell * grid.cell >= kLeastTopArea && !top.edge.empty())
      tops.push_back(std::move(top));
  }
  // The largest first; of equal ones the first found.
  std::stable_sort(tops.begin(), tops.end(),
                   [](const Top& a, const Top& b) { return a.cells.size() > b.cells.size(); });
  return tops;
}

}  // namespace

std::vector<TableRamp> place_ramps(const TableGround& ground, int most, MarblesRandom* random) {
  std::vector<TableRamp> ramps;
  const std::vector<Top> tops = most > 0 ? low_tops(ground) : std::vector<Top>();
  if (tops.empty()) return ramps;
  Reach before = reach_of(ground, ramps);
  const float cell_area = ground.grid.cell * ground.grid.cell;
  for (const Top& top : tops) {
    if (static_cast<int>(ramps.size()) >= most) break;
    int checked = 0;
    for (int k = 0; k < kCandidates && checked < kChecked; ++k) {
      const std::size_t edge = top.edge[random->below(top.edge.size())];
      const float turn = static_cast<float>(random->below(kDirections)) * (2 * static_cast<float>(M_PI) / kDirections);
      TableRamp ramp;
      ramp.uphill = Eigen::Vector2f(std::cos(turn), std::sin(turn));
      ramp.height = top.height;
      ramp.length = top.height / std::tan(kRampSlope);
      ramp.landing = kLanding;
      ramp.half_width = kHalfWidth;
      ramp.foot = ground.grid.centre(edge) - (ramp.length + kLanding - kIntoTop) * ramp.uphill;
      if (!fits(ground, ramp)) continue;
      ++checked;
      ramps.push_back(ramp);
      const Reach after = reach_of(ground, ramps);
      if (static_cast<float>(after.high - before.high) * cell_area >= kLeastTop &&
          static_cast<float>(after.low) >= kLeastFreeShare * static_cast<float>(before.low)) {
        before = after;
        break;
      }
      ramps.pop_back();
    }
  }
  return ramps;
}

void mend_ramps(const TableGround& ground, std::vector<TableRamp>* ramps) {
  std::erase_if(*ramps, [&](TableRamp& ramp) {
    if (fits(ground, ramp)) return false;
    const Eigen::Vector2f end = ramp.foot + (ramp.length + ramp.landing) * ramp.uphill;
    const Eigen::Vector2i cell = ground.grid.cell_of(end);
    if (!ground.grid.contains(cell.x(), cell.y())) return true;
    const float height = ground.height[ground.grid.index(cell.x(), cell.y())];
    if (height <= 0 || std::abs(height - ramp.height) > kAdapted || height > kSteepestAdapted * ramp.length)
      return true;
    ramp.height = height;
    return !fits(ground, ramp);
  });
}

}  // namespace parallax
