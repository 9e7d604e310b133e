#include "games/swarm_ground.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/check.h"

namespace parallax::swarm {
namespace {

constexpr std::uint16_t kUnreached = std::numeric_limits<std::uint16_t>::max();
constexpr double kInset = 1e-6;  // of a cell's border, where a thing put into the cell may lie at the outermost
constexpr std::array<std::array<int, 2>, 8> kAround{
    {{1, 0}, {0, 1}, {-1, 0}, {0, -1}, {1, 1}, {-1, 1}, {-1, -1}, {1, -1}}};

}  // namespace

Ground::Cell Ground::cell_of(const Eigen::Vector2d& position) {
  const Eigen::Vector2d at = (position.array() + kHalf) / kCell;
  if (!(at.x() >= 0 && at.y() >= 0 && at.x() < kSide && at.y() < kSide)) return {};
  return {static_cast<int>(at.x()), static_cast<int>(at.y())};
}

void Ground::mark_inside(const PlayingField& field, Mask* inside) const {
  inside->fill(0);
  for (int row = 0; row < kSide; ++row)
    for (int column = 0; column < kSide; ++column) {
      const Eigen::Vector2d at = centre(column, row);
      if (at.norm() < kHalf - kCell && inside_outline(field, at * radius_m_)) (*inside)[index(column, row)] = 1;
    }
}

void Ground::mark_obstacles(Mask* obstacle) const {
  obstacle->fill(0);
  if (!surface_ || surface_->empty() || !(surface_->cell_m > 0)) return;
  const double limit_m = kObstacleHeight * radius_m_;
  const auto cell_at = [&](double position_m) {
    return static_cast<int>(std::clamp(std::floor((position_m / radius_m_ + kHalf) / kCell), -1.0, double(kSide)));
  };
  for (int row = 0; row < surface_->rows; ++row)
    for (int column = 0; column < surface_->columns; ++column) {
      if (!(surface_->height_m[surface_->index(column, row)] > limit_m)) continue;
      const Eigen::Vector2d low = surface_->corner_m + surface_->cell_m * Eigen::Vector2d(column, row);
      const Eigen::Vector2d high = low.array() + surface_->cell_m;
      for (int r = cell_at(low.y()); r <= cell_at(high.y()); ++r)
        for (int c = cell_at(low.x()); c <= cell_at(high.x()); ++c)
          if (contains(c, r)) (*obstacle)[index(c, r)] = 1;
    }
}

bool Ground::keep_largest_part() {
  std::vector<std::uint16_t> part(kCells, 0), stack;
  std::uint16_t parts = 0, best = 0;
  std::size_t best_size = 0;
  for (std::size_t start = 0; start < kCells; ++start) {
    if (!free_[start] || part[start]) continue;
    ++parts;
    std::size_t size = 0;
    stack.assign(1, static_cast<std::uint16_t>(start));
    part[start] = parts;
    while (!stack.empty()) {
      const int at = stack.back();
      stack.pop_back();
      ++size;
      for (std::size_t n = 0; n < 4; ++n) {
        const int column = at % kSide + kAround[n][0], row = at / kSide + kAround[n][1];
        if (!free_at(column, row) || part[index(column, row)]) continue;
        part[index(column, row)] = parts;
        stack.push_back(static_cast<std::uint16_t>(index(column, row)));
      }
    }
    if (size > best_size) {
      best_size = size;
      best = parts;
    }
  }
  for (std::size_t i = 0; i < kCells; ++i) free_[i] = best_size > 0 && part[i] == best;
  return best_size > 0;
}

void Ground::find_entries(const Mask& inside, const Mask& obstacle) {
  entries_.clear();
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double cells = 0;
  const auto add = [&](int column, int row, const Eigen::Vector2d& out) {
    Entry entry;
    entry.position = centre(column, row);
    entry.outward = out.norm() > 0 ? Eigen::Vector2d(out.normalized()) : Eigen::Vector2d::UnitX();
    const Cell start = cell_of(entry.position + kCell * entry.outward);
    if (contains(start.column, start.row) && obstacle[index(start.column, start.row)]) return;
    entries_.push_back(entry);
  };
  for (int row = 0; row < kSide; ++row)
    for (int column = 0; column < kSide; ++column) {
      if (!free_at(column, row)) continue;
      sum += centre(column, row);
      cells += 1;
      Eigen::Vector2d out = Eigen::Vector2d::Zero();
      bool edge = false;
      for (const auto& step : kAround) {
        const int c = column + step[0], r = row + step[1];
        if (contains(c, r) && inside[index(c, r)]) continue;
        edge = true;
        out += Eigen::Vector2d(step[0], step[1]).normalized();
      }
      if (edge) add(column, row, out);
    }
  middle_ = nearest_walkable(sum / cells);
  // A table whose edges are all hidden behind things: they come out of hiding.
  if (entries_.empty())
    for (int row = 0; row < kSide; ++row)
      for (int column = 0; column < kSide; ++column)
        if (free_at(column, row)) entries_.push_back({centre(column, row), Eigen::Vector2d::UnitX(), 0});
  for (Entry& entry : entries_)
    entry.angle = std::atan2(entry.position.y() - middle_.y(), entry.position.x() - middle_.x());
  std::stable_sort(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) { return a.angle < b.angle; });
}

