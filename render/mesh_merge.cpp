#include "render/mesh_merge.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include "render/mesh_shapes.h"

namespace parallax {
namespace {

// Colours are told apart by their first bits.
constexpr float kColourSteps = 4;

// A cell, and what tells apart the vertices in it.
using CellKey = std::array<int, 3>;
using ClusterKey = std::array<int, 5>;

CellKey cell_of(const MeshVertex& v, float cell) {
  const auto step = [&](float value) { return static_cast<int>(std::floor(value / cell)); };
  return {step(v.position.x()), step(v.position.y()), step(v.position.z())};
}

ClusterKey cluster_of(const MeshVertex& v, float cell) {
  const CellKey at = cell_of(v, cell);
  const auto step = [](float value) { return static_cast<int>(std::floor(kColourSteps * value)); };
  const int octant = (v.normal.x() > 0 ? 1 : 0) + (v.normal.y() > 0 ? 2 : 0) + (v.normal.z() > 0 ? 4 : 0);
  return {at[0], at[1], at[2], octant, step(v.colour.r) * 256 + step(v.colour.g) * 16 + step(v.colour.b)};
}

struct Cluster {
  MeshVertex sum;
  float count = 0;
  std::uint32_t index = 0;
};

void add(const MeshVertex& v, Cluster* cluster) {
  MeshVertex& sum = cluster->sum;
  if (cluster->count == 0) {
    sum = v;
  } else {
    sum.position += v.position;
    sum.normal += v.normal;
    sum.uv += v.uv;
    sum.colour = {sum.colour.r + v.colour.r, sum.colour.g + v.colour.g, sum.colour.b + v.colour.b,
                  sum.colour.a + v.colour.a};
  }
  cluster->count += 1;
}

MeshVertex middle_of(const Cluster& cluster) {
  MeshVertex out = cluster.sum;
  const float n = cluster.count;
  out.position /= n;
  out.uv /= n;
  const float length = out.normal.norm();
  out.normal = length > 1e-6f ? Eigen::Vector3f(out.normal / length) : Eigen::Vector3f(Eigen::Vector3f::UnitZ());
  out.colour = {out.colour.r / n, out.colour.g / n, out.colour.b / n, out.colour.a / n};
  return out;
}

}  // namespace

std::shared_ptr<const Mesh> merged_model(const Model& model, const std::vector<PartMotion>& part_motion) {
  auto whole = std::make_shared<Mesh>();
  for (const ModelPart& part : model.parts) {
    if (!part.mesh) continue;
    if (!part.mesh->texture.empty()) return nullptr;
    Eigen::Affine3f model_from_part = part.model_from_part;
    for (const PartMotion& motion : part_motion)
      if (motion.part == part.name) model_from_part = model_from_part * motion.motion;
    append(*part.mesh, model_from_part, {}, whole.get());
  }
  return whole;
}

Mesh clustered_mesh(const Mesh& mesh, float cell) {
  // All of a cell are in the middle of the cell, so that nothing gapes where they face different ways.
  std::map<CellKey, Cluster> cells;
  std::map<ClusterKey, Cluster> clusters;
  for (const MeshVertex& v : mesh.vertices) {
    add(v, &cells[cell_of(v, cell)]);
    add(v, &clusters[cluster_of(v, cell)]);
  }
  Mesh out;
  out.two_sided = mesh.two_sided;
  for (auto& [key, cluster] : clusters) {
    cluster.index = static_cast<std::uint32_t>(out.vertices.size());
    out.vertices.push_back(middle_of(cluster));
    out.vertices.back().position = middle_of(cells.at({key[0], key[1], key[2]})).position;
  }
  const auto place = [&](std::uint32_t vertex) { return clusters.at(cluster_of(mesh.vertices[vertex], cell)).index; };
  const auto cell_at = [&](std::uint32_t vertex) { return cell_of(mesh.vertices[vertex], cell); };
  std::set<std::array<CellKey, 3>> seen;
  for (std::size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    const std::uint32_t a = place(mesh.indices[i]), b = place(mesh.indices[i + 1]), c = place(mesh.indices[i + 2]);
    const auto corner = [&](std::uint32_t k) -> const Eigen::Vector3f& { return out.vertices[k].position; };
    if (corner(a) == corner(b) || corner(b) == corner(c) || corner(c) == corner(a)) continue;
    // Many of a cell's triangles have become the same one.
    std::array<CellKey, 3> corners{cell_at(mesh.indices[i]), cell_at(mesh.indices[i + 1]),
                                   cell_at(mesh.indices[i + 2])};
    std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
    if (!seen.insert(corners).second) continue;
    out.indices.insert(out.indices.end(), {a, b, c});
  }
  return out;
}

}  // namespace parallax
