#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <opencv2/imgproc.hpp>

#include "render/synthetic_paint.h"
#include "render/synthetic_scenes.h"

namespace parallax {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

constexpr double kTableWidth = 1.7, kTableDepth = 1.0, kTableThickness = 0.03, kFloor = -0.72;
constexpr double kTablePxPerMetre = 1600;

class DeskBuilder {
 public:
  DeskBuilder(std::uint64_t seed, int day) : seed_(seed), day_(day), rng_(0x5eed0000u + seed * 7919u) {
    for (int i = 0; i < 20; ++i) rng_.next();
  }

  SyntheticScene build() {
    // Objects first: they leave their contact shadows on the table's picture, which is painted last.
    shadows_ = cv::Mat1f::zeros(texture_size(kTableWidth * 200, kTableDepth * 200));
    table_objects();
    table();
    room();
    other_place();
    return std::move(scene_);
  }

 private:
  using Painter = std::function<paint::Picture(cv::Size, cv::RNG&)>;

  int picture(double width_px, double height_px, const Painter& painter) {
    return scene_.add_texture(painter(texture_size(width_px, height_px), rng_));
  }
  int plain(const cv::Scalar& colour) {
    return picture(32, 32, [&](cv::Size s, cv::RNG& rng) {
      paint::Picture p = paint::plain(s, colour);
      paint::add_mottle(p, 12, 8, 0.9, rng);
      return p;
    });
  }
  // Where the next thing stands on this day: each morning one in three has been moved, within the reach of an arm and
  // not off the table. What it looks like does not change.
  void rearrange(Vector2d* at, double* yaw) {
    const std::uint64_t thing = things_++;
    for (int day = 1; day <= day_; ++day) {
      cv::RNG rng((seed_ * 1000003u + thing) * 1000003u + static_cast<std::uint64_t>(day));
      for (int i = 0; i < 8; ++i) rng.next();
      if (rng.uniform(0.0, 1.0) > 1.0 / 3) continue;
      const Vector2d to = *at + Vector2d(rng.uniform(-0.25, 0.25), rng.uniform(-0.2, 0.2));
      *at = to.cwiseMax(Vector2d(-0.72, -0.4)).cwiseMin(Vector2d(0.72, 0.4));
      *yaw += rng.uniform(-1.0, 1.0);
    }
  }
  double jitter(double half) { return rng_.uniform(-half, half); }

  void shadow(const Vector2d& centre, const Vector2d& size, double yaw) {
    const double k = shadows_.cols / kTableWidth;
    const cv::Point2f c(static_cast<float>((centre.x() + 0.012 + kTableWidth / 2) * k),
                        static_cast<float>((kTableDepth / 2 - centre.y() - 0.015) * k));
    const cv::RotatedRect rectangle(c, cv::Size2f(static_cast<float>(size.x() * k), static_cast<float>(size.y() * k)),
                                    static_cast<float>(-yaw * 57.29578));
    cv::Point2f corners[4];
    rectangle.points(corners);
    std::vector<cv::Point> polygon;
    for (const auto& p : corners) polygon.emplace_back(p);
    cv::fillConvexPoly(shadows_, polygon, 1.0);
  }
  void box(const Vector2d& at, double bottom, const Vector3d& size, double yaw, int top, int front, int side) {
    scene_.add_box(at, bottom, size, yaw, top, front, side);
    if (bottom < 0.01) shadow(at, size.head<2>(), yaw);
  }
  void sheet(const Vector2d& at, double z, const Vector2d& size, double yaw, int texture) {
    const Vector3d ex(std::cos(yaw), std::sin(yaw), 0), ey(-std::sin(yaw), std::cos(yaw), 0);
    scene_.add_rectangle(Vector3d(at.x(), at.y(), z) - ex * size.x() / 2 + ey * size.y() / 2, ex * size.x(),
                         -ey * size.y(), texture);
  }
  void can(Vector2d at, double radius, double height, double yaw, int label, int lid, bool open = false) {
    rearrange(&at, &yaw);
    scene_.add_can(at, 0.0005, radius, height, yaw, label, lid, open);
    shadow(at, {1.8 * radius, 1.8 * radius}, 0.4);
  }
  void books(Vector2d at, int count, double yaw) {
    rearrange(&at, &yaw);
    double z = 0.0005;
    for (int i = 0; i < count; ++i) {
      const double thick = rng_.uniform(0.014, 0.034);
      const int cover = picture(288, 416, paint::book_cover), edge = picture(288, 32, paint::page_edges);
      const Vector3d size(rng_.uniform(0.14, 0.19), rng_.uniform(0.2, 0.25), thick);
      box(at + Vector2d(jitter(0.012), jitter(0.012)), z, size, yaw + jitter(0.25), cover, edge, edge);
      z += thick;
    }
  }

