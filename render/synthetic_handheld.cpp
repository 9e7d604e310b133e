#include "render/synthetic_handheld.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/error.h"
#include "core/file_io.h"

namespace parallax {

namespace {

constexpr double kFirst_s = 1000;
constexpr std::size_t kTruthKept = 36000;
// Enough for a hand that never rests: 38 days.
constexpr int kEndless = 100'000'000;

// Takes KEY=VALUE out of the keys of a name; `fallback` when it is not there.
std::string take_key(std::string* name, const std::string& key, const std::string& fallback) {
  const auto question = name->find('?');
  if (question == std::string::npos) return fallback;
  for (auto at = question + 1; at < name->size();) {
    const auto end = std::min(name->find('&', at), name->size());
    if (name->compare(at, key.size() + 1, key + "=") == 0) {
      const std::string value = name->substr(at + key.size() + 1, end - at - key.size() - 1);
      name->erase(at, std::min(end + 1, name->size()) - at);
      while (!name->empty() && (name->back() == '&' || name->back() == '?')) name->pop_back();
      return value;
    }
    at = end + 1;
  }
  return fallback;
}

// Seconds from the start; before the first pose and behind the last one these are held.
RigidTransform pose_at(const Trajectory& path, double seconds) {
  const Timestamp time = from_seconds(seconds);
  const auto after =
      std::lower_bound(path.begin(), path.end(), time, [](const auto& pose, Timestamp t) { return pose.time < t; });
  if (after == path.begin()) return path.front().world_from_camera;
  if (after == path.end()) return path.back().world_from_camera;
  const auto& a = *(after - 1);
  const double part = to_seconds(time - a.time) / to_seconds(after->time - a.time);
  return a.world_from_camera *
         RigidTransform::exp((a.world_from_camera.inverse() * after->world_from_camera).log() * part);
}

}  // namespace

SyntheticHandheld::SyntheticHandheld(const std::string& name, const HandheldOptions& options)
    : description_(name.starts_with("synthetic:") ? name : "synthetic:" + name),
      options_(options),
      hand_(HandMotion::State{}),
      tremor_(0) {
  std::string sequence = name;
  const std::string path = take_key(&sequence, "path", "hand");
  const std::string calibration = take_key(&sequence, "calibration", "own");
  if (calibration != "own" && calibration != "none")
    throw InputError(description_ + ": key calibration: found '" + calibration + "', expected own or none");
  calibrated_ = calibration == "own";
  path_ = path == "hand" ? Path::hand : path == "own" ? Path::own : Path::file;
  if (path.empty())
    throw InputError(description_ + ": key path: found nothing, expected hand, own or a trajectory file");
  if (path_ == Path::file) script_ = parse_trajectory(read_text_file(path), path);

  SourceOptions source_options;
  source_options.colour = options.colour;
  source_ = open_synthetic_source(sequence, source_options, options.threads);
  tremor_ = HandTremor(source_->options().seed);
  if (path_ == Path::own) {
    tick_s_ = 1 / source_->frames_per_second();
    return;
  }
  SyntheticOptions endless = source_->options();
  endless.frames = kEndless;
  endless.fps = kSyntheticFps;
  endless.threads = std::max(endless.threads, options.threads);
  SyntheticMotion motion;
  motion.world_from_camera = [this](int tick, double offset_s) { return world_from_camera(tick, offset_s); };
  motion.label = [](int) { return FrameLabel{}; };
  motion.gain = [](int tick) { return 1.0 + 0.03 * std::sin(0.31 * tick / kSyntheticFps); };
  motion.cover = [](int) { return 0.0; };
  source_ = std::make_unique<SyntheticSource>(description_, endless, motion, source_options);
}

SyntheticHandheld::~SyntheticHandheld() = default;

RigidTransform SyntheticHandheld::world_from_camera(int tick, double offset_s) const {
  const double seconds = tick * tick_s_ + offset_s;
  if (path_ == Path::file) return pose_at(script_, seconds);
  return held_.world_from_camera(offset_s) * tremor_.at(seconds);
}

std::optional<int> SyntheticHandheld::wait_for_tick() {
  const int last = source_->options().frames - 1;
  MutexLock lock(mutex_);
  if (stopped_) return std::nullopt;
  int tick = tick_ + 1;
  if (options_.realtime) {
    const auto now = SteadyClock::now();
    if (!start_) start_ = now;
    const int newest = static_cast<int>(std::chrono::duration<double>(now - *start_).count() / tick_s_);
    if (newest > tick) {
      skipped_ += static_cast<std::uint64_t>(newest - tick);
      tick = newest;
    } else {
      const auto due =
          *start_ + std::chrono::duration_cast<SteadyClock::duration>(std::chrono::duration<double>(tick * tick_s_));
      if (wake_.wait_until(mutex_, due, [this]() PARALLAX_REQUIRES(mutex_) { return stopped_; })) return std::nullopt;
    }
  }
  if (tick > last) return std::nullopt;
  return tick;
}

std::optional<Frame> SyntheticHandheld::next() {
  const std::optional<int> tick = wait_for_tick();
  if (!tick) return std::nullopt;
  hand_.advance(control_.take(), (*tick - tick_) * tick_s_);
  held_ = hand_.state();
  tick_ = *tick;
  Frame frame = source_->frame(*tick);
  frame.index = delivered_++;
  frame.time = from_seconds(kFirst_s + *tick * tick_s_);
  if (truth_.size() >= kTruthKept) truth_.erase(truth_.begin(), truth_.begin() + kTruthKept / 10);
  truth_.push_back({frame.time, source_->world_from_camera(*tick)});
  MutexLock lock(mutex_);
  const auto now = SteadyClock::now();
  std::erase_if(deliveries_, [&](const auto& time) { return now - time > std::chrono::seconds(1); });
  deliveries_.push_back(now);
  return frame;
}

std::optional<CameraModel> SyntheticHandheld::calibration() const {
  if (!calibrated_) return std::nullopt;
  return source_->options().camera;
}

std::vector<StampedPose> SyntheticHandheld::ground_truth() const { return truth_; }

CameraStatus SyntheticHandheld::status() const {
  MutexLock lock(mutex_);
  CameraStatus status;
  status.state = deliveries_.empty() ? CameraState::starting : CameraState::streaming;
  status.requested_fps = frames_per_second();
  const auto now = SteadyClock::now();
  for (const auto& time : deliveries_) status.measured_fps += now - time <= std::chrono::seconds(1) ? 1 : 0;
  if (!deliveries_.empty() && status.measured_fps < 0.8 * frames_per_second() &&
      now - *start_ > std::chrono::seconds(1))
    status.fps_reason = "drawing the synthetic scene takes longer than a frame";
  status.skipped = skipped_;
  return status;
}

void SyntheticHandheld::stop() {
  {
    MutexLock lock(mutex_);
    stopped_ = true;
  }
  wake_.notify_all();
}

void SyntheticHandheld::set_control(const std::string& name, std::int64_t) {
  throw InputError(description_ + ": control '" + name + "': a synthetic camera has none");
}

int SyntheticHandheld::width() const { return source_->options().camera.width(); }
int SyntheticHandheld::height() const { return source_->options().camera.height(); }

std::string SyntheticHandheld::identity() const {
  // What is remembered of one lens is not said of another.
  return std::string("synthetic ") + to_string(source_->options().camera.kind()) + " " + std::to_string(width()) + "x" +
         std::to_string(height());
}

}  // namespace parallax
