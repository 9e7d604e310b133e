#include "render/synthetic_path.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>

#include "render/synthetic_scenes.h"

namespace parallax {

using Eigen::Vector3d;

namespace {

constexpr double kPi = std::numbers::pi;

// 0 before 0, 1 after 1, with zero first and second derivatives at both ends.
double smooth_step(double x) {
  x = std::clamp(x, 0.0, 1.0);
  return x * x * x * (x * (6 * x - 15) + 10);
}

// A number in 0..1 that depends on the seed and a salt.
double hashed(std::uint64_t seed, std::uint64_t salt) {
  std::uint64_t z = seed * 0x9e3779b97f4a7c15u + salt * 0xbf58476d1ce4e5b9u + 0x94d049bb133111ebu;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

// Sum of sines of incommensurate frequencies: the wobble of one axis. Unit amplitude, about.
class Wobble {
 public:
  Wobble(std::uint64_t seed, std::uint64_t salt, double slowest_hz, double fastest_hz) {
    for (std::size_t i = 0; i < kTerms; ++i) {
      const double f = slowest_hz * std::pow(fastest_hz / slowest_hz, static_cast<double>(i) / (kTerms - 1));
      rate_[i] = 2 * kPi * f * (0.85 + 0.3 * hashed(seed, salt * 64 + 2 * i));
      phase_[i] = 2 * kPi * hashed(seed, salt * 64 + 2 * i + 1);
    }
  }
  double operator()(double t) const {
    double sum = 0;
    for (std::size_t i = 0; i < kTerms; ++i)
      sum += std::sin(rate_[i] * t + phase_[i]) * 2 / (kTerms + static_cast<double>(i));
    return sum / 1.5;
  }

 private:
  static constexpr std::size_t kTerms = 4;
  std::array<double, kTerms> rate_{}, phase_{};
};

// The tremor of a hand: about a millimetre and a fifth of a degree.
class Tremor {
 public:
  explicit Tremor(std::uint64_t seed)
      : axes_{Wobble(seed, 1, 0.7, 7), Wobble(seed, 2, 0.7, 7), Wobble(seed, 3, 0.7, 7),
              Wobble(seed, 4, 0.7, 8), Wobble(seed, 5, 0.7, 8), Wobble(seed, 6, 0.7, 8)} {}
  // Applied on the camera's side.
  RigidTransform operator()(double t, double strength) const {
    Vector6d mu;
    for (int i = 0; i < 6; ++i) mu[i] = axes_[static_cast<std::size_t>(i)](t) * (i < 3 ? 0.0011 : 0.0035) * strength;
    return RigidTransform::exp(mu);
  }

 private:
  std::array<Wobble, 6> axes_;
};

// The calm part of the desk: still, slide, exploring.
class DeskPath {
 public:
  explicit DeskPath(std::uint64_t seed) : tremor_(seed) {
    for (std::size_t i = 0; i < phase_.size(); ++i) phase_[i] = 2 * kPi * hashed(seed, 1000 + i);
  }
  RigidTransform operator()(double t) const {
    const double slide = -0.05 + 0.10 * smooth_step((t - 1.0) / 1.5);
    const double tau = t - 2.7, e = smooth_step(tau / 2.5);
    const auto wave = [&](std::size_t i, double rate) { return std::sin(rate * tau + phase_[i]); };
    const Vector3d target(slide + e * (0.26 * wave(0, 0.62) + 0.12 * wave(1, 1.37)),
                          0.06 + e * (0.13 * wave(2, 0.51) + 0.05 * wave(3, 1.21)), 0.0);
    const double azimuth = e * (0.45 * wave(4, 0.43) + 0.2 * wave(5, 0.93));
    const double elevation = 0.76 + e * (0.17 * wave(6, 0.57) + 0.06 * wave(7, 1.33));
    const double distance = 0.68 * (1.0 + e * (0.24 * wave(8, 0.49) + 0.08 * wave(9, 1.07)));
    const Vector3d eye = target + distance * Vector3d(std::sin(azimuth) * std::cos(elevation),
                                                      -std::cos(azimuth) * std::cos(elevation), std::sin(elevation));
    return look_at(eye, target, e * 0.1 * wave(10, 0.71)) * tremor_(t, 1.0);
  }
  RigidTransform tremor(double t, double strength) const { return tremor_(t, strength); }

 private:
  Tremor tremor_;
  std::array<double, 11> phase_{};
};

double frame_time(int frame, double offset_s) { return frame / kSyntheticFps + offset_s; }

// Automatic gain: a slow wander of a few per cent.
double gain_drift(std::uint64_t seed, int frame) {
  const double t = frame_time(frame, 0);
  return 1.0 + 0.035 * std::sin(0.31 * t + 6.28 * hashed(seed, 2000)) +
         0.02 * std::sin(0.83 * t + 6.28 * hashed(seed, 2001));
}

SyntheticMotion calm() {
  SyntheticMotion motion;
  motion.label = [](int) { return FrameLabel{}; };
  motion.gain = [](int) { return 1.0; };
  motion.cover = [](int) { return 0.0; };
  return motion;
}

// The script of `shakes`, in frames: [first, last).
struct Span {
  int first, last;
  bool holds(int frame) const { return frame >= first && frame < last; }
};
constexpr std::array<Span, 2> kShaking = {{{240, 285}, {720, 765}}};
constexpr std::array<Span, 2> kCovered = {{{345, 390}, {810, 840}}};
constexpr Span kUnseen = {540, 590};
constexpr std::array<int, 3> kLightChanges = {640, 680, 860};
constexpr int kKidnapped = 460;        // jumps to a later part of the path...
constexpr double kKidnapAheadS = 9.0;  // ...by so much
constexpr int kCoverFrames = 4;        // a hand takes this long to arrive and to leave

}  // namespace

RigidTransform look_at(const Vector3d& eye, const Vector3d& target, double roll) {
  Eigen::Matrix3d R;
  R.col(2) = (target - eye).normalized();
  R.col(0) = R.col(2).cross(Vector3d::UnitZ()).normalized();
  R.col(1) = R.col(2).cross(R.col(0));
  return {R * exp_so3(Vector3d(0, 0, roll)), eye};
}

SyntheticMotion desk_motion(std::uint64_t seed) {
  SyntheticMotion motion = calm();
  const auto path = std::make_shared<const DeskPath>(seed);
  motion.world_from_camera = [path](int frame, double offset_s) { return (*path)(frame_time(frame, offset_s)); };
  motion.gain = [seed](int frame) { return gain_drift(seed, frame); };
  return motion;
}

SyntheticMotion shakes_motion(std::uint64_t seed) {
  SyntheticMotion motion = calm();
  const auto path = std::make_shared<const DeskPath>(seed);
  std::array<Wobble, 6> axes = {Wobble(seed, 11, 2.5, 5), Wobble(seed, 12, 2.5, 5), Wobble(seed, 13, 2.5, 5),
                                Wobble(seed, 14, 2.5, 5), Wobble(seed, 15, 2.5, 5), Wobble(seed, 16, 2.5, 5)};
  motion.world_from_camera = [path, axes](int frame, double offset_s) {
    const double t = frame_time(frame, offset_s);
    if (kUnseen.holds(frame)) {
      const double s = 0.5 * t;
      return look_at(Vector3d(20 + 0.2 * std::sin(s), -0.7, 0.6), Vector3d(20.1 + 0.1 * std::cos(s), 0.5, 0.2)) *
             path->tremor(t, 1.0);
    }
    RigidTransform pose = (*path)(t + (frame >= kKidnapped ? kKidnapAheadS : 0.0));
    for (const Span& span : kShaking) {
      if (!span.holds(frame)) continue;
      const double first = frame_time(span.first, -0.5 / kSyntheticFps),
                   last = frame_time(span.last, -0.5 / kSyntheticFps);
      const double strength = smooth_step((t - first) / 0.2) * smooth_step((last - t) / 0.2);
      Vector6d mu;
      for (int i = 0; i < 6; ++i) mu[i] = axes[static_cast<std::size_t>(i)](t) * strength * (i < 3 ? 0.03 : 0.16);
      pose = pose * RigidTransform::exp(mu);
    }
    return pose;
  };
  motion.cover = [](int frame) {
    double cover = 0;
    for (const Span& span : kCovered)
      if (span.holds(frame))
        cover = std::min(
            {1.0, (frame - span.first + 1.0) / kCoverFrames, static_cast<double>(span.last - frame) / kCoverFrames});
    return cover;
  };
  motion.gain = [seed](int frame) {
    double gain = gain_drift(seed, frame);
    if (frame >= kLightChanges[0] && frame < kLightChanges[1]) gain *= 0.5;
    if (frame >= kLightChanges[2]) gain *= 1.35;
    return gain;
  };
  motion.label = [cover = motion.cover](int frame) {
    FrameLabel label;
    label.covered = cover(frame) > 0;
    for (const Span& span : kShaking) label.shaking |= span.holds(frame);
    label.unseen = kUnseen.holds(frame);
    label.cut = frame == kKidnapped || frame == kUnseen.first || frame == kUnseen.last;
    for (const int change : kLightChanges) label.light |= frame == change;
    return label;
  };
  return motion;
}

SyntheticMotion walls_motion(int frames) {
  SyntheticMotion motion = calm();
  motion.world_from_camera = [frames](int frame, double offset_s) {
    const double per_frame = frames > 1 ? kWallsTravel / (frames - 1) : 0.0;
    const double s = (frame + offset_s * kSyntheticFps) * per_frame;
    const double arc = kWallsTurnRadius * kPi / 2;
    Vector3d eye(std::min(s, kWallsStraight), 0, kWallsCameraHeight);
    double turn = 0;  // clockwise from above; 0 faces the first wall
    if (s > kWallsStraight) {
      turn = std::min((s - kWallsStraight) / arc, 1.0) * kPi / 2;
      eye.x() += kWallsTurnRadius * std::sin(turn);
      eye.y() += kWallsTurnRadius * (std::cos(turn) - 1);
      eye.y() -= std::max(0.0, s - kWallsStraight - arc);
    }
    return look_at(eye, eye + Vector3d(std::sin(turn), std::cos(turn), 0));
  };
  return motion;
}

SyntheticMotion rotation_motion(std::uint64_t seed) {
  SyntheticMotion motion = calm();
  std::array<double, 3> phase = {2 * kPi * hashed(seed, 31), 2 * kPi * hashed(seed, 32), 2 * kPi * hashed(seed, 33)};
  motion.world_from_camera = [phase](int frame, double offset_s) {
    const double t = frame_time(frame, offset_s), e = smooth_step((t - 0.5) / 2);
    const RigidTransform base = look_at({0, -0.45, 0.5}, {0, 0.06, 0});
    const Vector3d w(0.16 * e * std::sin(0.9 * t + phase[0]), 0.4 * e * std::sin(0.55 * t + phase[1]),
                     0.12 * e * std::sin(0.7 * t + phase[2]));
    return RigidTransform(base.R * exp_so3(w), base.t);
  };
  motion.gain = [seed](int frame) { return gain_drift(seed, frame); };
  return motion;
}

SyntheticMotion room_motion(std::uint64_t seed) {
  SyntheticMotion motion = calm();
  const auto tremor = std::make_shared<const Tremor>(seed);
  std::array<double, 4> phase{};
  for (std::size_t i = 0; i < 4; ++i) phase[i] = 2 * kPi * hashed(seed, 40 + i);
  motion.world_from_camera = [tremor, phase](int frame, double offset_s) {
    const double t = frame_time(frame, offset_s), e = smooth_step((t - 1.0) / 5);
    // Looks outwards from a circle about the middle, which is the sideways motion that initialisation wants.
    const double angle = 2 * kPi / 60 * (t + 0.3 * std::sin(0.5 * t));
    const double radius = 0.55 + 0.25 * e * std::sin(0.17 * t + phase[0]);
    const double height = 1.3 + 0.3 * e * std::sin(0.23 * t + phase[1]);
    const Vector3d out(std::sin(angle), std::cos(angle), 0);
    const Vector3d eye = radius * out + Vector3d(0, 0, height);
    const double look = angle + 0.3 * e * std::sin(0.41 * t + phase[2]);
    const double tilt = 0.12 + 0.18 * e * std::sin(0.29 * t + phase[3]);
    const Vector3d target = eye + Vector3d(std::sin(look), std::cos(look), -std::tan(tilt));
    return look_at(eye, target) * (*tremor)(t, 0.6);
  };
  motion.gain = [seed](int frame) { return gain_drift(seed, frame); };
  return motion;
}

}  // namespace parallax
