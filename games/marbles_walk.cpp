#include "games/marbles_walk.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>

#include "core/check.h"

namespace parallax {
namespace {

constexpr float kRoom = kMarbleRadius + 0.2f;     // kept free around a marble's centre
constexpr float kRimRoom = kMarbleRadius + 0.4f;  // and from the rim
constexpr float kStepTolerance = 0.025f;          // heights that are rolled over
constexpr float kEasyClearance = 1.0f;            // ways with less room than this count more
constexpr float kTightCost = 4;
constexpr float kInfinite = std::numeric_limits<float>::infinity();

struct Neighbour {
  int dx, dy;
  float length;
};
constexpr float kDiagonal = 1.41421356f;
constexpr Neighbour kNeighbours[] = {{1, 0, 1},         {-1, 0, 1},         {0, 1, 1},          {0, -1, 1},
                                     {1, 1, kDiagonal}, {-1, 1, kDiagonal}, {1, -1, kDiagonal}, {-1, -1, kDiagonal}};

struct StencilCell {
  int dx, dy;
};

// Whether the surface goes on from one cell to another without an edge: the rise lies between what either's slope would
// make of the way, given in cells. Over a ramp's foot and its upper end it does, off its side it does not.
bool goes_on(const WalkMap& walk, std::size_t from, std::size_t to, int columns, int rows) {
  const Eigen::Vector2f way = walk.grid.cell * Eigen::Vector2f(static_cast<float>(columns), static_cast<float>(rows));
  const float rise = walk.height[to] - walk.height[from];
  const auto [least, most] = std::minmax({walk.slope[from].dot(way), walk.slope[to].dot(way)});
  return rise >= least - kStepTolerance && rise <= most + kStepTolerance;
}

std::vector<StencilCell> stencil_of(float cell) {
  std::vector<StencilCell> stencil;
  const int reach = static_cast<int>(std::ceil(kRoom / cell)) + 1;
  for (int dy = -reach; dy <= reach; ++dy)
    for (int dx = -reach; dx <= reach; ++dx) {
      const auto gap = [&](int d) { return std::max(0.0f, (static_cast<float>(std::abs(d)) - 0.5f) * cell); };
      if ((dx == 0 && dy == 0) || std::hypot(gap(dx), gap(dy)) >= kRoom) continue;
      stencil.push_back({dx, dy});
    }
  return stencil;
}

// Calls `relax(next, length)` for the neighbours a marble can roll to.
template <class Relax>
void for_each_step(const WalkMap& walk, std::size_t at, const Relax& relax) {
  const int column = walk.grid.column_of(at), row = walk.grid.row_of(at);
  for (const Neighbour& step : kNeighbours) {
    if (!walk.grid.contains(column + step.dx, row + step.dy)) continue;
    const std::size_t next = walk.grid.index(column + step.dx, row + step.dy);
    if (walk.drivable[next] && goes_on(walk, at, next, step.dx, step.dy)) relax(next, step.length * walk.grid.cell);
  }
}

void measure_clearance(WalkMap* walk) {
  const TableGrid& grid = walk->grid;
  walk->clearance.assign(grid.size(), 0);
  for (std::size_t i = 0; i < grid.size(); ++i) walk->clearance[i] = walk->drivable[i] ? 1e6f : 0.0f;
  // Two sweeps of the chamfer distance.
  const auto sweep = [&](std::size_t i, int sign) {
    const int column = grid.column_of(i), row = grid.row_of(i);
    const Neighbour before[] = {{-sign, 0, 1}, {0, -sign, 1}, {-sign, -sign, kDiagonal}, {sign, -sign, kDiagonal}};
    for (const Neighbour& step : before) {
      const bool within = grid.contains(column + step.dx, row + step.dy);
      const float there = within ? walk->clearance[grid.index(column + step.dx, row + step.dy)] : 0.0f;
      walk->clearance[i] = std::min(walk->clearance[i], there + step.length * grid.cell);
    }
  };
  for (std::size_t i = 0; i < grid.size(); ++i) sweep(i, 1);
  for (std::size_t i = grid.size(); i-- > 0;) sweep(i, -1);
}

void number_areas(WalkMap* walk) {
  walk->area.assign(walk->grid.size(), -1);
  walk->area_size.clear();
  std::vector<std::size_t> part;
  for (std::size_t first = 0; first < walk->grid.size(); ++first) {
    if (!walk->drivable[first] || walk->area[first] >= 0) continue;
    const int number = static_cast<int>(walk->area_size.size());
    part.assign(1, first);
    walk->area[first] = number;
    for (std::size_t k = 0; k < part.size(); ++k)
      for_each_step(*walk, part[k], [&](std::size_t next, float) {
        if (walk->area[next] >= 0) return;
        walk->area[next] = number;
        part.push_back(next);
      });
    walk->area_size.push_back(static_cast<int>(part.size()));
  }
}

}  // namespace

std::optional<std::size_t> WalkMap::cell_at(const Eigen::Vector2f& place) const {
  const Eigen::Vector2i cell = grid.cell_of(place);
  if (!grid.contains(cell.x(), cell.y())) return std::nullopt;
  return grid.index(cell.x(), cell.y());
}

std::optional<std::size_t> WalkMap::nearest_drivable(const Eigen::Vector2f& place, float within, int of_area) const {
  const Eigen::Vector2i middle = grid.cell_of(place);
  const int reach = static_cast<int>(std::ceil(std::min(within, 1e4f) / grid.cell));
  std::optional<std::size_t> best;
  float least = within;
  const int c0 = std::max(0, middle.x() - reach), c1 = std::min(grid.columns - 1, middle.x() + reach);
  const int r0 = std::max(0, middle.y() - reach), r1 = std::min(grid.rows - 1, middle.y() + reach);
  for (int row = r0; row <= r1; ++row)
    for (int column = c0; column <= c1; ++column) {
      const std::size_t i = grid.index(column, row);
      if (area[i] < 0 || (of_area >= 0 && area[i] != of_area)) continue;
      const float distance = (grid.centre(i) - place).norm();
      if (distance >= least) continue;
      least = distance;
      best = i;
    }
  return best;
}

int WalkMap::greatest_area() const {
  if (area_size.empty()) return -1;
  return static_cast<int>(std::max_element(area_size.begin(), area_size.end()) - area_size.begin());
}

std::optional<float> ramp_height(const TableRamp& ramp, const Eigen::Vector2f& place) {
  const Eigen::Vector2f from_foot = place - ramp.foot;
  const float along = from_foot.dot(ramp.uphill);
  const float across = ramp.uphill.x() * from_foot.y() - ramp.uphill.y() * from_foot.x();
  if (along < 0 || along > ramp.length + ramp.landing || std::abs(across) > ramp.half_width) return std::nullopt;
  return ramp.height * std::min(1.0f, along / ramp.length);
}

WalkMap make_walk_map(const TableGround& ground, const std::vector<TableRamp>& ramps) {
  WalkMap walk;
  walk.grid = ground.grid;
  const TableGrid& grid = walk.grid;
  walk.height = ground.height;
  walk.slope.assign(grid.size(), Eigen::Vector2f::Zero());
  for (const TableRamp& ramp : ramps)
    for (std::size_t i = 0; i < grid.size(); ++i) {
      const auto height = ramp_height(ramp, grid.centre(i));
      if (!height || *height < walk.height[i]) continue;
      walk.height[i] = *height;
      const bool rises = (grid.centre(i) - ramp.foot).dot(ramp.uphill) < ramp.length;
      walk.slope[i] = rises ? Eigen::Vector2f(ramp.height / ramp.length * ramp.uphill) : Eigen::Vector2f(0, 0);
    }

  walk.drivable.assign(grid.size(), 0);
  const std::vector<StencilCell> stencil = stencil_of(grid.cell);
  for (std::size_t i = 0; i < grid.size(); ++i) {
    if (distance_inside(ground.outline, grid.centre(i)) < kRimRoom) continue;
    const int column = grid.column_of(i), row = grid.row_of(i);
    walk.drivable[i] = std::all_of(stencil.begin(), stencil.end(), [&](const StencilCell& at) {
      return grid.contains(column + at.dx, row + at.dy) &&
             goes_on(walk, i, grid.index(column + at.dx, row + at.dy), at.dx, at.dy);
    });
  }
  measure_clearance(&walk);
  number_areas(&walk);
  return walk;
}

std::vector<float> ways_to(const WalkMap& walk, std::size_t target) {
  PARALLAX_CHECK(target < walk.grid.size(), "marbles: a target outside the table");
  std::vector<float> way(walk.grid.size(), kInfinite);
  using Entry = std::pair<float, std::size_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  way[target] = 0;
  open.push({0, target});
  while (!open.empty()) {
    const auto [length, at] = open.top();
    open.pop();
    if (length > way[at]) continue;
    for_each_step(walk, at, [&, here = length](std::size_t next, float step) {
      const float tightness = std::max(0.0f, 1 - walk.clearance[next] / kEasyClearance);
      const float there = here + step * (1 + kTightCost * tightness);
      if (there >= way[next]) return;
      way[next] = there;
      open.push({there, next});
    });
  }
  return way;
}

bool straight_is_free(const WalkMap& walk, const Eigen::Vector2f& from, const Eigen::Vector2f& to) {
  const float length = (to - from).norm();
  const int steps = std::max(1, static_cast<int>(std::ceil(length / (0.5f * walk.grid.cell))));
  std::optional<std::size_t> last;
  for (int k = 0; k <= steps; ++k) {
    const auto at = walk.cell_at(from + (to - from) * (static_cast<float>(k) / static_cast<float>(steps)));
    if (!at || !walk.drivable[*at]) return false;
    if (last) {
      const int columns = walk.grid.column_of(*at) - walk.grid.column_of(*last);
      const int rows = walk.grid.row_of(*at) - walk.grid.row_of(*last);
      if (!goes_on(walk, *last, *at, columns, rows)) return false;
    }
    last = at;
  }
  return true;
}

std::optional<Eigen::Vector2f> aim_along(const WalkMap& walk, const std::vector<float>& ways,
                                         const Eigen::Vector2f& from, float reach) {
  std::optional<std::size_t> at = walk.cell_at(from);
  if (!at || !std::isfinite(ways[*at]) || !walk.drivable[*at]) return std::nullopt;
  Eigen::Vector2f aim = walk.grid.centre(*at);
  const std::size_t start = *at;
  // The first steps are taken in any case: past a corner there is no straight way.
  for (int steps = 0; ways[*at] > 0; ++steps) {
    std::size_t next = *at;
    for_each_step(walk, *at, [&](std::size_t there, float) {
      if (ways[there] < ways[next]) next = there;
    });
    if (next == *at) break;
    at = next;
    const Eigen::Vector2f place = walk.grid.centre(next);
    if (steps >= 2 && ((place - from).norm() > reach || !straight_is_free(walk, walk.grid.centre(start), place))) break;
    aim = place;
  }
  return aim;
}

}  // namespace parallax
