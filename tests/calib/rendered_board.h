// Calibration targets as a camera sees them, anti-aliased by supersampling through the camera's own model, with exact
// truth beside them.
#pragma once

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "calib/camera_calibration.h"
#include "calib/target.h"
#include "core/camera_model.h"
#include "core/image.h"
#include "core/se3.h"

namespace parallax::calib_test {

struct BoardLook {
  double black = 40, white = 205, around = 120;  // grey levels
  double blur_px = 0.6;                          // of the lens
  double noise = 2;                              // grey levels
};

// Rays are worked out once a camera; a view then takes some tens of milliseconds.
class BoardRenderer {
 public:
  BoardRenderer(const CameraModel& camera, const CalibrationTarget& target, const BoardLook& look = {})
      : camera_(camera), target_(target), look_(look) {
    // At the pixels' corners.
    const int columns = camera.width() + 1, rows = camera.height() + 1;
    rays_.resize(static_cast<std::size_t>(columns * rows), Eigen::Vector3d::Zero());
    for (int y = 0; y < rows; ++y)
      for (int x = 0; x < columns; ++x) {
        Eigen::Vector3d ray;
        if (camera.unproject({x - 0.5, y - 0.5}, &ray)) rays_[static_cast<std::size_t>(y * columns + x)] = ray;
      }
  }

  GreyImage render(const RigidTransform& camera_from_target, std::mt19937* random) const {
    const int columns = camera_.width() + 1;
    cv::Mat1f image(camera_.height(), camera_.width());
    std::vector<double> corner(rays_.size());
    const RigidTransform target_from_camera = camera_from_target.inverse();
    for (std::size_t i = 0; i < rays_.size(); ++i) corner[i] = shade(target_from_camera, rays_[i]);
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        const auto at = static_cast<std::size_t>(y * columns + x), below = at + static_cast<std::size_t>(columns);
        double grey = corner[at];
        if (corner[at + 1] != grey || corner[below] != grey || corner[below + 1] != grey) {
          grey = 0;
          constexpr int n = 6;
          for (int j = 0; j < n; ++j)
            for (int i = 0; i < n; ++i) {
              const double a = (i + 0.5) / n, b = (j + 0.5) / n;
              const Eigen::Vector3d ray = (1 - b) * ((1 - a) * rays_[at] + a * rays_[at + 1]) +
                                          b * ((1 - a) * rays_[below] + a * rays_[below + 1]);
              grey += shade(target_from_camera, ray) / (n * n);
            }
        }
        image(y, x) = static_cast<float>(grey);
      }
    }
    if (look_.blur_px > 0) cv::GaussianBlur(image, image, cv::Size(), look_.blur_px);
    std::normal_distribution<float> noise(0, static_cast<float>(look_.noise));
    for (auto& value : image) value += noise(*random);
    GreyImage out;
    image.convertTo(out, CV_8U);
    return out;
  }

 private:
  double shade(const RigidTransform& target_from_camera, const Eigen::Vector3d& ray) const {
    if (ray.z() == 0) return 0;  // a corner of the image that sees nothing
    const Eigen::Vector3d direction = target_from_camera.R * ray, origin = target_from_camera.t;
    const double along = -origin.z() / direction.z();
    if (!(along > 0)) return look_.around;
    const double x = origin.x() + along * direction.x(), y = origin.y() + along * direction.y();
    const TargetExtent extent = target_extent(target_);
    const double margin = target_.square_m;
    if (x < extent.left - margin || y < extent.top - margin || x > extent.right + margin || y > extent.bottom + margin)
      return look_.around;
    return target_is_black(target_, x, y) ? look_.black : look_.white;
  }

  CameraModel camera_;
  CalibrationTarget target_;
  BoardLook look_;
  std::vector<Eigen::Vector3d> rays_;
};

inline CalibrationTarget chessboard(int columns = 9, int rows = 6, double square_m = 0.025) {
  CalibrationTarget target;
  target.columns = columns;
  target.rows = rows;
  target.square_m = square_m;
  return target;
}

struct NamedLens {
  LensModel model;
  CameraModel camera;
};

