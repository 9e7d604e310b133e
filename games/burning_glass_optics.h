// Sunlight through a convex lens onto the plane z = 0: rays traced one by one, each carrying the same power, and the
// light they leave on the sheet (PTAM section 7.5: "a virtual convex lens is placed at the camera centre and simple
// ray-tracing used to render the caustics").
//
// Two lenses:
// - corrected: the ideal thin lens. A ray with slopes m = (dx/dz, dy/dz) that goes through the lens at h leaves it with
//   slopes m - h / f (Gaussian optics; Born and Wolf, Principles of Optics, section 4.4). Every parallel bundle meets
//   in one point of the focal plane, on the ray through the lens's centre.
// - simple glass: a bi-convex lens with two equal spherical faces of crown glass. Both faces are met and Snell's law
//   is applied there in vector form: for a ray d, a normal n against it, r = n1 / n2, c = -n.d:
//   d' = r d + (r c - sqrt(1 - r^2 (1 - c^2))) n. The faces' radius follows from the lens-maker's equation for a
//   thick lens, 1/f = (n - 1) (2/R - (n - 1) t / (n R^2)). Its spherical aberration, coma and field curvature are
//   those of the real thing: cusps, and a spot that is best a little before the focus.
//
// Both let through what two uncoated faces do at normal incidence, (1 - ((n - 1) / (n + 1))^2)^2. The sun is a disc of
// 9.3 mrad, equally bright all over.
//
// Plane frame, metres. Power is in square metres of sunlight that falls straight: power / area is a concentration, 1
// where the bare sun stands overhead. One thread at a time; nothing fails.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "games/burning_glass_grid.h"

namespace parallax::burning {

inline constexpr double kSunDiameter_rad = 0.0093;  // mean apparent diameter, 32 arc minutes
inline constexpr double kGlassIndex = 1.5168;       // borosilicate crown at 587.6 nm
double lens_transmission();

enum class LensShape { corrected, simple_glass };

struct Lens {
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d axis = -Eigen::Vector3d::UnitZ();  // unit; which of its two directions does not matter
  double focal_length_m = 0.3, diameter_m = 0.1;
  LensShape shape = LensShape::corrected;
};

// Unit vector towards the sun; azimuth from x towards y, elevation from the plane up.
Eigen::Vector3d sun_direction(double azimuth_rad, double elevation_rad);

class RayBundle;
struct LightOnSheet;

enum class RayEnd { plane, sky, reflected };  // sky: never meets the plane

// One lens under one sun.
class LightPath {
 public:
  LightPath(const Lens& lens, const Eigen::Vector3d& towards_sun);

  // A ray by where it goes through the lens and where on the sun it comes from, both on the unit disc.
  RayEnd follow(const Eigen::Vector2d& on_lens, const Eigen::Vector2d& on_sun, Eigen::Vector2d* position_m) const;

  // Of all rays together: the lens's area as the sun sees it, times the transmission.
  double power_m2() const { return power_m2_; }
  // Where the light is narrowest for rays near the middle: on the undeviated ray, at the focal length along the axis.
  Eigen::Vector3d focus_m() const { return focus_m_; }
  double facing() const { return facing_; }  // cosine between the sun and the axis, >= 0

  // Of the simple glass.
  double face_radius_m() const { return face_radius_m_; }
  double thickness_m() const { return thickness_m_; }

 private:
  friend void trace_light(const LightPath& path, const RayBundle& bundle, std::uint64_t turn, const SheetGrid& grid,
                          LightOnSheet* out);
  template <class T, int N>
  void follow(const Eigen::Array<T, N, 2>& on_lens, const Eigen::Array<T, N, 2>& on_sun,
              Eigen::Array<T, N, 2>* position_m, RayEnd* ends) const;

  Lens lens_;
  Eigen::Matrix3d plane_from_lens_;  // rotation; z along the light
  Eigen::Vector3d light_, sun_right_, sun_up_;
  Eigen::Vector3d focus_m_;
  double power_m2_ = 0, facing_ = 0, face_radius_m_ = 0, thickness_m_ = 0;
};

// Places on the lens and on the sun for many rays, a row each: evenly spread over both discs, the pairs shuffled by the
// seed.
class RayBundle {
 public:
  using Places = Eigen::Array<float, Eigen::Dynamic, 2>;
  static constexpr int kLanes = 16;  // rays that are traced together; rows are filled up to a multiple, with zeros

  RayBundle(int count, std::uint64_t seed);
  int size() const { return size_; }
  const Places& on_lens() const { return on_lens_; }
  const Places& on_sun() const { return on_sun_; }

 private:
  int size_;
  Places on_lens_, on_sun_;
};

// The light on the sheet, as concentration.
struct LightOnSheet {
  std::vector<float> concentration = std::vector<float>(kSheetSize, 0.0f);
  SheetBox box;  // outside of it there is none
  float peak = 0;
  // Where the power went, m2; they add up to all of it.
  double on_sheet_m2 = 0, beside_m2 = 0, sky_m2 = 0, reflected_m2 = 0;

  void clear();
};

// Replaces what is in `out`. Every turn of the bundle is another sample of the same light, the next one another one.
// A ray's power is shared by the four cells nearest to it.
void trace_light(const LightPath& path, const RayBundle& bundle, std::uint64_t turn, const SheetGrid& grid,
                 LightOnSheet* out);

}  // namespace parallax::burning
