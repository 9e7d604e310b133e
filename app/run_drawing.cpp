#include "app/run_drawing.h"

#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <future>
#include <optional>
#include <thread>

#include "app/offscreen_view.h"
#include "camera/image_writer.h"
#include "camera/video_writer.h"
#include "core/bounded_queue.h"
#include "core/error.h"

namespace parallax {
namespace {

constexpr double kDefaultRate = 30;
// A frame that waits holds its images (and shares in the map's): grey and colour.
constexpr std::size_t kKeptBytes = std::size_t{160} << 20;
constexpr std::size_t kBytesPerPixel = 4;
constexpr std::size_t kWaiting = 3;  // frames queued when the tracker waits anyway

struct Job {
  Frame frame;
  TrackingResult tracked;
  std::shared_ptr<const TrackingSnapshot> map;
};

std::size_t capacity(const CameraModel& camera, DrawingPace pace, std::size_t most_kept) {
  if (most_kept > 0) return most_kept;
  if (pace == DrawingPace::wait) return kWaiting;
  const auto pixels = static_cast<std::size_t>(camera.width()) * static_cast<std::size_t>(camera.height());
  return std::clamp<std::size_t>(kKeptBytes / (kBytesPerPixel * pixels), 8, 512);
}

}  // namespace

struct RunDrawing::Implementation {
  Implementation(const CameraModel& lens, DrawingPace draw_pace, std::size_t most_kept)
      : camera(lens), pace(draw_pace), queue(capacity(lens, draw_pace, most_kept)) {}

  CameraModel camera;
  DrawingPace pace;
  HintOptions hints;
  std::optional<VideoWriter> video;  // the drawing thread's, once that runs
  std::string folder;
  BoundedQueue<Job> queue;
  int left_out = 0;
  bool closed = false;
  std::promise<void> started;
  std::promise<void> ended;  // with what went wrong
  std::future<void> end = ended.get_future();
  std::jthread thread;

  void write(const Frame& frame, const cv::Mat3b& picture) {
    if (video) video->write(picture);
    if (folder.empty()) return;
    char name[32];
    std::snprintf(name, sizeof name, "%06d.png", frame.index);
    write_png((std::filesystem::path(folder) / name).string(), picture);
  }

  void run(const std::stop_token& stop) {
    std::optional<OffscreenView> view;
    try {
      view.emplace(camera, hints);
    } catch (...) {
      started.set_exception(std::current_exception());
      ended.set_value();
      return;
    }
    started.set_value();
    try {
      while (auto job = queue.pop(stop)) write(job->frame, view->draw(job->frame, job->tracked, job->map.get()));
      if (video && !stop.stop_requested()) video->close();
      ended.set_value();
    } catch (...) {
      ended.set_exception(std::current_exception());
      queue.close();
    }
  }

  // Ends the queue and waits; throws what the drawing thread threw.
  void finish() {
    if (closed) return;
    closed = true;
    queue.close();
    end.get();
  }
};

RunDrawing::RunDrawing(const CameraModel& camera, double frames_per_second, const std::string& video_path,
                       const std::string& frames_folder, DrawingPace pace, bool manual, std::size_t most_kept)
    : implementation_(std::make_unique<Implementation>(camera, pace, most_kept)) {
  Implementation& self = *implementation_;
  self.hints.automatic = !manual;
  self.folder = frames_folder;
  if (!video_path.empty())
    self.video.emplace(video_path, frames_per_second > 0 ? frames_per_second : kDefaultRate,
                       cv::Size(camera.width(), camera.height()));
  if (!frames_folder.empty()) {
    std::error_code error;
    std::filesystem::create_directories(frames_folder, error);
    if (error) throw RunError(frames_folder + ": cannot be made: " + error.message());
  }
  self.thread = std::jthread([&self](const std::stop_token& stop) { self.run(stop); });
  self.started.get_future().get();
}

RunDrawing::~RunDrawing() = default;

void RunDrawing::draw(const Frame& frame, const TrackingResult& tracked,
                      const std::shared_ptr<const TrackingSnapshot>& map) {
  Implementation& self = *implementation_;
  Job job{frame, tracked, map};
  const bool taken = self.pace == DrawingPace::wait ? self.queue.push(std::move(job)) : self.queue.try_push(job);
  if (taken) return;
  if (self.queue.closed()) self.finish();
  ++self.left_out;
}

void RunDrawing::close() { implementation_->finish(); }

int RunDrawing::left_out() const { return implementation_->left_out; }

}  // namespace parallax
