// Contact shadows (render/mesh_shadow) as textures, computed when a thing appears, tilts or rises, and kept while it
// only moves over the plane. Internal to render/.
#pragma once

#include <array>
#include <list>
#include <memory>

#include "render/draw_list.h"
#include "render/gl_objects.h"

namespace parallax {

class GlShadows {
 public:
  struct Shadow {
    const GlTexture* texture = nullptr;  // null: no shadow
    Eigen::Affine3f plane_from_frame = Eigen::Affine3f::Identity();
    Eigen::Vector2f low = Eigen::Vector2f::Zero(), high = Eigen::Vector2f::Zero();
  };

  // Valid until collect().
  Shadow find(const std::shared_ptr<const Mesh>& mesh, const Eigen::Affine3f& plane_from_model);
  // The rectangle of the plane that a shadow falls on, in its frame.
  static Mesh receiver(const Shadow& shadow, float strength);
  // Once a frame: forgets what has not been asked for in a while.
  void collect();

 private:
  struct Entry {
    std::weak_ptr<const Mesh> mesh;
    Eigen::Matrix<float, 3, 4> above_from_model;
    GlTexture texture;
    Eigen::Vector2f low, high;
    bool falls = false;
    int unused_frames = 0;
  };
  std::list<Entry> entries_;
};

}  // namespace parallax
