// Lines and points as triangles in pixels of the viewport, with what the fragment shader needs for smooth edges. World
// lines are cut into short pieces, each end of which goes through CameraModel::project(), so they bend as the lens
// bends them. Internal to render/.
#pragma once

#include <vector>

#include "render/draw_list.h"
#include "render/gl_lens.h"
#include "render/gl_objects.h"

namespace parallax {

struct StrokeVertex {
  float place[3];   // viewport pixels from the top left corner, depth
  float extent[4];  // see stroke_vertex.glsl
  float shape;
  float colour[4];  // linear
};

struct Strokes {
  std::vector<StrokeVertex> vertices;
  std::vector<std::uint32_t> indices;
};

// Makes strokes for one lens and one size of viewport.
class StrokeMaker {
 public:
  // `image`: the size in pixels that screen positions count in, the camera's.
  StrokeMaker(const GlLens& lens, cv::Size image, cv::Size viewport);

  void world_line(const RigidTransform& camera_from_world, const WorldLine& line, Strokes* out) const;
  void world_point(const RigidTransform& camera_from_world, const WorldPoint& point, Strokes* out) const;
  void grid(const RigidTransform& camera_from_world, const PlaneGrid& grid, Strokes* out) const;
  void screen_line(const ScreenLine& line, Strokes* out) const;
  void screen_point(const ScreenPoint& point, Strokes* out) const;

 private:
  struct Joint {
    Eigen::Vector2f place;
    float depth;
  };
  Eigen::Vector2f to_viewport(const Eigen::Vector2d& px) const;
  void line_in_camera(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const DrawColour& colour, float width_px,
                      Strokes* out) const;
  void cut(const Eigen::Vector3d& a, const Eigen::Vector3d& b, int depth, std::vector<Joint>* chain, Strokes* out,
           const DrawColour& colour, float width_px) const;
  void chain(const std::vector<Joint>& joints, const DrawColour& colour, float width_px, Strokes* out) const;
  void blob(const Joint& at, const DrawColour& colour, float size_px, bool ring, Strokes* out) const;

  const GlLens& lens_;
  Eigen::Vector2f scale_, size_;
};

// Strokes on the graphics card, filled anew for each batch.
class GlStrokes {
 public:
  void draw(const Strokes& strokes);

 private:
  GlVertexArray array_;
  GlBuffer vertices_, indices_;
};

}  // namespace parallax
