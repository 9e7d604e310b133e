#include "games/marbles_ground.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace parallax {
namespace {

constexpr float kFinestCell = 0.25f;       // of a marble's diameter
constexpr int kMostCells = 160;            // along a side
constexpr float kGreatestExtent = 80;      // half, of a table
constexpr float kGreatestHeight = 20;      // what is higher is as good as endless
constexpr std::size_t kMostCorners = 64;   // of an outline
constexpr float kLeastTableArea = 40;      // square diameters: less is not an outline to play on
constexpr float kSpeckleArea = 0.5f;       // square diameters: smaller things are noise
constexpr float kHoleArea = 2.0f;          // smaller gaps within things are closed
constexpr float kStepOfOneTop = 0.25f;     // neighbours on one top differ by less
constexpr float kSpreadOfLevelTop = 0.5f;  // heights of a top that is called level (10th to 90th percentile)
constexpr float kHeightStep = 0.25f;       // of tops that are not level
constexpr std::size_t kCirclePoints = 24;

float median(std::vector<float>* values) {
  const auto middle = values->begin() + static_cast<std::ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

// Heights of the map's cells under one of ours: the median of those that are high enough, when they are a quarter of
// all; else 0.
float resample(const SceneSurface& surface, const Eigen::Vector2d& least_m, const Eigen::Vector2d& most_m,
               double unit_m, std::uint8_t* known, std::vector<float>* found) {
  const Eigen::Vector2d from = (least_m - surface.corner_m) / surface.cell_m;
  const Eigen::Vector2d to = (most_m - surface.corner_m) / surface.cell_m;
  *known = 0;
  if (!(to.x() >= 0 && to.y() >= 0 && from.x() < surface.columns && from.y() < surface.rows)) return 0;
  // The cells whose centres lie within, or the one in the middle.
  int c0 = static_cast<int>(std::ceil(from.x() - 0.5)), c1 = static_cast<int>(std::ceil(to.x() - 0.5));
  int r0 = static_cast<int>(std::ceil(from.y() - 0.5)), r1 = static_cast<int>(std::ceil(to.y() - 0.5));
  if (c1 <= c0) c1 = (c0 = static_cast<int>(std::floor(0.5 * (from.x() + to.x())))) + 1;
  if (r1 <= r0) r1 = (r0 = static_cast<int>(std::floor(0.5 * (from.y() + to.y())))) + 1;
  c0 = std::max(c0, 0), r0 = std::max(r0, 0);
  c1 = std::min(c1, surface.columns), r1 = std::min(r1, surface.rows);
  found->clear();
  std::size_t all = 0;
  for (int row = r0; row < r1; ++row)
    for (int column = c0; column < c1; ++column, ++all) {
      const std::size_t i = surface.index(column, row);
      if (i < surface.known.size() && surface.known[i]) *known = 1;
      const float height = static_cast<float>(surface.height_m[i] / unit_m);
      if (height >= kLeastObstacleHeight) found->push_back(std::min(height, kGreatestHeight));
    }
  if (found->empty() || 4 * found->size() < all) return 0;
  return median(found);
}

// Calls `visit` with every connected set of cells for which joined(cell, neighbour) holds, starting from cells for
// which `is_part` does.
void for_each_part(const TableGrid& grid, bool diagonal, const std::function<bool(std::size_t)>& is_part,
                   const std::function<bool(std::size_t, std::size_t)>& joined,
                   const std::function<void(const std::vector<std::size_t>&)>& visit) {
  std::vector<std::uint8_t> seen(grid.size(), 0);
  std::vector<std::size_t> part;
  for (std::size_t first = 0; first < grid.size(); ++first) {
    if (seen[first] || !is_part(first)) continue;
    part.assign(1, first);
    seen[first] = 1;
    for (std::size_t k = 0; k < part.size(); ++k) {
      const std::size_t at = part[k];
      const int column = grid.column_of(at), row = grid.row_of(at);
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) {
          if ((dx == 0 && dy == 0) || (!diagonal && dx != 0 && dy != 0)) continue;
          if (!grid.contains(column + dx, row + dy)) continue;
          const std::size_t next = grid.index(column + dx, row + dy);
          if (seen[next] || !is_part(next) || !joined(at, next)) continue;
          seen[next] = 1;
          part.push_back(next);
        }
    }
    visit(part);
  }
}

void remove_speckles(TableGround* ground) {
  const float cell_area = ground->grid.cell * ground->grid.cell;
  std::vector<float>& height = ground->height;
  for_each_part(
      ground->grid, true, [&](std::size_t i) { return height[i] > 0; }, [](std::size_t, std::size_t) { return true; },
      [&](const std::vector<std::size_t>& part) {
        if (static_cast<float>(part.size()) * cell_area >= kSpeckleArea) return;
        for (const std::size_t i : part) height[i] = 0;
      });
}

void close_holes(TableGround* ground) {
  const TableGrid& grid = ground->grid;
  const float cell_area = grid.cell * grid.cell;
  std::vector<float>& height = ground->height;
  const std::vector<float> before = height;
  for_each_part(
      grid, false, [&](std::size_t i) { return before[i] <= 0; }, [](std::size_t, std::size_t) { return true; },
      [&](const std::vector<std::size_t>& part) {
        if (static_cast<float>(part.size()) * cell_area >= kHoleArea) return;
        std::vector<float> around;
        for (const std::size_t i : part)
          for (int side = 0; side < 4; ++side) {
            const int column = grid.column_of(i) + (side == 0) - (side == 1);
            const int row = grid.row_of(i) + (side == 2) - (side == 3);
            if (!grid.contains(column, row)) return;  // open to the outside
            const float next = before[grid.index(column, row)];
            if (next > 0) around.push_back(next);
          }
        const float level = median(&around);
        for (const std::size_t i : part) height[i] = level;
      });
}

void smooth(TableGround* ground) {
  const TableGrid& grid = ground->grid;
  const std::vector<float> before = ground->height;
  std::vector<float> around;
  for (std::size_t i = 0; i < before.size(); ++i) {
    if (before[i] <= 0) continue;
    around.clear();
    for (int dy = -1; dy <= 1; ++dy)
      for (int dx = -1; dx <= 1; ++dx) {
        const int column = grid.column_of(i) + dx, row = grid.row_of(i) + dy;
        if (grid.contains(column, row) && before[grid.index(column, row)] > 0)
          around.push_back(before[grid.index(column, row)]);
      }
    ground->height[i] = median(&around);
  }
}

void level_tops(TableGround* ground) {
  std::vector<float>& height = ground->height;
  const std::vector<float> before = height;
  for_each_part(
      ground->grid, true, [&](std::size_t i) { return before[i] > 0; },
      [&](std::size_t a, std::size_t b) { return std::abs(before[a] - before[b]) <= kStepOfOneTop; },
      [&](const std::vector<std::size_t>& part) {
        std::vector<float> heights;
        for (const std::size_t i : part) heights.push_back(before[i]);
        std::sort(heights.begin(), heights.end());
        const std::size_t tenth = heights.size() / 10;
        const bool level = heights[heights.size() - 1 - tenth] - heights[tenth] <= kSpreadOfLevelTop;
        const float top = heights[heights.size() / 2];
        for (const std::size_t i : part)
          height[i] = level ? top : std::max(1.0f, std::round(before[i] / kHeightStep)) * kHeightStep;
      });
}

}  // namespace

