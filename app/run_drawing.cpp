#include "app/run_drawing.h"

#include <cstdio>
#include <filesystem>
#include <vector>

#include "camera/image_writer.h"
#include "core/error.h"
#include "render/overlay.h"

namespace parallax {

RunDrawing::RunDrawing(const CameraModel& camera, double frames_per_second, const std::string& video_path,
                       const std::string& frames_folder)
    : camera_(camera), folder_(frames_folder) {
  if (!video_path.empty())
    video_.emplace(video_path, frames_per_second > 0 ? frames_per_second : 30.0,
                   cv::Size(camera.width(), camera.height()));
  if (!folder_.empty()) {
    std::error_code error;
    std::filesystem::create_directories(folder_, error);
    if (error) throw RunError(folder_ + ": cannot be made: " + error.message());
  }
}

std::string state_line(const TrackingResult& tracked) {
  char text[160];
  if (!tracked.camera_from_world) {
    std::snprintf(text, sizeof text, "%s  %s", to_string(tracked.state), tracked.message.c_str());
    return text;
  }
  std::snprintf(text, sizeof text, "%s  %d/%d found  %d keyframes  %d points  %.1f ms", to_string(tracked.quality),
                tracked.total_found(), tracked.total_attempted(), tracked.map_keyframes, tracked.map_points,
                static_cast<double>(tracked.times.total));
  return text;
}

void RunDrawing::draw(const Frame& frame, const TrackingResult& tracked, const std::optional<Plane>& plane) {
  OverlayInput input;
  input.background = frame.colour.empty() ? cv::Mat(frame.grey) : cv::Mat(frame.colour);
  input.camera = camera_;
  input.tracked = tracked.camera_from_world.has_value();
  if (input.tracked) input.camera_from_world = *tracked.camera_from_world;
  input.coarse_stage = tracked.coarse_stage;
  std::vector<OverlayPoint> points;
  for (const TrackedPoint& p : tracked.points)
    if (p.found) points.push_back({p.pixel, p.level, true});
  input.points = points;
  std::vector<OverlayTrail> trails;
  for (const auto& t : tracked.trails) trails.push_back({t[0], t[1]});
  input.trails = trails;
  if (plane) input.grid = OverlayGrid{plane->world_from_plane, plane->extent_m, 10};
  input.state_line = state_line(tracked);
  const cv::Mat3b picture = draw_overlay(input);
  if (video_) video_->write(picture);
  if (!folder_.empty()) {
    char name[32];
    std::snprintf(name, sizeof name, "%06d.png", frame.index);
    write_png((std::filesystem::path(folder_) / name).string(), picture);
  }
}

void RunDrawing::close() {
  if (video_) video_->close();
}

}  // namespace parallax
