#include "render/gl_mesh_cache.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/check.h"
#include "render/gl_lens.h"
#include "render/mesh_subdivision.h"

namespace parallax {
namespace {

// A cut mesh is kept up to this size; beyond it, the mesh is cut for each view, finely only where it is near.
constexpr double kLargestKeptMesh = 60'000;

// Triangles across the image plane have a corner that nothing projects, and are not drawn: there they are cut this
// fine.
constexpr float kAtImagePlane = 0.1f;

struct GpuVertex {
  float position[3], normal[3], uv[2], colour[4];
};

std::vector<GpuVertex> gpu_vertices(const Mesh& mesh) {
  std::vector<GpuVertex> out;
  out.reserve(mesh.vertices.size());
  for (const MeshVertex& v : mesh.vertices)
    out.push_back(
        {{v.position.x(), v.position.y(), v.position.z()},
         {v.normal.x(), v.normal.y(), v.normal.z()},
         {v.uv.x(), v.uv.y()},
         {linear_from_srgb(v.colour.r), linear_from_srgb(v.colour.g), linear_from_srgb(v.colour.b), v.colour.a}});
  return out;
}

float scale_of(const Eigen::Affine3f& a) { return a.linear().colwise().norm().maxCoeff(); }

template <typename Function>
void for_each_triangle(const Mesh& mesh, const Function& function) {
  for (std::size_t i = 0; i + 2 < mesh.indices.size(); i += 3)
    function(mesh.vertices[mesh.indices[i]].position, mesh.vertices[mesh.indices[i + 1]].position,
             mesh.vertices[mesh.indices[i + 2]].position);
}

double triangles_when_cut(const Mesh& mesh, float edge) {
  double total = 0;
  for_each_triangle(mesh, [&](const auto& a, const auto& b, const auto& c) {
    const double longest = std::max({(a - b).norm(), (b - c).norm(), (c - a).norm()});
    total += std::max(1.0, 2 * longest * longest / (edge * edge));
  });
  return total;
}

Mesh cut_for_view(const Mesh& mesh, const Eigen::Affine3f& camera_from_model, const GlLens& lens, float coarseness) {
  return subdivide(mesh, [&](const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
    const Eigen::Vector3f middle = camera_from_model * Eigen::Vector3f(0.5f * (a + b));
    const float half = 0.5f * (camera_from_model.linear() * (a - b)).norm();
    const float distance = std::max(middle.norm() - half, 2 * kNearPlane_m);
    float finer = coarseness;
    if (lens.sees_to_image_plane()) {
      const float z = middle.z(), reach = (camera_from_model.linear() * Eigen::Vector3f(0.5f * (a - b))).z();
      if (std::abs(z) < std::abs(reach)) finer *= kAtImagePlane;
    }
    return 2 * half > finer * lens.max_edge_rad(middle, half) * distance;
  });
}

}  // namespace

Eigen::Affine3f in_camera(const RigidTransform& camera_from_world, const Eigen::Affine3f& world_from_model) {
  const Eigen::Affine3d model = world_from_model.cast<double>();
  Eigen::Affine3f out = Eigen::Affine3f::Identity();
  out.linear() = (camera_from_world.R * model.linear()).cast<float>();
  out.translation() = (camera_from_world * Eigen::Vector3d(model.translation())).cast<float>();
  return out;
}

void GlMesh::upload(const Mesh& mesh, bool dynamic) {
  if (!array_) {
    array_ = GlVertexArray::make();
    vertices_ = GlBuffer::make();
    indices_ = GlBuffer::make();
  }
  const GLenum usage = dynamic ? GL_STREAM_DRAW : GL_STATIC_DRAW;
  const std::vector<GpuVertex> vertices = gpu_vertices(mesh);
  gl().BindVertexArray(array_.id());
  gl().BindBuffer(GL_ARRAY_BUFFER, vertices_.id());
  gl().BufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(vertices.size() * sizeof(GpuVertex)), vertices.data(),
                  usage);
  gl().BindBuffer(GL_ELEMENT_ARRAY_BUFFER, indices_.id());
  gl().BufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(mesh.indices.size() * sizeof(std::uint32_t)),
                  mesh.indices.data(), usage);
  const auto attribute = [](GLuint location, GLint size, std::size_t offset) {
    gl().EnableVertexAttribArray(location);
    gl().VertexAttribPointer(location, size, GL_FLOAT, GL_FALSE, sizeof(GpuVertex),
                             reinterpret_cast<const void*>(offset));
  };
  attribute(0, 3, offsetof(GpuVertex, position));
  attribute(1, 3, offsetof(GpuVertex, normal));
  attribute(2, 2, offsetof(GpuVertex, uv));
  attribute(3, 4, offsetof(GpuVertex, colour));
  gl().BindVertexArray(0);
  count_ = static_cast<GLsizei>(mesh.indices.size());
}

