#include "app/initialisation_hint.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cctype>
#include <cmath>

#include "mapper/homography.h"

namespace parallax {
namespace {

constexpr double kDegrees = 180 / M_PI;
constexpr int kMinTrails = 8;
constexpr std::size_t kMostTrails = 200;
// What is left of the trails when a rotation has been taken away: the noise of following them stays below this...
constexpr double kTrailNoise_deg = 0.06;
// ...and the lens is calibrated to about this share of the movement.
constexpr double kLensShare = 0.02;
// Before this nobody can tell a turn from a slide.
constexpr double kBegun_deg = 1.0;
// Trails further off the rotation than this many medians do not help to find it.
constexpr double kOutlier = 3;
// Fewer patches than this give no map, however they move.
constexpr int kNothingToSee = 30;
// Of a ray of length 1: further to the side it has no place on the plane z = 1.
constexpr double kLeastDepth = 0.1;
// How the tracker says what to do when nothing was refused.
constexpr const char* kInstruction = "press ";

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Rotation that takes the columns of `from` to those of `to` with the least square error (Kabsch).
Eigen::Matrix3d best_rotation(const std::vector<Eigen::Vector3d>& from, const std::vector<Eigen::Vector3d>& to,
                              const std::vector<char>& used) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i)
    if (used[i]) sum += to[i] * from[i].transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1);
  return svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
}

double angle_deg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * kDegrees;
}

// Median angle between the two sights of the same places when the rotation has been taken away that a plane's
// homography gives: what a slide gives, however the camera was turned meanwhile. Of the two motions that explain the
// homography, the one whose plane faces the camera more: the other one's lies along the movement, edge on. Zero when
// the trails do not give one.
double planar_parallax_deg(const std::vector<Eigen::Vector3d>& from, const std::vector<Eigen::Vector3d>& to) {
  std::vector<Eigen::Vector3d> rays1, rays2;
  for (std::size_t i = 0; i < from.size(); ++i) {
    if (from[i].z() <= kLeastDepth || to[i].z() <= kLeastDepth) continue;
    rays1.emplace_back(from[i] / from[i].z());
    rays2.emplace_back(to[i] / to[i].z());
  }
  Eigen::Matrix3d H;
  for (int round = 0; round < 3; ++round) {
    if (!fit_homography(rays1, rays2, &H)) return 0;
    std::vector<double> errors(rays1.size());
    for (std::size_t i = 0; i < rays1.size(); ++i) errors[i] = angle_deg(H * rays1[i], rays2[i]);
    const double limit = kOutlier * std::max(median(errors), kTrailNoise_deg);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < rays1.size(); ++i) {
      if (errors[i] > limit) continue;
      rays1[kept] = rays1[i];
      rays2[kept++] = rays2[i];
    }
    if (kept == rays1.size()) break;
    rays1.resize(kept);
    rays2.resize(kept);
  }
  std::array<PlanarPose, 4> poses;
  const int count = decompose_homography(H, &poses);
  const PlanarPose* seen = nullptr;
  double most_facing = 0;
  for (int k = 0; k < count; ++k) {
    const PlanarPose& pose = poses[static_cast<std::size_t>(k)];
    std::vector<double> facing(rays1.size());
    for (std::size_t i = 0; i < rays1.size(); ++i) facing[i] = pose.normal.dot(rays1[i].normalized());
    if (!(median(facing) > most_facing)) continue;
    most_facing = median(facing);
    seen = &pose;
  }
  if (seen == nullptr) return 0;
  std::vector<double> angles(from.size());
  for (std::size_t i = 0; i < from.size(); ++i) angles[i] = angle_deg(seen->second_from_first.R * from[i], to[i]);
  return median(angles);
}

std::string sentence(std::string text) {
  if (!text.empty()) text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
  if (!text.empty() && text.back() != '.') text += '.';
  return text;
}

}  // namespace