  void table_objects() {
    const auto page = [&] { return picture(480, 672, paint::printed_page); };
    const auto label = [&] { return picture(512, 224, paint::can_label); };
    const int metal = plain({150, 152, 155}), coffee = plain({22, 36, 58}), dark = plain({40, 38, 38});
    // Papers and photographs, each a little higher than the last.
    double z = 0.0008;
    const auto lay = [&](Vector2d at, const Vector2d& size, double yaw, int texture) {
      rearrange(&at, &yaw);
      sheet(at + Vector2d(jitter(0.02), jitter(0.02)), z += 0.0004, size, yaw + jitter(0.1), texture);
    };
    const auto thing = [&](Vector2d at, double bottom, const Vector3d& size, double yaw, int top, int front, int side) {
      rearrange(&at, &yaw);
      box(at, bottom, size, yaw, top, front, side);
    };
    const Vector2d a4(0.21, 0.297);
    lay({-0.52, -0.26}, a4, 0.25, page());
    lay({-0.42, -0.31}, a4, -0.12, page());
    lay({0.40, -0.28}, a4, -0.3, page());
    lay({0.55, 0.02}, a4, 0.5, page());
    lay({0.68, -0.30}, a4, 0.1, page());
    lay({-0.70, 0.05}, a4, 0.2, page());
    lay({-0.12, -0.36}, {0.18, 0.12}, 0.1, picture(480, 320, paint::photograph));
    lay({-0.30, -0.12}, {0.13, 0.09}, -0.4, picture(320, 224, paint::photograph));
    lay({0.13, -0.38}, {0.15, 0.1}, -0.25, picture(416, 288, paint::photograph));
    lay({-0.10, 0.24}, {0.076, 0.076}, 0.3, plain({180, 120, 235}));
    lay({0.30, -0.11}, {0.076, 0.076}, -0.2, plain({90, 225, 240}));

    thing({0.04, -0.05}, 0.0005, {0.44, 0.15, 0.022}, -0.04, picture(1056, 384, paint::keyboard), dark, dark);
    thing({0.335, -0.07}, 0.0005, {0.062, 0.105, 0.03}, -0.15, plain({58, 54, 52}), dark, dark);
    books({-0.58, 0.26}, 4, 0.2);
    books({0.62, -0.12}, 2, -0.35);
    books({-0.32, 0.40}, 3, -0.1);
    const auto carton = [&](const Vector2d& at, const Vector3d& size, double yaw) {
      const double k = 1500;
      thing(at, 0.0005, size, yaw, picture(size.x() * k, size.y() * k, paint::cardboard),
            picture(size.x() * k, size.z() * k, paint::cardboard),
            picture(size.y() * k, size.z() * k, paint::cardboard));
    };
    carton({-0.40, 0.20}, {0.11, 0.07, 0.16}, 0.3);
    carton({0.26, 0.20}, {0.12, 0.09, 0.08}, -0.25);
    carton({0.66, 0.36}, {0.2, 0.16, 0.2}, -0.2);
    carton({-0.22, -0.24}, {0.15, 0.1, 0.05}, 0.45);
    carton({-0.74, 0.38}, {0.14, 0.12, 0.26}, 0.15);
    can({-0.22, 0.15}, 0.033, 0.115, 1.2, label(), metal);
    can({-0.15, 0.11}, 0.033, 0.115, 2.6, label(), metal);
    can({0.44, 0.14}, 0.026, 0.06, 0.4, label(), metal);
    can({0.33, -0.20}, 0.024, 0.05, 2.2, label(), metal);
    can({0.50, 0.30}, 0.035, 0.18, 3.0, label(), metal);
    can({-0.33, 0.02}, 0.041, 0.095, 0.8, label(), coffee, true);
    // A monitor: foot, stem, and a screen standing on it.
    box({0.14, 0.34}, 0.0005, {0.24, 0.15, 0.012}, 0.05, dark, dark, dark);
    box({0.14, 0.38}, 0.012, {0.05, 0.03, 0.14}, 0.05, dark, dark, dark);
    const int screen = picture(1056, 608, paint::screen);
    box({0.14, 0.37}, 0.13, {0.52, 0.025, 0.3}, 0.05, dark, screen, dark);
    for (int i = 0; i < 9; ++i)  // pens and pencils
      thing({jitter(0.7), -0.25 + jitter(0.2)}, 0.0032 + 0.0001 * i, {0.14, 0.007, 0.007}, jitter(1.5), dark, dark,
            dark);
    for (int i = 0; i < 10; ++i) {  // dice and erasers
      const double side = rng_.uniform(0.014, 0.03);
      const int face = picture(64, 64, [](cv::Size s, cv::RNG& rng) {
        paint::Picture p = paint::plain(s, paint::random_colour(rng, 60, 240));
        paint::add_collage(p, 5, 10, 40, rng);
        return p;
      });
      thing({jitter(0.75), 0.05 + jitter(0.22)}, 0.0005, {side, side * 0.8, side * 0.7}, jitter(1.5), face, face, face);
    }
  }

