// Meshes on the graphics card: uploaded once, kept while somebody holds the mesh, and cut as finely as the lens asks
// for. Internal to render/.
#pragma once

#include <cmath>
#include <map>
#include <memory>

#include "render/draw_list.h"
#include "render/gl_lens.h"
#include "render/gl_objects.h"

namespace parallax {

// The product is taken in double precision: the camera may be far from the world's origin.
Eigen::Affine3f in_camera(const RigidTransform& camera_from_world, const Eigen::Affine3f& world_from_model);

inline float linear_from_srgb(float c) { return c <= 0.04045f ? c / 12.92f : std::pow((c + 0.055f) / 1.055f, 2.4f); }

// Vertices and triangles in buffers, ready to draw.
class GlMesh {
 public:
  void upload(const Mesh& mesh, bool dynamic);
  void draw() const;

 private:
  GlVertexArray array_;
  GlBuffer vertices_, indices_;
  GLsizei count_ = 0;
};

class GlMeshCache {
 public:
  struct Entry {
    std::weak_ptr<const Mesh> mesh;
    std::map<int, GlMesh> levels;  // 0: as it is; k: every edge at most longest_edge / 2^k
    GlTexture texture;             // of the mesh; no id: white
    Eigen::Vector3f centre = Eigen::Vector3f::Zero();
    float radius = 0, longest_edge = 0;
    bool see_through = false;
  };

  // The entry of a mesh, uploaded on first sight. Valid until collect().
  Entry& entry(const std::shared_ptr<const Mesh>& mesh);

  // Draws an instance, cut as finely as the lens asks for where it is.
  void draw(Entry& entry, const Mesh& mesh, const Eigen::Affine3f& camera_from_model, const GlLens& lens);

  // A mesh that is drawn once, cut for the view. `coarseness` times longer edges will do for what has no sharp outline.
  void draw_once(const Mesh& mesh, const Eigen::Affine3f& camera_from_model, const GlLens& lens, float coarseness = 1);

  // Frees what nobody holds any more.
  void collect();
  std::size_t size() const { return entries_.size(); }

 private:
  std::map<const Mesh*, Entry> entries_;
  GlMesh scratch_;
};

}  // namespace parallax
