#include "app/offscreen_view.h"

namespace parallax {
namespace {

constexpr int kNearestKeyframe = 1;  // the renderer's key of the keyframe that is shown when lost

}  // namespace

OffscreenView::OffscreenView(const CameraModel& camera, const HintOptions& hints)
    : camera_(camera),
      hints_(hints),
      context_(camera.width(), camera.height()),
      interface_(camera.width(), camera.height()) {}

cv::Mat3b OffscreenView::draw(const Frame& frame, const TrackingResult& tracked, const TrackingSnapshot* map,
                              const Content* content, const std::string& remark) {
  return draw(frame, tracked, map, content, remark, Extra{});
}

cv::Mat3b OffscreenView::draw(const Frame& frame, const TrackingResult& tracked, const TrackingSnapshot* map,
                              const Content* content, const std::string& remark, const Extra& extra) {
  const int width = camera_.width(), height = camera_.height();
  context_.make_current();
  memory_.update(tracked);

  AugmentedInput input;
  input.frame = &frame;
  input.tracked = &tracked;
  input.map = map;
  input.content = content;
  input.ambient_light = light_.update(frame.colour.empty() ? cv::Mat(frame.grey) : cv::Mat(frame.colour));
  DrawList list = augmented_view(camera_, input, settings);
  if (extra.scene) extra.scene(&list);
  renderer_.draw(list, {0, 0, width, height});

  AugmentedInterface view;
  view.area = {0, 0, static_cast<float>(width), static_cast<float>(height)};
  view.camera = &camera_;
  view.tracked = &tracked;
  view.content = settings.content ? content : nullptr;
  view.message = memory_.message();
  view.remark = remark;
  view.hints = hints_;
  view.times = false;
  view.lost_text = !extra.interface;
  if (tracked.state == TrackingState::lost && map != nullptr) {
    const auto pose = memory_.last_pose(*map);
    const SnapshotKeyframe* keyframe = pose ? nearest_keyframe(*map, *pose) : nullptr;
    const GreyImage picture = keyframe != nullptr ? keyframe_picture(*keyframe) : GreyImage();
    if (!picture.empty()) {
      view.lost_picture = renderer_.picture(kNearestKeyframe, picture);
      view.lost_picture_aspect = static_cast<float>(picture.cols) / static_cast<float>(picture.rows);
    }
  }
  interface_.frame(
      [&] {
        draw_augmented_interface(view);
        if (extra.interface) extra.interface(view.area);
      },
      [&](const ImDrawData& data) { renderer_.draw_interface(data, width, height); });
  return read_framebuffer(width, height);
}

}  // namespace parallax
