#include "render/mesh_shapes.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace parallax {
namespace {

constexpr float kTurn = 2 * std::numbers::pi_v<float>;

std::uint32_t add(Mesh* mesh, const Eigen::Vector3f& position, const Eigen::Vector3f& normal,
                  const Eigen::Vector2f& uv = Eigen::Vector2f::Zero()) {
  mesh->vertices.push_back({position, normal, uv, {}});
  return static_cast<std::uint32_t>(mesh->vertices.size() - 1);
}

void add_triangle(Mesh* mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  mesh->indices.insert(mesh->indices.end(), {a, b, c});
}

// A surface of revolution about z through profile points (radius, z) from the bottom up, with a normal (radial, z)
// each.
struct ProfilePoint {
  Eigen::Vector2f at, normal;
};
void revolve(Mesh* mesh, const std::vector<ProfilePoint>& profile, int segments) {
  const auto base = static_cast<std::uint32_t>(mesh->vertices.size());
  const auto n = static_cast<std::uint32_t>(profile.size());
  for (int s = 0; s <= segments; ++s) {
    const float share = static_cast<float>(s) / static_cast<float>(segments);
    // The last column lies exactly on the first.
    const float angle = s == segments ? 0.0f : kTurn * share;
    const float c = std::cos(angle), d = std::sin(angle);
    for (std::uint32_t i = 0; i < n; ++i) {
      const ProfilePoint& p = profile[i];
      add(mesh, {p.at.x() * c, p.at.x() * d, p.at.y()},
          Eigen::Vector3f(p.normal.x() * c, p.normal.x() * d, p.normal.y()).normalized(),
          {share, 1 - static_cast<float>(i) / static_cast<float>(n - 1)});
    }
  }
  for (int s = 0; s < segments; ++s) {
    for (std::uint32_t i = 0; i + 1 < n; ++i) {
      const std::uint32_t a = base + static_cast<std::uint32_t>(s) * n + i, b = a + n;
      if (profile[i].at.x() > 0) add_triangle(mesh, a, b, a + 1);
      if (profile[i + 1].at.x() > 0) add_triangle(mesh, b, b + 1, a + 1);
    }
  }
}

void add_disc(Mesh* mesh, float radius, float z, bool facing_up, int segments) {
  const Eigen::Vector3f normal(0, 0, facing_up ? 1.0f : -1.0f);
  const std::uint32_t centre = add(mesh, {0, 0, z}, normal, {0.5f, 0.5f});
  for (int s = 0; s <= segments; ++s) {
    const float angle = s == segments ? 0.0f : kTurn * static_cast<float>(s) / static_cast<float>(segments);
    const float c = std::cos(angle), d = std::sin(angle);
    const std::uint32_t v = add(mesh, {radius * c, radius * d, z}, normal, {0.5f + 0.5f * c, 0.5f - 0.5f * d});
    if (s == 0) continue;
    if (facing_up) {
      add_triangle(mesh, centre, v - 1, v);
    } else {
      add_triangle(mesh, centre, v, v - 1);
    }
  }
}

std::vector<ProfilePoint> ball_profile(float radius, float centre_z, int segments) {
  std::vector<ProfilePoint> out;
  for (int i = 0; i <= segments; ++i) {
    const float latitude = 0.5f * kTurn * (static_cast<float>(i) / static_cast<float>(segments) - 0.5f);
    const bool pole = i == 0 || i == segments;
    const Eigen::Vector2f n(pole ? 0.0f : std::cos(latitude), i == 0 ? -1.0f : pole ? 1.0f : std::sin(latitude));
    out.push_back({{radius * n.x(), centre_z + radius * n.y()}, n});
  }
  return out;
}

// The side of a cone between two rings.
std::vector<ProfilePoint> side_profile(float bottom_radius, float bottom_z, float top_radius, float top_z) {
  const Eigen::Vector2f normal(top_z - bottom_z, bottom_radius - top_radius);
  return {{{bottom_radius, bottom_z}, normal}, {{top_radius, top_z}, normal}};
}

std::shared_ptr<const Mesh> share(Mesh mesh) { return std::make_shared<const Mesh>(std::move(mesh)); }

}  // namespace

std::shared_ptr<const Mesh> box_mesh(const Eigen::Vector3f& size) {
  Mesh mesh;
  for (int axis = 0; axis < 3; ++axis) {
    for (const float sign : {-1.0f, 1.0f}) {
      Eigen::Vector3f normal = Eigen::Vector3f::Zero(), u = normal;
      normal[axis] = sign;
      u[(axis + 1) % 3] = 1;
      const Eigen::Vector3f v = normal.cross(u);
      std::uint32_t corner[4];
      for (int k = 0; k < 4; ++k) {
        const float a = k % 2 ? 1.0f : -1.0f, b = k / 2 ? 1.0f : -1.0f;
        const Eigen::Vector3f place = 0.5f * (normal + a * u + b * v).cwiseProduct(size);
        corner[k] = add(&mesh, place, normal, {0.5f + 0.5f * a, 0.5f - 0.5f * b});
      }
      add_triangle(&mesh, corner[0], corner[1], corner[2]);
      add_triangle(&mesh, corner[2], corner[1], corner[3]);
    }
  }
  return share(std::move(mesh));
}

std::shared_ptr<const Mesh> sphere_mesh(float radius, int segments) {
  Mesh mesh;
  revolve(&mesh, ball_profile(radius, 0, std::max(2, segments / 2)), segments);
  return share(std::move(mesh));
}

std::shared_ptr<const Mesh> cylinder_mesh(float radius, float height, int segments) {
  Mesh mesh;
  revolve(&mesh, side_profile(radius, 0, radius, height), segments);
  add_disc(&mesh, radius, 0, false, segments);
  add_disc(&mesh, radius, height, true, segments);
  return share(std::move(mesh));
}

