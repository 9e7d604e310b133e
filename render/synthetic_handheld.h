// A synthetic scene as a live camera held by the user: 30 frames a second (its own rate, when it moves by itself) as
// time passes, moved with mouse and keys, with the inertia and tremor of a hand, motion blur and sensor noise, and the
// exact truth. It stands in for a USB camera where there is none.
//
// A name is that of a synthetic sequence (render/synthetic_source.h), whose scene, lens, noise and seed it takes, with
// these keys more:
//   path         hand (default): moved by the user; own: the sequence's own motion, which ends with the sequence;
//                else a trajectory file (TUM form, camera to world, seconds from 0), whose last pose is held
//   calibration  own (default), or none: as a camera of which nothing is known
//
// World: that of the scene, z up, metres. Time stamps: 1000 s at the first frame, then as time passes.
#pragma once

#include <condition_variable>
#include <memory>
#include <string>
#include <vector>

#include "camera/live_camera.h"
#include "core/mutex.h"
#include "core/trajectory.h"
#include "render/synthetic_hand.h"
#include "render/synthetic_source.h"

namespace parallax {

struct HandheldOptions {
  bool colour = true;
  // Frames come when their time has come; else as fast as they are asked for, one tick after the other (for tests).
  bool realtime = true;
  int threads = 2;  // that draw a frame
};

class SyntheticHandheld final : public LiveCamera {
 public:
  // Throws InputError for an unknown name, key or value, or a trajectory file that cannot be read.
  SyntheticHandheld(const std::string& name, const HandheldOptions& options = {});
  ~SyntheticHandheld() override;

  // What moves it. The same object for as long as the camera lives; safe from any thread.
  HandControl& hand() { return control_; }
  // Whether it is moved by hand: else by its script.
  bool by_hand() const { return path_ == Path::hand; }

  // One thread. When drawing is slower than 30 frames a second, frames are left out: the newest is delivered.
  std::optional<Frame> next() override;
  std::vector<SourceWarning> take_warnings() override { return {}; }
  double frames_per_second() const override { return 1 / tick_s_; }
  std::string description() const override { return description_; }
  std::optional<CameraModel> calibration() const override;
  // Of the frames delivered so far, the newest 36,000 (20 minutes). From the thread that calls next(), or after stop().
  std::vector<StampedPose> ground_truth() const override;

  CameraStatus status() const override;
  void stop() override;
  std::vector<CameraControl> controls() override { return {}; }
  void set_control(const std::string& name, std::int64_t value) override;
  int width() const override;
  int height() const override;
  std::string identity() const override;

 private:
  enum class Path { hand, own, file };
  // The tick to deliver next: waits for it in real time; nothing when stopped or at the end.
  std::optional<int> wait_for_tick();
  RigidTransform world_from_camera(int tick, double offset_s) const;

  std::string description_;
  HandheldOptions options_;
  Path path_ = Path::hand;
  bool calibrated_ = true;
  double tick_s_ = 1 / kSyntheticFps;
  Trajectory script_;
  std::unique_ptr<SyntheticSource> source_;
  HandControl control_;
  HandMotion hand_;
  HandMotion::State held_;  // at the tick that is being drawn
  HandTremor tremor_;

  std::optional<SteadyClock::time_point> start_;
  int tick_ = -1, delivered_ = 0;
  std::vector<StampedPose> truth_;

  mutable Mutex mutex_;
  std::condition_variable_any wake_;
  bool stopped_ PARALLAX_GUARDED_BY(mutex_) = false;
  std::vector<SteadyClock::time_point> deliveries_ PARALLAX_GUARDED_BY(mutex_);  // within the last second
  std::uint64_t skipped_ PARALLAX_GUARDED_BY(mutex_) = 0;
};

}  // namespace parallax