  void table() {
    const cv::Size size = texture_size(kTableWidth * kTablePxPerMetre, kTableDepth * kTablePxPerMetre);
    paint::Picture top = paint::wood(size, kTablePxPerMetre, {96, 150, 200}, rng_);
    cv::GaussianBlur(shadows_, shadows_, {0, 0}, 3.5);
    cv::Mat1f shadow_map;
    cv::resize(shadows_, shadow_map, size, 0, 0, cv::INTER_LINEAR);
    for (int y = 0; y < size.height; ++y)
      for (int x = 0; x < size.width; ++x)
        if (const float s = shadow_map(y, x); s > 0.01f)
          for (int c = 0; c < 3; ++c)
            top(y, x)[c] = static_cast<uchar>(static_cast<float>(top(y, x)[c]) * (1.0f - 0.6f * s));
    const int edge = picture(1024, 32, [](cv::Size s, cv::RNG& rng) {
      return paint::wood(s, 600, {70, 110, 150}, rng);
    });
    scene_.add_box({0, 0}, -kTableThickness, {kTableWidth, kTableDepth, kTableThickness}, 0, scene_.add_texture(top),
                   edge, edge);
  }

  void room() {
    const double back = 0.95, left = -1.8, right = 1.8, front = -2.4, top = 1.7;
    const auto wall = [&](cv::Size s, cv::RNG& rng) { return paint::plaster(s, {196, 204, 206}, rng); };
    const int wide = picture(1024, 704, wall),
              brown = picture(1024, 704, [](cv::Size s, cv::RNG&rng) { return paint::bricks(s, 64, rng); });
    const Vector3d down(0, 0, kFloor - top);
    scene_.add_rectangle({left, back, top}, {right - left, 0, 0}, down, wide);
    scene_.add_rectangle({left, front, top}, {0, back - front, 0}, down, brown);
    scene_.add_rectangle({right, back, top}, {0, front - back, 0}, down, wide);
    scene_.add_rectangle({right, front, top}, {left - right, 0, 0}, down, brown);
    scene_.add_rectangle({left, back, kFloor}, {right - left, 0, 0}, {0, front - back, 0},
                         picture(1440, 1344, [](cv::Size s, cv::RNG& rng) {
                           return paint::carpet(s, {92, 78, 70}, rng);
                         }));
    scene_.add_rectangle({left, front, top}, {right - left, 0, 0}, {0, back - front, 0}, plain({215, 220, 222}));
    const auto hang = [&](double x, double z, double w, double h, const Painter& painter) {
      scene_.add_rectangle({x, back - 0.004, z}, {w, 0, 0}, {0, 0, -h}, picture(w * 560, h * 560, painter));
    };
    hang(-1.35, 0.85, 0.8, 1.3, paint::book_shelf);
    hang(-0.38, 1.02, 0.3, 0.4, paint::poster);
    hang(0.02, 1.05, 0.42, 0.3, paint::poster);
    hang(0.55, 1.0, 0.36, 0.5, paint::poster);
    hang(0.98, 0.7, 0.3, 0.4, paint::poster);
    hang(0.58, 0.42, 0.3, 0.3, paint::poster);
    hang(-0.5, 0.5, 0.36, 0.3, paint::printed_page);
    hang(-0.1, 0.35, 0.26, 0.36, paint::printed_page);
    for (const double y : {0.3, -0.5}) {
      scene_.add_rectangle({left + 0.004, y - 0.5, 0.9}, {0, 0.45, 0}, {0, 0, -0.6}, picture(288, 384, paint::poster));
      scene_.add_rectangle({right - 0.004, y, 0.9}, {0, -0.45, 0}, {0, 0, -0.6}, picture(288, 384, paint::poster));
    }
    scene_.add_box({-1.4, 0.2}, kFloor, {0.4, 0.5, 0.9}, 0.1, wide, picture(320, 512, paint::cardboard),
                   picture(352, 512, paint::cardboard));
  }

