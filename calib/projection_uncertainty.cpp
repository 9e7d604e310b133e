#include "calib/projection_uncertainty.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/check.h"

namespace parallax {
namespace {

struct GridPoint {
  bool seen = false;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  LensJacobian by_lens;
  Eigen::Matrix<double, 2, 3> by_rotation = Eigen::Matrix<double, 2, 3>::Zero();
};

double larger_axis(const Eigen::Matrix2d& covariance) {
  const double mean = 0.5 * covariance.trace();
  const double half = std::sqrt(std::max(mean * mean - covariance.determinant(), 0.0));
  return std::sqrt(std::max(mean + half, 0.0));
}

}  // namespace

UncertaintyMap projection_uncertainty(const CameraCalibration& calibration, int columns, int rows) {
  PARALLAX_CHECK(calibration.ok && columns > 1 && rows > 1, "a calibration, and a grid of at least 2 by 2");
  const CameraModel& camera = calibration.camera;
  std::vector<GridPoint> grid(static_cast<std::size_t>(columns * rows));
  const auto n = calibration.parameters.size();
  Eigen::Matrix3d rotation_square = Eigen::Matrix3d::Zero();
  Eigen::MatrixXd rotation_by_lens = Eigen::MatrixXd::Zero(3, n);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      GridPoint& point = grid[static_cast<std::size_t>(row * columns + column)];
      point.pixel = {(camera.width() - 1.0) * column / (columns - 1), (camera.height() - 1.0) * row / (rows - 1)};
      Eigen::Vector3d ray;
      Eigen::Vector2d px;
      Eigen::Matrix<double, 2, 3> by_ray;
      if (!camera.unproject(point.pixel, &ray)) continue;
      ray.normalize();
      point.seen = project_with_lens(camera, ray, &px, &by_ray, &point.by_lens);
      if (!point.seen) continue;
      point.by_rotation = -by_ray * hat(ray);
      rotation_square += point.by_rotation.transpose() * point.by_rotation;
      rotation_by_lens += point.by_rotation.transpose() * point.by_lens;
    }
  }
  const Eigen::MatrixXd taken_up = rotation_square.ldlt().solve(rotation_by_lens);
  UncertaintyMap map;
  map.columns = columns;
  map.rows = rows;
  map.sigma_px.assign(grid.size(), 0.0);
  int seen = 0;
  for (std::size_t i = 0; i < grid.size(); ++i) {
    if (!grid[i].seen) continue;
    const Eigen::MatrixXd J = grid[i].by_lens - grid[i].by_rotation * taken_up;
    map.sigma_px[i] = std::max(larger_axis(J * calibration.covariance * J.transpose()),
                               larger_axis(J * calibration.covariance_views * J.transpose()));
    map.max_px = std::max(map.max_px, map.sigma_px[i]);
    map.mean_px += map.sigma_px[i];
    ++seen;
  }
  if (seen > 0) map.mean_px /= seen;
  for (std::size_t i = 0; i < grid.size(); ++i) {
    if (grid[i].seen) continue;
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < grid.size(); ++k) {
      const double distance = (grid[k].pixel - grid[i].pixel).squaredNorm();
      if (!grid[k].seen || !(distance < nearest)) continue;
      nearest = distance;
      map.sigma_px[i] = map.sigma_px[k];
    }
  }
  return map;
}

}  // namespace parallax