Eigen::Vector2i TableGrid::cell_of(const Eigen::Vector2f& place) const {
  const Eigen::Vector2f at = (place - corner) / cell;
  const auto whole = [](float value) { return static_cast<int>(std::floor(std::clamp(value, -1e6f, 1e6f))); };
  return {whole(at.x()), whole(at.y())};
}

std::vector<Eigen::Vector2f> table_outline(const PlayingField& field, double unit_m) {
  std::vector<Eigen::Vector2f> outline;
  const std::size_t corners = field.outline_m.size();
  const std::size_t step = (corners + kMostCorners - 1) / kMostCorners;
  bool usable = corners >= 3;
  for (std::size_t i = 0; usable && i < corners; i += step) {
    const Eigen::Vector2d corner = field.outline_m[i] / unit_m;
    usable = corner.allFinite();
    outline.push_back(corner.cwiseMax(-kGreatestExtent).cwiseMin(kGreatestExtent).cast<float>());
  }
  float twice_area = 0;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2f &a = outline[i], &b = outline[(i + 1) % outline.size()];
    twice_area += a.x() * b.y() - a.y() * b.x();
  }
  if (usable && outline.size() >= 3 && 0.5f * twice_area >= kLeastTableArea) return outline;
  outline.clear();
  const double radius = std::clamp(field.radius_m / unit_m, 5.0, static_cast<double>(kGreatestExtent));
  for (std::size_t i = 0; i < kCirclePoints; ++i) {
    const double angle = 2 * M_PI * static_cast<double>(i) / static_cast<double>(kCirclePoints);
    outline.push_back((radius * Eigen::Vector2d(std::cos(angle), std::sin(angle))).cast<float>());
  }
  return outline;
}

float distance_inside(const std::vector<Eigen::Vector2f>& outline, const Eigen::Vector2f& place) {
  float least = kGreatestExtent * 4;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2f& a = outline[i];
    const Eigen::Vector2f side = outline[(i + 1) % outline.size()] - a;
    const float length = side.norm();
    if (!(length > 1e-6f)) continue;
    least = std::min(least, (side.x() * (place - a).y() - side.y() * (place - a).x()) / length);
  }
  return least;
}

