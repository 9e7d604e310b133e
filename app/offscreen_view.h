// The AR view without a window: the same content, shaders and text as on the screen, drawn on OSMesa.
//
// Belongs to the thread that made it (its OpenGL context is current there), and uses Dear ImGui while it draws: no
// other thread may use Dear ImGui at that moment.
#pragma once

#include <functional>
#include <opencv2/core/mat.hpp>
#include <string>

#include "app/augmented_interface.h"
#include "app/augmented_view.h"
#include "app/view_memory.h"
#include "render/gl_context.h"
#include "render/light_estimate.h"
#include "render/scene_renderer.h"

namespace parallax {

class OffscreenView {
 public:
  // Pictures have the camera's size. Throws RunError when OSMesa is not there.
  explicit OffscreenView(const CameraModel& camera, const HintOptions& hints = {});

  // The next frame. What is drawn depends on the frames so far (light, hints), and on nothing else: no clock, and no
  // times in the state line, so that the same run gives the same pictures. `map` and `content` may be null.
  cv::Mat3b draw(const Frame& frame, const TrackingResult& tracked, const TrackingSnapshot* map,
                 const Content* content = nullptr, const std::string& remark = {});

  // Further things to draw (a game): appended to the picture, and written over it between ImGui's frames.
  struct Extra {
    std::function<void(DrawList*)> scene;
    std::function<void(const PictureArea&)> interface;
  };
  cv::Mat3b draw(const Frame& frame, const TrackingResult& tracked, const TrackingSnapshot* map, const Content* content,
                 const std::string& remark, const Extra& extra);

  AugmentedSettings settings;

 private:
  CameraModel camera_;
  HintOptions hints_;
  OffscreenContext context_;
  SceneRenderer renderer_;
  HeadlessInterface interface_;
  LightEstimate light_;
  ViewMemory memory_;
};

}  // namespace parallax
