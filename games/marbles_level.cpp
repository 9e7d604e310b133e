#include "games/marbles_level.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "games/marbles_ramps.h"
#include "games/marbles_random.h"

namespace parallax {
namespace {

constexpr float kLeastArea = 10;           // square diameters a marble can be in: less is no level
constexpr float kCoinSpacing = 2.2f;       // between things; relaxed when there is little room
constexpr float kLeastCoinSpacing = 1.2f;  // but not below this
constexpr float kGoalShare = 0.6f;         // the goal is at least this share of the longest way from the start
constexpr int kPlaceTries = 400;

// Places of one area, drawn at random without coming close to one another.
class Places {
 public:
  Places(const TableGround& ground, const WalkMap& walk, int area) : walk_(walk) {
    for (std::size_t i = 0; i < walk.grid.size(); ++i)
      if (walk.area[i] == area && ground.known[i]) cells_.push_back(i);
    if (cells_.empty())
      for (std::size_t i = 0; i < walk.grid.size(); ++i)
        if (walk.area[i] == area) cells_.push_back(i);
  }

  const std::vector<std::size_t>& cells() const { return cells_; }
  void take(std::size_t cell) { taken_.push_back(walk_.grid.centre(cell)); }

  // A free cell for which `suits` holds, at least `spacing` from what is taken.
  template <class Suits>
  std::optional<std::size_t> draw(float spacing, MarblesRandom* random, const Suits& suits) const {
    for (int k = 0; k < kPlaceTries; ++k) {
      const std::size_t cell = cells_[random->below(cells_.size())];
      const Eigen::Vector2f place = walk_.grid.centre(cell);
      const bool free = std::all_of(taken_.begin(), taken_.end(),
                                    [&](const Eigen::Vector2f& other) { return (other - place).norm() >= spacing; });
      if (free && suits(cell)) return cell;
    }
    return std::nullopt;
  }