  void other_place() {
    const Vector3d at(20, 0, 0);
    const int bricks = picture(1600, 1024, [](cv::Size s, cv::RNG& rng) { return paint::bricks(s, 96, rng); });
    scene_.add_rectangle(at + Vector3d(-2, 1.2, 1.8), {4, 0, 0}, {0, 0, -2.4}, bricks);
    scene_.add_rectangle(at + Vector3d(-2, -2.5, 1.8), {0, 3.7, 0}, {0, 0, -2.4}, bricks);
    scene_.add_rectangle(at + Vector3d(2, 1.2, 1.8), {0, -3.7, 0}, {0, 0, -2.4}, bricks);
    scene_.add_rectangle(at + Vector3d(-2, 1.2, 0), {4, 0, 0}, {0, -3.7, 0},
                         picture(1600, 1472, [](cv::Size s, cv::RNG& rng) {
                           return paint::carpet(s, {60, 92, 70}, rng);
                         }));
    for (int i = 0; i < 10; ++i) {
      const Vector3d size(rng_.uniform(0.1, 0.3), rng_.uniform(0.1, 0.25), rng_.uniform(0.08, 0.35));
      const int front = picture(224, 224, i % 2 ? paint::cardboard : paint::book_cover);
      scene_.add_box(at.head<2>() + Vector2d(jitter(0.9), 0.3 + jitter(0.5)), 0.0005, size, jitter(1.2), front, front,
                     front);
    }
  }

  const std::uint64_t seed_;
  const int day_;
  std::uint64_t things_ = 0;  // asked for by rearrange()
  cv::RNG rng_;
  SyntheticScene scene_;
  cv::Mat1f shadows_;
};

}  // namespace

SyntheticScene build_desk_scene(std::uint64_t seed, int day) { return DeskBuilder(seed, day).build(); }

}  // namespace parallax
