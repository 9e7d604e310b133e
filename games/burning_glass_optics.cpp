#include "games/burning_glass_optics.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "games/burning_glass_noise.h"

namespace parallax::burning {
namespace {

constexpr double kGoldenAngle = 2.399963229728653;  // of a sunflower's seeds
constexpr double kEdgeThickness = 0.02;             // of a simple glass, in diameters: it must be held somewhere
constexpr int kTurns = 4096;                        // of a bundle, before they come again

// N rays side by side: one of doubles, or many of floats.
template <class T, int N>
struct Rays {
  using Lanes = Eigen::Array<T, N, 1>;
  Lanes px, py, pz, dx, dy, dz;
  Eigen::Array<bool, N, 1> passed = Eigen::Array<bool, N, 1>::Constant(true);  // what did not has values of no meaning

  // Rotates and moves places, and rotates directions.
  void transform(const Eigen::Matrix3d& R, const Eigen::Vector3d& t) {
    rotate(R, &px, &py, &pz);
    rotate(R, &dx, &dy, &dz);
    px += static_cast<T>(t.x());
    py += static_cast<T>(t.y());
    pz += static_cast<T>(t.z());
  }
  static void rotate(const Eigen::Matrix3d& rotation, Lanes* x, Lanes* y, Lanes* z) {
    const Eigen::Matrix<T, 3, 3> R = rotation.cast<T>();
    const Lanes a = *x, b = *y, c = *z;
    *x = R(0, 0) * a + R(0, 1) * b + R(0, 2) * c;
    *y = R(1, 0) * a + R(1, 1) * b + R(1, 2) * c;
    *z = R(2, 0) * a + R(2, 1) * b + R(2, 2) * c;
  }
};

// Moves along the rays to a sphere about (0, 0, centre_z), to the first meeting or the second, and there from one
// index of refraction to another by Snell's law for unit vectors, which leaves them unit vectors.
template <class T, int N>
void through_face(T centre_z, T radius, bool first, T index_ratio, Rays<T, N>* rays) {
  using Lanes = typename Rays<T, N>::Lanes;
  Rays<T, N>& r = *rays;
  const T side = first ? 1 : -1;
  const Lanes z = r.pz - centre_z;
  const Lanes b = r.px * r.dx + r.py * r.dy + z * r.dz;
  const Lanes to_sphere = b.square() - (r.px.square() + r.py.square() + z.square()) + radius * radius;
  const Lanes way = -b - side * to_sphere.max(T(0)).sqrt();
  r.px += way * r.dx;
  r.py += way * r.dy;
  r.pz += way * r.dz;
  // The normal against the ray.
  const T scale = side / radius;
  const Lanes nx = r.px * scale, ny = r.py * scale, nz = (r.pz - centre_z) * scale;
  const Lanes along = -(nx * r.dx + ny * r.dy + nz * r.dz);
  const Lanes under_root = T(1) - index_ratio * index_ratio * (T(1) - along.square());
  const Lanes normal_part = index_ratio * along - under_root.max(T(0)).sqrt();
  r.dx = index_ratio * r.dx + normal_part * nx;
  r.dy = index_ratio * r.dy + normal_part * ny;
  r.dz = index_ratio * r.dz + normal_part * nz;
  r.passed = r.passed && to_sphere >= T(0) && under_root >= T(0);
}

struct Turn {
  explicit Turn(double angle) : c(static_cast<float>(std::cos(angle))), s(static_cast<float>(std::sin(angle))) {}
  template <class Places>
  Places operator()(const Places& places) const {
    Places out;
    out.col(0) = c * places.col(0) - s * places.col(1);
    out.col(1) = s * places.col(0) + c * places.col(1);
    return out;
  }
  float c, s;
};

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

// The rays that go through these places on the lens and come from these on the sun, both on the unit disc: where they
// are on the plane, for those that get there.
template <class T, int N>
void LightPath::follow(const Eigen::Array<T, N, 2>& on_lens, const Eigen::Array<T, N, 2>& on_sun,
                       Eigen::Array<T, N, 2>* position_m, RayEnd* ends) const {
  Rays<T, N> rays;
  const T radius = static_cast<T>(lens_.diameter_m / 2);
  rays.px = on_lens.col(0) * radius;
  rays.py = on_lens.col(1) * radius;
  rays.pz.setZero();
  const Eigen::Matrix<T, 3, 1> light = (plane_from_lens_.transpose() * light_).template cast<T>(),
                               right = (plane_from_lens_.transpose() * sun_right_).template cast<T>(),
                               up = (plane_from_lens_.transpose() * sun_up_).template cast<T>();
  rays.dx = light.x() + right.x() * on_sun.col(0) + up.x() * on_sun.col(1);
  rays.dy = light.y() + right.y() * on_sun.col(0) + up.y() * on_sun.col(1);
  rays.dz = light.z() + right.z() * on_sun.col(0) + up.z() * on_sun.col(1);
  rays.passed = rays.dz > T(1e-9);  // not along the lens
  if (lens_.shape == LensShape::corrected) {
    const T power = static_cast<T>(1 / lens_.focal_length_m);
    const typename Rays<T, N>::Lanes depth = rays.dz.max(T(1e-9));
    rays.dx = rays.dx / depth - rays.px * power;
    rays.dy = rays.dy / depth - rays.py * power;
    rays.dz.setOnes();
  } else {
    const typename Rays<T, N>::Lanes norm = (rays.dx.square() + rays.dy.square() + rays.dz.square()).sqrt();
    rays.dx /= norm;
    rays.dy /= norm;
    rays.dz /= norm;
    const T centre = static_cast<T>(face_radius_m_ - thickness_m_ / 2);  // of the first face's sphere, behind the lens
    const T face = static_cast<T>(face_radius_m_), index = static_cast<T>(kGlassIndex);
    through_face(centre, face, true, 1 / index, &rays);
    through_face(-centre, face, false, index, &rays);
  }
  rays.transform(plane_from_lens_, lens_.centre_m);
  const Eigen::Array<bool, N, 1> lands = rays.dz < T(-1e-9) && rays.pz > T(0);
  const typename Rays<T, N>::Lanes way = -rays.pz / rays.dz.min(T(-1e-9));
  position_m->col(0) = rays.px + way * rays.dx;
  position_m->col(1) = rays.py + way * rays.dy;
  for (int i = 0; i < N; ++i) ends[i] = !rays.passed[i] ? RayEnd::reflected : lands[i] ? RayEnd::plane : RayEnd::sky;
}

RayEnd LightPath::follow(const Eigen::Vector2d& on_lens, const Eigen::Vector2d& on_sun,
                         Eigen::Vector2d* position_m) const {
  Eigen::Array<double, 1, 2> position;
  RayEnd end;
  follow<double, 1>(on_lens.transpose().array(), on_sun.transpose().array(), &position, &end);
  if (end == RayEnd::plane) *position_m = position.matrix().transpose();
  return end;
}

RayBundle::RayBundle(int count, std::uint64_t seed) : size_(count) {
  Generator generator(seed);
  const int rows = (count + kLanes - 1) / kLanes * kLanes;
  on_lens_.setZero(rows, 2);
  for (int i = 0; i < count; ++i) {
    const double radius = std::sqrt((i + 0.5) / count), angle = i * kGoldenAngle;
    on_lens_.row(i) << static_cast<float>(radius * std::cos(angle)), static_cast<float>(radius * std::sin(angle));
  }
  on_sun_ = on_lens_;
  for (int i = count; i > 1; --i)
    on_sun_.row(i - 1).swap(on_sun_.row(static_cast<int>(generator.next() % static_cast<std::uint64_t>(i))));
}

void LightOnSheet::clear() {
  for (int row = box.bottom; row < box.top; ++row) {
    for (int column = box.left; column < box.right; ++column) concentration[SheetGrid::index(column, row)] = 0;
  }
  box = SheetBox();
  peak = 0;
  on_sheet_m2 = beside_m2 = sky_m2 = reflected_m2 = 0;
}

namespace {

// Lays rays on the sheet.
class LightSum {
 public:
  LightSum(const SheetGrid& grid, float share, LightOnSheet* out) : grid_(grid), share_(share), out_(out) {}

