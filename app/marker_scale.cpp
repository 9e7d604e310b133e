#include "app/marker_scale.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "map/hit_test.h"

namespace parallax {
namespace {

using Vector7d = Eigen::Matrix<double, 7, 1>;
using Matrix7d = Eigen::Matrix<double, 7, 7>;

constexpr int kMaxIterations = 50;
constexpr double kConverged = 1e-10;    // of a step, relative to the marker's size and in radians
constexpr double kMinSideShare = 1e-9;  // of the distance to the camera: smaller is nothing
constexpr int kMaxKeyframes = 40;       // that are searched: each takes some milliseconds
// Four points on a plane whose sides and diagonals are further from a square's than this are no square.
constexpr double kNotSquare = 0.15;
constexpr double kShortest_m = 1e-6;
// Across a marker, its border included; of one of them the half width of the window in which a corner is refined.
constexpr int kModules = 6, kLargestWindow_px = 7;
constexpr double kWindowShare = 0.55;

// Corners of a marker of side 1: x right, y down as printed, z into the paper.
const std::array<Eigen::Vector3d, 4>& unit_corners() {
  static const std::array<Eigen::Vector3d, 4> corners{Eigen::Vector3d(-0.5, -0.5, 0), Eigen::Vector3d(0.5, -0.5, 0),
                                                      Eigen::Vector3d(0.5, 0.5, 0), Eigen::Vector3d(-0.5, 0.5, 0)};
  return corners;
}

MarkerScale refusal(std::string reason) {
  MarkerScale out;
  out.reason = std::move(reason);
  return out;
}

struct Square {
  RigidTransform world_from_marker;
  double side = 1;  // in map metres
  Eigen::Vector3d corner(int i) const {
    return world_from_marker * (side * unit_corners()[static_cast<std::size_t>(i)]);
  }
};

// The point nearest to all rays in the least-squares sense; nothing when they are parallel.
std::optional<Eigen::Vector3d> meeting_point(const std::vector<Ray>& rays) {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const Ray& r : rays) {
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - r.direction * r.direction.transpose();
    A += across;
    b += across * r.origin;
  }
  const Eigen::LDLT<Eigen::Matrix3d> solver(A);
  if (solver.info() != Eigen::Success || !solver.isPositive() || solver.rcond() < 1e-12) return std::nullopt;
  return solver.solve(b);
}

std::optional<Square> square_through(const std::array<Eigen::Vector3d, 4>& p) {
  const Eigen::Vector3d x = p[1] - p[0] + p[2] - p[3], y = p[3] - p[0] + p[2] - p[1], z = x.cross(y);
  Square out;
  out.side = ((p[1] - p[0]).norm() + (p[2] - p[1]).norm() + (p[3] - p[2]).norm() + (p[0] - p[3]).norm()) / 4;
  if (!(out.side > 0) || !(z.norm() > 0)) return std::nullopt;
  out.world_from_marker.R.col(0) = x.normalized();
  out.world_from_marker.R.col(2) = z.normalized();
  out.world_from_marker.R.col(1) = z.normalized().cross(x.normalized());
  out.world_from_marker.t = (p[0] + p[1] + p[2] + p[3]) / 4;
  return out;
}

std::optional<Square> first_guess(const CameraModel& camera, std::span<const MarkerSighting> sightings) {
  std::array<Eigen::Vector3d, 4> corners;
  for (std::size_t i = 0; i < 4; ++i) {
    std::vector<Ray> rays;
    for (const MarkerSighting& s : sightings)
      if (const auto ray = pixel_ray(camera, s.camera_from_world, s.marker.corners_px[i])) rays.push_back(*ray);
    const auto at = meeting_point(rays);
    if (!at) return std::nullopt;
    corners[i] = *at;
  }
  return square_through(corners);
}

// Cost is the sum of the squared pixel errors; false when a corner cannot be seen.
struct Normal {
  Matrix7d H = Matrix7d::Zero();
  Vector7d g = Vector7d::Zero();
  double cost = 0;
};
bool linearise(const CameraModel& camera, std::span<const MarkerSighting> sightings, const Square& square,
               Normal* out) {
  *out = Normal();
  for (const MarkerSighting& s : sightings) {
    for (int i = 0; i < 4; ++i) {
      const Eigen::Vector3d world = square.corner(i);
      Eigen::Vector2d px;
      Eigen::Matrix<double, 2, 3> d_px;
      if (!camera.project(s.camera_from_world * world, &px, &d_px)) return false;
      // About the marker's centre, so that translation and rotation do not mix: t + dt, exp(w) R, s exp(e).
      const Eigen::Vector3d arm = world - square.world_from_marker.t;
      Eigen::Matrix<double, 3, 7> d_world;
      d_world << Eigen::Matrix3d::Identity(), -hat(arm), arm;
      const Eigen::Matrix<double, 2, 7> J = d_px * s.camera_from_world.R * d_world;
      const Eigen::Vector2d error = s.marker.corners_px[static_cast<std::size_t>(i)] - px;
      out->H += J.transpose() * J;
      out->g += J.transpose() * error;
      out->cost += error.squaredNorm();
    }
  }
  return true;
}

// Levenberg-Marquardt; false when it does not come to rest.
bool fit(const CameraModel& camera, std::span<const MarkerSighting> sightings, Square* square, Normal* normal) {
  if (!linearise(camera, sightings, *square, normal)) return false;
  double damping = 1e-6;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    Matrix7d H = normal->H;
    H.diagonal() *= 1 + damping;
    const Vector7d step = H.ldlt().solve(normal->g);
    if (!step.allFinite()) return false;
    Square next = *square;
    next.world_from_marker.t += step.head<3>();
    next.world_from_marker.R = exp_so3(step.segment<3>(3)) * next.world_from_marker.R;
    next.side *= std::exp(std::clamp(step[6], -1.0, 1.0));
    Normal there;
    if (linearise(camera, sightings, next, &there) && there.cost <= normal->cost) {
      const double moved = std::max(step.head<3>().norm() / square->side, step.tail<4>().norm());
      *square = next;
      *normal = there;
      damping = std::max(damping / 10, 1e-12);
      if (moved < kConverged) return true;
    } else {
      damping *= 10;
      if (damping > 1e8) return true;  // no step helps any more
    }
  }
  return true;
}

