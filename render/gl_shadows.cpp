#include "render/gl_shadows.h"

#include <cmath>
#include <opencv2/core.hpp>

#include "render/mesh_shadow.h"

namespace parallax {
namespace {
constexpr int kKeptFrames = 60;
constexpr float kSame = 2e-3f;  // of the size: what a pose may differ by and cast the same shadow
// A room is brighter above than to the sides, so what hides a little of the sky hides more of the light: the light left
// is the share of sky left to this power.
constexpr double kRoom = 1.8;
constexpr float kStrength = 0.9f;  // the rest comes off the things around

cv::Mat1b light_lost(const cv::Mat1b& hidden) {
  cv::Mat1b table(1, 256), out;
  for (int i = 0; i < 256; ++i)
    table(0, i) = cv::saturate_cast<unsigned char>(255 * (1 - std::pow(1 - i / 255.0, kRoom)));
  cv::LUT(hidden, table, out);
  return out;
}

}  // namespace

GlShadows::Shadow GlShadows::find(const std::shared_ptr<const Mesh>& mesh, const Eigen::Affine3f& plane_from_model) {
  Shadow out;
  if (!plane_from_model.matrix().allFinite()) return out;
  out.plane_from_frame = frame_below(plane_from_model);
  const Eigen::Affine3f above_from_model = out.plane_from_frame.inverse() * plane_from_model;
  const Eigen::Matrix<float, 3, 4> key = above_from_model.matrix().topRows<3>();
  const float tolerance = kSame * key.leftCols<3>().norm();
  Entry* entry = nullptr;
  for (Entry& e : entries_) {
    if (e.mesh.lock() != mesh) continue;
    const Eigen::Matrix<float, 3, 4> difference = e.above_from_model - key;
    float size = 0;  // the height counts in the mesh's own size
    for (const auto& v : {e.low, e.high}) size = std::max(size, v.cwiseAbs().maxCoeff());
    if (difference.leftCols<3>().cwiseAbs().maxCoeff() > tolerance) continue;
    if (difference.col(3).cwiseAbs().maxCoeff() > 0.5f * kSame * size) continue;
    entry = &e;
    break;
  }
  if (entry == nullptr) {
    const ContactShadow shadow = contact_shadow(*mesh, above_from_model);
    entry = &entries_.emplace_back();
    entry->mesh = mesh;
    entry->above_from_model = key;
    entry->low = shadow.low;
    entry->high = shadow.high;
    entry->falls = !shadow.hidden.empty();
    if (entry->falls) entry->texture.upload(light_lost(shadow.hidden));
  }
  entry->unused_frames = 0;
  out.texture = entry->falls ? &entry->texture : nullptr;
  out.low = entry->low;
  out.high = entry->high;
  return out;
}

Mesh GlShadows::receiver(const Shadow& shadow, float strength) {
  Mesh out;
  for (const float v : {0.0f, 1.0f}) {
    for (const float u : {0.0f, 1.0f}) {
      MeshVertex vertex;
      vertex.position = {shadow.low.x() + u * (shadow.high.x() - shadow.low.x()),
                         shadow.low.y() + v * (shadow.high.y() - shadow.low.y()), 0};
      vertex.uv = {u, v};
      vertex.colour.a = kStrength * strength;
      out.vertices.push_back(vertex);
    }
  }
  out.indices = {0, 1, 2, 2, 1, 3};
  return out;
}

void GlShadows::collect() {
  std::erase_if(entries_, [](Entry& e) { return e.mesh.expired() || ++e.unused_frames > kKeptFrames; });
}

}  // namespace parallax
