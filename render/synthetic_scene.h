// What a synthetic scene is made of: textured rectangles, discs and upright or lying cylinders, lit by one distant
// lamp.
//
// Frames and units: world, z up, metres. A scene never changes once built; it is shared between sources and safe to
// read from any thread.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "render/synthetic_texture.h"

namespace parallax {

enum class SurfaceShape { rectangle, disc, cylinder };

// Rectangle: `origin` is the top-left corner as its picture is looked at, `u` runs along its top edge and `v` down its
// left edge (whole lengths); it is seen from the side u x v points away from. Disc: the ellipse inscribed in that
// rectangle. Cylinder (mantle only): `origin` is the middle of the top rim, `v` runs down the axis, `u` from the axis
// to the mantle where the picture begins; the picture wraps around once, seen from outside and, flipped, from inside.
struct Surface {
  SurfaceShape shape = SurfaceShape::rectangle;
  Eigen::Vector3d origin = Eigen::Vector3d::Zero(), u = Eigen::Vector3d::UnitX(), v = Eigen::Vector3d::UnitY();
  int texture = 0;
  bool two_sided = false;
  double brightness = 0;  // of a rectangle or disc, above 0: this instead of shading()
};

struct SurfaceHit {
  int surface = -1;
  double distance = 0;               // in lengths of the ray's direction vector
  Eigen::Vector2d texture_st{0, 0};  // 0..1 over the picture
};

class SyntheticScene {
 public:
  // Adds a picture and returns its number. The size must be what texture_size() gives.
  int add_texture(const cv::Mat3b& picture);

  int add(const Surface& surface);
  int add_rectangle(const Eigen::Vector3d& origin, const Eigen::Vector3d& u, const Eigen::Vector3d& v, int texture,
                    bool two_sided = false);
  // A box standing on z = `bottom` with its footprint centred on (x, y) and turned by `yaw` about z. Pictures: top, the
  // two long sides (front, seen from -y at yaw 0, and back) and the two short ones.
  void add_box(const Eigen::Vector2d& centre, double bottom, const Eigen::Vector3d& size, double yaw, int top_texture,
               int front_texture, int side_texture);
  // An upright can: mantle and lid. With `open`, there is no lid but a disc (the drink) a third of the way down.
  void add_can(const Eigen::Vector2d& centre, double bottom, double radius, double height, double yaw,
               int mantle_texture, int lid_texture, bool open = false);

  const std::vector<Surface>& surfaces() const { return surfaces_; }
  const Texture& texture(int i) const { return *textures_.at(static_cast<std::size_t>(i)); }
  int texture_count() const { return static_cast<int>(textures_.size()); }

  // The first surface a ray meets, in double precision and without any acceleration: the reference for the ray caster.
  std::optional<SurfaceHit> cast(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) const;
  // One surface alone.
  static std::optional<SurfaceHit> intersect(const Surface& surface, const Eigen::Vector3d& from,
                                             const Eigen::Vector3d& direction);

  // Where (s, t) of a surface's picture lies in the world.
  static Eigen::Vector3d point_on(const Surface& surface, double s, double t);

  // Lambert's law: brightness of a surface with this unit normal under the lamp and the sky.
  static double shading(const Eigen::Vector3d& normal);

 private:
  std::vector<Surface> surfaces_;
  std::vector<std::shared_ptr<const Texture>> textures_;
};

// Scenes by name: "desk", "walls", "repeat", "blank", "room", "board", "circle board", "building". The same name and
// seed give the same scene, and one that is still in use somewhere is shared instead of being painted again. `day`: on
// each day after day 0 a third of the things on the desk stand elsewhere than the day before (desk and building only).
// Callable from any thread. CHECK on any other name.
std::shared_ptr<const SyntheticScene> synthetic_scene(const std::string& name, std::uint64_t seed, int day = 0);

}  // namespace parallax
