#include "app/augmented_interface.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "app/content_drawing.h"
#include "app/interface_drawing.h"
#include "app/level_colours.h"
#include "core/check.h"
#include "render/imgui_fonts.h"

namespace parallax {
namespace {

constexpr ImU32 kStrip = IM_COL32(8, 9, 12, 200);
constexpr ImU32 kGreen = IM_COL32(90, 220, 110, 255);
constexpr ImU32 kRed = IM_COL32(255, 105, 90, 255);
// A box of text is at most this share of the picture's width.
constexpr float kBoxWidth = 0.86f;
constexpr float kPictureWidth = 0.27f;  // of the keyframe's picture when lost
constexpr float kStripHeights = 1.5f;   // of the state line, in heights of the font
// A picture so high has the window's font in its ordinary size, a smaller one a smaller font, down to what can be read.
constexpr float kHeightOfWholeFont = 560, kSmallestFont = 0.8f;

// A dark box with text, its middle at x and its top at y; returns its lower edge. `extra` is kept free below the text.
float text_box(ImDrawList* list, const PictureArea& area, float x, float y, const std::string& text, ImU32 colour,
               float extra, float least_width) {
  const float unit = ImGui::GetFontSize(), wrap = kBoxWidth * area.width - unit;
  const ImVec2 size = text_extent(text, 0, wrap);
  const float width = std::max(size.x, least_width) + unit, height = size.y + unit + extra;
  const float left = std::clamp(x - width / 2, area.x, std::max(area.x, area.x + area.width - width));
  list->AddRectFilled({left, y}, {left + width, y + height}, kInterfaceGround, 0.4f * unit);
  text_at(list, left + (width - size.x) / 2, y + unit / 2, colour, text, 0, wrap);
  return y + height;
}

std::string cut_to(std::string text, float width) {
  while (!text.empty() && text_extent(text).x > width) text.pop_back();
  return text;
}

// As many of the parts of a state line, which two spaces divide, as there is room for.
std::string whole_parts(std::string text, float width) {
  while (text_extent(text).x > width) {
    const auto last = text.rfind("  ");
    if (last == std::string::npos) return cut_to(text, width);
    text.erase(last);
  }
  return text;
}

float draw_legend(ImDrawList* list, float right, float middle) {
  const float unit = ImGui::GetFontSize();
  for (int level = kPyramidLevels - 1; level >= 0; --level) {
    const std::string name = "L" + std::to_string(level);
    right -= text_extent(name).x;
    text_at(list, right, middle - unit / 2, kInterfaceText, name);
    right -= 0.55f * unit;
    list->AddCircleFilled({right, middle}, 0.32f * unit, interface_colour(level_colour(level)));
    right -= 0.8f * unit;
  }
  return right;
}

void draw_state_line(ImDrawList* list, const AugmentedInterface& view) {
  const PictureArea& a = view.area;
  const float unit = ImGui::GetFontSize(), top = a.y + a.height - kStripHeights * unit;
  const float middle = a.y + a.height - kStripHeights * unit / 2;
  list->AddRectFilled({a.x, top}, {a.x + a.width, a.y + a.height}, kStrip);
  float x = a.x + unit / 2, right = a.x + a.width - unit / 2;
  const std::string line = view.tracked != nullptr ? state_line(*view.tracked, view.frames_per_second, view.times) : "";
  const float line_width = text_extent(line).x, remark_width = text_extent(view.remark).x + unit;
  const float legend_width = 4 * (2.2f * unit + text_extent("L0").x - unit);
  const bool points = view.tracked != nullptr && view.tracked->camera_from_world;
  if (view.legend && points && x + line_width + remark_width + legend_width < right)
    right = draw_legend(list, right, middle);
  const float y = middle - unit / 2;
  if (!view.remark.empty()) {
    right -= remark_width;
    text_at(list, std::min(right, x + line_width) + unit, y, kInterfaceAmber, cut_to(view.remark, a.width - unit));
  }
  text_at(list, x, y, kInterfaceText, whole_parts(line, right - x));
}

ImU32 colour_of(HintKind kind) {
  switch (kind) {
    case HintKind::ready:
      return kGreen;
    case HintKind::refused:
    case HintKind::turning:
    case HintKind::losing:
      return kInterfaceAmber;
    default:
      return kInterfaceText;
  }
}

// The gauge: grey ground, filled as far as the camera has moved, with a mark where it is enough.
void draw_gauge(ImDrawList* list, const PictureArea& area, float bottom, double gauge, HintKind kind) {
  const float unit = ImGui::GetFontSize(), width = 0.45f * area.width, height = 0.6f * unit;
  const float left = area.x + (area.width - width) / 2, top = bottom - unit * 0.5f - height;
  filled_bar(list, {left, top}, {left + width, top + height}, static_cast<float>(gauge),
             kind == HintKind::ready ? kGreen : kInterfaceAmber, height / 2);
  list->AddLine({left + width - 1, top - 2}, {left + width - 1, top + height + 2}, kInterfaceText, 2);
}

void draw_hint(ImDrawList* list, const AugmentedInterface& view) {
  const PictureArea& a = view.area;
  const float unit = ImGui::GetFontSize(), top = a.y + 0.6f * unit, centre = a.x + a.width / 2;
  const TrackingResult& tracked = *view.tracked;
  if (tracked.state == TrackingState::lost) {
    if (view.lost_text) text_box(list, a, centre, top, "Lost: move the camera back to where it has been.", kRed, 0, 0);
    if (view.lost_picture != nullptr) {
      const float width = kPictureWidth * a.width, height = width / std::max(view.lost_picture_aspect, 0.1f);
      const float right = a.x + a.width - 0.6f * unit, bottom = a.y + a.height - (kStripHeights + 0.6f) * unit;
      const ImVec2 from{right - width, bottom - height};
      list->AddRectFilled({from.x - 0.3f * unit, from.y - 1.5f * unit}, {right + 0.3f * unit, bottom + 0.3f * unit},
                          kInterfaceGround, 0.3f * unit);
      text_at(list, from.x, from.y - 1.25f * unit, kInterfaceText, "Look at this again:");
      list->AddImage(view.lost_picture, from, {right, bottom});
    }
    return;
  }
  const InitialisationHint hint = initialisation_hint(*view.camera, tracked, view.message, view.hints);
  if (hint.kind == HintKind::none || hint.text.empty()) return;
  const bool gauge = tracked.state == TrackingState::trailing;
  const float bottom =
      text_box(list, a, centre, top, hint.text, colour_of(hint.kind), gauge ? unit : 0, gauge ? 0.45f * a.width : 0);
  if (gauge) draw_gauge(list, a, bottom, hint.gauge, hint.kind);
}

std::string length_text(double metres) {
  char text[40];
  if (metres < 1)
    std::snprintf(text, sizeof text, "%.1f cm", 100 * metres);
  else
    std::snprintf(text, sizeof text, "%.2f m", metres);
  return text;
}

void draw_labels(ImDrawList* list, const AugmentedInterface& view) {
  std::optional<RigidTransform> pose = view.labels_from;
  if (!pose && view.tracked != nullptr) pose = view.tracked->camera_from_world;
  if (view.content == nullptr || !pose) return;
  const float unit = ImGui::GetFontSize();
  struct Placed {
    double depth;
    Eigen::Vector2d px;
    std::string text;
    bool selected;
  };
  std::vector<Placed> labels;
  for (const ContentItem& item : view.content->items()) {
    const bool selected = view.selected && *view.selected == item.id;
    std::string text = item.kind == ContentKind::model && !selected ? "" : item.text;
    if (item.kind == ContentKind::line) text = length_text(item.length_m()) + (text.empty() ? "" : "  ") + text;
    const Eigen::Vector3d in_camera = *pose * label_anchor(item);
    Eigen::Vector2d px;
    if (text.empty() || in_camera.z() <= 0 || !view.camera->project(in_camera, &px)) continue;
    if (!view.camera->in_image(px, -20)) continue;
    labels.push_back({in_camera.z(), px, text, selected});
  }
  // Near ones over far ones.
  std::stable_sort(labels.begin(), labels.end(), [](const Placed& a, const Placed& b) { return a.depth > b.depth; });
  for (const Placed& l : labels) {
    const Eigen::Vector2f at = view.area.from_pixel(*view.camera, l.px);
    const ImVec2 size = text_extent(l.text);
    const float left = std::floor(at.x() - size.x / 2), top = std::floor(at.y() - size.y - 0.4f * unit);
    text_on_ground(list, left, top, l.text, 0.35f * unit, 0.2f * unit);
    if (l.selected)
      list->AddRect({left - 0.35f * unit, top - 0.2f * unit},
                    {left + size.x + 0.35f * unit, top + size.y + 0.2f * unit}, kInterfaceText, 0.25f * unit);
  }
}

// Makes a context current, and what was current before when it goes.
class CurrentContext {
 public:
  explicit CurrentContext(ImGuiContext* context) : before_(ImGui::GetCurrentContext()) {
    ImGui::SetCurrentContext(context);
  }
  ~CurrentContext() { ImGui::SetCurrentContext(before_); }
  CurrentContext(const CurrentContext&) = delete;
  CurrentContext& operator=(const CurrentContext&) = delete;

