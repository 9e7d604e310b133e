#include "render/gl_sprites.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "render/gl_mesh_cache.h"

namespace parallax {

std::vector<SpriteVertex> sprite_squares(const std::vector<Sprite>& sprites, const RigidTransform& camera_from_world) {
  struct Item {
    float distance;
    Eigen::Vector3f place;
    const Sprite* sprite;
  };
  std::vector<Item> items;
  items.reserve(sprites.size());
  for (const Sprite& sprite : sprites) {
    if (!sprite.position.allFinite() || !(sprite.radius_m > 0) || !(sprite.colour.a > 0)) continue;
    const Eigen::Vector3f place = (camera_from_world * sprite.position.cast<double>()).cast<float>();
    const float distance = place.norm();
    if (distance > 0) items.push_back({distance, place, &sprite});
  }
  std::stable_sort(items.begin(), items.end(), [](const Item& a, const Item& b) { return a.distance > b.distance; });
  std::vector<SpriteVertex> out;
  out.reserve(4 * items.size());
  for (const Item& item : items) {
    const DrawColour& c = item.sprite->colour;
    const Eigen::Vector3f along = item.place / item.distance;
    // Not turned against the image where it can be helped: a square's edges are cut off by its disc anyway.
    const Eigen::Vector3f reference = std::abs(along.y()) < 0.9f ? Eigen::Vector3f::UnitY() : Eigen::Vector3f::UnitX();
    const Eigen::Vector3f right = reference.cross(along).normalized(), down = along.cross(right);
    for (const float v : {-1.0f, 1.0f}) {
      for (const float u : {-1.0f, 1.0f}) {
        const Eigen::Vector3f p = item.place + item.sprite->radius_m * (u * right + v * down);
        out.push_back({{p.x(), p.y(), p.z()},
                       {u, v},
                       {linear_from_srgb(c.r), linear_from_srgb(c.g), linear_from_srgb(c.b), c.a},
                       item.sprite->additive ? 1.0f : 0.0f});
      }
    }
  }
  return out;
}

void GlSprites::draw(const std::vector<SpriteVertex>& squares) {
  if (squares.empty()) return;
  if (!array_) {
    array_ = GlVertexArray::make();
    vertices_ = GlBuffer::make();
    indices_ = GlBuffer::make();
    gl().BindVertexArray(array_.id());
    gl().BindBuffer(GL_ARRAY_BUFFER, vertices_.id());
    gl().BindBuffer(GL_ELEMENT_ARRAY_BUFFER, indices_.id());
    const auto attribute = [](GLuint location, GLint size, std::size_t offset) {
      gl().EnableVertexAttribArray(location);
      gl().VertexAttribPointer(location, size, GL_FLOAT, GL_FALSE, sizeof(SpriteVertex),
                               reinterpret_cast<const void*>(offset));
    };
    attribute(0, 3, offsetof(SpriteVertex, position));
    attribute(1, 2, offsetof(SpriteVertex, corner));
    attribute(2, 4, offsetof(SpriteVertex, colour));
    attribute(3, 1, offsetof(SpriteVertex, additive));
  }
  std::vector<std::uint32_t> indices;
  indices.reserve(squares.size() / 4 * 6);
  for (std::uint32_t base = 0; base + 3 < squares.size(); base += 4)
    for (const std::uint32_t k : {0u, 1u, 2u, 2u, 1u, 3u}) indices.push_back(base + k);
  gl().BindVertexArray(array_.id());
  gl().BindBuffer(GL_ARRAY_BUFFER, vertices_.id());
  gl().BufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(squares.size() * sizeof(SpriteVertex)), squares.data(),
                  GL_STREAM_DRAW);
  gl().BufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(indices.size() * sizeof(std::uint32_t)),
                  indices.data(), GL_STREAM_DRAW);
  gl().DrawElements(GL_TRIANGLES, static_cast<GLsizei>(indices.size()), GL_UNSIGNED_INT, nullptr);
  gl().BindVertexArray(0);
}

}  // namespace parallax
