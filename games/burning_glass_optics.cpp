#include "games/burning_glass_optics.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "games/burning_glass_noise.h"

namespace parallax::burning {
namespace {

constexpr double kGoldenAngle = 2.399963229728653;  // of a sunflower's seeds
constexpr double kEdgeThickness = 0.02;             // of a simple glass, in diameters: it must be held somewhere
constexpr int kTurns = 4096;                        // of a bundle, before they come again

// Snell's law for unit vectors, which gives one; false when all is reflected. `normal` points against the ray.
bool refract(const Eigen::Vector3d& normal, double index_ratio, Eigen::Vector3d* direction) {
  const double along = -normal.dot(*direction);
  const double under_root = 1 - index_ratio * index_ratio * (1 - along * along);
  if (!(under_root >= 0)) return false;
  *direction = index_ratio * *direction + (index_ratio * along - std::sqrt(under_root)) * normal;
  return true;
}

// Moves along a ray to a sphere about (0, 0, centre_z): to its first meeting or its second.
bool advance_to_sphere(double centre_z, double radius, bool first, const Eigen::Vector3d& direction,
                       Eigen::Vector3d* position) {
  const Eigen::Vector3d from_centre = *position - Eigen::Vector3d(0, 0, centre_z);
  const double b = from_centre.dot(direction);
  const double under_root = b * b - from_centre.squaredNorm() + radius * radius;
  if (!(under_root >= 0)) return false;
  *position += (first ? -b - std::sqrt(under_root) : -b + std::sqrt(under_root)) * direction;
  return true;
}

Eigen::Vector2d turned(const Eigen::Vector2d& v, double c, double s) {
  return {c * v.x() - s * v.y(), s * v.x() + c * v.y()};
}

}  // namespace

double lens_transmission() {
  const double face = (kGlassIndex - 1) / (kGlassIndex + 1);
  const double through = 1 - face * face;
  return through * through;
}

Eigen::Vector3d sun_direction(double azimuth_rad, double elevation_rad) {
  return {std::cos(elevation_rad) * std::cos(azimuth_rad), std::cos(elevation_rad) * std::sin(azimuth_rad),
          std::sin(elevation_rad)};
}

LightPath::LightPath(const Lens& lens, const Eigen::Vector3d& towards_sun) : lens_(lens), light_(-towards_sun) {
  const double along = light_.dot(lens.axis);
  const Eigen::Vector3d z = along < 0 ? Eigen::Vector3d(-lens.axis) : lens.axis;
  facing_ = std::abs(along);
  plane_from_lens_.col(2) = z;
  plane_from_lens_.col(0) = z.unitOrthogonal();
  plane_from_lens_.col(1) = z.cross(plane_from_lens_.col(0));
  const double spread = std::tan(kSunDiameter_rad / 2);
  sun_right_ = spread * light_.unitOrthogonal();
  sun_up_ = light_.cross(sun_right_);
  const double radius = lens.diameter_m / 2;
  power_m2_ = std::numbers::pi * radius * radius * facing_ * lens_transmission();
  double to_focus = lens.focal_length_m;
  if (lens.shape == LensShape::simple_glass) {
    const double n = kGlassIndex, f = lens.focal_length_m;
    face_radius_m_ = 2 * (n - 1) * f;
    for (int i = 0; i < 30; ++i) {
      const double half = std::min(radius, 0.999 * face_radius_m_);
      const double sag = face_radius_m_ - std::sqrt(face_radius_m_ * face_radius_m_ - half * half);
      thickness_m_ = 2 * sag + kEdgeThickness * lens.diameter_m;
      face_radius_m_ = f * (n - 1) * (1 + std::sqrt(std::max(0.0, 1 - thickness_m_ / (n * f))));
    }
    to_focus = thickness_m_ / 2 + f * (1 - (n - 1) * thickness_m_ / (n * face_radius_m_));
  }
  focus_m_ = lens.centre_m + light_ * (to_focus / std::max(facing_, 1e-9));
}

bool LightPath::through_glass(Eigen::Vector3d* position, Eigen::Vector3d* direction) const {
  const double centre = face_radius_m_ - thickness_m_ / 2;  // of the first face's sphere, behind the lens
  if (!advance_to_sphere(centre, face_radius_m_, true, *direction, position)) return false;
  Eigen::Vector3d normal = (*position - Eigen::Vector3d(0, 0, centre)) / face_radius_m_;
  if (!refract(normal, 1 / kGlassIndex, direction)) return false;
  if (!advance_to_sphere(-centre, face_radius_m_, false, *direction, position)) return false;
  normal = (Eigen::Vector3d(0, 0, -centre) - *position) / face_radius_m_;
  return refract(normal, kGlassIndex, direction);
}

RayEnd LightPath::follow(const Eigen::Vector2d& on_lens, const Eigen::Vector2d& on_sun,
                         Eigen::Vector2d* position_m) const {
  const Eigen::Vector3d incoming = light_ + on_sun.x() * sun_right_ + on_sun.y() * sun_up_;
  Eigen::Vector3d direction = plane_from_lens_.transpose() * incoming;
  const double radius = lens_.diameter_m / 2;
  Eigen::Vector3d position(on_lens.x() * radius, on_lens.y() * radius, 0);
  if (!(direction.z() > 1e-9)) return RayEnd::reflected;  // along the lens
  if (lens_.shape == LensShape::corrected) {
    direction /= direction.z();
    direction.head<2>() -= position.head<2>() / lens_.focal_length_m;
  } else {
    direction.normalize();
    if (!through_glass(&position, &direction)) return RayEnd::reflected;
  }
  const Eigen::Vector3d from = lens_.centre_m + plane_from_lens_ * position;
  const Eigen::Vector3d towards = plane_from_lens_ * direction;
  if (!(towards.z() < -1e-9 && from.z() > 0)) return RayEnd::sky;
  *position_m = (from - towards * (from.z() / towards.z())).head<2>();
  return RayEnd::plane;
}

RayBundle::RayBundle(int count, std::uint64_t seed) {
  Generator generator(seed);
  for (int i = 0; i < count; ++i) {
    const double radius = std::sqrt((i + 0.5) / count), angle = i * kGoldenAngle;
    on_lens_.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
  }
  on_sun_ = on_lens_;
  for (std::size_t i = on_sun_.size(); i > 1; --i) std::swap(on_sun_[i - 1], on_sun_[generator.next() % i]);
}

void LightOnSheet::clear() {
  for (int row = box.bottom; row < box.top; ++row) {
    for (int column = box.left; column < box.right; ++column) concentration[SheetGrid::index(column, row)] = 0;
  }
  box = SheetBox();
  peak = 0;
  on_sheet_m2 = beside_m2 = sky_m2 = reflected_m2 = 0;
}

void trace_light(const LightPath& path, const RayBundle& bundle, std::uint64_t turn, const SheetGrid& grid,
                 LightOnSheet* out) {
  out->clear();
  if (bundle.size() == 0) return;
  const double power = path.power_m2() / bundle.size();
  const float share = static_cast<float>(power / (grid.cell_m() * grid.cell_m()));
  // The two discs turn by different angles, so that no turn brings the same pairs.
  const double lens_angle = kGoldenAngle * static_cast<double>(turn % kTurns);
  const double sun_angle = -std::numbers::sqrt2 * static_cast<double>(turn % kTurns);
  const double lens_c = std::cos(lens_angle), lens_s = std::sin(lens_angle);
  const double sun_c = std::cos(sun_angle), sun_s = std::sin(sun_angle);
  std::int64_t sky = 0, reflected = 0;
  double on_sheet = 0, beside = 0;  // in rays
  for (std::size_t i = 0; i < bundle.on_lens().size(); ++i) {
    Eigen::Vector2d at;
    const RayEnd end =
        path.follow(turned(bundle.on_lens()[i], lens_c, lens_s), turned(bundle.on_sun()[i], sun_c, sun_s), &at);
    if (end != RayEnd::plane) {
      (end == RayEnd::sky ? sky : reflected) += 1;
      continue;
    }
    const Eigen::Vector2d cell = grid.cell_at(at);
    if (!(cell.x() > -1 && cell.y() > -1 && cell.x() < kSheetCells && cell.y() < kSheetCells)) {
      beside += 1;
      continue;
    }
    const int column = static_cast<int>(std::floor(cell.x())), row = static_cast<int>(std::floor(cell.y()));
    const float u = static_cast<float>(cell.x() - column), v = static_cast<float>(cell.y() - row);
    const float weights[4] = {(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v};
    for (int corner = 0; corner < 4; ++corner) {
      const int x = column + (corner & 1), y = row + (corner >> 1);
      if (x < 0 || y < 0 || x >= kSheetCells || y >= kSheetCells) {
        beside += weights[corner];
        continue;
      }
      on_sheet += weights[corner];
      float& there = out->concentration[SheetGrid::index(x, y)];
      there += weights[corner] * share;
      out->peak = std::max(out->peak, there);
      out->box.include(x, y);
    }
  }
  out->on_sheet_m2 = power * on_sheet;
  out->beside_m2 = power * beside;
  out->sky_m2 = power * static_cast<double>(sky);
  out->reflected_m2 = power * static_cast<double>(reflected);
}

}  // namespace parallax::burning
