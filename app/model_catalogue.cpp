#include "app/model_catalogue.h"

#include <algorithm>
#include <utility>

#include "render/mesh_shapes.h"

namespace parallax {
namespace {

using Eigen::Vector3f;

constexpr DrawColour kRed{0.85f, 0.25f, 0.2f, 1}, kGreen{0.25f, 0.6f, 0.3f, 1}, kBlue{0.25f, 0.45f, 0.85f, 1},
    kYellow{0.95f, 0.78f, 0.25f, 1}, kWhite{0.93f, 0.93f, 0.9f, 1}, kBrown{0.5f, 0.33f, 0.2f, 1},
    kGrey{0.45f, 0.47f, 0.52f, 1};

class Builder {
 public:
  Builder& add(const std::shared_ptr<const Mesh>& part, const Vector3f& at, const DrawColour& colour) {
    Eigen::Affine3f place = Eigen::Affine3f::Identity();
    place.translation() = at;
    append(*part, place, colour, mesh_.get());
    return *this;
  }
  std::shared_ptr<const Mesh> done() { return mesh_; }

 private:
  std::shared_ptr<Mesh> mesh_ = std::make_shared<Mesh>();
};

std::shared_ptr<const Mesh> house() {
  // The roof is a ridge of two slopes: a prism from gable to gable.
  auto roof = std::make_shared<Mesh>();
  const float w = 0.5f, d = 0.42f, low = 0, high = 0.35f;
  const auto face = [&](std::initializer_list<Vector3f> corners) {
    const auto first = static_cast<std::uint32_t>(roof->vertices.size());
    const Vector3f* c = corners.begin();
    const Vector3f normal = (c[1] - c[0]).cross(c[2] - c[0]).normalized();
    for (const Vector3f& p : corners) roof->vertices.push_back({p, normal, Eigen::Vector2f::Zero(), {}});
    for (std::uint32_t i = 2; i < corners.size(); ++i)
      roof->indices.insert(roof->indices.end(), {first, first + i - 1, first + i});
  };
  face({{-w, -d, low}, {w, -d, low}, {w, 0, high}, {-w, 0, high}});
  face({{w, d, low}, {-w, d, low}, {-w, 0, high}, {w, 0, high}});
  face({{w, -d, low}, {w, d, low}, {w, 0, high}});
  face({{-w, d, low}, {-w, -d, low}, {-w, 0, high}});
  face({{-w, d, low}, {w, d, low}, {w, -d, low}, {-w, -d, low}});
  return Builder()
      .add(box_mesh({0.86f, 0.66f, 0.5f}), {0, 0, 0.25f}, kWhite)
      .add(roof, {0, 0, 0.5f}, kRed)
      .add(box_mesh({0.16f, 0.02f, 0.3f}), {-0.18f, -0.335f, 0.15f}, kBrown)
      .add(box_mesh({0.18f, 0.02f, 0.16f}), {0.2f, -0.335f, 0.3f}, kBlue)
      .add(box_mesh({0.1f, 0.1f, 0.3f}), {0.25f, 0.15f, 0.8f}, kGrey)
      .done();
}

std::shared_ptr<const Mesh> tree() {
  return Builder()
      .add(cylinder_mesh(0.07f, 0.25f), {0, 0, 0}, kBrown)
      .add(cone_mesh(0.33f, 0.42f), {0, 0, 0.2f}, kGreen)
      .add(cone_mesh(0.26f, 0.36f), {0, 0, 0.43f}, kGreen)
      .add(cone_mesh(0.18f, 0.3f), {0, 0, 0.7f}, kGreen)
      .done();
}

std::shared_ptr<const Mesh> snowman() {
  return Builder()
      .add(sphere_mesh(0.27f), {0, 0, 0.25f}, kWhite)
      .add(sphere_mesh(0.19f), {0, 0, 0.6f}, kWhite)
      .add(sphere_mesh(0.13f), {0, 0, 0.83f}, kWhite)
      .add(sphere_mesh(0.02f, 12), {-0.05f, -0.12f, 0.86f}, kGrey)
      .add(sphere_mesh(0.02f, 12), {0.05f, -0.12f, 0.86f}, kGrey)
      .add(sphere_mesh(0.025f, 12), {0, -0.13f, 0.82f}, kRed)
      .add(cylinder_mesh(0.16f, 0.015f), {0, 0, 0.93f}, kGrey)
      .add(cylinder_mesh(0.1f, 0.07f), {0, 0, 0.93f}, kGrey)
      .done();
}

struct Entry {
  std::string name;
  std::shared_ptr<const Mesh> mesh;
};

const std::vector<Entry>& catalogue() {
  static const std::vector<Entry> entries{
      {"cube", Builder().add(box_mesh({1, 1, 1}), {0, 0, 0.5f}, kBlue).done()},
      {"ball", Builder().add(sphere_mesh(0.5f, 48), {0, 0, 0.5f}, kRed).done()},
      {"cylinder", Builder().add(cylinder_mesh(0.3f, 1, 48), {0, 0, 0}, kGreen).done()},
      {"cone", Builder().add(cone_mesh(0.4f, 1, 48), {0, 0, 0}, kYellow).done()},
      {"ring", Builder().add(torus_mesh(0.38f, 0.12f), {0, 0, 0.12f}, kYellow).done()},
      {"pin", Builder().add(pin_mesh(1), {0, 0, 0}, kRed).done()},
      {"house", house()},
      {"tree", tree()},
      {"snowman", snowman()},
      {"axes", axes_mesh(1)}};
  return entries;
}

}  // namespace

const std::vector<std::string>& model_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> out;
    for (const Entry& e : catalogue()) out.push_back(e.name);
    return out;
  }();
  return names;
}

std::shared_ptr<const Mesh> model_mesh(const std::string& name) {
  const auto it = std::find_if(catalogue().begin(), catalogue().end(), [&](const Entry& e) { return e.name == name; });
  return it == catalogue().end() ? nullptr : it->mesh;
}

}  // namespace parallax
