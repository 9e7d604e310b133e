#include "camera/stereo_rectification.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "core/error.h"

namespace parallax {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double shortest_baseline_m = 0.001, longest_baseline_m = 5.0;
constexpr double widest_angle_deg = 60;      // between the cameras' directions of view
constexpr double same_direction_rad = 1e-6;  // at 1000 px of focal length: a thousandth of a pixel
constexpr double same_pixel_px = 1e-6;

std::string number(double value, const char* format = "%.4g") {
  char text[32];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

std::string degrees(double radians) { return number(radians * 180 / std::numbers::pi, "%.1f"); }

// The right camera at `place`, in the frame half way between the cameras: x right, y down, z forward.
void check_right_side(const Vector3d& place, const std::string& name) {
  const double length = place.norm();
  if (!(length > shortest_baseline_m && length <= longest_baseline_m)) {
    throw InputError(name + ": found a baseline of " + number(length) + " m, expected more than " +
                     number(shortest_baseline_m) + " and at most " + number(longest_baseline_m) +
                     " m (is it given in metres?)");
  }
  int axis = 0;
  place.cwiseAbs().maxCoeff(&axis);
  if (axis == 0 && place.x() > 0) return;
  const std::string metres = number(std::abs(place[axis])) + " m ";
  if (axis == 0) {
    throw InputError(name + ": the right camera stands " + metres +
                     "to the left of the left one; are the two swapped?");
  }
  const char* where = axis == 1 ? (place.y() > 0 ? "below" : "above") : (place.z() > 0 ? "before" : "behind");
  throw InputError(name + ": the right camera stands " + metres + where +
                   " the left one; expected it beside it, to the right");
}

bool equal_pinholes(const CameraModel& a, const CameraModel& b) {
  return a.kind() == CameraModelKind::pinhole && b.kind() == CameraModelKind::pinhole && a.width() == b.width() &&
         a.height() == b.height() && (a.focal_px() - b.focal_px()).cwiseAbs().maxCoeff() < same_pixel_px &&
         (a.centre_px() - b.centre_px()).cwiseAbs().maxCoeff() < same_pixel_px;
}

void check_size(const cv::Mat& image, const CameraModel& camera, const char* side, const std::string& name) {
  if (image.cols == camera.width() && image.rows == camera.height()) return;
  const auto size = [](int width, int height) { return std::to_string(width) + "x" + std::to_string(height); };
  throw InputError(name + ": it is for " + side + " images of " + size(camera.width(), camera.height()) + ", found " +
                   size(image.cols, image.rows));
}

}  // namespace

void RectificationOptions::validate() const {
  if (!(least_seen >= 0.5 && least_seen <= 1)) throw InputError("rectification: least_seen: expected 0.5 to 1");
  if (!(least_focal > 0.05 && least_focal <= most_focal && most_focal < 20))
    throw InputError("rectification: least_focal, most_focal: expected 0.05 to 20, in this order");
}

StereoRectifier::StereoRectifier(const StereoCalibration& calibration, const RectificationOptions& options,
                                 const std::string& name)
    : name_(name), cameras_{calibration.left, calibration.right} {
  options.validate();
  turn(calibration.right_from_left, name);
  camera_.width = cameras_[0].width();
  camera_.height = cameras_[0].height();
  camera_.baseline_m = calibration.right_from_left.t.norm();
  pass_through_ = equal_pinholes(cameras_[0], cameras_[1]) && rectified_from_left().angle() < same_direction_rad &&
                  rectified_from_right().angle() < same_direction_rad;
  if (pass_through_) {
    rectified_from_camera_ = {};
    camera_.focal_px = cameras_[0].focal_px();
    camera_.centre_px = cameras_[0].centre_px();
    return;
  }
  choose_view(options, name);
  maps_[0] = make_maps(0, &left_mask_);
  maps_[1] = make_maps(1, nullptr);
}

void StereoRectifier::turn(const RigidTransform& right_from_left, const std::string& name) {
  if (!right_from_left.R.allFinite() || !right_from_left.t.allFinite())
    throw InputError(name + ": found a pose of the right camera that is no number, expected a rigid transform");
  // Half of the turn between them for each.
  const Vector3d half = 0.5 * log_so3(right_from_left.R);
  const Eigen::Matrix3d middle_from_left = exp_so3(half), middle_from_right = exp_so3(-half);
  const Vector3d baseline = middle_from_left * right_from_left.inverse().t;
  check_right_side(baseline, name);
  const double apart = 2 * half.norm();
  if (apart * 180 / std::numbers::pi > widest_angle_deg)
    throw InputError(name + ": found cameras turned by " + degrees(apart) +
                     " degrees from each other, expected at most " + number(widest_angle_deg));
  Eigen::Matrix3d rectified_from_middle;
  const Vector3d x = baseline.normalized(), y = Vector3d::UnitZ().cross(x).normalized();
  rectified_from_middle.row(0) = x.transpose();
  rectified_from_middle.row(1) = y.transpose();
  rectified_from_middle.row(2) = x.cross(y).transpose();
  rectified_from_camera_[0] = {Eigen::Matrix3d(rectified_from_middle * middle_from_left), Vector3d::Zero()};
  rectified_from_camera_[1] = {Eigen::Matrix3d(rectified_from_middle * middle_from_right), Vector3d::Zero()};
}

void StereoRectifier::choose_view(const RectificationOptions& options, const std::string& name) {
  for (std::size_t side = 0; side < 2; ++side) {
    const CameraModel& camera = cameras_[side];
    Vector3d ray;
    const Vector2d centre((camera.width() - 1) / 2.0, (camera.height() - 1) / 2.0);
    const bool seen = camera.unproject(centre, &ray);
    if (seen) ray = rectified_from_camera_[side].R * ray;
    if (!seen || !(ray.z() > 0.1 * ray.norm()))
      throw InputError(name + ": the cameras look along their baseline, expected across it");
    middle_[side] = ray.head<2>() / ray.z();
  }
  // The scale of each pixel is kept, roughly, when images of different sizes meet.
  const double mean_focal =
      0.5 * (cameras_[0].mean_focal_px() + cameras_[1].mean_focal_px() * camera_.height / cameras_[1].height());
  double low = options.least_focal * mean_focal, high = options.most_focal * mean_focal;
  if (seen_at(low) < options.least_seen) {
    for (int i = 0; i < 30; ++i) {
      const double focal = 0.5 * (low + high);
      (seen_at(focal) >= options.least_seen ? high : low) = focal;
    }
  } else {
    high = low;
  }
  seen_ = seen_at(high);
  if (seen_ < 0.5)
    throw InputError(name + ": found cameras that share " + number(100 * seen_, "%.0f") +
                     " percent of a rectified view, expected more than half");
  camera_.focal_px = {high, high};
  const Vector2d middle = 0.5 * (middle_[0] + middle_[1]);
  camera_.centre_px = Vector2d((camera_.width - 1) / 2.0, (camera_.height - 1) / 2.0) - high * middle;
}

// The part of the rectified images with this focal length that is seen, from a grid of pixels.
double StereoRectifier::seen_at(double focal_px) const {
  constexpr int columns = 40, rows = 30;
  const Vector2d middle = 0.5 * (middle_[0] + middle_[1]);
  int seen = 0;
  for (std::size_t side = 0; side < 2; ++side) {
    for (int i = 0; i <= rows; ++i) {
      for (int j = 0; j <= columns; ++j) {
        const Vector3d ray(middle.x() + (static_cast<double>(j) / columns - 0.5) * (camera_.width - 1) / focal_px,
                           middle.y() + (static_cast<double>(i) / rows - 0.5) * (camera_.height - 1) / focal_px, 1);
        Vector2d pixel;
        seen += cameras_[side].project(rectified_from_camera_[side].R.transpose() * ray, &pixel) &&
                cameras_[side].in_image(pixel);
      }
    }
  }
  return static_cast<double>(seen) / (2 * (rows + 1) * (columns + 1));
}

bool StereoRectifier::source_pixel(int side, const Vector2d& rectified, Vector2d* source) const {
  const auto i = static_cast<std::size_t>(side);
  return cameras_[i].project(rectified_from_camera_[i].R.transpose() * camera_.ray(rectified), source);
}

bool StereoRectifier::rectified_pixel(bool right, const Vector2d& pixel, Vector2d* rectified) const {
  const std::size_t side = right ? 1 : 0;
  Vector3d ray;
  if (!cameras_[side].unproject(pixel, &ray)) return false;
  ray = rectified_from_camera_[side].R * ray;
  if (!(ray.z() > 1e-9 * ray.norm())) return false;
  *rectified = camera_.focal_px.cwiseProduct(ray.head<2>() / ray.z()) + camera_.centre_px;
  return true;
}

StereoRectifier::Maps StereoRectifier::make_maps(int side, cv::Mat1b* mask) const {
  constexpr float nowhere = -30000;  // far outside any image, and a whole number of cv::remap's 16 bits
  const CameraModel& source = cameras_[static_cast<std::size_t>(side)];
  cv::Mat1f x(camera_.height, camera_.width), y(camera_.height, camera_.width);
  cv::Mat1b inside(camera_.height, camera_.width);
  for (int v = 0; v < camera_.height; ++v) {
    for (int u = 0; u < camera_.width; ++u) {
      Vector2d pixel;
      const bool seen = source_pixel(side, Vector2d(u, v), &pixel) && pixel.cwiseAbs().maxCoeff() < -nowhere;
      x(v, u) = seen ? static_cast<float>(pixel.x()) : nowhere;
      y(v, u) = seen ? static_cast<float>(pixel.y()) : nowhere;
      inside(v, u) = seen && source.in_image(pixel) ? 255 : 0;
    }
  }
  Maps maps;
  cv::convertMaps(x, y, maps.whole, maps.fraction, CV_16SC2);
  if (mask != nullptr && cv::countNonZero(inside) < inside.rows * inside.cols) {
    constexpr int border_px = 4;  // what a corner finder looks at around a pixel
    cv::erode(inside, *mask, cv::getStructuringElement(cv::MORPH_RECT, {2 * border_px + 1, 2 * border_px + 1}),
              {-1, -1}, 1, cv::BORDER_CONSTANT, cv::Scalar(255));
  }
  return maps;
}

void StereoRectifier::look_up(int side, const cv::Mat& in, cv::Mat* out) const {
  const Maps& maps = maps_[static_cast<std::size_t>(side)];
  if (out->u != nullptr && out->u->refcount != 1) out->release();  // somebody else holds its pixels
  cv::remap(in, *out, maps.whole, maps.fraction, cv::INTER_LINEAR, cv::BORDER_CONSTANT, cv::Scalar());
}

void StereoRectifier::rectify(const StereoFrame& in, StereoImages* out) const {
  check_size(in.left.grey, cameras_[0], "left", name_);
  check_size(in.right.grey, cameras_[1], "right", name_);
  out->index = in.left.index;
  out->time = in.left.time;
  if (pass_through_) {
    out->left = in.left.grey;
    out->right = in.right.grey;
    out->colour = in.left.colour;
    return;
  }
  look_up(0, in.left.grey, &out->left);
  look_up(1, in.right.grey, &out->right);
  if (in.left.colour.empty()) {
    out->colour.release();
  } else {
    look_up(0, in.left.colour, &out->colour);
  }
}

}  // namespace parallax
