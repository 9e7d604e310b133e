#include "app/run_drawing.h"

#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <future>
#include <optional>
#include <thread>
#include <utility>

#include "app/game_hud.h"
#include "app/offscreen_view.h"
#include "camera/image_writer.h"
#include "camera/video_writer.h"
#include "core/bounded_queue.h"
#include "core/error.h"
#include "core/interruption.h"
#include "mapper/surface_reconstruction.h"
#include "render/occlusion_mask.h"

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

// As long as it takes.
constexpr double kWholeSurface_ms = 1e9;

}  // namespace

struct RunDrawing::Implementation {
  Implementation(const CameraModel& lens, RunDrawingOptions wanted)
      : camera(lens), options(std::move(wanted)), queue(capacity(lens, options.pace, options.most_kept)) {}

  CameraModel camera;
  RunDrawingOptions options;
  std::optional<VideoWriter> video;  // the drawing thread's, once that runs
  BoundedQueue<Job> queue;
  int left_out = 0;
  bool closed = false;
  std::optional<GameOutcome> outcome;  // once the thread has ended
  std::promise<void> started;
  std::promise<void> ended;  // with what went wrong
  std::future<void> end = ended.get_future();
  std::jthread thread;

  // What the drawing thread works with.
  struct Stage {
    std::optional<OffscreenView> view;  // when there is something to draw for
    std::optional<GameSession> game;
    std::vector<GameSight> sights;
    std::optional<SurfaceReconstruction> surface;
    std::optional<OcclusionMask> mask;
  };

  void set_up(Stage* stage) const {
    HintOptions hints;
    hints.automatic = !options.manual;
    if (video || !options.frames_folder.empty()) stage->view.emplace(camera, hints);
    if (!options.game) return;
    stage->game.emplace(*options.game, options.models);
    stage->game->set_scripted(true);
    stage->surface.emplace(camera);
    if (options.occlusion) stage->mask.emplace(camera);
    if (stage->view) {  // the table is for the game
      stage->view->settings.points = stage->view->settings.grid = stage->view->settings.other_planes = false;
    }
  }

  // The whole surface is worked out before the game goes on: the same map gives the same game.
  void play(const Job& job, Stage* stage) const {
    if (job.map && job.map->plane) {
      stage->surface->update(job.map);
      const Interruption never;
      while (stage->surface->step(kWholeSurface_ms, never)) {
      }
      stage->game->set_surface(stage->surface->surface());
    }
    stage->game->frame(job.frame, job.tracked, job.map.get(), GameInput{});
    stage->game->runner().take_sounds();
    if (const auto sight = stage->game->sight()) stage->sights.push_back(*sight);
  }

  void handle(const Job& job, Stage* stage) {
    if (stage->game) play(job, stage);
    if (!stage->view) return;
    OffscreenView::Extra extra;
    if (stage->game) {
      extra.scene = [&](DrawList* list) {
        stage->game->draw(list);
        if (stage->mask && stage->surface->surface() && job.tracked.camera_from_world)
          list->occlusion_depth =
              stage->mask->update(*stage->surface->surface(), *job.tracked.camera_from_world, job.frame.grey);
      };
      extra.interface = [&](const PictureArea& area) {
        if (job.map && !job.map->empty())
          draw_game_hud({area, stage->game->runner().game().info().title, stage->game->runner().game().hud(),
                         stage->game->status(), stage->game->advice(), &camera,
                         stage->game->runner().phase() != GamePhase::idle});
      };
    }
    write(job.frame, stage->view->draw(job.frame, job.tracked, job.map.get(), nullptr, {}, extra));
  }

  void write(const Frame& frame, const cv::Mat3b& picture) {
    if (video) video->write(picture);
    if (options.frames_folder.empty()) return;
    char name[32];
    std::snprintf(name, sizeof name, "%06d.png", frame.index);
    write_png((std::filesystem::path(options.frames_folder) / name).string(), picture);
  }

  void run(const std::stop_token& stop) {
    Stage stage;
    try {
      set_up(&stage);
    } catch (...) {
      started.set_exception(std::current_exception());
      ended.set_value();
      return;
    }
    started.set_value();
    try {
      while (auto job = queue.pop(stop)) handle(*job, &stage);
      if (video && !stop.stop_requested()) video->close();
      if (stage.game) {
        outcome = outcome_of(*stage.game, options.game->options);
        outcome->sights = std::move(stage.sights);
      }
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

RunDrawing::RunDrawing(const CameraModel& camera, double frames_per_second, const RunDrawingOptions& options)
    : implementation_(std::make_unique<Implementation>(camera, options)) {
  Implementation& self = *implementation_;
  if (!options.video_path.empty())
    self.video.emplace(options.video_path, frames_per_second > 0 ? frames_per_second : kDefaultRate,
                       cv::Size(camera.width(), camera.height()));
  if (!options.frames_folder.empty()) {
    std::error_code error;
    std::filesystem::create_directories(options.frames_folder, error);
    if (error) throw RunError(options.frames_folder + ": cannot be made: " + error.message());
  }
  self.thread = std::jthread([&self](const std::stop_token& stop) { self.run(stop); });
  self.started.get_future().get();
}

RunDrawing::~RunDrawing() = default;

void RunDrawing::draw(const Frame& frame, const TrackingResult& tracked,
                      const std::shared_ptr<const TrackingSnapshot>& map) {
  Implementation& self = *implementation_;
  Job job{frame, tracked, map};
  const bool taken =
      self.options.pace == DrawingPace::wait ? self.queue.push(std::move(job)) : self.queue.try_push(job);
  if (taken) return;
  if (self.queue.closed()) self.finish();
  ++self.left_out;
}

void RunDrawing::close() { implementation_->finish(); }

int RunDrawing::left_out() const { return implementation_->left_out; }

const std::optional<GameOutcome>& RunDrawing::game() const { return implementation_->outcome; }

}  // namespace parallax