// A plausible lens of each model, 640x480.
inline std::vector<NamedLens> lenses() {
  const Eigen::Vector2d focal(545, 548), centre(323.4, 236.2);
  const auto radtan = [&](const std::array<double, 8>& d, int n) {
    return CameraModel(CameraModelKind::radtan, 640, 480, focal, centre, d, n);
  };
  return {
      {LensModel::pinhole, CameraModel(CameraModelKind::pinhole, 640, 480, focal, centre)},
      {LensModel::radtan4, radtan({-0.28, 0.09, 0.0012, -0.0007}, 4)},
      {LensModel::radtan5, radtan({-0.27, 0.08, 0.0012, -0.0007, 0.02}, 5)},
      {LensModel::radtan8, radtan({0.25, 0.05, 0.0008, -0.0006, 0.01, 0.52, 0.11, 0.02}, 8)},
      {LensModel::kannala_brandt, CameraModel(CameraModelKind::kannala_brandt, 640, 480, {262, 263}, {321.7, 241.9},
                                              {-0.012, 0.021, -0.011, 0.0017}, 4)},
      {LensModel::fov, CameraModel(CameraModelKind::fov, 640, 480, {389, 388}, {318.1, 243.3}, {0.93}, 1)},
  };
}

// Poses that show the whole target (with a margin of a few pixels), spread over the image, tilted all ways, near and
// far.
inline std::vector<RigidTransform> board_poses(const CameraModel& camera, const CalibrationTarget& target, int count,
                                               unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  const TargetExtent extent = target_extent(target);
  const Eigen::Vector3d middle(0.5 * (extent.left + extent.right), 0.5 * (extent.top + extent.bottom), 0);
  std::vector<RigidTransform> poses;
  for (int attempt = 0; attempt < 20000 && static_cast<int>(poses.size()) < count; ++attempt) {
    const Eigen::Vector2d at(camera.width() * (0.5 + 0.42 * unit(random)),
                             camera.height() * (0.5 + 0.42 * unit(random)));
    Eigen::Vector3d sight;
    if (!camera.unproject(at, &sight)) continue;
    sight.normalize();
    const Eigen::Matrix3d facing =
        Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), sight).toRotationMatrix();
    const Eigen::Matrix3d R =
        facing * exp_so3(Eigen::Vector3d(0.6 * unit(random), 0.6 * unit(random), 0.35 * unit(random)));
    const double size = 0.45 + 0.2 * unit(random);  // of the image width
    const double distance = extent.width() * camera.mean_focal_px() / (size * camera.width());
    const RigidTransform pose(R, sight * distance - R * middle);
    bool inside = true;
    for (const double x : {extent.left, middle.x(), extent.right})
      for (const double y : {extent.top, middle.y(), extent.bottom}) {
        Eigen::Vector2d px;
        const Eigen::Vector3d p = pose * Eigen::Vector3d(x, y, 0);
        // Not near the image plane, where a printed board shows nothing.
        inside = inside && p.z() > 0.25 * p.norm() && camera.project(p, &px) && camera.in_image(px, 6);
      }
    if (inside) poses.push_back(pose);
  }
  return poses;
}

// Exact points with Gaussian noise, without images.
inline CalibrationData exact_views(const CameraModel& camera, const CalibrationTarget& target,
                                   const std::vector<RigidTransform>& poses, double noise_px, std::mt19937* random) {
  CalibrationData data{target, camera.width(), camera.height(), {}};
  std::normal_distribution<double> noise(0, noise_px > 0 ? noise_px : 1);
  const auto points = target_points(target);
  for (std::size_t v = 0; v < poses.size(); ++v) {
    CalibrationView view;
    view.frame = static_cast<int>(v);
    view.name = "view " + std::to_string(v);
    for (std::size_t i = 0; i < points.size(); ++i) {
      Eigen::Vector2d px;
      if (!camera.project(poses[v] * points[i], &px) || !camera.in_image(px)) continue;
      if (noise_px > 0) px += Eigen::Vector2d(noise(*random), noise(*random));
      view.corners.push_back({static_cast<int>(i), px});
    }
    data.views.push_back(view);
  }
  return data;
}

}  // namespace parallax::calib_test
