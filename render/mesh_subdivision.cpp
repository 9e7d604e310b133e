#include "render/mesh_subdivision.h"

#include <array>
#include <unordered_map>

namespace parallax {
namespace {

constexpr int kMaxDepth = 14;

using TooLong = std::function<bool(const Eigen::Vector3f&, const Eigen::Vector3f&)>;

MeshVertex middle(const MeshVertex& a, const MeshVertex& b) {
  MeshVertex out;
  out.position = 0.5f * (a.position + b.position);
  out.normal = 0.5f * (a.normal + b.normal);
  out.uv = 0.5f * (a.uv + b.uv);
  out.colour = {0.5f * (a.colour.r + b.colour.r), 0.5f * (a.colour.g + b.colour.g), 0.5f * (a.colour.b + b.colour.b),
                0.5f * (a.colour.a + b.colour.a)};
  return out;
}

struct Triangle {
  std::array<std::uint32_t, 3> corner;
  int depth;
};

class Cutter {
 public:
  Cutter(const Mesh& mesh, const TooLong& too_long) : too_long_(too_long) { out_.vertices = mesh.vertices; }

  // The middle of an edge that is too long, else nothing.
  std::optional<std::uint32_t> cut(std::uint32_t a, std::uint32_t b) {
    const std::uint64_t key = (std::uint64_t{std::min(a, b)} << 32) | std::max(a, b);
    if (const auto found = middles_.find(key); found != middles_.end()) return found->second;
    if (!too_long_(out_.vertices[a].position, out_.vertices[b].position)) return std::nullopt;
    const auto index = static_cast<std::uint32_t>(out_.vertices.size());
    out_.vertices.push_back(middle(out_.vertices[a], out_.vertices[b]));
    middles_.emplace(key, index);
    return index;
  }

  Mesh take() { return std::move(out_); }
  Mesh& mesh() { return out_; }

 private:
  const TooLong& too_long_;
  Mesh out_;
  std::unordered_map<std::uint64_t, std::uint32_t> middles_;
};

}  // namespace

Mesh subdivide(const Mesh& mesh, const TooLong& too_long, std::size_t max_triangles) {
  Cutter cutter(mesh, too_long);
  std::vector<Triangle> waiting;
  for (std::size_t i = 0; i + 2 < mesh.indices.size(); i += 3)
    waiting.push_back({{mesh.indices[i], mesh.indices[i + 1], mesh.indices[i + 2]}, 0});
  auto& done = cutter.mesh().indices;
  while (!waiting.empty()) {
    Triangle t = waiting.back();
    waiting.pop_back();
    const auto keep = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
      waiting.push_back({{a, b, c}, t.depth + 1});
    };
    const bool may_cut = t.depth < kMaxDepth && done.size() / 3 + waiting.size() < max_triangles;
    std::array<std::optional<std::uint32_t>, 3> m;  // m[i] on the edge from corner i to the next
    int cuts = 0;
    if (may_cut) {
      for (int i = 0; i < 3; ++i) {
        m[i] = cutter.cut(t.corner[i], t.corner[(i + 1) % 3]);
        cuts += m[i].has_value();
      }
    }
    if (cuts == 0) {
      done.insert(done.end(), t.corner.begin(), t.corner.end());
    } else if (cuts == 3) {
      keep(t.corner[0], *m[0], *m[2]);
      keep(*m[0], t.corner[1], *m[1]);
      keep(*m[2], *m[1], t.corner[2]);
      keep(*m[0], *m[1], *m[2]);
    } else {
      // Turn it so that the first edge is cut and, with two cuts, the second as well.
      int first = 0;
      while (!m[first] || (cuts == 2 && !m[(first + 1) % 3])) ++first;
      const std::uint32_t a = t.corner[first], b = t.corner[(first + 1) % 3], c = t.corner[(first + 2) % 3];
      const std::uint32_t ab = *m[first];
      if (cuts == 1) {
        keep(a, ab, c);
        keep(ab, b, c);
      } else {
        const std::uint32_t bc = *m[(first + 1) % 3];
        keep(ab, b, bc);
        keep(a, ab, bc);
        keep(a, bc, c);
      }
    }
  }
  Mesh out = cutter.take();
  out.texture = mesh.texture;
  out.two_sided = mesh.two_sided;
  return out;
}

}  // namespace parallax
