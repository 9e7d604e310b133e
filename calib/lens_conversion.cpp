#include "calib/lens_conversion.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/se3.h"

namespace parallax {
namespace {

struct Sample {
  Eigen::Vector2d pixel;
  Eigen::Vector3d ray;
};

constexpr int grid_columns = 33, grid_rows = 25;

std::vector<Sample> samples_of(const CameraModel& camera, const Eigen::Vector2d& low, const Eigen::Vector2d& high) {
  std::vector<Sample> samples;
  for (int row = 0; row < grid_rows; ++row) {
    for (int column = 0; column < grid_columns; ++column) {
      Sample s;
      s.pixel = {low.x() + (high.x() - low.x()) * column / (grid_columns - 1.0),
                 low.y() + (high.y() - low.y()) * row / (grid_rows - 1.0)};
      if (camera.unproject(s.pixel, &s.ray)) samples.push_back(s);
    }
  }
  return samples;
}

// Mean squared distance; samples that the lens cannot show count as a tenth of the image away.
double cost_of(const CameraModel& camera, const std::vector<Sample>& samples) {
  const double blind = 0.01 * camera.width() * camera.width();
  double cost = 0;
  for (const auto& s : samples) {
    Eigen::Vector2d px;
    cost += camera.project(s.ray, &px) ? (px - s.pixel).squaredNorm() : blind;
  }
  return cost;
}

std::optional<CameraModel> fit(CameraModel camera, LensModel model, const Eigen::MatrixXd& map,
                               const std::vector<Sample>& samples, double* final_cost) {
  double cost = cost_of(camera, samples), lambda = 1e-3;
  const int n = static_cast<int>(map.cols());
  for (int iteration = 0; iteration < 100; ++iteration) {
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd g = Eigen::VectorXd::Zero(n);
    for (const auto& s : samples) {
      Eigen::Vector2d px;
      Eigen::Matrix<double, 2, 3> d_point;
      LensJacobian d_lens;
      if (!project_with_lens(camera, s.ray, &px, &d_point, &d_lens)) continue;
      const Eigen::MatrixXd J = d_lens * map;
      H.noalias() += J.transpose() * J;
      g.noalias() += J.transpose() * (px - s.pixel);
    }
    bool better = false;
    double gain = 0;
    for (int attempt = 0; attempt < 12 && !better; ++attempt) {
      Eigen::MatrixXd damped = H;
      damped.diagonal() *= 1 + lambda;
      damped.diagonal().array() += 1e-15;
      const Eigen::VectorXd step = damped.ldlt().solve(-g);
      const auto candidate = make_lens(model, camera.width(), camera.height(), lens_parameters(camera) + map * step);
      const double new_cost = candidate ? cost_of(*candidate, samples) : std::numeric_limits<double>::infinity();
      better = new_cost < cost;
      lambda = better ? std::max(lambda * 0.1, 1e-12) : lambda * 10;
      if (!better) continue;
      gain = cost - new_cost;
      cost = new_cost;
      camera = *candidate;
    }
    if (!better || gain < 1e-7 * cost || cost < 1e-16 * static_cast<double>(samples.size())) break;
  }
  *final_cost = cost;
  return camera;
}

// Lenses to start from: the source's own focal length, and shorter and longer, with no or typical distortion.
std::vector<CameraModel> starts_for(const CameraModel& source, LensModel model, bool square) {
  std::vector<CameraModel> starts;
  const int n = lens_parameter_count(model);
  for (const double stretch : {1.0, 0.8, 1.25, 0.6, 1.6}) {
    for (const double omega : {0.01, 0.8, 1.1}) {
      if (model != LensModel::fov && omega > 0.1) continue;
      Eigen::VectorXd p = Eigen::VectorXd::Zero(n);
      p.head<2>() = stretch * source.focal_px();
      if (square) p.head<2>().setConstant(stretch * source.mean_focal_px());
      p.segment<2>(2) = source.centre_px();
      if (model == LensModel::fov) p(4) = omega;
      if (const auto lens = make_lens(model, source.width(), source.height(), p)) starts.push_back(*lens);
    }
  }
  return starts;
}

}  // namespace

std::optional<LensConversion> convert_lens(const CameraModel& source, LensModel model, const LensFreedom& freedom) {
  const Eigen::Vector2d low(0, 0), high(source.width() - 1.0, source.height() - 1.0);
  std::vector<Sample> samples = samples_of(source, low, high);
  if (model != LensModel::kannala_brandt) {
    // Towards the image plane pixels run away: what lies beyond 84 degrees is not asked of these models.
    std::erase_if(samples, [](const Sample& s) { return s.ray.head<2>().norm() > 9.5; });
  }
  const Eigen::MatrixXd map = lens_freedom_map(model, freedom);
  if (static_cast<int>(samples.size()) * 2 < 4 * map.cols()) return std::nullopt;
  std::vector<CameraModel> starts;
  if (lens_model(source) == model) starts.push_back(source);
  for (const auto& start : starts_for(source, model, freedom.square_pixels)) starts.push_back(start);
  double best = std::numeric_limits<double>::infinity();
  std::optional<CameraModel> chosen;
  for (const auto& start : starts) {
    double cost = 0;
    const auto camera = fit(start, model, map, samples, &cost);
    if (!camera || !(cost < best)) continue;
    best = cost;
    chosen = camera;
    // Within a hundredth of a pixel no other start will do noticeably better.
    if (best < 1e-4 * static_cast<double>(samples.size())) break;
  }
  if (!chosen) return std::nullopt;
  LensConversion out;
  out.camera = *chosen;
  double sum = 0;
  int shown = 0;
  for (const auto& s : samples) {
    Eigen::Vector2d px;
    if (!chosen->project(s.ray, &px)) continue;
    const double distance = (px - s.pixel).norm();
    sum += distance * distance;
    out.max_px = std::max(out.max_px, distance);
    ++shown;
  }
  if (shown == 0) return std::nullopt;
  out.rms_px = std::sqrt(sum / shown);
  out.covered = shown / static_cast<double>(grid_columns * grid_rows);
  return out;
}

LensDifference compare_lenses(const CameraModel& a, const CameraModel& b, const Eigen::Vector2d& low,
                              const Eigen::Vector2d& high) {
  const std::vector<Sample> samples = samples_of(a, low, high);
  LensDifference out;
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  for (int round = 0; round < 6; ++round) {
    Eigen::Matrix3d H = 1e-12 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    double sum = 0;
    int n = 0;
    out.max_px = 0;
    for (const auto& s : samples) {
      Eigen::Vector2d px;
      Eigen::Matrix<double, 2, 3> d_point;
      const Eigen::Vector3d p = R * s.ray;
      if (!b.project(p, &px, &d_point)) continue;
      const Eigen::Matrix<double, 2, 3> J = -d_point * hat(p);
      H += J.transpose() * J;
      g += J.transpose() * (px - s.pixel);
      sum += (px - s.pixel).squaredNorm();
      out.max_px = std::max(out.max_px, (px - s.pixel).norm());
      ++n;
    }
    out.rms_px = n > 0 ? std::sqrt(sum / n) : std::numeric_limits<double>::infinity();
    out.rotation = log_so3(R);
    if (n < 3) break;
    if (round < 5) R = exp_so3(H.ldlt().solve(-g)) * R;
  }
  return out;
}

}  // namespace parallax