// The window stays within the marker's black border, so that the pattern inside does not pull at the corner.
void refine_corners(const GreyImage& image, std::vector<cv::Point2f>* corners) {
  double shortest = 1e9;
  for (std::size_t i = 0; i < 4; ++i) shortest = std::min(shortest, cv::norm((*corners)[i] - (*corners)[(i + 1) % 4]));
  const int half = std::clamp(static_cast<int>(kWindowShare * shortest / kModules), 1, kLargestWindow_px);
  const cv::TermCriteria until(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 40, 0.005);
  cv::cornerSubPix(image, *corners, {half, half}, {-1, -1}, until);
}

double cost_of(const CameraModel& camera, const MarkerSighting& sighting, const Square& square) {
  Normal normal;
  return linearise(camera, {&sighting, 1}, square, &normal) ? normal.cost : 1e12;
}

}  // namespace

void MarkerOptions::validate() const {
  const auto check = [](const char* name, double value) {
    if (!std::isfinite(value) || value <= 0)
      throw InputError(std::string("marker.") + name + ": found " + std::to_string(value) +
                       ", expected a positive number");
  };
  check("side_m", side_m);
  check("corner_sigma_px", corner_sigma_px);
  check("max_relative_sigma", max_relative_sigma);
  check("max_residual_px", max_residual_px);
}

