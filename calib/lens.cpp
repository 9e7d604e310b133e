#include "calib/lens.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"

namespace parallax {

const char* to_string(LensModel model) {
  switch (model) {
    case LensModel::pinhole:
      return "pinhole";
    case LensModel::radtan4:
      return "radtan4";
    case LensModel::radtan5:
      return "radtan5";
    case LensModel::radtan8:
      return "radtan8";
    case LensModel::kannala_brandt:
      return "kannala_brandt";
    case LensModel::fov:
      return "fov";
  }
  return "unknown";
}

LensModel lens_model(const std::string& name) {
  if (name == "radtan") return LensModel::radtan5;
  for (const LensModel model : {LensModel::pinhole, LensModel::radtan4, LensModel::radtan5, LensModel::radtan8,
                                LensModel::kannala_brandt, LensModel::fov})
    if (name == to_string(model)) return model;
  throw InputError("model: found '" + name +
                   "', expected pinhole, radtan4, radtan5 (radtan), radtan8, kannala_brandt or fov");
}

LensModel lens_model(const CameraModel& camera) {
  switch (camera.kind()) {
    case CameraModelKind::pinhole:
      return LensModel::pinhole;
    case CameraModelKind::kannala_brandt:
      return LensModel::kannala_brandt;
    case CameraModelKind::fov:
      return LensModel::fov;
    case CameraModelKind::radtan:
      break;
  }
  return camera.n_distortion() == 4   ? LensModel::radtan4
         : camera.n_distortion() == 5 ? LensModel::radtan5
                                      : LensModel::radtan8;
}

int lens_parameter_count(LensModel model) {
  switch (model) {
    case LensModel::pinhole:
      return 4;
    case LensModel::fov:
      return 5;
    case LensModel::radtan4:
    case LensModel::kannala_brandt:
      return 8;
    case LensModel::radtan5:
      return 9;
    case LensModel::radtan8:
      return 12;
  }
  return 4;
}

std::vector<std::string> lens_parameter_names(LensModel model) {
  std::vector<std::string> names{"fx", "fy", "cx", "cy"};
  if (model == LensModel::fov) {
    names.emplace_back("omega");
  } else if (model == LensModel::kannala_brandt) {
    for (const char* name : {"k1", "k2", "k3", "k4"}) names.emplace_back(name);
  } else {
    for (const char* name : {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}) names.emplace_back(name);
    names.resize(static_cast<std::size_t>(lens_parameter_count(model)));
  }
  return names;
}

Eigen::VectorXd lens_parameters(const CameraModel& camera) {
  Eigen::VectorXd p(4 + camera.n_distortion());
  p.head<4>() << camera.focal_px(), camera.centre_px();
  for (int i = 0; i < camera.n_distortion(); ++i) p(4 + i) = camera.distortion()[static_cast<std::size_t>(i)];
  return p;
}

std::optional<CameraModel> make_lens(LensModel model, int width, int height, const Eigen::VectorXd& parameters) {
  if (!parameters.allFinite()) return std::nullopt;
  const int n = lens_parameter_count(model) - 4;
  std::array<double, 8> d{};
  for (int i = 0; i < n; ++i) d[static_cast<std::size_t>(i)] = parameters(4 + i);
  CameraModelKind kind = CameraModelKind::radtan;
  if (model == LensModel::pinhole) kind = CameraModelKind::pinhole;
  if (model == LensModel::kannala_brandt) kind = CameraModelKind::kannala_brandt;
  if (model == LensModel::fov) {
    kind = CameraModelKind::fov;
    d[0] = std::abs(d[0]);  // an even function of omega
  }
  try {
    return CameraModel(kind, width, height, parameters.head<2>(), parameters.segment<2>(2), d, n);
  } catch (const InputError&) {
    return std::nullopt;
  }
}

Eigen::MatrixXd lens_freedom_map(LensModel model, const LensFreedom& freedom) {
  const int n = lens_parameter_count(model);
  std::vector<Eigen::VectorXd> columns;
  const auto unit = [n](int i) { return Eigen::VectorXd(Eigen::VectorXd::Unit(n, i)); };
  if (freedom.square_pixels) {
    columns.push_back(unit(0) + unit(1));
  } else {
    columns.push_back(unit(0));
    columns.push_back(unit(1));
  }
  if (freedom.principal_point) {
    columns.push_back(unit(2));
    columns.push_back(unit(3));
  }
  const bool radtan = model == LensModel::radtan4 || model == LensModel::radtan5 || model == LensModel::radtan8;
  for (int i = 4; i < n; ++i)
    if (!radtan || freedom.tangential || (i != 6 && i != 7)) columns.push_back(unit(i));
  Eigen::MatrixXd map(n, static_cast<int>(columns.size()));
  for (std::size_t i = 0; i < columns.size(); ++i) map.col(static_cast<int>(i)) = columns[i];
  return map;
}

bool project_with_lens(const CameraModel& camera, const Eigen::Vector3d& point, Eigen::Vector2d* pixel,
                       Eigen::Matrix<double, 2, 3>* d_pixel_d_point, LensJacobian* d_pixel_d_parameters) {
  if (!camera.project(point, pixel, d_pixel_d_point)) return false;
  const double fx = camera.focal_px().x(), fy = camera.focal_px().y();
  LensJacobian& J = *d_pixel_d_parameters;
  J.setZero(2, 4 + camera.n_distortion());
  // Distorted normalised coordinates: what the focal length multiplies.
  J(0, 0) = (pixel->x() - camera.centre_px().x()) / fx;
  J(1, 1) = (pixel->y() - camera.centre_px().y()) / fy;
  J(0, 2) = J(1, 3) = 1;
  const auto& d = camera.distortion();
  switch (camera.kind()) {
    case CameraModelKind::pinhole:
      break;
    case CameraModelKind::fov: {
      // g = atan(t r) / (omega r), t = 2 tan(omega / 2).
      const double omega = std::max(d[0], 1e-9), half = std::tan(omega / 2), t = 2 * half;
      const double x = point.x() / point.z(), y = point.y() / point.z(), r = std::hypot(x, y);
      const double d_t = 1 + half * half;  // sec^2(omega / 2)
      double d_g = 0;
      if (r > 1e-9) {
        const double g = std::atan(t * r) / (omega * r);
        d_g = d_t / ((1 + t * t * r * r) * omega) - g / omega;
      } else {
        d_g = (d_t - t / omega) / omega;
      }
      J(0, 4) = fx * x * d_g;
      J(1, 4) = fy * y * d_g;
      break;
    }
    case CameraModelKind::kannala_brandt: {
      const double rho = std::hypot(point.x(), point.y());
      if (!(rho > 1e-15 * std::abs(point.z()))) break;
      const double angle = std::atan2(rho, point.z()), a2 = angle * angle;
      double power = angle * a2;
      for (int i = 0; i < 4; ++i) {
        J(0, 4 + i) = fx * point.x() / rho * power;
        J(1, 4 + i) = fy * point.y() / rho * power;
        power *= a2;
      }
      break;
    }
    case CameraModelKind::radtan: {
      const double x = point.x() / point.z(), y = point.y() / point.z(), s = x * x + y * y;
      const double denominator = 1 / (1 + s * (d[5] + s * (d[6] + s * d[7])));
      const double radial = (1 + s * (d[0] + s * (d[1] + s * d[4]))) * denominator;
      const int n = camera.n_distortion();
      const double slope[8] = {s * denominator,
                               s * s * denominator,
                               0,
                               0,
                               s * s * s * denominator,
                               -radial * s * denominator,
                               -radial * s * s * denominator,
                               -radial * s * s * s * denominator};
      for (int i = 0; i < n; ++i) {
        J(0, 4 + i) = fx * x * slope[i];
        J(1, 4 + i) = fy * y * slope[i];
      }
      J(0, 6) = fx * 2 * x * y;
      J(1, 6) = fy * (s + 2 * y * y);
      J(0, 7) = fx * (s + 2 * x * x);
      J(1, 7) = fy * 2 * x * y;
      break;
    }
  }
  return true;
}

}  // namespace parallax