std::shared_ptr<const Mesh> cone_mesh(float radius, float height, int segments) {
  Mesh mesh;
  revolve(&mesh, side_profile(radius, 0, 0, height), segments);
  add_disc(&mesh, radius, 0, false, segments);
  return share(std::move(mesh));
}

std::shared_ptr<const Mesh> arrow_mesh(float length, float shaft_radius, int segments) {
  Mesh mesh;
  const float head = std::min(0.5f * length, 6 * shaft_radius), neck = length - head;
  revolve(&mesh, side_profile(shaft_radius, 0, shaft_radius, neck), segments);
  add_disc(&mesh, shaft_radius, 0, false, segments);
  revolve(&mesh, side_profile(2.5f * shaft_radius, neck, 0, length), segments);
  add_disc(&mesh, 2.5f * shaft_radius, neck, false, segments);
  return share(std::move(mesh));
}

std::shared_ptr<const Mesh> torus_mesh(float radius, float tube_radius, int segments, int tube_segments) {
  Mesh mesh;
  std::vector<ProfilePoint> profile;
  for (int i = 0; i <= tube_segments; ++i) {
    const float angle = i == tube_segments ? 0.0f : kTurn * static_cast<float>(i) / static_cast<float>(tube_segments);
    const Eigen::Vector2f n(std::cos(angle), std::sin(angle));
    profile.push_back({Eigen::Vector2f(radius, 0) + tube_radius * n, n});
  }
  revolve(&mesh, profile, segments);
  return share(std::move(mesh));
}

std::shared_ptr<const Mesh> quad_mesh(float width, float height, const cv::Mat4b& texture, bool two_sided) {
  Mesh mesh;
  for (int k = 0; k < 4; ++k) {
    const float a = k % 2 ? 1.0f : 0.0f, b = k / 2 ? 1.0f : 0.0f;
    add(&mesh, {width * (a - 0.5f), height * (b - 0.5f), 0}, {0, 0, 1}, {a, 1 - b});
  }
  mesh.indices = {0, 1, 2, 2, 1, 3};
  mesh.texture = texture;
  mesh.two_sided = two_sided;
  return share(std::move(mesh));
}

std::shared_ptr<const Mesh> disc_mesh(float radius, int segments) {
  Mesh mesh;
  add_disc(&mesh, radius, 0, true, segments);
  mesh.two_sided = true;
  return share(std::move(mesh));
}

std::shared_ptr<const Mesh> frustum_mesh(float half_width, float half_height, float depth) {
  Mesh mesh;
  mesh.two_sided = true;
  const Eigen::Vector3f apex = Eigen::Vector3f::Zero();
  const Eigen::Vector3f base[] = {{-half_width, -half_height, depth},
                                  {half_width, -half_height, depth},
                                  {half_width, half_height, depth},
                                  {-half_width, half_height, depth}};
  for (int k = 0; k < 4; ++k) {
    const Eigen::Vector3f &a = base[k], &b = base[(k + 1) % 4];
    const Eigen::Vector3f normal = b.cross(a).normalized();
    add_triangle(&mesh, add(&mesh, apex, normal), add(&mesh, b, normal), add(&mesh, a, normal));
  }
  std::uint32_t corner[4];
  for (int k = 0; k < 4; ++k) corner[k] = add(&mesh, base[k], {0, 0, 1});
  add_triangle(&mesh, corner[0], corner[1], corner[2]);
  add_triangle(&mesh, corner[0], corner[2], corner[3]);
  return share(std::move(mesh));
}

std::shared_ptr<const Mesh> pin_mesh(float height, int segments) {
  Mesh mesh;
  const float ball = 0.22f * height, centre = height - ball;
  revolve(&mesh, side_profile(0, 0, 0.55f * ball, centre), segments);
  revolve(&mesh, ball_profile(ball, centre, std::max(2, segments / 2)), segments);
  return share(std::move(mesh));
}

std::shared_ptr<const Mesh> axes_mesh(float length) {
  Mesh mesh;
  const auto arrow = arrow_mesh(length, 0.025f * length, 16);
  const auto turned = [](const Eigen::Vector3f& to) {
    Eigen::Affine3f out = Eigen::Affine3f::Identity();
    out.linear() = Eigen::Quaternionf::FromTwoVectors(Eigen::Vector3f::UnitZ(), to).toRotationMatrix();
    return out;
  };
  append(*arrow, turned(Eigen::Vector3f::UnitX()), {0.9f, 0.15f, 0.15f, 1}, &mesh);
  append(*arrow, turned(Eigen::Vector3f::UnitY()), {0.15f, 0.75f, 0.2f, 1}, &mesh);
  append(*arrow, turned(Eigen::Vector3f::UnitZ()), {0.2f, 0.35f, 0.95f, 1}, &mesh);
  return share(std::move(mesh));
}

void append(const Mesh& part, const Eigen::Affine3f& whole_from_part, const DrawColour& colour, Mesh* whole) {
  const auto base = static_cast<std::uint32_t>(whole->vertices.size());
  const Eigen::Matrix3f normals = whole_from_part.linear().inverse().transpose();
  for (MeshVertex v : part.vertices) {
    v.position = whole_from_part * v.position;
    v.normal = (normals * v.normal).normalized();
    v.colour = {v.colour.r * colour.r, v.colour.g * colour.g, v.colour.b * colour.b, v.colour.a * colour.a};
    whole->vertices.push_back(v);
  }
  for (const std::uint32_t index : part.indices) whole->indices.push_back(base + index);
  whole->two_sided |= part.two_sided;
}

}  // namespace parallax