GreyImage marker_sheet(int id) {
  constexpr int kSide_px = 600;  // 100 a square of the pattern, black border included
  GreyImage sheet(3 * kSide_px, 3 * kSide_px, uchar(255));
  cv::Mat1b marker;
  cv::aruco::drawMarker(cv::aruco::getPredefinedDictionary(cv::aruco::DICT_4X4_50), id, kSide_px, marker, 1);
  marker.copyTo(sheet(cv::Rect(kSide_px, kSide_px, kSide_px, kSide_px)));
  return sheet;
}

std::vector<DetectedMarker> detect_markers(const GreyImage& image) {
  std::vector<DetectedMarker> out;
  if (image.empty()) return out;
  const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_4X4_50);
  const auto parameters = cv::aruco::DetectorParameters::create();
  parameters->cornerRefinementMethod = cv::aruco::CORNER_REFINE_NONE;
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  cv::aruco::detectMarkers(image, dictionary, corners, ids, parameters);
  for (std::size_t i = 0; i < ids.size(); ++i) {
    DetectedMarker marker;
    marker.id = ids[i];
    refine_corners(image, &corners[i]);
    for (std::size_t c = 0; c < 4; ++c) marker.corners_px[c] = {corners[i][c].x, corners[i][c].y};
    out.push_back(marker);
  }
  return out;
}

MarkerScale scale_from_sightings(const CameraModel& camera, std::span<const MarkerSighting> sightings,
                                 const MarkerOptions& options) {
  options.validate();
  std::vector<MarkerSighting> used(sightings.begin(), sightings.end());
  if (used.size() < 2)
    return refusal("The marker was seen in fewer than two keyframes: move sideways with the marker in view.");
  while (true) {
    auto square = first_guess(camera, used);
    Normal normal;
    if (!square || !fit(camera, used, &*square, &normal) || !(square->side > kMinSideShare))
      return refusal("The marker was seen from too much the same place: move sideways with the marker in view.");
    const auto values = static_cast<double>(8 * used.size());
    MarkerScale out;
    out.residual_px = std::sqrt(normal.cost / (values / 2));
    if (out.residual_px > options.max_residual_px) {
      if (used.size() <= 2)
        return refusal(
            "The sightings of the marker do not agree: there must be one of its number, and it must not move.");
      const auto worst = std::max_element(used.begin(), used.end(), [&](const auto& a, const auto& b) {
        return cost_of(camera, a, *square) < cost_of(camera, b, *square);
      });
      used.erase(worst);
      continue;
    }
    const double noise = std::max(options.corner_sigma_px, std::sqrt(normal.cost / (values - 7)));
    const Eigen::LDLT<Matrix7d> solver(normal.H);
    const double variance = noise * noise * solver.solve(Vector7d(Vector7d::Unit(6)))[6];
    const double relative = variance > 0 ? std::sqrt(variance) : 1e9;
    if (!(relative <= options.max_relative_sigma))
      return refusal("The marker was seen from too much the same place: move sideways with the marker in view.");
    out.ok = true;
    out.factor = options.side_m / square->side;
    out.sigma = relative * out.factor;
    out.id = used.front().marker.id;
    out.views = static_cast<int>(used.size());
    for (int i = 0; i < 4; ++i) out.corners[static_cast<std::size_t>(i)] = square->corner(i);
    return out;
  }
}

