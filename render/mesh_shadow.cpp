#include "render/mesh_shadow.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace parallax {
namespace {

constexpr int kSlices = 8;             // of height, each 0.6 times as high as the one above
constexpr float kSharpest = 0.8f;      // texels: the edge of what touches the plane
constexpr float kHighestShare = 3.0f;  // of the extent: what floats higher has no shadow worth drawing
constexpr float kNone = -1.0f;
constexpr int kNextToNothing = 1;  // of 255

// The kernel's share within r is r^2 / (r^2 + h^2). Two Gaussians come within 0.05 of that: shares and sigmas over h.
constexpr float kShares[] = {0.6f, 0.4f}, kSigmas[] = {0.55f, 1.6f};

struct HeightMaps {
  cv::Mat1f highest, lowest;

  void add(int x, int y, float z) {
    if (x < 0 || y < 0 || x >= highest.cols || y >= highest.rows) return;
    float& high = highest(y, x);
    float& low = lowest(y, x);
    high = std::max(high, z);
    low = low == kNone ? z : std::min(low, z);
  }
};

// Marks every texel whose centre the triangle covers; of one that covers none, the corners, so that nothing is lost.
void fill(const std::array<Eigen::Vector3f, 3>& t, HeightMaps* maps) {
  const auto texel = [](float v) { return static_cast<int>(std::floor(v)); };
  const Eigen::Vector2f u = (t[1] - t[0]).head<2>(), v = (t[2] - t[0]).head<2>();
  const float area = u.x() * v.y() - u.y() * v.x();
  bool covers = false;
  if (std::abs(area) > 1e-6f) {
    const auto [low_x, high_x] = std::minmax({t[0].x(), t[1].x(), t[2].x()});
    const auto [low_y, high_y] = std::minmax({t[0].y(), t[1].y(), t[2].y()});
    for (int y = std::max(0, texel(low_y)); y <= std::min(maps->highest.rows - 1, texel(high_y)); ++y) {
      for (int x = std::max(0, texel(low_x)); x <= std::min(maps->highest.cols - 1, texel(high_x)); ++x) {
        const Eigen::Vector2f d(static_cast<float>(x) + 0.5f - t[0].x(), static_cast<float>(y) + 0.5f - t[0].y());
        const float b = (d.x() * v.y() - d.y() * v.x()) / area, c = (u.x() * d.y() - u.y() * d.x()) / area;
        if (b < 0 || c < 0 || b + c > 1) continue;
        maps->add(x, y, std::max(0.0f, t[0].z() + b * (t[1].z() - t[0].z()) + c * (t[2].z() - t[0].z())));
        covers = true;
      }
    }
  }
  if (!covers && std::abs(area) > 1e-6f)
    for (const auto& p : t) maps->add(texel(p.x()), texel(p.y()), std::max(p.z(), 0.0f));
}

// A Gaussian as three running means.
cv::Mat1f blurred(const cv::Mat1f& image, float sigma) {
  if (sigma < 0.4f) return image;
  int width = static_cast<int>(std::lround(std::sqrt(4 * sigma * sigma + 1)));
  width = std::min(width | 1, 2 * image.cols - 1);
  cv::Mat1f out = image;
  for (int i = 0; i < 3; ++i) {
    cv::Mat1f next;
    cv::blur(out, next, {width, width}, {-1, -1}, cv::BORDER_CONSTANT);
    out = next;
  }
  return out;
}

// What the columns between the lowest and the highest surface hide, in slices of height (texels).
cv::Mat1f hidden_by(const HeightMaps& maps, float highest) {
  cv::Mat1f most = cv::Mat1f::zeros(maps.highest.size());
  float top = std::max(highest, 0.5f) * 1.0001f;
  for (int slice = 0; slice < kSlices; ++slice) {
    const float bottom = slice + 1 == kSlices ? -1 : 0.6f * top;
    cv::Mat1f here = cv::Mat1f::zeros(most.size());
    double sum = 0;
    int n = 0;
    for (int y = 0; y < here.rows; ++y) {
      for (int x = 0; x < here.cols; ++x) {
        const float low = maps.lowest(y, x), high = maps.highest(y, x);
        if (low == kNone || low > top || high <= bottom) continue;
        here(y, x) = 1;
        sum += std::min(high, top);
        ++n;
      }
    }
    top = bottom;
    if (n == 0) continue;
    const float height = static_cast<float>(sum / n);
    cv::Mat1f hidden = cv::Mat1f::zeros(most.size());
    for (int i = 0; i < 2; ++i) hidden += kShares[i] * blurred(here, std::max(kSharpest, kSigmas[i] * height));
    most = cv::max(most, hidden);
  }
  return most;
}

// Leaves out the border where there is next to nothing, but for one texel.
void crop(ContactShadow* shadow) {
  const cv::Mat1b& hidden = shadow->hidden;
  const cv::Rect seen = cv::boundingRect(hidden > kNextToNothing);
  if (seen.empty()) {
    *shadow = {};
    return;
  }
  const cv::Rect kept = cv::Rect(seen.x - 1, seen.y - 1, seen.width + 2, seen.height + 2) & cv::Rect({}, hidden.size());
  const Eigen::Vector2f texel =
      (shadow->high - shadow->low).cwiseQuotient(Eigen::Vector2i(hidden.cols, hidden.rows).cast<float>());
  shadow->high =
      shadow->low + texel.cwiseProduct(Eigen::Vector2i(kept.x + kept.width, kept.y + kept.height).cast<float>());
  shadow->low += texel.cwiseProduct(Eigen::Vector2i(kept.x, kept.y).cast<float>());
  shadow->hidden = hidden(kept).clone();
}

}  // namespace

