#include "render/synthetic_building.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "render/synthetic_building_parts.h"

namespace parallax {

using Eigen::Vector3d;
using paint::FloorKind;
using paint::WallKind;

namespace {

constexpr double kBay = BuildingParts::kBay;
constexpr double kInner0 = kCorridorHalfWidth, kOuter0 = -kCorridorHalfWidth;
constexpr double kInnerX = kBuildingLength - kCorridorHalfWidth, kOuterX = kBuildingLength + kCorridorHalfWidth;
constexpr double kInnerY = kBuildingWidth - kCorridorHalfWidth, kOuterY = kBuildingWidth + kCorridorHalfWidth;

struct CorridorWall {
  WallLine line;
  int bays;
  bool outside;
  std::array<WallKind, 3> kinds;  // along its length
  int sparse_from, sparse_to;     // bays with next to nothing to see
  int room;                       // the bay with an open door; -1: none
};

// In the order of the legs: south, east, north, west; the outer wall first.
const std::array<CorridorWall, 8>& corridor_walls() {
  using enum WallKind;
  static const Vector3d east(1, 0, 0), north(0, 1, 0);
  static const std::array<CorridorWall, 8> walls = {{
      {{{kOuterX, kOuter0, 0}, -east}, 16, true, {brick, dado, dado}, 0, 0, -1},
      {{{kInner0, kInner0, 0}, east}, 14, false, {dado, plaster, panel}, 0, 0, 4},
      {{{kOuterX, kOuterY, 0}, -north}, 7, true, {bare, bare, bare}, 2, 6, -1},
      {{{kInnerX, kInner0, 0}, north}, 5, false, {plaster, bare, bare}, 1, 5, -1},
      {{{kOuter0, kOuterY, 0}, east}, 16, true, {panel, plaster, concrete}, 10, 12, -1},
      {{{kInnerX, kInnerY, 0}, -east}, 14, false, {bare, bare, brick}, 2, 5, 8},
      {{{kOuter0, kOuter0, 0}, north}, 7, true, {dado, concrete, concrete}, 0, 0, -1},
      {{{kInner0, kInnerY, 0}, -north}, 5, false, {concrete, dado, brick}, 0, 0, -1},
  }};
  return walls;
}

WallKind kind_of(const CorridorWall& wall, int bay) {
  return wall.kinds[static_cast<std::size_t>(std::min(2, bay * 3 / wall.bays))];
}

double light_at(const BuildingParts& parts, int place) { return parts.lit(place) ? 1.0 : 0.78; }

// A room behind the wall, seen through its open door.
void add_room(BuildingParts& parts, const CorridorWall& wall, int bay, int slot) {
  constexpr double kDoorAt = 0.6, kDoorWidth = 1.0, kDoorHeight = 2.1, kThick = 0.15, kDeep = 3.2, kSide = 1.1;
  const WallLine& line = wall.line;
  const double at = bay * kBay;
  const Vector3d in = line.inwards(), out = -in;
  const auto place = [&](double along, double deep) -> Vector3d {
    return line.from + (at + along) * line.along + deep * out;
  };
  const WallKind kind = kind_of(wall, bay);
  parts.wall_part(line, at, 0, kDoorAt, kCorridorHeight, kind);
  parts.wall_part(line, at + kDoorAt + kDoorWidth, 0, kBay - kDoorAt - kDoorWidth, kCorridorHeight, kind);
  parts.wall_part(line, at + kDoorAt, kDoorHeight, kDoorWidth, kCorridorHeight - kDoorHeight, kind);
  const WallLine left_jamb{place(kDoorAt, 0), out}, right_jamb{place(kDoorAt + kDoorWidth, kThick), in};
  for (const WallLine& jamb : {left_jamb, right_jamb})
    parts.rectangle(jamb.from + Vector3d(0, 0, kDoorHeight), kThick * jamb.along, {0, 0, -kDoorHeight}, parts.wood());
  parts.rectangle(place(kDoorAt, 0) + Vector3d(0, 0, kDoorHeight), kDoorWidth * line.along, kThick * out, parts.wood());

  parts.set_light(0.8);
  const WallLine back{place(-kSide, kThick + kDeep), line.along}, left{place(-kSide, kThick), out},
      right{place(kBay + kSide, kThick + kDeep), in};
  parts.wall_bay(back, 0, WallKind::plaster, slot);
  parts.wall_bay(back, kBay, WallKind::plaster, slot + 1);
  parts.wall_part(left, 0, 0, kDeep, kCorridorHeight, WallKind::plaster);
  parts.wall_part(right, 0, 0, kDeep, kCorridorHeight, WallKind::plaster);
  for (const double from : {-kSide, kBay - kSide}) {
    const Vector3d a = place(from, 0), b = place(from + kBay, kThick + kDeep);
    const Vector3d low = a.cwiseMin(b), high = a.cwiseMax(b);
    parts.floor(low.x(), low.y(), high.x(), high.y(), 0, FloorKind::carpet, slot);
    parts.ceiling(low.x(), low.y(), high.x(), high.y(), kCorridorHeight, slot);
  }
  parts.hang(back, 1.2, 2.2, 1.6, 1.3, parts.window_picture(slot), 0.95 * parts.daylight());
  parts.box(back, 1.0, 0, {1.5, 0.7, 0.74}, parts.wood(), parts.wood(), parts.wood());
  parts.box(back, 3.0, 0, {1.2, 0.35, 1.9}, parts.wood(), parts.shelf(slot), parts.wood());
  parts.box(left, 0.9, 0, {1.4, 0.35, 1.9}, parts.wood(), parts.shelf(slot + 1), parts.wood());
  parts.box(right, 0.9, 0, {1.2, 0.5, 0.8}, parts.wood(), parts.carton(slot), parts.carton(slot));
  parts.hang(right, 1.0, 1.9, 0.7, 0.9, parts.poster(parts.movable(slot + 50).uniform(0, 1000)));
  parts.set_light(1);
}

void add_corridor(BuildingParts& parts) {
  // Walls, floors and ceilings first: what is added early hides what comes later, which saves time.
  const auto& walls = corridor_walls();
  for (int w = 0; w < 8; ++w) {
    const CorridorWall& wall = walls[static_cast<std::size_t>(w)];
    for (int bay = 0; bay < wall.bays; ++bay) {
      if ((w == 6 && bay == 0) || bay == wall.room) continue;  // where the stairs begin
      parts.set_light(light_at(parts, w / 2 * 100 + bay / 2));
      parts.wall_bay(wall.line, bay * kBay, kind_of(wall, bay), parts.fixed(w * 100 + bay + 40'000).uniform(0, 1000));
    }
  }
  const auto cell = [&](double x, double y, FloorKind kind, int number) {
    const int which = parts.fixed(number + 50'000).uniform(0, 1000);
    parts.set_light(light_at(parts, number / 100 * 100 + number % 100 / 2));
    parts.floor(x, y, x + kBay, y + kBay, 0, kind, which);
    parts.ceiling(x, y, x + kBay, y + kBay, kCorridorHeight, which);
  };
  for (int i = 0; i < 16; ++i) {
    cell(kOuter0 + i * kBay, kOuter0, FloorKind::chequered, i);
    cell(kOuter0 + i * kBay, kInnerY, i < 8 ? FloorKind::lino : FloorKind::chequered, 200 + i);
  }
  for (int i = 0; i < 5; ++i) {
    cell(kInnerX, kInner0 + i * kBay, FloorKind::carpet, 100 + i);
    cell(kOuter0, kInner0 + i * kBay, FloorKind::lino, 300 + i);
  }
  parts.set_light(1);
  for (int w = 0; w < 8; ++w) {
    const CorridorWall& wall = walls[static_cast<std::size_t>(w)];
    if (wall.room >= 0) add_room(parts, wall, wall.room, 700 + 10 * w);
  }
  constexpr double kLampLength = 1.2, kLampWidth = 0.3, kLampDrop = 0.008;
  for (int i = 0; i < 16; i += 2)
    for (const int leg : {0, 2})
      if (const double y = leg == 0 ? 0 : kBuildingWidth; parts.lit(leg * 100 + i / 2))
        parts.rectangle({kOuter0 + (i + 0.5) * kBay - kLampLength / 2, y - kLampWidth / 2, kCorridorHeight - kLampDrop},
                        {kLampLength, 0, 0}, {0, kLampWidth, 0}, parts.lamp(), 1);
  for (int i = 0; i < 5; i += 2)
    for (const int leg : {1, 3})
      if (const double x = leg == 3 ? 0 : kBuildingLength; parts.lit(leg * 100 + i / 2))
        parts.rectangle({x - kLampWidth / 2, kInner0 + (i + 0.5) * kBay - kLampLength / 2, kCorridorHeight - kLampDrop},
                        {kLampWidth, 0, 0}, {0, kLampLength, 0}, parts.lamp(), 1);
  for (int w = 0; w < 8; ++w) {
    const CorridorWall& wall = walls[static_cast<std::size_t>(w)];
    for (int bay = 0; bay < wall.bays; ++bay) {
      if ((w == 6 && bay == 0) || bay == wall.room) continue;
      parts.set_light(light_at(parts, w / 2 * 100 + bay / 2));
      const bool end = wall.outside && (bay == 0 || bay == wall.bays - 1);  // in a corner: nothing in the way
      const bool sparse = bay >= wall.sparse_from && bay < wall.sparse_to;
      if (end)
        parts.notices(wall.line, bay * kBay, w * 100 + bay);
      else
        parts.furnish(wall.line, bay * kBay, w * 100 + bay, wall.outside, sparse);
    }
  }
  parts.set_light(1);
}

void add_stairs(BuildingParts& parts) {
  constexpr double kLow = -kCorridorHalfWidth, kHigh = kCorridorHalfWidth, kSpine = 0.05, kBand = 0.06;
  constexpr double kWest = kStairsTurn - kStairsLanding, kLanding = kStairsRisers * kStairsRiser;
  constexpr double kTop = kUpperFloor + kCorridorHeight, kLane = kHigh - kSpine, kRun = kStairsFoot - kStairsTurn;
  constexpr double kEntrance = kOuter0 - kStairsFoot;  // length of the way from the corridor to the first riser
  const Vector3d east(1, 0, 0), north(0, 1, 0);
  // Walls of the well; the lower ones of the entrance.
  const WallLine south{{kOuter0, kLow, 0}, -east}, north_wall{{kWest, kHigh, 0}, east}, west{{kWest, kLow, 0}, north};
  const double half = (kOuter0 - kEntrance - kWest) / 2;
  for (int i = 0; i < 2; ++i) {
    parts.wall_part(south, kEntrance + i * half, 0, half, kTop, WallKind::dado);
    parts.wall_part(north_wall, i * half, 0, half, kTop, WallKind::plaster);
  }
  parts.wall_part(south, 0, 0, kEntrance, kCorridorHeight, WallKind::dado);
  parts.wall_part(north_wall, 2 * half, 0, kEntrance, kCorridorHeight, WallKind::plaster);
  parts.wall_part(west, 0, 0, kHigh - kLow, kTop, WallKind::brick);
  parts.floor(kStairsFoot, kLow, kOuter0, kHigh, 0, FloorKind::lino, 1);
  parts.ceiling(kStairsFoot, kLow, kOuter0, kHigh, kCorridorHeight, 1);
  parts.floor(kWest, kLow, kStairsTurn, kHigh, kLanding, FloorKind::lino, 2);
  parts.ceiling(kWest, kLow, kWest + 2 * half, kHigh, kTop, 2);
  // Under the second flight, and the edge of the upper floor over the first one with its parapet.
  const WallLine store{{kStairsFoot, -kSpine, 0}, north}, edge{{kStairsFoot, -kSpine, 0}, -north};
  parts.wall_part(store, 0, 0, kHigh + kSpine, kCorridorHeight, WallKind::plaster);
  parts.hang(store, 0.12, 2.0, 0.9, 2.0, parts.door_picture());
  parts.wall_part(edge, 0, kCorridorHeight, kLane, kUpperFloor - kCorridorHeight, WallKind::concrete);
  parts.wall_part(edge, 0, kUpperFloor, kLane, 1, WallKind::concrete);
  parts.wall_part({{kStairsFoot + 0.1, kLow, 0}, north}, 0, kUpperFloor, kLane, 1, WallKind::concrete);
  parts.rectangle({kStairsFoot, kLow, kUpperFloor + 1}, {0, kLane, 0}, {0.1, 0, 0}, parts.wood());
  parts.wall_part({{kStairsFoot + 0.1, -kSpine, 0}, -east}, 0, kUpperFloor, 0.1, 1, WallKind::concrete);
  // The wall between the flights: full height at the bottom, then a parapet that follows the second flight.
  constexpr double kParapet = kLanding + 1, kRise = kUpperFloor - kLanding;
  parts.wall_part({{kStairsTurn, -kSpine, 0}, east}, 0, 0, kRun, kParapet, WallKind::panel);
  parts.wall_part({{kStairsFoot, kSpine, 0}, -east}, 0, 0, kRun, kParapet, WallKind::panel);
  const Vector3d up(kRun, 0, kRise), down(0, 0, -kRise);
  parts.rectangle({kStairsTurn, -kBand, kParapet}, up, down, parts.wall_picture(WallKind::concrete, 0));
  parts.rectangle({kStairsFoot, kBand, kParapet + kRise}, -up, down, parts.wall_picture(WallKind::concrete, 1));
  parts.rectangle({kStairsTurn, -kBand, kParapet}, {0, 2 * kBand, 0}, up, parts.wood());
  parts.rectangle({kStairsTurn, kBand, kParapet}, {0, -2 * kBand, 0}, {0, 0, -kParapet}, parts.wood());
  parts.rectangle({kStairsFoot, -kBand, kUpperFloor + 1}, {0, 2 * kBand, 0}, {0, 0, -1}, parts.wood());
  for (int i = 0; i < kStairsRisers; ++i) {
    const double first = kStairsFoot - i * kStairsTread, second = kStairsTurn + i * kStairsTread;
    const double z = (i + 1) * kStairsRiser;
    parts.rectangle({first, kLow, z}, {0, kLane, 0}, {0, 0, -kStairsRiser}, parts.riser());
    parts.rectangle({second, kHigh, kLanding + z}, {0, -kLane, 0}, {0, 0, -kStairsRiser}, parts.riser());
    if (i + 1 == kStairsRisers) break;
    parts.rectangle({first - kStairsTread, kLow, z}, {0, kLane, 0}, {kStairsTread, 0, 0}, parts.tread());
    parts.rectangle({second + kStairsTread, kHigh, kLanding + z}, {0, -kLane, 0}, {-kStairsTread, 0, 0}, parts.tread());
  }
  parts.hang(west, 0.35, kLanding + 2.2, 1.5, 1.3, parts.window_picture(3), 0.95 * parts.daylight());
  parts.hang(south, kEntrance + 0.5, 2.6, 0.7, 0.9, parts.poster(parts.movable(900).uniform(0, 1000)));
  parts.hang(south, kEntrance + 2.7, 3.4, 0.7, 0.9, parts.poster(parts.movable(901).uniform(0, 1000)));
  parts.hang(north_wall, 0.3, 3.4, 0.6, 0.8, parts.poster(parts.movable(902).uniform(0, 1000)));
  parts.hang(north_wall, 2.2, 4.6, 0.7, 0.9, parts.poster(parts.movable(903).uniform(0, 1000)));
  parts.rectangle({kStairsTurn - 0.6, -0.6, kTop - 0.008}, {0.3, 0, 0}, {0, 1.2, 0}, parts.lamp(), 1);
}

void add_upper_floor(BuildingParts& parts) {
  const Vector3d east(1, 0, 0), north(0, 1, 0);
  const int bays = static_cast<int>(std::round((kUpperEnd - kStairsFoot) / kBay));
  const WallLine south{{kUpperEnd, -kCorridorHalfWidth, kUpperFloor}, -east},
      north_wall{{kStairsFoot, kCorridorHalfWidth, kUpperFloor}, east},
      end{{kUpperEnd, kCorridorHalfWidth, kUpperFloor}, -north};
  for (int i = 0; i < bays; ++i) {
    parts.wall_bay(south, i * kBay, i < 4 ? WallKind::plaster : WallKind::concrete, 3 * i + 1);
    parts.wall_bay(north_wall, i * kBay, i < 4 ? WallKind::brick : WallKind::dado, 5 * i + 2);
    const double x = kStairsFoot + i * kBay;
    parts.floor(x, -kCorridorHalfWidth, x + kBay, kCorridorHalfWidth, kUpperFloor, FloorKind::lino, 3 * i);
    parts.ceiling(x, -kCorridorHalfWidth, x + kBay, kCorridorHalfWidth, kUpperFloor + kCorridorHeight, i);
    if (i % 2 == 0)
      parts.rectangle({x + 0.5, -0.15, kUpperFloor + kCorridorHeight - 0.008}, {1.2, 0, 0}, {0, 0.3, 0}, parts.lamp(),
                      1);
  }
  parts.wall_bay(end, 0, WallKind::dado, 1);
  parts.window(end, 0, 1300);
  for (int i = 0; i < bays; ++i) {
    if (i + 1 < bays) parts.furnish(south, i * kBay, 1100 + i, true, false);
    // One comes up the stairs close to the north wall.
    if (i < 2)
      parts.notices(north_wall, i * kBay, 1200 + i);
    else
      parts.furnish(north_wall, i * kBay, 1200 + i, false, false);
  }
}

}  // namespace

SyntheticScene build_building_scene(std::uint64_t seed, int day) {
  BuildingParts parts(seed, day);
  add_corridor(parts);
  add_stairs(parts);
  add_upper_floor(parts);
  return std::move(parts.scene());
}

}  // namespace parallax