TrailMotion trail_motion(const CameraModel& camera, const std::vector<std::array<Eigen::Vector2f, 2>>& trails) {
  std::vector<Eigen::Vector3d> from, to;
  // Evenly chosen: the trails are drawn with every frame, and more of them say no more.
  const std::size_t step = std::max<std::size_t>(1, trails.size() / kMostTrails);
  for (std::size_t i = 0; i < trails.size(); i += step) {
    const auto& t = trails[i];
    Eigen::Vector3d a, b;
    if (!camera.unproject(t[0].cast<double>(), &a) || !camera.unproject(t[1].cast<double>(), &b)) continue;
    from.push_back(a.normalized());
    to.push_back(b.normalized());
  }
  TrailMotion out;
  if (static_cast<int>(from.size()) < kMinTrails) return out;
  std::vector<double> angles(from.size());
  for (std::size_t i = 0; i < from.size(); ++i) angles[i] = angle_deg(from[i], to[i]);
  out.median_deg = median(angles);
  std::vector<char> used(from.size(), 1);
  for (int round = 0; round < 3; ++round) {
    const Eigen::Matrix3d R = best_rotation(from, to, used);
    for (std::size_t i = 0; i < from.size(); ++i) angles[i] = angle_deg(R * from[i], to[i]);
    out.beyond_rotation_deg = median(angles);
    for (std::size_t i = 0; i < from.size(); ++i) used[i] = angles[i] <= kOutlier * out.beyond_rotation_deg;
  }
  out.parallax_deg = planar_parallax_deg(from, to);
  return out;
}

InitialisationHint initialisation_hint(const CameraModel& camera, const TrackingResult& tracked,
                                       const std::string& message, const HintOptions& options) {
  InitialisationHint out;
  out.patches = static_cast<int>(tracked.trails.size());
  switch (tracked.state) {
    case TrackingState::tracking:
    case TrackingState::lost:
      return out;
    case TrackingState::waiting: {
      const bool refused = !tracked.message.empty() && tracked.message.rfind(kInstruction, 0) != 0;
      out.kind = refused ? HintKind::refused : HintKind::hold_still;
      out.text =
          refused ? sentence(tracked.message) : "Hold the camera still over the table, then press " + options.key + ".";
      if (options.automatic && !refused) out.text = "Hold the camera still over the table.";
      return out;
    }
    case TrackingState::initialising:
      out.kind = HintKind::working;
      out.text = "Making the first map: keep the table in view.";
      out.gauge = 1;
      return out;
    case TrackingState::trailing:
      break;
  }
  const TrailMotion motion = trail_motion(camera, tracked.trails);
  const bool begun = motion.median_deg > kBegun_deg;
  const bool moved = motion.beyond_rotation_deg > std::max(kTrailNoise_deg, kLensShare * motion.median_deg);
  out.parallax_deg = moved ? std::max(motion.parallax_deg, motion.beyond_rotation_deg) : 0;
  out.gauge = std::clamp(out.parallax_deg / options.enough_deg, 0.0, 1.0);
  const bool few = out.patches < options.few_patches;
  if (!message.empty() && !options.automatic) {
    out.kind = HintKind::refused;
    out.text = sentence(message);
  } else if (out.patches < kNothingToSee) {
    out.kind = HintKind::losing;
    out.text = "There is too little to see here: choose a view with more texture, or more light.";
  } else if (begun && !moved) {
    out.kind = HintKind::turning;
    out.text = "The camera only turns: slide it sideways.";
  } else if (out.gauge >= 1) {
    out.kind = HintKind::ready;
    out.text = options.automatic ? "Good: hold it there." : "Good: press " + options.key + ".";
  } else if (few) {
    out.kind = HintKind::losing;
    out.text = "Patches are getting lost: slide more slowly, and keep the same part of the table in view.";
  } else {
    out.kind = HintKind::slide;
    out.text = "Slide the camera sideways, about a hand's width.";
  }
  return out;
}

}  // namespace parallax