void Ground::rebuild(const PlayingField& field) {
  PARALLAX_CHECK(std::isfinite(field.radius_m) && field.radius_m > 0, "a playing field needs a radius");
  radius_m_ = field.radius_m;
  surface_ = field.surface;
  Mask inside, obstacle;
  mark_inside(field, &inside);
  if (std::none_of(inside.begin(), inside.end(), [](std::uint8_t cell) { return cell != 0; }))
    mark_inside(empty_field(radius_m_), &inside);  // an outline too small to stand in
  mark_obstacles(&obstacle);
  free_ = inside;
  for (int row = 0; row < kSide; ++row)
    for (int column = 0; column < kSide; ++column) {
      if (!obstacle[index(column, row)]) continue;
      for (int r = std::max(row - 1, 0); r <= std::min(row + 1, kSide - 1); ++r)
        for (int c = std::max(column - 1, 0); c <= std::min(column + 1, kSide - 1); ++c) free_[index(c, r)] = 0;
    }
  if (!keep_largest_part()) {
    // Things everywhere: then they are the ground.
    surface_.reset();
    obstacle.fill(0);
    free_ = inside;
    keep_largest_part();
  }
  find_entries(inside, obstacle);
  goal_cell_ = {};
  std::uint64_t hash = 14695981039346656037ull;
  const auto mix = [&hash](std::uint64_t value) { hash = (hash ^ value) * 1099511628211ull; };
  for (const std::uint8_t cell : free_) mix(cell);
  if (surface_)
    for (const float height : surface_->height_m)
      mix(std::bit_cast<std::uint64_t>(static_cast<double>(height) / radius_m_));
  hash_ = hash;
}

bool Ground::walkable(const Eigen::Vector2d& position) const {
  const Cell cell = cell_of(position);
  return free_at(cell.column, cell.row);
}

Eigen::Vector2d Ground::nearest_walkable(const Eigen::Vector2d& position) const {
  if (walkable(position)) return position;
  const Eigen::Vector2d from = position.allFinite() ? position : Eigen::Vector2d::Zero();
  Eigen::Vector2d best = from;
  double best_distance = std::numeric_limits<double>::infinity();
  for (int row = 0; row < kSide; ++row)
    for (int column = 0; column < kSide; ++column) {
      if (!free_at(column, row)) continue;
      const Eigen::Array2d middle = centre(column, row), reach = Eigen::Array2d::Constant(kCell / 2 - kInset);
      const Eigen::Vector2d at = from.array().max(middle - reach).min(middle + reach);
      const double distance = (at - from).squaredNorm();
      if (distance < best_distance) {
        best_distance = distance;
        best = at;
      }
    }
  return best;
}

Eigen::Vector2d Ground::slide(const Eigen::Vector2d& from, const Eigen::Vector2d& to) const {
  const Cell start = cell_of(from);
  const auto reaches = [&](const Eigen::Vector2d& place) {
    const Cell cell = cell_of(place);
    if (!free_at(cell.column, cell.row)) return false;
    // Not through the corner between two walls.
    return cell.column == start.column || cell.row == start.row ||
           (free_at(cell.column, start.row) && free_at(start.column, cell.row));
  };
  if (reaches(to)) return to;
  const Eigen::Vector2d along_x(to.x(), from.y()), along_y(from.x(), to.y());
  const bool x_first = std::abs(to.x() - from.x()) >= std::abs(to.y() - from.y());
  const Eigen::Vector2d& first = x_first ? along_x : along_y;
  const Eigen::Vector2d& second = x_first ? along_y : along_x;
  if (reaches(first)) return first;
  if (reaches(second)) return second;
  return from;
}

