#include "render/mesh_merge.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace parallax {
namespace {

// A sphere of so many rings, coloured by hemisphere.
Mesh sphere(int rings) {
  Mesh mesh;
  const int around = 2 * rings;
  for (int i = 0; i <= rings; ++i) {
    for (int j = 0; j < around; ++j) {
      const double polar = std::numbers::pi * i / rings, turn = 2 * std::numbers::pi * j / around;
      MeshVertex v;
      v.position = Eigen::Vector3d(std::sin(polar) * std::cos(turn), std::sin(polar) * std::sin(turn), std::cos(polar))
                       .cast<float>();
      v.normal = v.position;
      if (v.position.z() < 0) v.colour = {1, 0, 0, 1};
      mesh.vertices.push_back(v);
    }
  }
  const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(i * around + j % around); };
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < around; ++j) {
      for (const std::uint32_t k : {at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j), at(i + 1, j + 1), at(i, j + 1)})
        mesh.indices.push_back(k);
    }
  }
  return mesh;
}

// Six times the enclosed volume: what winding and gaps would change.
double volume(const Mesh& mesh) {
  double sum = 0;
  for (std::size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    const Eigen::Vector3d a = mesh.vertices[mesh.indices[i]].position.cast<double>(),
                          b = mesh.vertices[mesh.indices[i + 1]].position.cast<double>(),
                          c = mesh.vertices[mesh.indices[i + 2]].position.cast<double>();
    sum += a.dot(b.cross(c));
  }
  return std::abs(sum) / 6;
}

TEST(MeshMerge, ACoarserMeshHasTheShapeAndFewerTriangles) {
  const Mesh fine = sphere(40);
  const float cell = 0.3f;
  const Mesh coarse = clustered_mesh(fine, cell);
  EXPECT_LT(coarse.indices.size(), fine.indices.size() / 5);
  EXPECT_GT(coarse.indices.size(), 60u);
  ASSERT_EQ(coarse.indices.size() % 3, 0u);
  for (const std::uint32_t k : coarse.indices) ASSERT_LT(k, coarse.vertices.size());
  for (const MeshVertex& v : coarse.vertices) {
    EXPECT_NEAR(v.position.norm(), 1, 0.15);
    EXPECT_NEAR(v.normal.norm(), 1, 1e-5);
    // Two colours that meet stay two colours.
    EXPECT_TRUE(std::abs(v.colour.g - 1) < 1e-5 || std::abs(v.colour.g) < 1e-5) << v.colour.g;
  }
  EXPECT_NEAR(volume(coarse), volume(fine), 0.15 * volume(fine));
}

TEST(MeshMerge, CellsThatAreSmallChangeNothing) {
  const Mesh fine = sphere(12);
  const Mesh same = clustered_mesh(fine, 1e-3f);
  EXPECT_NEAR(volume(same), volume(fine), 1e-5);
}

TEST(MeshMerge, AModelsPartsBecomeOneMeshInItsFrame) {
  const auto part = std::make_shared<const Mesh>(sphere(6));
  Model model;
  model.parts.push_back({"body", part, Eigen::Affine3f::Identity()});
  model.parts.push_back({"leg", part, Eigen::Affine3f(Eigen::Translation3f(0, 0, 5))});
  const Eigen::Affine3f lifted(Eigen::Translation3f(0, 2, 0));
  const auto whole = merged_model(model, {{"leg", lifted}});
  ASSERT_TRUE(whole);
  ASSERT_EQ(whole->vertices.size(), 2 * part->vertices.size());
  ASSERT_EQ(whole->indices.size(), 2 * part->indices.size());
  // As draw_model() would put it.
  DrawList list;
  draw_model(model, Eigen::Affine3f::Identity(), {}, 0, {{"leg", lifted}}, &list);
  std::size_t i = 0;
  for (const MeshInstance& instance : list.meshes)
    for (const MeshVertex& v : instance.mesh->vertices) {
      const Eigen::Vector3f expected = instance.world_from_model * v.position;
      ASSERT_LT((whole->vertices[i++].position - expected).norm(), 1e-5f) << i;
    }

  Mesh textured = sphere(3);
  textured.texture = cv::Mat4b(2, 2, cv::Vec4b(1, 2, 3, 255));
  model.parts.push_back({"sign", std::make_shared<const Mesh>(textured), Eigen::Affine3f::Identity()});
  EXPECT_EQ(merged_model(model, {}), nullptr) << "a texture is no part of one mesh";
}

}  // namespace
}  // namespace parallax
