// The text and gauges that belong into the AR picture and into videos, drawn with Dear ImGui: state line, legend, the
// hints and the parallax gauge before initialisation, labels, and the way back when lost. Panels of the window are not
// here.
//
// Between ImGui::NewFrame() and ImGui::Render(), on the thread that owns the ImGui context that is current. Everything
// is laid out in units of the current font and stays inside the picture.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "app/initialisation_hint.h"
#include "core/camera_model.h"
#include "map/content.h"
#include "tracker/tracking_types.h"

struct ImDrawData;
struct ImGuiContext;

namespace parallax {

// Where the camera's picture is, in ImGui's coordinates (top left, display units).
struct PictureArea {
  float x = 0, y = 0, width = 640, height = 480;
  // The centre of pixel (0, 0) lies half a pixel inside the corner.
  Eigen::Vector2f from_pixel(const CameraModel& camera, const Eigen::Vector2d& px) const;
  Eigen::Vector2d to_pixel(const CameraModel& camera, const Eigen::Vector2f& at) const;
};

struct AugmentedInterface {
  PictureArea area;
  const CameraModel* camera = nullptr;      // required
  const TrackingResult* tracked = nullptr;  // null: nothing but `remark`
  const Content* content = nullptr;         // in the world of `tracked`'s map
  // Where labels are seen from; nothing: from where the camera was tracked. For other views, with their own `camera`.
  std::optional<RigidTransform> labels_from;
  std::string message;  // ViewMemory::message()
  std::optional<double> frames_per_second;
  std::string remark;  // kept in the state line whatever happens: "estimated lens", "camera disconnected"
  std::string banner;  // in the middle of the picture: "camera disconnected: ..."; empty: none
  HintOptions hints;
  std::optional<int> selected;  // item of the content
  // The keyframe nearest to where tracking was lost, as SceneRenderer::picture() gives it; null: no picture.
  void* lost_picture = nullptr;
  float lost_picture_aspect = 4.0f / 3;  // width over height
  bool state_line = true, legend = true, labels = true, hint = true;
  bool lost_text = true;  // the words of the hint when lost: a game says them in its own place
  bool times = true;      // milliseconds in the state line
};

void draw_augmented_interface(const AugmentedInterface& view);

// The state line: "good  712/804 found  17 keyframes  2434 points  30 fps  3.1 ms"; `times`: with milliseconds.
std::string state_line(const TrackingResult& tracked, std::optional<double> frames_per_second = {}, bool times = true);

// Dear ImGui without a window, for videos and tests. It has a context of its own, which is current only inside frame():
// two threads must not be in Dear ImGui at once (its current context is one for the process).
class HeadlessInterface {
 public:
  // Size of the picture in pixels; the font grows with it.
  HeadlessInterface(int width, int height);
  ~HeadlessInterface();
  HeadlessInterface(const HeadlessInterface&) = delete;
  HeadlessInterface& operator=(const HeadlessInterface&) = delete;

  // One frame: `widgets` draws, and `use` gets what is to be rendered while the context is still current.
  void frame(const std::function<void()>& widgets, const std::function<void(const ImDrawData&)>& use);

 private:
  ImGuiContext* context_ = nullptr;
};

}  // namespace parallax
