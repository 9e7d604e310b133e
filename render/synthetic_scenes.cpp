#include "render/synthetic_scenes.h"

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <opencv2/imgproc.hpp>

#include "core/check.h"
#include "render/synthetic_board.h"
#include "render/synthetic_building.h"
#include "render/synthetic_paint.h"

namespace parallax {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

cv::RNG generator(std::uint64_t seed, std::uint64_t salt) {
  cv::RNG rng(0x9e3779b9u + seed * 104729u + salt * 31337u);
  for (int i = 0; i < 20; ++i) rng.next();
  return rng;
}

paint::Picture gallery_wall(cv::Size size, double px_per_metre, cv::RNG& rng) {
  paint::Picture p = paint::bricks(size, static_cast<int>(0.28 * px_per_metre), rng);
  // Posters pasted over the bricks, and small things everywhere.
  for (int i = 0; i < 60; ++i) {
    const cv::Size s(static_cast<int>(px_per_metre * rng.uniform(0.4, 1.2)),
                     static_cast<int>(px_per_metre * rng.uniform(0.5, 1.3)));
    const cv::Rect where(rng.uniform(0, size.width - s.width), rng.uniform(0, size.height - s.height), s.width,
                         s.height);
    (i % 4 == 3 ? paint::printed_page(s, rng) : paint::poster(s, rng)).copyTo(p(where));
  }
  paint::add_mottle(p, 45, 24, 0.9, rng);
  paint::add_collage(p, 3500, 5, 60, rng);
  return p;
}

}  // namespace

SyntheticScene build_walls_scene(std::uint64_t seed) {
  constexpr double kPxPerMetre = 224, kHeight = 6, kBeyond = 4;
  cv::RNG rng = generator(seed, 1);
  SyntheticScene scene;
  const Vector3d corner(kWallsCornerX, kWallsDistance, kHeight), down(0, 0, -kHeight);
  const double first = kWallsCornerX + kBeyond, second = kWallsDistance + kWallsTurnRadius + kWallsStraight + kBeyond;
  const auto wall = [&](double length) {
    return scene.add_texture(gallery_wall(texture_size(length * kPxPerMetre, kHeight * kPxPerMetre), kPxPerMetre, rng));
  };
  const int first_wall = wall(first), second_wall = wall(second);
  scene.add_rectangle(corner - Vector3d(first, 0, 0), {first, 0, 0}, down, first_wall);
  scene.add_rectangle(corner, {0, -second, 0}, down, second_wall);
  return scene;
}

SyntheticScene build_repeat_scene(std::uint64_t seed) {
  cv::RNG rng = generator(seed, 2);
  SyntheticScene scene;
  const int floor = scene.add_texture(paint::tiles({2048, 1536}, 64, rng));
  const int wall = scene.add_texture(paint::tiles({2048, 768}, 64, rng));
  scene.add_rectangle({-1.28, 0.9, 0}, {2.56, 0, 0}, {0, -1.92, 0}, floor);
  scene.add_rectangle({-1.28, 0.9, 0.96}, {2.56, 0, 0}, {0, 0, -0.96}, wall);
  const auto thing = [&](paint::Picture (*painter)(cv::Size, cv::RNG&)) {
    return scene.add_texture(painter({160, 160}, rng));
  };
  const int a = thing(paint::cardboard), b = thing(paint::book_cover);
  scene.add_box({-0.35, 0.3}, 0.0005, {0.1, 0.08, 0.06}, 0.3, a, a, a);
  scene.add_box({0.3, -0.1}, 0.0005, {0.09, 0.13, 0.03}, -0.4, b, a, a);
  scene.add_can({0.1, 0.4}, 0.0005, 0.033, 0.1, 1.0, scene.add_texture(paint::can_label({512, 224}, rng)), a);
  return scene;
}

SyntheticScene build_blank_scene() {
  SyntheticScene scene;
  const int grey = scene.add_texture(paint::plain({32, 32}, {140, 140, 140}));
  scene.add_rectangle({-500, 500, 0}, {1000, 0, 0}, {0, -1000, 0}, grey);
  return scene;
}

