#include "render/gl_strokes.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "render/gl_mesh_cache.h"

namespace parallax {
namespace {

constexpr int kMaxCuts = 14;
// Of what the lens asks for: half of the deviation.
constexpr double kLineFineness = 0.7;
// Lines and points lie a little nearer than the surface they mark.
constexpr double kTowardsCamera = 0.998;

struct LinearColour {
  float r, g, b, a;
  explicit LinearColour(const DrawColour& c)
      : r(linear_from_srgb(c.r)), g(linear_from_srgb(c.g)), b(linear_from_srgb(c.b)), a(c.a) {}
};

double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace

StrokeMaker::StrokeMaker(const GlLens& lens, cv::Size image, cv::Size viewport)
    : lens_(lens),
      scale_(static_cast<float>(viewport.width) / static_cast<float>(image.width),
             static_cast<float>(viewport.height) / static_cast<float>(image.height)),
      size_(static_cast<float>(viewport.width), static_cast<float>(viewport.height)) {}

Eigen::Vector2f StrokeMaker::to_viewport(const Eigen::Vector2d& px) const {
  return ((px.cast<float>().array() + 0.5f) * scale_.array()).matrix();
}

void StrokeMaker::world_line(const RigidTransform& camera_from_world, const WorldLine& line, Strokes* out) const {
  line_in_camera(camera_from_world * line.a.cast<double>(), camera_from_world * line.b.cast<double>(), line.colour,
                 line.width_px, out);
}

void StrokeMaker::grid(const RigidTransform& camera_from_world, const PlaneGrid& grid, Strokes* out) const {
  const RigidTransform camera_from_plane = camera_from_world * grid.world_from_plane;
  const double e = grid.half_extent_m;
  const int cells = std::max(1, grid.cells);
  for (int i = 0; i <= cells; ++i) {
    const double at = -e + 2 * e * i / cells;
    line_in_camera(camera_from_plane * Eigen::Vector3d(at, -e, 0), camera_from_plane * Eigen::Vector3d(at, e, 0),
                   grid.colour, 1.5f, out);
    line_in_camera(camera_from_plane * Eigen::Vector3d(-e, at, 0), camera_from_plane * Eigen::Vector3d(e, at, 0),
                   grid.colour, 1.5f, out);
  }
}

void StrokeMaker::line_in_camera(const Eigen::Vector3d& from, const Eigen::Vector3d& to, const DrawColour& colour,
                                 float width_px, Strokes* out) const {
  Eigen::Vector3d a = from, b = to;
  if (!a.allFinite() || !b.allFinite()) return;
  if (lens_.camera().kind() != CameraModelKind::kannala_brandt) {
    // Beside the image plane a bending lens may still see; what is nearer than the near plane OpenGL cuts off.
    const double near = (lens_.camera().kind() == CameraModelKind::pinhole ? 1 : 0.01) * kNearPlane_m;
    if (a.z() < near && b.z() < near) return;
    if (a.z() < near) a += (b - a) * ((near - a.z()) / (b.z() - a.z()));
    if (b.z() < near) b += (a - b) * ((near - b.z()) / (a.z() - b.z()));
  }
  std::vector<Joint> joints;
  cut(a, b, 0, &joints, out, colour, width_px);
  chain(joints, colour, width_px, out);
}

void StrokeMaker::cut(const Eigen::Vector3d& a, const Eigen::Vector3d& b, int depth, std::vector<Joint>* joints,
                      Strokes* out, const DrawColour& colour, float width_px) const {
  const double angle = angle_between(a, b);
  const Eigen::Vector3d middle = 0.5 * (a + b);
  const double off_axis = std::atan2(middle.head<2>().norm(), middle.z()) + 0.5 * angle;
  if (depth < kMaxCuts && angle > kLineFineness * lens_.max_edge_rad(off_axis)) {
    cut(a, middle, depth + 1, joints, out, colour, width_px);
    cut(middle, b, depth + 1, joints, out, colour, width_px);
    return;
  }
  Eigen::Vector2d pa, pb;
  const bool see_a = lens_.camera().project(a, &pa), see_b = lens_.camera().project(b, &pb);
  if (see_a && see_b) {
    const auto joint = [&](const Eigen::Vector3d& p, const Eigen::Vector2d& px) {
      return Joint{to_viewport(px), static_cast<float>(lens_.depth(p) * kTowardsCamera)};
    };
    if (joints->empty()) joints->push_back(joint(a, pa));
    joints->push_back(joint(b, pb));
    return;
  }
  chain(*joints, colour, width_px, out);
  joints->clear();
}

void StrokeMaker::chain(const std::vector<Joint>& given, const DrawColour& colour, float width_px, Strokes* out) const {
  std::vector<Joint> joints;
  for (const Joint& j : given) {
    if (!j.place.allFinite()) continue;
    if (joints.empty() || (j.place - joints.back().place).norm() > 1e-3f || &j == &given.back()) joints.push_back(j);
  }
  if (joints.size() < 2) return;
  const float half = 0.5f * width_px * scale_.x(), reach = half + 1;
  // What is far outside the viewport is left out; it would only cost time.
  Eigen::AlignedBox2f box;
  float length = 0;
  for (std::size_t i = 0; i < joints.size(); ++i) {
    box.extend(joints[i].place);
    if (i > 0) length += (joints[i].place - joints[i - 1].place).norm();
  }
  if (box.max().x() < -reach || box.max().y() < -reach || box.min().x() > size_.x() + reach ||
      box.min().y() > size_.y() + reach)
    return;

  const LinearColour c(colour);
  const auto direction = [&](std::size_t i) {  // of the piece that begins at joint i
    const Eigen::Vector2f d = joints[i + 1].place - joints[i].place;
    const float n = d.norm();
    return n > 1e-6f ? Eigen::Vector2f(d / n) : Eigen::Vector2f(1, 0);
  };
  const auto base = static_cast<std::uint32_t>(out->vertices.size());
  float at = 0;
  const std::size_t n = joints.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector2f before = direction(i == 0 ? 0 : i - 1), after = direction(i + 1 < n ? i : n - 2);
    Eigen::Vector2f along = before + after;
    along = along.norm() > 1e-3f ? along.normalized() : after;
    const Eigen::Vector2f across(-along.y(), along.x());
    const float mitre = 1 / std::max(0.5f, along.dot(after));
    if (i > 0) at += (joints[i].place - joints[i - 1].place).norm();
    Eigen::Vector2f place = joints[i].place;
    float from_start = at;
    if (i == 0) {
      place -= along;
      from_start = -1;
    } else if (i + 1 == n) {
      place += along;
      from_start = length + 1;
    }
    for (const float side : {-1.0f, 1.0f}) {
      const Eigen::Vector2f p = place + side * reach * mitre * across;
      out->vertices.push_back({{p.x(), p.y(), joints[i].depth},
                               {side * reach, from_start, length - from_start, half},
                               0,
                               {c.r, c.g, c.b, c.a}});
    }
    if (i == 0) continue;
    const std::uint32_t v = base + 2 * static_cast<std::uint32_t>(i);
    for (const std::uint32_t k : {v - 2, v - 1, v, v, v - 1, v + 1}) out->indices.push_back(k);
  }
}

void StrokeMaker::world_point(const RigidTransform& camera_from_world, const WorldPoint& point, Strokes* out) const {
  const Eigen::Vector3d p = camera_from_world * point.position.cast<double>();
  Eigen::Vector2d px;
  if (!p.allFinite() || !lens_.camera().project(p, &px) || lens_.depth(p) < kNearPlane_m) return;
  blob({to_viewport(px), static_cast<float>(lens_.depth(p) * kTowardsCamera)}, point.colour, point.size_px, false, out);
}

void StrokeMaker::screen_line(const ScreenLine& line, Strokes* out) const {
  chain({{to_viewport(line.a_px.cast<double>()), 1}, {to_viewport(line.b_px.cast<double>()), 1}}, line.colour,
        line.width_px, out);
}

void StrokeMaker::screen_point(const ScreenPoint& point, Strokes* out) const {
  blob({to_viewport(point.px.cast<double>()), 1}, point.colour, point.size_px, point.ring, out);
}

void StrokeMaker::blob(const Joint& at, const DrawColour& colour, float size_px, bool ring, Strokes* out) const {
  const float radius = 0.5f * size_px * scale_.x(), reach = radius + 1, pen = 1.5f * scale_.x();
  const Eigen::Vector2f& p = at.place;
  if (!p.allFinite() || p.x() < -reach || p.y() < -reach || p.x() > size_.x() + reach || p.y() > size_.y() + reach)
    return;
  const LinearColour c(colour);
  const auto base = static_cast<std::uint32_t>(out->vertices.size());
  for (const float y : {-reach, reach})
    for (const float x : {-reach, reach})
      out->vertices.push_back(
          {{p.x() + x, p.y() + y, at.depth}, {x, y, pen, radius}, ring ? 2.0f : 1.0f, {c.r, c.g, c.b, c.a}});
  for (const std::uint32_t k : {0u, 1u, 2u, 2u, 1u, 3u}) out->indices.push_back(base + k);
}

void GlStrokes::draw(const Strokes& strokes) {
  if (strokes.indices.empty()) return;
  if (!array_) {
    array_ = GlVertexArray::make();
    vertices_ = GlBuffer::make();
    indices_ = GlBuffer::make();
    gl().BindVertexArray(array_.id());
    gl().BindBuffer(GL_ARRAY_BUFFER, vertices_.id());
    gl().BindBuffer(GL_ELEMENT_ARRAY_BUFFER, indices_.id());
    const auto attribute = [](GLuint location, GLint size, std::size_t offset) {
      gl().EnableVertexAttribArray(location);
      gl().VertexAttribPointer(location, size, GL_FLOAT, GL_FALSE, sizeof(StrokeVertex),
                               reinterpret_cast<const void*>(offset));
    };
    attribute(0, 3, offsetof(StrokeVertex, place));
    attribute(1, 4, offsetof(StrokeVertex, extent));
    attribute(2, 1, offsetof(StrokeVertex, shape));
    attribute(3, 4, offsetof(StrokeVertex, colour));
  }
  gl().BindVertexArray(array_.id());
  gl().BindBuffer(GL_ARRAY_BUFFER, vertices_.id());
  gl().BufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(strokes.vertices.size() * sizeof(StrokeVertex)),
                  strokes.vertices.data(), GL_STREAM_DRAW);
  gl().BufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(strokes.indices.size() * sizeof(std::uint32_t)),
                  strokes.indices.data(), GL_STREAM_DRAW);
  gl().DrawElements(GL_TRIANGLES, static_cast<GLsizei>(strokes.indices.size()), GL_UNSIGNED_INT, nullptr);
  gl().BindVertexArray(0);
}

}  // namespace parallax
