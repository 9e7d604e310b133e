#include "app/content_drawing.h"

#include <cmath>

#include "app/model_catalogue.h"

namespace parallax {
namespace {

constexpr DrawColour kLabel{1.0f, 0.85f, 0.3f, 1};
constexpr DrawColour kMeasured{1.0f, 0.35f, 0.75f, 1};
constexpr DrawColour kSelected{1, 1, 1, 1};
constexpr double kStem_m = 0.03;  // a label's text stands so high above its foot, in the item's frame
constexpr double kFoot_m = 0.006;
constexpr int kRingSides = 32;
constexpr float kSelectedEmission = 0.35f;

void draw_model(const ContentItem& item, bool selected, DrawList* out) {
  const auto mesh = model_mesh(item.text);
  if (!mesh) return;
  const SimilarityTransform& T = item.world_from_item;
  MeshInstance instance;
  instance.mesh = mesh;
  instance.world_from_model.linear() = (T.s * item.size_m * T.R).cast<float>();
  instance.world_from_model.translation() = T.t.cast<float>();
  if (selected) {
    instance.emission = kSelectedEmission;
    add_ring({T.R, T.t}, 0.75 * T.s * item.size_m, kSelected, 2, out);
  }
  out->meshes.push_back(std::move(instance));
}

void draw_label(const ContentItem& item, bool selected, DrawList* out) {
  const SimilarityTransform& T = item.world_from_item;
  const DrawColour colour = selected ? kSelected : kLabel;
  add_ring({T.R, T.t}, kFoot_m * T.s, colour, 2, out);
  out->world_lines.push_back({T.t.cast<float>(), label_anchor(item).cast<float>(), colour, 2});
  out->world_points.push_back({T.t.cast<float>(), colour, 5});
}

void draw_line(const ContentItem& item, bool selected, DrawList* out) {
  const DrawColour colour = selected ? kSelected : kMeasured;
  const Eigen::Vector3f a = item.position().cast<float>(), b = item.line_end().cast<float>();
  out->world_lines.push_back({a, b, colour, 2.5f});
  out->world_points.push_back({a, colour, 7});
  out->world_points.push_back({b, colour, 7});
}

}  // namespace

Eigen::Vector3d label_anchor(const ContentItem& item) {
  switch (item.kind) {
    case ContentKind::label:
      return item.world_from_item * Eigen::Vector3d(0, 0, kStem_m);
    case ContentKind::line:
      return item.world_from_item * (0.5 * item.end_in_item);
    case ContentKind::model:
      break;
  }
  return item.world_from_item * Eigen::Vector3d(0, 0, 1.1 * item.size_m);
}

void add_ring(const RigidTransform& world_from_ring, double radius_m, const DrawColour& colour, float width_px,
              DrawList* out) {
  const auto at = [&](int i) {
    const double angle = 2 * M_PI * i / kRingSides;
    return Eigen::Vector3f(
        (world_from_ring * Eigen::Vector3d(radius_m * std::cos(angle), radius_m * std::sin(angle), 0.01 * radius_m))
            .cast<float>());
  };
  for (int i = 0; i < kRingSides; ++i) out->world_lines.push_back({at(i), at(i + 1), colour, width_px});
}

void draw_content(const Content& content, std::optional<int> selected, DrawList* out) {
  for (const ContentItem& item : content.items()) {
    const bool chosen = selected && *selected == item.id;
    switch (item.kind) {
      case ContentKind::label:
        draw_label(item, chosen, out);
        break;
      case ContentKind::model:
        draw_model(item, chosen, out);
        break;
      case ContentKind::line:
        draw_line(item, chosen, out);
        break;
    }
  }
}

}  // namespace parallax
