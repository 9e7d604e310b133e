#include "calib/initial_lens.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "calib/planar_pose.h"

namespace parallax {
namespace {

// Views that are judged: spread evenly over all of them.
std::vector<const ViewPoints*> chosen_views(std::span<const ViewPoints> views, std::size_t most) {
  std::vector<const ViewPoints*> chosen;
  const std::size_t n = std::min(views.size(), most);
  for (std::size_t i = 0; i < n; ++i) chosen.push_back(&views[i * views.size() / n]);
  return chosen;
}

// The two columns of a homography are orthogonal and of one length once the focal length is taken out: both linear in
// 1 / f^2. Least squares over the views; nothing when they do not say (all views frontal).
std::optional<double> closed_form_focal(std::span<const ViewPoints> views, int width, int height) {
  double numerator = 0, denominator = 0;
  const Eigen::Vector2d centre(0.5 * (width - 1), 0.5 * (height - 1));
  for (const auto& view : views) {
    std::vector<Eigen::Vector2d> from, to;
    for (std::size_t i = 0; i < view.points.size(); ++i) {
      from.push_back(view.points[i].head<2>());
      to.push_back((view.pixels[i] - centre) / width);
    }
    Eigen::Matrix3d h;
    if (!find_homography(from, to, &h)) continue;
    h /= std::sqrt(h.col(0).norm() * h.col(1).norm());
    const double a[2] = {h.col(0).head<2>().dot(h.col(1).head<2>()),
                         h.col(0).head<2>().squaredNorm() - h.col(1).head<2>().squaredNorm()};
    const double b[2] = {h(2, 0) * h(2, 1), h(2, 0) * h(2, 0) - h(2, 1) * h(2, 1)};
    for (int i = 0; i < 2; ++i) {  // a / f^2 + b = 0
      numerator -= a[i] * b[i];
      denominator += a[i] * a[i];
    }
  }
  if (!(denominator > 0) || !(numerator / denominator > 1e-3)) return std::nullopt;
  return width / std::sqrt(numerator / denominator);
}

double score(const CameraModel& camera, std::span<const ViewPoints* const> views) {
  std::vector<double> rms;
  for (const ViewPoints* view : views) {
    RigidTransform pose;
    double error = std::numeric_limits<double>::infinity();
    if (!find_planar_pose(camera, view->points, view->pixels, &pose, &error))
      error = std::numeric_limits<double>::infinity();
    rms.push_back(error);
  }
  std::sort(rms.begin(), rms.end());
  return rms.empty() ? std::numeric_limits<double>::infinity() : rms[rms.size() / 2];
}

}  // namespace

ViewPoints view_points(const std::vector<Eigen::Vector3d>& target, const std::vector<TargetCorner>& corners) {
  ViewPoints out;
  for (const auto& corner : corners) {
    out.points.push_back(target[static_cast<std::size_t>(corner.id)]);
    out.pixels.push_back(corner.px);
  }
  return out;
}

std::vector<LensGuess> guess_lenses(std::span<const ViewPoints> views, int width, int height) {
  const auto judges = chosen_views(views, 12);
  std::vector<LensGuess> pinholes, wide;
  const auto try_lens = [&](LensModel model, double focal_px, double omega, std::vector<LensGuess>* list) {
    Eigen::VectorXd p = Eigen::VectorXd::Zero(lens_parameter_count(model));
    p.head<4>() << focal_px, focal_px, 0.5 * (width - 1), 0.5 * (height - 1);
    if (model == LensModel::fov) p(4) = omega;
    const auto camera = make_lens(model, width, height, p);
    if (!camera) return;
    const double error = score(*camera, judges);
    if (std::isfinite(error)) list->push_back({*camera, error});
  };
  if (const auto focal = closed_form_focal(views, width, height)) try_lens(LensModel::pinhole, *focal, 0, &pinholes);
  for (double f = 0.25; f < 5; f *= 1.25) try_lens(LensModel::pinhole, f * width, 0, &pinholes);
  for (double f = 0.2; f < 1.6; f *= 1.25) {
    for (const double omega : {0.5, 0.9, 1.2}) try_lens(LensModel::fov, f * width, omega, &wide);
    try_lens(LensModel::kannala_brandt, f * width, 0, &wide);
  }
  const auto better = [](const LensGuess& a, const LensGuess& b) { return a.score_px < b.score_px; };
  std::sort(pinholes.begin(), pinholes.end(), better);
  std::sort(wide.begin(), wide.end(), better);
  std::vector<LensGuess> out;
  if (!wide.empty() && (pinholes.empty() || wide[0].score_px < pinholes[0].score_px)) out.push_back(wide[0]);
  if (!pinholes.empty()) out.push_back(pinholes[0]);
  if (!wide.empty() && (out.size() < 2)) out.push_back(wide[0]);
  return out;
}

}  // namespace parallax
