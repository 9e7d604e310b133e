#include "render/synthetic_building_parts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <opencv2/imgproc.hpp>
#include <string>

#include "render/synthetic_building.h"

namespace parallax {

using Eigen::Vector3d;

namespace {

constexpr double kOnWall = 0.008;  // how far a picture stands off: more than depth in floats needs 30 m away
constexpr double kGap = 0.004;

}  // namespace

BuildingParts::BuildingParts(std::uint64_t seed, int day) : seed_(seed), day_(day) {
  cv::RNG rng = generator(5'000'000 + static_cast<std::uint64_t>(day));
  if (day > 0) daylight_ = rng.uniform(0.6, 1.25);
  paint_stock();
}

cv::RNG BuildingParts::generator(std::uint64_t salt) const {
  cv::RNG rng(0x51ed270bu + seed_ * 104729u + salt * 31337u);
  for (int i = 0; i < 20; ++i) rng.next();
  return rng;
}

cv::RNG BuildingParts::movable(int slot) const {
  const auto number = static_cast<std::uint64_t>(slot);
  for (int day = day_; day > 0; --day) {
    const std::uint64_t salt = 1'000'000 + number * 2003 + static_cast<std::uint64_t>(day);
    if (generator(salt).uniform(0, 3) == 0) return generator(salt + 7'000'000);
  }
  return generator(100'000 + number);
}

bool BuildingParts::lit(int place) const {
  return day_ == 0 || generator(9'000'000 + static_cast<std::uint64_t>(place) * 2003 + static_cast<std::uint64_t>(day_))
                              .uniform(0, 5) != 0;
}

void BuildingParts::paint_stock() {
  using paint::Picture;
  using Painter = std::function<Picture(cv::Size, cv::RNG&)>;
  std::uint64_t salt = 0;
  const auto picture = [&](double w, double h, const Painter& painter) {
    cv::RNG rng = generator(++salt);
    return scene_.add_texture(painter(texture_size(w, h), rng));
  };
  for (int kind = 0; kind < paint::kWallKinds; ++kind)
    for (int i = 0; i < 3; ++i)
      walls_[static_cast<std::size_t>(kind)].push_back(picture(448, 544, [&](cv::Size s, cv::RNG& rng) {
        return paint::corridor_wall(static_cast<paint::WallKind>(kind), s, s.height / kCorridorHeight, rng);
      }));
  for (int kind = 0; kind < paint::kFloorKinds; ++kind)
    for (int i = 0; i < 3; ++i)
      floors_[static_cast<std::size_t>(kind)].push_back(picture(448, 448, [&](cv::Size s, cv::RNG& rng) {
        return paint::corridor_floor(static_cast<paint::FloorKind>(kind), s.width, 8, rng);
      }));
  for (int i = 0; i < 3; ++i)
    ceilings_.push_back(
        picture(320, 320, [](cv::Size s, cv::RNG& rng) { return paint::corridor_ceiling(s.width, 4, rng); }));
  // Few kinds of doors, so that one looks like another.
  for (const cv::Scalar& colour : {cv::Scalar(60, 92, 130), cv::Scalar(120, 104, 74), cv::Scalar(150, 160, 164)})
    doors_.push_back(picture(224, 480, [&](cv::Size s, cv::RNG& rng) { return paint::corridor_door(s, colour, rng); }));
  for (int i = 0; i < 44; ++i) {
    const bool page = i % 3 == 2;
    posters_.push_back(page ? picture(160, 224, paint::printed_page) : picture(224, 288, paint::poster));
  }
  for (int i = 0; i < 8; ++i) boards_.push_back(picture(544, 352, paint::notice_board));
  for (int i = 0; i < 8; ++i) windows_.push_back(picture(384, 352, paint::window_view));
  for (int i = 0; i < 5; ++i) shelves_.push_back(picture(416, 544, paint::book_shelf));
  for (int i = 0; i < 8; ++i) cartons_.push_back(picture(160, 160, paint::cardboard));
  radiator_ = picture(288, 160, paint::radiator);
  wood_ = picture(256, 128, [](cv::Size s, cv::RNG& rng) { return paint::wood(s, 260, {80, 120, 165}, rng); });
  metal_ = picture(160, 224, [](cv::Size s, cv::RNG& rng) {
    Picture out = paint::plain(s, {150, 146, 138});
    paint::add_mottle(out, 26, 48, 0.85, rng);
    for (int i = 0; i < 4; ++i) {
      const cv::Rect drawer(4, 4 + i * s.height / 4, s.width - 8, s.height / 4 - 8);
      cv::Mat3b part = out(drawer);
      part *= rng.uniform(0.85, 1.1);
      out(cv::Rect(s.width * 4 / 10, drawer.y + drawer.height / 3, s.width / 5, 6)) = cv::Vec3b(50, 50, 50);
      out(cv::Rect(4, drawer.y + drawer.height, s.width - 8, 3)) = cv::Vec3b(60, 60, 60);
    }
    return out;
  });
  lamp_ = picture(64, 64, [](cv::Size s, cv::RNG&) { return paint::plain(s, {250, 250, 250}); });
  tread_ = picture(224, 64, paint::stair_tread);
  riser_ = picture(224, 32, [](cv::Size s, cv::RNG& rng) {
    Picture out = paint::plain(s, {112, 116, 120});
    paint::add_mottle(out, 44, 24, 0.9, rng);
    return out;
  });
  red_ = picture(96, 128, [](cv::Size s, cv::RNG& rng) {
    Picture out = paint::plain(s, {40, 40, 190});
    paint::print_line(out, paint::random_text(6, rng), {8, 40}, s.width, 16, 1, {235, 235, 235});
    paint::add_mottle(out, 16, 16, 0.9, rng);
    return out;
  });
}

void BuildingParts::rectangle(const Vector3d& origin, const Vector3d& u, const Vector3d& v, int texture, double glow) {
  // Lamps in the ceiling: floors are bright, and walls differ a little, so that edges between them are seen.
  const Vector3d n = -u.cross(v).normalized();
  const double shade = 0.86 + 0.08 * n.z() + 0.05 * n.x() + 0.03 * n.y();
  scene_.add({SurfaceShape::rectangle, origin, u, v, texture, false, glow > 0 ? glow : shade * light_});
}

void BuildingParts::box(const WallLine& wall, double at, double bottom, const Vector3d& size, int top, int front,
                        int side) {
  const Vector3d in = wall.inwards(), x = wall.along * size.x(), y = in * size.y(), down(0, 0, -size.z());
  const Vector3d back_left = wall.from + at * wall.along + kGap * in + Vector3d(0, 0, bottom + size.z());
  rectangle(back_left, x, y, top);
  rectangle(back_left + y, x, down, front);
  rectangle(back_left, y, down, side);
  rectangle(back_left + x + y, -y, down, side);
}

void BuildingParts::hang(const WallLine& wall, double at, double top, double width, double height, int texture,
                         double glow) {
  rectangle(wall.from + at * wall.along + kOnWall * wall.inwards() + Vector3d(0, 0, top), width * wall.along,
            {0, 0, -height}, texture, glow);
}

void BuildingParts::wall_bay(const WallLine& wall, double at, paint::WallKind kind, int which) {
  rectangle(wall.from + at * wall.along + Vector3d(0, 0, kCorridorHeight), kBay * wall.along, {0, 0, -kCorridorHeight},
            pick(walls_[static_cast<std::size_t>(kind)], which));
}

void BuildingParts::wall_part(const WallLine& wall, double at, double bottom, double width, double height,
                              paint::WallKind kind) {
  // Cut out of a picture of a whole wall, so that bricks keep their size.
  constexpr double kPx = 160;  // a little coarser than the stock, for there are many
  cv::RNG rng = generator(20'000 + static_cast<std::uint64_t>(scene_.surfaces().size()));
  const double wide = std::max(width, kBay), high = std::max(bottom + height, kCorridorHeight);
  const cv::Size all(static_cast<int>(wide * kPx), static_cast<int>(high * kPx));
  const paint::Picture whole = paint::corridor_wall(kind, all, kPx, rng);
  const cv::Size size(std::min(static_cast<int>(width * kPx), all.width),
                      std::min(static_cast<int>(height * kPx), all.height));
  const int y = std::clamp(static_cast<int>((high - bottom - height) * kPx), 0, all.height - size.height);
  paint::Picture part;
  cv::resize(whole(cv::Rect((all.width - size.width) / 2, y, size.width, size.height)), part,
             texture_size(size.width, size.height), 0, 0, cv::INTER_LINEAR);
  rectangle(wall.from + at * wall.along + Vector3d(0, 0, bottom + height), width * wall.along, {0, 0, -height},
            scene_.add_texture(part));
}

void BuildingParts::floor(double x0, double y0, double x1, double y1, double z, paint::FloorKind kind, int which) {
  rectangle({x0, y1, z}, {x1 - x0, 0, 0}, {0, y0 - y1, 0}, pick(floors_[static_cast<std::size_t>(kind)], which));
}

void BuildingParts::ceiling(double x0, double y0, double x1, double y1, double z, int which) {
  rectangle({x0, y0, z}, {x1 - x0, 0, 0}, {0, y1 - y0, 0}, pick(ceilings_, which));
}

void BuildingParts::door(const WallLine& wall, double at, int slot) {
  cv::RNG rng = fixed(slot);
  const int kind = rng.uniform(0, 10) < 7 ? 0 : rng.uniform(1, 3);
  hang(wall, at + 0.4, 2.1, 0.96, 2.1, pick(doors_, kind));
  const std::string number =
      std::string(1, static_cast<char>('A' + rng.uniform(0, 4))) + "-" + std::to_string(rng.uniform(100, 400));
  hang(wall, at + 1.46, 1.65, 0.24, 0.15, scene_.add_texture(paint::name_plate(texture_size(128, 64), number, rng)));
  cv::RNG moved = movable(slot);
  const int which = moved.uniform(0, 1000);
  if (moved.uniform(0, 2) == 0) hang(wall, at + 1.5, 1.45, 0.3, 0.42, poster(which - which % 3 + 2));
}

void BuildingParts::window(const WallLine& wall, double at, int slot) {
  cv::RNG rng = fixed(slot);
  hang(wall, at + 0.3, 2.3, 1.5, 1.3, pick(windows_, rng.uniform(0, 1000)), 0.95 * daylight_);
  box(wall, at + 0.45, 0.12, {1.2, 0.11, 0.55}, metal_, radiator_, metal_);
  cv::RNG moved = movable(slot);
  if (moved.uniform(0, 3) == 0)
    box(wall, at + moved.uniform(0.5, 1.3), 0.67, {0.22, 0.1, moved.uniform(0.1, 0.3)}, carton(slot), carton(slot),
        carton(slot));
}

void BuildingParts::notices(const WallLine& wall, double at, int slot) {
  cv::RNG moved = movable(slot);
  if (fixed(slot).uniform(0, 3) == 0) {
    hang(wall, at + 0.3, 1.95, 1.55, 1.0, pick(boards_, moved.uniform(0, 1000)));
    return;
  }
  for (int i = 0; i < 2; ++i) {
    const double width = moved.uniform(0.5, 0.75);
    hang(wall, at + 0.1 + i + moved.uniform(0.0, 0.2), moved.uniform(1.75, 2.1), width, width * 1.3,
         poster(moved.uniform(0, 1000)));
  }
}

void BuildingParts::clutter(const WallLine& wall, double at, int slot) {
  cv::RNG rng = fixed(slot), moved = movable(slot);
  switch (rng.uniform(0, 4)) {
    case 0:
      box(wall, at + 0.3, 0, {1.4, 0.34, 1.9}, wood_, shelf(rng.uniform(0, 1000)), wood_);
      break;
    case 1: {
      const double x = at + moved.uniform(0.2, 0.9);
      box(wall, x, 0, {0.8, 0.38, 1.1}, metal_, metal_, metal_);
      const int on_top = moved.uniform(0, 1000);
      box(wall, x + moved.uniform(0.05, 0.4), 1.1, {0.36, 0.28, moved.uniform(0.16, 0.4)}, carton(on_top),
          carton(on_top), carton(on_top + 1));
      break;
    }
    case 2: {
      double x = at + moved.uniform(0.0, 0.4);
      for (int i = moved.uniform(1, 4); i > 0; --i) {
        const double width = moved.uniform(0.3, 0.5), height = moved.uniform(0.25, 0.6);
        const int which = moved.uniform(0, 1000);
        box(wall, x, 0, {width, moved.uniform(0.25, 0.38), height}, carton(which), carton(which), carton(which + 1));
        x += width + moved.uniform(0.02, 0.2);
      }
      hang(wall, at + moved.uniform(0.2, 1.2), 1.9, 0.6, 0.8, poster(moved.uniform(0, 1000)));
      break;
    }
    default: {
      // Fire extinguisher with its sign; a bin.
      const Vector3d can = wall.from + (at + 0.5) * wall.along + 0.12 * wall.inwards();
      scene_.add_can(can.head<2>(), 0.5, 0.075, 0.5, 0, red_, red_);
      hang(wall, at + 0.38, 1.8, 0.24, 0.3, red_);
      const Vector3d bin = wall.from + (at + moved.uniform(1.1, 1.9)) * wall.along + 0.22 * wall.inwards();
      scene_.add_can(bin.head<2>(), 0, 0.15, 0.45, 0, carton(slot), metal_);
      break;
    }
  }
}

void BuildingParts::furnish(const WallLine& wall, double at, int slot, bool outside, bool sparse) {
  const int kind = fixed(slot + 500'000).uniform(0, 12);
  if (sparse) {
    if (kind < 2) door(wall, at, slot);
    if (kind == 2) notices(wall, at, slot);
    return;
  }
  if (kind < 3)
    door(wall, at, slot);
  else if (kind < 6 && outside)
    window(wall, at, slot);
  else if (kind >= 6 && kind < 9)
    notices(wall, at, slot);
  else if (kind < 11)
    clutter(wall, at, slot);
}

}  // namespace parallax