void GlMesh::draw() const {
  gl().BindVertexArray(array_.id());
  gl().DrawElements(GL_TRIANGLES, count_, GL_UNSIGNED_INT, nullptr);
}

GlMeshCache::Entry& GlMeshCache::entry(const std::shared_ptr<const Mesh>& mesh) {
  PARALLAX_CHECK(mesh != nullptr, "an instance without a mesh");
  Entry& entry = entries_[mesh.get()];
  if (entry.mesh.lock() == mesh) return entry;
  for (const std::uint32_t index : mesh->indices)
    PARALLAX_CHECK(index < mesh->vertices.size(), "a triangle names a vertex that is not in its mesh");
  entry = Entry();
  entry.mesh = mesh;
  entry.levels[0].upload(*mesh, false);
  Eigen::AlignedBox3f box;
  for (const MeshVertex& v : mesh->vertices) {
    box.extend(v.position);
    entry.see_through |= v.colour.a < 0.999f;
  }
  if (!box.isEmpty()) {
    entry.centre = box.center();
    entry.radius = 0.5f * box.diagonal().norm();
  }
  for_each_triangle(*mesh, [&](const auto& a, const auto& b, const auto& c) {
    entry.longest_edge = std::max({entry.longest_edge, (a - b).norm(), (b - c).norm(), (c - a).norm()});
  });
  if (!mesh->texture.empty()) {
    entry.texture.upload(mesh->texture, true, true);
    entry.see_through |=
        std::any_of(mesh->texture.begin(), mesh->texture.end(), [](const cv::Vec4b& texel) { return texel[3] < 255; });
  }
  return entry;
}

void GlMeshCache::draw(Entry& entry, const Mesh& mesh, const Eigen::Affine3f& camera_from_model, const GlLens& lens) {
  const float scale = scale_of(camera_from_model);
  const Eigen::Vector3f centre = camera_from_model * entry.centre;
  const float distance = std::max(centre.norm() - entry.radius * scale, 2 * kNearPlane_m);
  if (lens.sees_to_image_plane() && std::abs(centre.z()) < entry.radius * scale) {
    draw_once(mesh, camera_from_model, lens);
    return;
  }
  const double wanted = lens.max_edge_rad(centre, entry.radius * scale) * distance / std::max(scale, 1e-12f);
  if (!(wanted < entry.longest_edge)) {
    entry.levels[0].draw();
    return;
  }
  const int level = static_cast<int>(std::ceil(std::log2(entry.longest_edge / wanted)));
  const float edge = std::ldexp(entry.longest_edge, -level);
  if (level > 12 || triangles_when_cut(mesh, edge) > kLargestKeptMesh) {
    draw_once(mesh, camera_from_model, lens);
    return;
  }
  const auto [found, fresh] = entry.levels.try_emplace(level);
  if (fresh) {
    found->second.upload(
        subdivide(mesh, [edge](const Eigen::Vector3f& a, const Eigen::Vector3f& b) { return (a - b).norm() > edge; }),
        false);
  }
  found->second.draw();
}

void GlMeshCache::draw_once(const Mesh& mesh, const Eigen::Affine3f& camera_from_model, const GlLens& lens,
                            float coarseness) {
  const bool bends = lens.camera().kind() != CameraModelKind::pinhole;
  scratch_.upload(bends ? cut_for_view(mesh, camera_from_model, lens, coarseness) : mesh, true);
  scratch_.draw();
}

void GlMeshCache::collect() {
  std::erase_if(entries_, [](const auto& item) { return item.second.mesh.expired(); });
}

}  // namespace parallax