SyntheticScene build_room_scene(std::uint64_t seed) {
  cv::RNG rng = generator(seed, 3);
  SyntheticScene scene;
  using Painter = std::function<paint::Picture(cv::Size, cv::RNG&)>;
  const auto picture = [&](double w, double h, const Painter& painter) {
    return scene.add_texture(painter(texture_size(w, h), rng));
  };
  constexpr double kHalf = 2.5, kTop = 2.6, kPx = 360;
  const Vector3d down(0, 0, -kTop),
      corners[4] = {{-kHalf, kHalf, kTop}, {kHalf, kHalf, kTop}, {kHalf, -kHalf, kTop}, {-kHalf, -kHalf, kTop}};
  for (int i = 0; i < 4; ++i) {
    const Vector3d from = corners[i], along = corners[(i + 1) % 4] - from, unit = along / (2 * kHalf);
    const Vector3d inwards = unit.cross(Vector3d::UnitZ());
    scene.add_rectangle(from, along, down, picture(2 * kHalf * kPx, kTop * kPx, [&](cv::Size s, cv::RNG& r) {
                          return i % 2 ? paint::bricks(s, 80, r)
                                       : paint::plaster(s, paint::random_colour(r, 150, 215), r);
                        }));
    const auto hang = [&](double x, double z, double w, double h, const Painter& painter) {
      scene.add_rectangle(from + x * unit + Vector3d(0, 0, z - kTop) + 0.004 * inwards, w * unit, {0, 0, -h},
                          picture(w * 400, h * 400, painter));
    };
    hang(0.3, 2.1, 1.0, 1.9, paint::book_shelf);
    hang(1.6, 2.0, 0.6, 0.8, paint::poster);
    hang(2.4, 2.2, 0.9, 0.6, paint::poster);
    hang(2.5, 1.4, 0.5, 0.7, paint::printed_page);
    hang(3.6, 1.9, 0.8, 1.1, i % 2 ? Painter(paint::screen) : Painter(paint::poster));
    // Furniture along the wall.
    const Vector3d middle = from + 0.5 * along + 0.55 * inwards;
    const double yaw = std::atan2(unit.y(), unit.x());
    const int front = picture(480, 320, paint::cardboard), side = picture(224, 320, paint::cardboard);
    const int top = picture(480, 224, [](cv::Size s, cv::RNG& r) { return paint::wood(s, 400, {80, 120, 165}, r); });
    scene.add_box(middle.head<2>(), 0, {1.2, 0.5, 0.75}, yaw, top, front, side);
    const Vector2d along2 = unit.head<2>();
    for (int k = 0; k < 3; ++k) {
      const Vector2d at = middle.head<2>() + (-0.4 + 0.4 * k + rng.uniform(-0.06, 0.06)) * along2;
      const int cover = picture(192, 256, paint::book_cover);
      if (k == 1)
        scene.add_can(at, 0.7505, 0.08, 0.25, rng.uniform(0.0, 6.0), picture(512, 224, paint::can_label), cover);
      else
        scene.add_box(at, 0.7505, {0.16, 0.22, rng.uniform(0.05, 0.3)}, rng.uniform(-1.0, 1.0), cover, cover, cover);
    }
  }
  scene.add_rectangle(Vector3d(-kHalf, kHalf, 0), {2 * kHalf, 0, 0}, {0, -2 * kHalf, 0},
                      picture(1500, 1500, [](cv::Size s, cv::RNG& r) {
                        return paint::carpet(s, {80, 86, 110}, r);
                      }));
  scene.add_rectangle(Vector3d(-kHalf, -kHalf, kTop), {2 * kHalf, 0, 0}, {0, 2 * kHalf, 0},
                      picture(640, 640, [](cv::Size s, cv::RNG& r) {
                        return paint::plaster(s, {220, 225, 226}, r);
                      }));
  return scene;
}

SyntheticScene build_synthetic_scene(const std::string& name, std::uint64_t seed, int day) {
  if (name == "desk") return build_desk_scene(seed, day);
  if (name == "building") return build_building_scene(seed, day);
  if (name == "walls") return build_walls_scene(seed);
  if (name == "repeat") return build_repeat_scene(seed);
  if (name == "blank") return build_blank_scene();
  if (name == "board") return build_board_scene(seed, SyntheticBoardKind::chessboard);
  if (name == "circle board") return build_board_scene(seed, SyntheticBoardKind::circles);
  PARALLAX_CHECK(name == "room", "no such scene: " + name);
  return build_room_scene(seed);
}

}  // namespace parallax