  void add(const Eigen::Vector2d& position_m) {
    const Eigen::Vector2d cell = grid_.cell_at(position_m);
    if (!(cell.x() > -1 && cell.y() > -1 && cell.x() < kSheetCells && cell.y() < kSheetCells)) {
      beside += 1;
      return;
    }
    const int column = static_cast<int>(cell.x() + 1) - 1, row = static_cast<int>(cell.y() + 1) - 1;
    const float u = static_cast<float>(cell.x() - column), v = static_cast<float>(cell.y() - row);
    const float weights[4] = {(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v};
    if (column >= 0 && row >= 0 && column + 1 < kSheetCells && row + 1 < kSheetCells) {
      for (int corner = 0; corner < 4; ++corner) put(column + (corner & 1), row + (corner >> 1), weights[corner]);
      out_->box.include(SheetBox{column, row, column + 2, row + 2});
      on_sheet += 1;
      return;
    }
    for (int corner = 0; corner < 4; ++corner) {
      const int x = column + (corner & 1), y = row + (corner >> 1);
      if (x < 0 || y < 0 || x >= kSheetCells || y >= kSheetCells) {
        beside += weights[corner];
        continue;
      }
      put(x, y, weights[corner]);
      out_->box.include(x, y);
      on_sheet += weights[corner];
    }
  }

  double on_sheet = 0, beside = 0;  // in rays

 private:
  void put(int x, int y, float weight) {
    float& there = out_->concentration[SheetGrid::index(x, y)];
    there += weight * share_;
    out_->peak = std::max(out_->peak, there);
  }

  const SheetGrid& grid_;
  float share_;
  LightOnSheet* out_;
};

}  // namespace

void trace_light(const LightPath& path, const RayBundle& bundle, std::uint64_t turn, const SheetGrid& grid,
                 LightOnSheet* out) {
  out->clear();
  if (bundle.size() == 0) return;
  const double power = path.power_m2() / bundle.size();
  // The two discs turn by different angles, so that no turn brings the same pairs.
  const Turn turn_lens(kGoldenAngle * static_cast<double>(turn % kTurns)),
      turn_sun(-std::numbers::sqrt2 * static_cast<double>(turn % kTurns));
  std::int64_t sky = 0, reflected = 0;
  LightSum sum(grid, static_cast<float>(power / (grid.cell_m() * grid.cell_m())), out);
  using Places = Eigen::Array<float, RayBundle::kLanes, 2>;
  for (int begin = 0; begin < bundle.size(); begin += RayBundle::kLanes) {
    Places at;
    RayEnd ends[RayBundle::kLanes];
    const Places on_lens = turn_lens(Places(bundle.on_lens().middleRows<RayBundle::kLanes>(begin)));
    const Places on_sun = turn_sun(Places(bundle.on_sun().middleRows<RayBundle::kLanes>(begin)));
    path.follow<float, RayBundle::kLanes>(on_lens, on_sun, &at, ends);
    for (int i = 0; i < std::min(RayBundle::kLanes, bundle.size() - begin); ++i) {
      if (ends[i] == RayEnd::plane)
        sum.add({at(i, 0), at(i, 1)});
      else
        ++(ends[i] == RayEnd::sky ? sky : reflected);
    }
  }
  out->on_sheet_m2 = power * sum.on_sheet;
  out->beside_m2 = power * sum.beside;
  out->sky_m2 = power * static_cast<double>(sky);
  out->reflected_m2 = power * static_cast<double>(reflected);
}

}  // namespace parallax::burning