MarkerScale scale_from_plane(const CameraModel& camera, const MarkerSighting& sighting, const Plane& plane,
                             const MarkerOptions& options) {
  options.validate();
  HitOptions everywhere;
  everywhere.extent_factor = 1e9;
  const auto side_of = [&](const std::array<Eigen::Vector2d, 4>& px, std::array<Eigen::Vector3d, 4>* corners) {
    for (std::size_t i = 0; i < 4; ++i) {
      const auto ray = pixel_ray(camera, sighting.camera_from_world, px[i]);
      const auto hit = ray ? hit_plane(*ray, {&plane, 1}, everywhere) : std::nullopt;
      if (!hit) return 0.0;
      (*corners)[i] = hit->position;
    }
    double sum = 0;
    for (std::size_t i = 0; i < 4; ++i) sum += ((*corners)[i] - (*corners)[(i + 1) % 4]).norm();
    return sum / 4;
  };
  MarkerScale out;
  const double side = side_of(sighting.marker.corners_px, &out.corners);
  if (!(side > kMinSideShare)) return refusal("The marker does not lie on the plane.");
  double off = 0;
  for (std::size_t i = 0; i < 4; ++i)
    off = std::max(off, std::abs((out.corners[i] - out.corners[(i + 1) % 4]).norm() / side - 1));
  for (std::size_t i = 0; i < 2; ++i)
    off = std::max(off, std::abs((out.corners[i] - out.corners[i + 2]).norm() / (std::sqrt(2.0) * side) - 1));
  if (off > kNotSquare) return refusal("The marker does not lie on the plane: put it flat on the table.");
  double variance = 0;
  for (std::size_t i = 0; i < 8; ++i) {
    auto px = sighting.marker.corners_px;
    px[i / 2][static_cast<Eigen::Index>(i % 2)] += options.corner_sigma_px;
    std::array<Eigen::Vector3d, 4> corners;
    const double moved = side_of(px, &corners) / side - 1;
    variance += moved * moved;
  }
  if (!(std::sqrt(variance) <= options.max_relative_sigma))
    return refusal("The marker is too small in the picture: go nearer.");
  out.ok = true;
  out.factor = options.side_m / side;
  out.sigma = std::sqrt(variance) * out.factor;
  out.id = sighting.marker.id;
  out.views = 1;
  return out;
}

MarkerScale scale_from_marker(const CameraModel& camera, const TrackingSnapshot& map, const MarkerOptions& options,
                              const std::optional<PresentView>& present) {
  options.validate();
  if (map.empty()) return refusal("There is no map yet.");
  std::map<int, std::vector<MarkerSighting>> seen;
  const auto look = [&](const GreyImage& image, const RigidTransform& camera_from_world) {
    for (const DetectedMarker& marker : detect_markers(image)) seen[marker.id].push_back({camera_from_world, marker});
  };
  const int n = static_cast<int>(map.keyframes.size()), step = (n + kMaxKeyframes - 1) / kMaxKeyframes;
  for (int i = n - 1; i >= 0; i -= step) {
    const SnapshotKeyframe& kf = map.keyframes[static_cast<std::size_t>(i)];
    if (kf.images) look(kf.images->pyramid.level[0], kf.camera_from_world);
  }
  std::map<int, MarkerSighting> now;
  if (present) {
    for (const DetectedMarker& marker : detect_markers(present->image)) {
      now.insert({marker.id, {present->camera_from_world, marker}});
      seen[marker.id].push_back({present->camera_from_world, marker});
    }
  }
  if (seen.empty())
    return refusal("No marker was found: lay a printed 4x4 ArUco marker on the table, with a white border around it.");
  const auto best = std::max_element(seen.begin(), seen.end(),
                                     [](const auto& a, const auto& b) { return a.second.size() < b.second.size(); });
  MarkerScale out = scale_from_sightings(camera, best->second, options);
  if (!out.ok && map.plane && now.contains(best->first)) {
    MarkerScale on_plane = scale_from_plane(camera, now.at(best->first), *map.plane, options);
    if (on_plane.ok) return on_plane;
  }
  return out;
}

DistanceScale scale_from_distance(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double distance_m) {
  DistanceScale out;
  const double apart = (b - a).norm();
  if (!std::isfinite(distance_m) || distance_m <= 0) {
    out.reason = "The distance must be more than nothing.";
  } else if (!(apart > kShortest_m)) {
    out.reason = "The two points are one and the same: pick two that lie apart.";
  } else {
    out.ok = true;
    out.factor = distance_m / apart;
  }
  return out;
}

}  // namespace parallax
