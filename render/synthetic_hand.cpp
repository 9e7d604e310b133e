#include "render/synthetic_hand.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace parallax {

using Eigen::Vector3d;

namespace {

// How quickly the hand follows: time constants of its velocity and of its turning.
constexpr double kFollow_s = 0.12, kTurn_s = 0.08;
constexpr double kStep_s = 1.0 / 480;
// The camera stays within reach of the desk and does not look over its own back.
const Vector3d kLowest(-1.2, -1.6, 0.06), kHighest(1.2, 0.75, 1.8);
constexpr double kLowestPitch = -1.5, kHighestPitch = 0.6;

struct Axes {
  Vector3d right, up, forward;
};

Axes axes_of(double heading, double pitch) {
  const Vector3d forward(-std::sin(heading) * std::cos(pitch), std::cos(heading) * std::cos(pitch), std::sin(pitch));
  const Vector3d right(std::cos(heading), std::sin(heading), 0);
  return {right, right.cross(forward), forward};
}

}  // namespace

void HandControl::set_velocity(const Vector3d& right_up_forward) {
  MutexLock lock(mutex_);
  wish_.velocity = right_up_forward;
}

void HandControl::turn(double heading, double pitch) {
  MutexLock lock(mutex_);
  wish_.heading += heading;
  wish_.pitch += pitch;
}

void HandControl::push(double metres) {
  MutexLock lock(mutex_);
  wish_.push_m += metres;
}

HandControl::Wish HandControl::take() {
  MutexLock lock(mutex_);
  const Wish taken = wish_;
  wish_.heading = wish_.pitch = wish_.push_m = 0;
  return taken;
}

RigidTransform HandMotion::State::world_from_camera(double offset_s) const {
  const Axes axes = axes_of(heading + heading_rate * offset_s, pitch + pitch_rate * offset_s);
  Eigen::Matrix3d R;
  R.col(0) = axes.right;
  R.col(1) = -axes.up;
  R.col(2) = axes.forward;
  return {R, position + velocity * offset_s};
}

void HandMotion::advance(const HandControl::Wish& wish, double seconds) {
  wanted_velocity_ = wish.velocity;
  heading_left_ += wish.heading;
  pitch_left_ += wish.pitch;
  push_left_m_ += wish.push_m;
  const int steps = std::max(1, static_cast<int>(std::ceil(seconds / kStep_s)));
  for (int i = 0; i < steps; ++i) step(seconds / steps);
}

void HandMotion::step(double seconds) {
  // What is left to turn and to push is approached exponentially; the rates themselves are smoothed too.
  const double blend = 1 - std::exp(-seconds / kTurn_s);
  state_.heading_rate += blend * (heading_left_ / kTurn_s / 2 - state_.heading_rate);
  state_.pitch_rate += blend * (pitch_left_ / kTurn_s / 2 - state_.pitch_rate);
  const double turned = state_.heading_rate * seconds, tilted = state_.pitch_rate * seconds;
  heading_left_ -= turned;
  pitch_left_ -= tilted;
  state_.heading += turned;
  const double pitch = std::clamp(state_.pitch + tilted, kLowestPitch, kHighestPitch);
  if (pitch != state_.pitch + tilted) pitch_left_ = state_.pitch_rate = 0;
  state_.pitch = pitch;

  const Axes axes = axes_of(state_.heading, state_.pitch);
  const double push = push_left_m_ / (2 * kFollow_s);
  const Vector3d wanted =
      axes.right * wanted_velocity_.x() + axes.up * wanted_velocity_.y() + axes.forward * (wanted_velocity_.z() + push);
  push_left_m_ -= push * seconds;
  state_.velocity += (1 - std::exp(-seconds / kFollow_s)) * (wanted - state_.velocity);
  const Vector3d free = state_.position + state_.velocity * seconds;
  state_.position = free.cwiseMax(kLowest).cwiseMin(kHighest);
  for (int i = 0; i < 3; ++i)
    if (state_.position[i] != free[i]) state_.velocity[i] = 0;
}

HandTremor::HandTremor(std::uint64_t seed) {
  std::mt19937_64 random(seed * 0x9e3779b97f4a7c15u + 0x5bd1e995u);
  const auto part = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
  for (std::size_t axis = 0; axis < axes_.size(); ++axis) {
    const double amplitude = axis < 3 ? 0.0008 : 0.0025;  // metres, radians
    for (int i = 0; i < kTerms; ++i) {
      const double hz = 0.7 * std::pow(10.0, static_cast<double>(i) / (kTerms - 1)) * (0.85 + 0.3 * part());
      axes_[axis][static_cast<std::size_t>(i)] = {2 * std::numbers::pi * hz, 2 * std::numbers::pi * part(),
                                                  amplitude / (1.0 + i)};
    }
  }
}

RigidTransform HandTremor::at(double seconds) const {
  Vector6d mu = Vector6d::Zero();
  for (std::size_t axis = 0; axis < axes_.size(); ++axis)
    for (const Sine& s : axes_[axis]) mu[static_cast<int>(axis)] += s.amplitude * std::sin(s.rate * seconds + s.phase);
  return RigidTransform::exp(mu);
}

}  // namespace parallax