 private:
  const WalkMap& walk_;
  std::vector<std::size_t> cells_;
  std::vector<Eigen::Vector2f> taken_;
};

// The nearest coin next, from the start on.
void order_as_tour(const WalkMap& walk, MarblesLevel* level) {
  Eigen::Vector2f at = level->start;
  for (std::size_t k = 0; k + 1 < level->coins.size(); ++k) {
    const auto cell = walk.cell_at(at);
    if (!cell) return;
    const std::vector<float> ways = ways_to(walk, *cell);
    const auto way = [&](const MarblesCoin& coin) { return ways[*walk.cell_at(coin.place)]; };
    const auto first = level->coins.begin() + static_cast<std::ptrdiff_t>(k);
    const auto nearest = std::min_element(first, level->coins.end(),
                                          [&](const MarblesCoin& a, const MarblesCoin& b) { return way(a) < way(b); });
    std::iter_swap(first, nearest);
    at = level->coins[k].place;
  }
}

int area_of(const WalkMap& walk, const Eigen::Vector2f& place) {
  const auto cell = walk.cell_at(place);
  return cell ? walk.area[*cell] : -1;
}

}  // namespace

bool make_marbles_level(const TableGround& ground, const MarblesLevelWishes& wishes, MarblesLevel* level) {
  MarblesRandom random(wishes.seed);
  *level = MarblesLevel();
  level->goal_radius = wishes.goal_radius;
  level->ramps = place_ramps(ground, wishes.ramps, &random);
  const WalkMap walk = make_walk_map(ground, level->ramps);
  const int area = walk.greatest_area();
  if (area < 0) return false;
  const float cell_area = walk.grid.cell * walk.grid.cell;
  if (static_cast<float>(walk.area_size[static_cast<std::size_t>(area)]) * cell_area < kLeastArea) return false;
  Places places(ground, walk, area);

  // The start where there is room, the goal a long way off.
  const auto roomy = [&](std::size_t cell) { return walk.clearance[cell] > 0.6f && ground.height[cell] <= 0; };
  const auto any = [](std::size_t) { return true; };
  auto start = places.draw(0, &random, roomy);
  if (!start) start = places.draw(0, &random, any);
  const std::vector<float> ways = ways_to(walk, *start);
  float longest = 0;
  for (const std::size_t cell : places.cells()) longest = std::max(longest, ways[cell]);
  places.take(*start);
  const auto far_off = [&](std::size_t cell) { return ways[cell] >= kGoalShare * longest; };
  auto goal = places.draw(0, &random, [&](std::size_t cell) { return far_off(cell) && roomy(cell); });
  if (!goal) goal = places.draw(0, &random, far_off);
  if (!goal)
    goal = *std::max_element(places.cells().begin(), places.cells().end(),
                             [&](std::size_t a, std::size_t b) { return ways[a] < ways[b]; });
  places.take(*goal);
  level->start = walk.grid.centre(*start), level->start_height = walk.height[*start];
  level->goal = walk.grid.centre(*goal), level->goal_height = walk.height[*goal];

  // The first coins lie on top of what the ramps lead to.
  const auto add_coin = [&](const auto& suits) {
    for (float spacing = kCoinSpacing; spacing >= kLeastCoinSpacing; spacing -= 0.5f) {
      const auto cell = places.draw(spacing, &random, suits);
      if (!cell) continue;
      places.take(*cell);
      level->coins.push_back({walk.grid.centre(*cell), walk.height[*cell], false});
      return;
    }
  };
  for (const TableRamp& ramp : level->ramps) {
    if (static_cast<int>(level->coins.size()) >= wishes.coins) break;
    const Eigen::Vector2f top = ramp.foot + (ramp.length + ramp.landing) * ramp.uphill;
    add_coin([&](std::size_t cell) {
      return ground.height[cell] == ramp.height && (walk.grid.centre(cell) - top).norm() < 8 &&
             !ramp_height(ramp, walk.grid.centre(cell));
    });
  }
  const auto flat = [&](std::size_t cell) { return walk.height[cell] == ground.height[cell]; };
  while (static_cast<int>(level->coins.size()) < wishes.coins) {
    const std::size_t before = level->coins.size();
    add_coin(flat);
    if (level->coins.size() == before) break;
  }
  order_as_tour(walk, level);

  for (int k = 0; k < wishes.loose; ++k) {
    const auto cell =
        places.draw(1.6f, &random, [&](std::size_t c) { return walk.height[c] <= 0 && walk.clearance[c] > 0.3f; });
    if (!cell) break;
    places.take(*cell);
    level->loose.push_back(walk.grid.centre(*cell));
  }
  return true;
}

bool mend_marbles_level(const TableGround& ground, MarblesLevel* level) {
  mend_ramps(ground, &level->ramps);
  const WalkMap walk = make_walk_map(ground, level->ramps);
  int area = area_of(walk, level->start);
  const float cell_area = walk.grid.cell * walk.grid.cell;
  const auto large = [&](int number) {
    return number >= 0 &&
           static_cast<float>(walk.area_size[static_cast<std::size_t>(number)]) * cell_area >= kLeastArea;
  };
  if (!large(area)) area = walk.greatest_area();
  if (!large(area)) return false;
  const auto mend = [&](Eigen::Vector2f* place, float* height) {
    auto cell = walk.cell_at(*place);
    if (!cell || walk.area[*cell] != area) {
      cell = walk.nearest_drivable(*place, std::numeric_limits<float>::max(), area);
      if (!cell) return;
      *place = walk.grid.centre(*cell);
    }
    *height = walk.height[*cell];
  };
  mend(&level->start, &level->start_height);
  mend(&level->goal, &level->goal_height);
  for (MarblesCoin& coin : level->coins)
    if (!coin.taken) mend(&coin.place, &coin.height);
  return true;
}

}  // namespace parallax