TableGround read_ground(const PlayingField& field, double unit_m, bool with_obstacles) {
  TableGround ground;
  ground.outline = table_outline(field, unit_m);
  Eigen::Vector2f least = ground.outline.front(), most = least;
  for (const Eigen::Vector2f& corner : ground.outline) least = least.cwiseMin(corner), most = most.cwiseMax(corner);
  const Eigen::Vector2f extent = most - least;
  TableGrid& grid = ground.grid;
  grid.cell = std::max(kFinestCell, extent.maxCoeff() / static_cast<float>(kMostCells - 4));
  grid.columns = static_cast<int>(std::ceil(extent.x() / grid.cell)) + 4;
  grid.rows = static_cast<int>(std::ceil(extent.y() / grid.cell)) + 4;
  grid.corner = least - Eigen::Vector2f::Constant(2 * grid.cell);
  ground.height.assign(grid.size(), 0);
  ground.known.assign(grid.size(), 1);

  const SceneSurface* surface = field.surface.get();
  if (!surface || surface->empty() || !(surface->cell_m > 0) || surface->columns <= 0 || surface->rows <= 0 ||
      surface->height_m.size() < surface->index(surface->columns - 1, surface->rows - 1) + 1)
    return ground;
  std::vector<float> found;
  std::size_t seen = 0;
  const Eigen::Vector2d half = Eigen::Vector2d::Constant(0.5 * grid.cell * unit_m);
  for (std::size_t i = 0; i < grid.size(); ++i) {
    const Eigen::Vector2d centre_m = grid.centre(i).cast<double>() * unit_m;
    ground.height[i] = resample(*surface, centre_m - half, centre_m + half, unit_m, &ground.known[i], &found);
    seen += ground.known[i];
  }
  // A map that has seen little says nothing about where to play.
  if (4 * seen < grid.size()) ground.known.assign(grid.size(), 1);
  if (!with_obstacles) {
    ground.height.assign(grid.size(), 0);
    return ground;
  }
  remove_speckles(&ground);
  close_holes(&ground);
  smooth(&ground);
  level_tops(&ground);
  return ground;
}

std::vector<TableBox> merge_boxes(const TableGround& ground) {
  const TableGrid& grid = ground.grid;
  std::vector<TableBox> boxes;
  std::vector<std::uint8_t> done(grid.size(), 0);
  for (int row = 0; row < grid.rows; ++row)
    for (int column = 0; column < grid.columns; ++column) {
      const float height = ground.height[grid.index(column, row)];
      const auto free_to_take = [&](int c, int r) {
        const std::size_t i = grid.index(c, r);
        return !done[i] && ground.height[i] == height;
      };
      if (height <= 0 || done[grid.index(column, row)]) continue;
      // As far as it goes along the row, and then as many rows as are the same.
      int right = column + 1, up = row + 1;
      while (right < grid.columns && free_to_take(right, row)) ++right;
      for (bool whole = true; up < grid.rows; ++up) {
        for (int c = column; c < right && whole; ++c) whole = free_to_take(c, up);
        if (!whole) break;
      }
      for (int r = row; r < up; ++r)
        for (int c = column; c < right; ++c) done[grid.index(c, r)] = 1;
      const auto corner = [&](int c, int r) -> Eigen::Vector2f {
        return grid.corner + grid.cell * Eigen::Vector2f(static_cast<float>(c), static_cast<float>(r));
      };
      boxes.push_back({corner(column, row), corner(right, up), height});
    }
  return boxes;
}

std::vector<TableEdge> obstacle_edges(const TableGround& ground) {
  const TableGrid& grid = ground.grid;
  const auto height = [&](int column, int row) {
    return grid.contains(column, row) ? ground.height[grid.index(column, row)] : 0.0f;
  };
  std::vector<TableEdge> edges;
  // Along every line of the grid, pieces of one height in one go.
  for (const bool across : {false, true}) {
    const int lines = across ? grid.columns : grid.rows, length = across ? grid.rows : grid.columns;
    for (int line = 0; line <= lines; ++line) {
      int begun = 0;
      float level = 0;
      for (int k = 0; k <= length; ++k) {
        const float one = across ? height(line - 1, k) : height(k, line - 1);
        const float other = across ? height(line, k) : height(k, line);
        const float top = k < length && one != other ? std::max(one, other) : 0;
        if (top == level) continue;
        const auto corner = [&](int at) -> Eigen::Vector3f {
          const Eigen::Vector2f cells(static_cast<float>(across ? line : at), static_cast<float>(across ? at : line));
          Eigen::Vector3f place;
          place << grid.corner + grid.cell * cells, level;
          return place;
        };
        if (level > 0) edges.push_back({corner(begun), corner(k)});
        level = top;
        begun = k;
      }
    }
  }
  return edges;
}

}  // namespace parallax
