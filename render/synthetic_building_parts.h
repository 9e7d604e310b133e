// What the scene of the synthetic building is put together from: its stock of pictures, and furniture that stands
// against or hangs on a wall. World: z up, metres. Used by one thread while a scene is built.
#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "render/synthetic_building_paint.h"
#include "render/synthetic_scene.h"

namespace parallax {

// A wall as it is looked at: its lower left corner, and the direction to the right.
struct WallLine {
  Eigen::Vector3d from;
  Eigen::Vector3d along;
  Eigen::Vector3d inwards() const { return along.cross(Eigen::Vector3d::UnitZ()); }
};

class BuildingParts {
 public:
  static constexpr double kBay = 2.2;  // length of the walls' and floors' pictures

  BuildingParts(std::uint64_t seed, int day);

  // `glow` > 0: brightness of its own. The light of the place that is being built falls on all others.
  void rectangle(const Eigen::Vector3d& origin, const Eigen::Vector3d& u, const Eigen::Vector3d& v, int texture,
                 double glow = 0);
  void set_light(double light) { light_ = light; }
  // A box on the floor or higher with its back to the wall; `at` is where its left edge is along the wall.
  void box(const WallLine& wall, double at, double bottom, const Eigen::Vector3d& size, int top, int front, int side);
  // A picture flat on the wall.
  void hang(const WallLine& wall, double at, double top, double width, double height, int texture, double glow = 0);

  // A bay's length of wall, floor and ceiling; pictures are drawn from the stock by `which`.
  void wall_bay(const WallLine& wall, double at, paint::WallKind kind, int which);
  void floor(double x0, double y0, double x1, double y1, double z, paint::FloorKind kind, int which);
  void ceiling(double x0, double y0, double x1, double y1, double z, int which);
  // A part of a wall with a picture painted for it.
  void wall_part(const WallLine& wall, double at, double bottom, double width, double height, paint::WallKind kind);

  // Furniture of one bay. `slot` tells bays apart.
  void furnish(const WallLine& wall, double at, int slot, bool outside, bool sparse);
  void door(const WallLine& wall, double at, int slot);
  void window(const WallLine& wall, double at, int slot);
  void notices(const WallLine& wall, double at, int slot);
  void clutter(const WallLine& wall, double at, int slot);

  int door_picture() const { return doors_.front(); }
  int wall_picture(paint::WallKind kind, int which) const {
    return pick(walls_[static_cast<std::size_t>(kind)], which);
  }
  int window_picture(int which) const { return pick(windows_, which); }
  int poster(int which) const { return pick(posters_, which); }
  int tread() const { return tread_; }
  int riser() const { return riser_; }
  int lamp() const { return lamp_; }
  int carton(int which) const { return pick(cartons_, which); }
  int shelf(int which) const { return pick(shelves_, which); }
  int wood() const { return wood_; }
  int radiator() const { return radiator_; }

  // Of a thing that can be moved: another one on each day that it has been.
  cv::RNG movable(int slot) const;
  cv::RNG fixed(int slot) const { return generator(1000 + static_cast<std::uint64_t>(slot)); }
  // Whether the lamps of a place are lit today; the light from outside, a factor.
  bool lit(int place) const;
  double daylight() const { return daylight_; }

  SyntheticScene& scene() { return scene_; }

 private:
  using Stock = std::vector<int>;
  static int pick(const Stock& stock, int which) { return stock[static_cast<std::size_t>(which) % stock.size()]; }
  cv::RNG generator(std::uint64_t salt) const;
  void paint_stock();

  SyntheticScene scene_;
  std::uint64_t seed_;
  int day_;
  double light_ = 1, daylight_ = 1;
  std::array<Stock, paint::kWallKinds> walls_;
  std::array<Stock, paint::kFloorKinds> floors_;
  Stock ceilings_, doors_, posters_, boards_, windows_, shelves_, cartons_;
  int radiator_ = 0, wood_ = 0, metal_ = 0, lamp_ = 0, tread_ = 0, riser_ = 0, red_ = 0;
};

}  // namespace parallax