Eigen::Affine3f frame_below(const Eigen::Affine3f& plane_from_model) {
  Eigen::Vector2f along = plane_from_model.linear().col(0).head<2>();
  const Eigen::Vector2f other = plane_from_model.linear().col(1).head<2>();
  if (along.squaredNorm() < 0.25f * other.squaredNorm()) along = Eigen::Vector2f(other.y(), -other.x());
  const float yaw = along.norm() > 1e-12f ? std::atan2(along.y(), along.x()) : 0.0f;
  Eigen::Affine3f out = Eigen::Affine3f::Identity();
  out.linear() = Eigen::AngleAxisf(yaw, Eigen::Vector3f::UnitZ()).toRotationMatrix();
  out.translation().head<2>() = plane_from_model.translation().head<2>();
  return out;
}

ContactShadow contact_shadow(const Mesh& mesh, const Eigen::Affine3f& above_from_model, int size) {
  ContactShadow out;
  std::vector<Eigen::Vector3f> points;
  points.reserve(mesh.vertices.size());
  Eigen::AlignedBox3f box;
  for (const MeshVertex& v : mesh.vertices) {
    points.push_back(above_from_model * v.position);
    box.extend(points.back());
  }
  if (box.isEmpty() || box.max().z() <= 0 || !box.min().allFinite() || !box.max().allFinite()) return out;
  const float extent = std::max(box.sizes().x(), box.sizes().y());
  if (!(extent > 0) || box.min().z() > kHighestShare * extent) return out;
  const float height = std::min(box.max().z(), 1.5f * extent);
  const float side = extent + 4 * height;
  const float texels_per_metre = static_cast<float>(size) / side;
  const Eigen::Vector2f centre = box.center().head<2>();
  out.low = centre.array() - 0.5f * side;
  out.high = centre.array() + 0.5f * side;

  HeightMaps maps{cv::Mat1f(size, size, kNone), cv::Mat1f(size, size, kNone)};
  for (auto& p : points) {
    p.head<2>() -= out.low;
    p *= texels_per_metre;
  }
  for (std::size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    const std::array<Eigen::Vector3f, 3> t{points[mesh.indices[i]], points[mesh.indices[i + 1]],
                                           points[mesh.indices[i + 2]]};
    if (t[0].z() < 0 && t[1].z() < 0 && t[2].z() < 0) continue;
    fill(t, &maps);
  }
  const float highest = box.max().z() * texels_per_metre;
  const cv::Mat1f share = hidden_by(maps, highest);

  out.hidden.create(size, size);
  const float middle = 0.5f * static_cast<float>(size - 1);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      const float edge = std::max(std::abs(static_cast<float>(x) - middle), std::abs(static_cast<float>(y) - middle));
      const float fade = std::clamp((middle - edge) / (0.3f * middle), 0.0f, 1.0f);
      const float smooth = fade * fade * (3 - 2 * fade);
      out.hidden(y, x) = cv::saturate_cast<unsigned char>(255 * std::min(1.0f, share(y, x)) * smooth);
    }
  }
  crop(&out);
  return out;
}

}  // namespace parallax