 private:
  ImGuiContext* before_;
};

}  // namespace

Eigen::Vector2f PictureArea::from_pixel(const CameraModel& camera, const Eigen::Vector2d& px) const {
  return {x + static_cast<float>((px.x() + 0.5) / camera.width()) * width,
          y + static_cast<float>((px.y() + 0.5) / camera.height()) * height};
}

Eigen::Vector2d PictureArea::to_pixel(const CameraModel& camera, const Eigen::Vector2f& at) const {
  return {(at.x() - x) / static_cast<double>(width) * camera.width() - 0.5,
          (at.y() - y) / static_cast<double>(height) * camera.height() - 0.5};
}

std::string state_line(const TrackingResult& tracked, std::optional<double> frames_per_second, bool times) {
  char text[160], part[48];
  if (tracked.camera_from_world || tracked.state == TrackingState::lost) {
    std::snprintf(text, sizeof text, "%s  %d/%d found  %d keyframes  %d points", to_string(tracked.quality),
                  tracked.total_found(), tracked.total_attempted(), tracked.map_keyframes, tracked.map_points);
  } else if (tracked.state == TrackingState::trailing) {
    std::snprintf(text, sizeof text, "%s  %d patches", to_string(tracked.state),
                  static_cast<int>(tracked.trails.size()));
  } else {
    std::snprintf(text, sizeof text, "%s", to_string(tracked.state));
  }
  std::string line = text;
  if (frames_per_second && *frames_per_second > 0) {
    std::snprintf(part, sizeof part, "  %.0f fps", *frames_per_second);
    line += part;
  }
  if (times) {
    std::snprintf(part, sizeof part, "  %.1f ms", static_cast<double>(tracked.times.total));
    line += part;
  }
  return line;
}

void draw_augmented_interface(const AugmentedInterface& view) {
  PARALLAX_CHECK(view.camera != nullptr, "an interface over a picture needs its camera");
  ImDrawList* list = ImGui::GetBackgroundDrawList();
  const PictureArea& a = view.area;
  list->PushClipRect({a.x, a.y}, {a.x + a.width, a.y + a.height}, true);
  if (view.labels) draw_labels(list, view);
  if (view.hint && view.tracked != nullptr) draw_hint(list, view);
  if (!view.banner.empty())
    text_box(list, a, a.x + a.width / 2, a.y + 0.42f * a.height, view.banner, kInterfaceAmber, 0, 0);
  if (view.state_line) draw_state_line(list, view);
  list->PopClipRect();
}

HeadlessInterface::HeadlessInterface(int width, int height) {
  // The first context that is made becomes current by itself.
  const CurrentContext current(ImGui::GetCurrentContext());
  context_ = ImGui::CreateContext();
  ImGui::SetCurrentContext(context_);
  ImGuiIO& io = ImGui::GetIO();
  io.IniFilename = nullptr;
  io.LogFilename = nullptr;
  io.DisplaySize = {static_cast<float>(width), static_cast<float>(height)};
  load_interface_font(std::max(kSmallestFont, static_cast<float>(height) / kHeightOfWholeFont));
}

HeadlessInterface::~HeadlessInterface() { ImGui::DestroyContext(context_); }

void HeadlessInterface::frame(const std::function<void()>& widgets, const std::function<void(const ImDrawData&)>& use) {
  const CurrentContext current(context_);
  ImGui::GetIO().DeltaTime = 1.0f / 30;
  ImGui::NewFrame();
  widgets();
  ImGui::Render();
  use(*ImGui::GetDrawData());
}

}  // namespace parallax