bool Ground::clear_between(const Eigen::Vector2d& from, const Eigen::Vector2d& to) const {
  Cell at = cell_of(from);
  const Cell end = cell_of(to);
  if (!free_at(at.column, at.row) || !free_at(end.column, end.row)) return false;
  // Every cell the segment passes through, in turn (Amanatides and Woo 1987).
  const Eigen::Vector2d way = to - from;
  const int step_x = way.x() > 0 ? 1 : -1, step_y = way.y() > 0 ? 1 : -1;
  const auto until = [](double position, double speed, int cell, int step) {
    if (speed == 0) return std::numeric_limits<double>::infinity();
    return ((cell + (step > 0 ? 1 : 0)) * kCell - kHalf - position) / speed;
  };
  double next_x = until(from.x(), way.x(), at.column, step_x), next_y = until(from.y(), way.y(), at.row, step_y);
  const double every_x = way.x() != 0 ? kCell / std::abs(way.x()) : 0;
  const double every_y = way.y() != 0 ? kCell / std::abs(way.y()) : 0;
  for (int steps = std::abs(end.column - at.column) + std::abs(end.row - at.row); steps > 0; --steps) {
    if (next_x < next_y) {
      at.column += step_x;
      next_x += every_x;
    } else {
      at.row += step_y;
      next_y += every_y;
    }
    if (!free_at(at.column, at.row)) return false;
  }
  return true;
}

double Ground::height_at(const Eigen::Vector2d& position) const {
  return surface_ ? surface_->height_at(position * radius_m_) / radius_m_ : 0.0;
}

void Ground::set_goal(const Eigen::Vector2d& goal) {
  goal_ = goal;
  const Cell cell = cell_of(goal);
  if (cell.column == goal_cell_.column && cell.row == goal_cell_.row) return;
  goal_cell_ = cell;
  measure_distances();
}

// Dijkstra's shortest paths with buckets (Dial 1969): costs are small whole numbers.
void Ground::measure_distances() {
  distance_.fill(kUnreached);
  if (!free_at(goal_cell_.column, goal_cell_.row)) return;
  for (auto& bucket : waiting_) bucket.clear();
  const std::size_t start = index(goal_cell_.column, goal_cell_.row);
  distance_[start] = 0;
  waiting_[0].push_back(static_cast<std::uint16_t>(start));
  std::size_t left = 1;
  for (std::uint32_t distance = 0; left > 0; ++distance) {
    auto& bucket = waiting_[distance % 8];
    left -= bucket.size();
    for (const std::uint16_t at : bucket) {
      if (distance_[at] != distance) continue;  // reached by a shorter way meanwhile
      const int column = at % kSide, row = at / kSide;
      for (std::size_t n = 0; n < 8; ++n) {
        const int c = column + kAround[n][0], r = row + kAround[n][1];
        if (!free_at(c, r)) continue;
        if (n >= 4 && !(free_at(c, row) && free_at(column, r))) continue;
        const std::uint32_t there = distance + (n < 4 ? 5 : 7);
        if (there >= distance_[index(c, r)]) continue;
        distance_[index(c, r)] = static_cast<std::uint16_t>(there);
        waiting_[there % 8].push_back(static_cast<std::uint16_t>(index(c, r)));
        ++left;
      }
    }
    bucket.clear();
  }
}

Eigen::Vector2d Ground::way_from(const Eigen::Vector2d& from) const {
  const Eigen::Vector2d straight = goal_ - from;
  if (straight.squaredNorm() < 1e-12) return Eigen::Vector2d::Zero();
  if (clear_between(from, goal_)) return straight.normalized();
  const Cell at = cell_of(from);
  if (!free_at(at.column, at.row)) return straight.normalized();
  std::uint32_t best = kUnreached;
  Eigen::Vector2d target = goal_;
  for (std::size_t n = 0; n < 8; ++n) {
    const int c = at.column + kAround[n][0], r = at.row + kAround[n][1];
    if (!free_at(c, r) || distance_[index(c, r)] == kUnreached) continue;
    if (n >= 4 && !(free_at(c, at.row) && free_at(at.column, r))) continue;
    const std::uint32_t through = distance_[index(c, r)] + (n < 4 ? 5u : 7u);
    if (through < best) {
      best = through;
      target = centre(c, r);
    }
  }
  const Eigen::Vector2d way = target - from;
  return way.squaredNorm() > 1e-12 ? Eigen::Vector2d(way.normalized()) : Eigen::Vector2d(straight.normalized());
}

const Ground::Entry& Ground::entry_towards(double angle) const {
  const double turn = std::remainder(angle, 2 * std::numbers::pi);
  const auto after = std::lower_bound(entries_.begin(), entries_.end(), turn,
                                      [](const Entry& entry, double value) { return entry.angle < value; });
  const Entry& next = after == entries_.end() ? entries_.front() : *after;
  const Entry& before = after == entries_.begin() ? entries_.back() : *(after - 1);
  const auto off = [turn](const Entry& entry) {
    return std::abs(std::remainder(entry.angle - turn, 2 * std::numbers::pi));
  };
  return off(before) <= off(next) ? before : next;
}

}  // namespace parallax::swarm
