// The hand that holds the synthetic camera: what the user asks for (HandControl), the smooth motion that follows
// (HandMotion) and the tremor on top (HandTremor).
//
// World: z up, metres, seconds, radians. Heading: about z, 0 looks along +y, positive turns left. Pitch: positive looks
// up.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "core/mutex.h"
#include "core/se3.h"

namespace parallax {

// What the user asks for. Safe from any thread.
class HandControl {
 public:
  struct Wish {
    // Wanted velocity, metres a second: right, up (of the image) and forward (along the axis).
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
    // To be turned and pushed since the last take(): heading and pitch, radians; along the axis, metres.
    double heading = 0, pitch = 0, push_m = 0;
  };

  // The velocity stays until it is set again.
  void set_velocity(const Eigen::Vector3d& right_up_forward) PARALLAX_EXCLUDES(mutex_);
  void turn(double heading, double pitch) PARALLAX_EXCLUDES(mutex_);
  void push(double metres) PARALLAX_EXCLUDES(mutex_);
  // What was asked for; turns and pushes are handed over once.
  Wish take() PARALLAX_EXCLUDES(mutex_);

 private:
  Mutex mutex_;
  Wish wish_ PARALLAX_GUARDED_BY(mutex_);
};

// A damped follower of the wishes: no jumps in position or velocity. One thread.
class HandMotion {
 public:
  struct State {
    Eigen::Vector3d position{-0.05, -0.43, 0.47};
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
    double heading = 0, pitch = -0.76;
    double heading_rate = 0, pitch_rate = 0;

    // The pose so much later, at constant velocities.
    RigidTransform world_from_camera(double offset_s = 0) const;
  };

  explicit HandMotion(const State& start) : state_(start) {}
  // Follows for so long.
  void advance(const HandControl::Wish& wish, double seconds);
  const State& state() const { return state_; }

 private:
  void step(double seconds);

  State state_;
  Eigen::Vector3d wanted_velocity_ = Eigen::Vector3d::Zero();
  double heading_left_ = 0, pitch_left_ = 0, push_left_m_ = 0;
};

// About a millimetre and a fifth of a degree, applied on the camera's side. A pure function of seed and time.
class HandTremor {
 public:
  explicit HandTremor(std::uint64_t seed);
  RigidTransform at(double seconds) const;

 private:
  static constexpr int kTerms = 4;
  struct Sine {
    double rate = 0, phase = 0, amplitude = 0;
  };
  std::array<std::array<Sine, kTerms>, 6> axes_{};
};

}  // namespace parallax
