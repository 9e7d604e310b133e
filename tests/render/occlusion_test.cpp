// What real things hide of the virtual ones in the picture, and what else games draw with: soft spots, see-through
// things, light that adds, textures that change all the time.
#include <dlfcn.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>
#include <utility>

#include "core/error.h"
#include "render/mesh_shapes.h"
#include "render/occlusion_edges.h"
#include "render/occlusion_mask.h"
#include "tests/render/offscreen_scene.h"

namespace parallax {
namespace {

using testing::empty_list;
using testing::linear_light;
using testing::OffscreenScene;

constexpr int kWidth = 160, kHeight = 120;
const CameraModel kPinhole(CameraModelKind::pinhole, kWidth, kHeight, {120, 120}, {79.5, 59.5});
const CameraModel kWide(CameraModelKind::fov, kWidth, kHeight, {95, 95}, {79.5, 59.5}, {0.9}, 1);

MeshInstance instance_of(std::shared_ptr<const Mesh> mesh, const Eigen::Vector3f& place, const DrawColour& tint) {
  MeshInstance out;
  out.mesh = std::move(mesh);
  out.world_from_model.translation() = place;
  out.tint = tint;
  out.emission = 1;
  return out;
}

cv::Mat3b pattern() {
  cv::Mat3b out(kHeight, kWidth);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x)
      out(y, x) = cv::Vec3b(static_cast<unsigned char>(x), static_cast<unsigned char>(2 * y),
                            static_cast<unsigned char>((x * y) % 251));
  return out;
}

bool same_inside(const cv::Mat3b& a, const cv::Mat3b& b, const cv::Rect& where) {
  return cv::norm(a(where), b(where), cv::NORM_INF) == 0;
}

// What is wholly behind a real thing is as if it were not there, through every lens.
TEST(Occlusion, WhatRealThingsHideIsNotDrawn) {
  for (const CameraModel& camera : {kPinhole, kWide}) {
    OffscreenScene scene(kWidth, kHeight);
    DrawList list = empty_list(camera);
    list.background = pattern();
    const cv::Mat3b bare = list.background;
    list.meshes.push_back(instance_of(sphere_mesh(0.1f), {0, 0, 1}, {1, 0, 0, 1}));
    list.sprites.push_back({{0.05f, 0, 1.1f}, 0.1f, {1, 1, 1, 1}, true});
    list.occlusion_depth = cv::Mat1f(kHeight, kWidth, 2.0f);
    EXPECT_GT(cv::norm(scene.draw(list), bare, cv::NORM_INF), 100) << "the real thing is behind";
    list.occlusion_depth = 0.5f;
    EXPECT_EQ(cv::norm(scene.draw(list), bare, cv::NORM_INF), 0) << "the real thing is before";
    // Half before it: the other half is drawn as ever.
    list.sprites.clear();
    list.occlusion_depth(cv::Rect(80, 0, kWidth - 80, kHeight)).setTo(0);
    const cv::Mat3b half = scene.draw(list);
    EXPECT_TRUE(same_inside(half, bare, {0, 0, 78, kHeight}));
    list.occlusion_depth.release();
    EXPECT_TRUE(same_inside(half, scene.draw(list), {82, 0, kWidth - 82, kHeight}));
  }
}

TEST(Occlusion, HidesShadowsAndNotLines) {
  OffscreenScene scene(kWidth, kHeight);
  DrawList list = empty_list(kPinhole);
  list.camera_from_world = testing::look_at({0, -0.3, 0.4}, {0, 0, 0});
  list.background = cv::Mat3b(kHeight, kWidth, cv::Vec3b(180, 180, 180));
  const cv::Mat3b bare = list.background;
  list.shadow_plane = RigidTransform();
  list.meshes.push_back(instance_of(box_mesh({0.08f, 0.08f, 0.08f}), {0, 0, 0.05f}, {1, 1, 1, 1}));
  EXPECT_GT(cv::norm(scene.draw(list), bare, cv::NORM_INF), 50);
  list.occlusion_depth = cv::Mat1f(kHeight, kWidth, 0.1f);
  EXPECT_EQ(cv::norm(scene.draw(list), bare, cv::NORM_INF), 0) << "a wall before all of it";
  list.world_lines.push_back({{-0.2f, 0.1f, 0}, {0.2f, 0.1f, 0}, {1, 0, 0, 1}, 3});
  EXPECT_GT(cv::norm(scene.draw(list), bare, cv::NORM_INF), 100) << "marks on the plane are always seen";
}

// The depth image of one frame, coarser than the picture.
TEST(Occlusion, TheDepthImageHidesWhatIsBehindIt) {
  OffscreenScene scene(kWidth, kHeight);
  DrawList list = empty_list(kPinhole);
  list.background = pattern();
  const cv::Mat3b bare = list.background;
  list.meshes.push_back(instance_of(quad_mesh(4, 4), {0, 0, 1}, {0, 1, 0, 1}));
  list.occlusion_depth = cv::Mat1f::zeros(30, 40);
  const cv::Mat3b all = scene.draw(list);
  EXPECT_EQ(all(60, 80), cv::Vec3b(0, 255, 0)) << "0 hides nothing";
  list.occlusion_depth(cv::Rect(0, 0, 20, 15)).setTo(0.9f);
  list.occlusion_depth(cv::Rect(20, 15, 20, 15)).setTo(1.1f);
  const cv::Mat3b quarter = scene.draw(list);
  EXPECT_TRUE(same_inside(quarter, bare, {0, 0, 78, 58})) << "top left is nearer";
  EXPECT_TRUE(same_inside(quarter, all, {82, 0, 78, kHeight})) << "what is farther hides nothing";
  EXPECT_TRUE(same_inside(quarter, all, {0, 62, kWidth, 58}));
  // Where the outline runs along the texels, it is where they meet, a pixel soft.
  for (int y = 10; y < 50; ++y)
    for (int x = 77; x < 83; ++x) {
      if (x < 79) {
        EXPECT_EQ(quarter(y, x), bare(y, x)) << x;
      } else if (x > 80) {
        EXPECT_EQ(quarter(y, x), all(y, x)) << x;
      }
    }
}

// A spot's light is that of its profile over a disc of the projected radius.
TEST(Sprites, AreAsLargeAsProjected) {
  for (const CameraModel& camera : {kPinhole, kWide}) {
    OffscreenScene scene(kWidth, kHeight);
    for (const float radius : {0.05f, 0.1f}) {
      DrawList list = empty_list(camera);
      list.sprites.push_back({{0, 0, 0.8f}, radius, {1, 1, 1, 1}, false});
      const cv::Mat3b image = scene.draw(list);
      Eigen::Vector2d rim, middle;
      ASSERT_TRUE(camera.project({radius, 0, 0.8}, &rim) && camera.project({0, 0, 0.8}, &middle));
      const double expected = (rim - middle).norm();
      double light = 0;
      for (const cv::Vec3b& px : image) light += linear_light(px[1]);
      EXPECT_NEAR(std::sqrt(3 * light / std::numbers::pi), expected, 0.02 * expected + 0.1);
      const auto place = testing::centroid(image, middle, 50);
      ASSERT_TRUE(place);
      EXPECT_LT((*place - middle).norm(), 0.1);
      EXPECT_EQ(image(60, static_cast<int>(middle.x() + expected + 2))[1], 0) << "nothing outside";
    }
  }
}

TEST(Sprites, AreBlendedFarthestFirstAndHiddenByMeshes) {
  OffscreenScene scene(kWidth, kHeight);
  cv::Mat3b pictures[2];
  for (int order = 0; order < 2; ++order) {
    DrawList list = empty_list(kPinhole);
    const Sprite near{{0, 0, 0.5f}, 0.1f, {1, 0, 0, 0.6f}, false}, far{{0, 0, 1}, 0.2f, {0, 0, 1, 0.9f}, false};
    list.sprites = order == 0 ? std::vector{near, far} : std::vector{far, near};
    pictures[order] = scene.draw(list);
  }
  EXPECT_EQ(cv::norm(pictures[0], pictures[1], cv::NORM_INF), 0);
  EXPECT_GT(pictures[0](60, 80)[2], pictures[0](60, 80)[0]) << "the near one lies over the far one";
  DrawList list = empty_list(kPinhole);
  list.sprites.push_back({{0, 0, 1}, 0.1f, {1, 1, 1, 1}, false});
  list.meshes.push_back(instance_of(quad_mesh(1, 1), {0, 0, 0.8f}, {0, 0, 1, 1}));
  EXPECT_EQ(scene.draw(list)(60, 80), cv::Vec3b(255, 0, 0));
  list.sprites[0].position.z() = 0.6f;
  EXPECT_GT(scene.draw(list)(60, 80)[1], 240);
}

// Light adds up as light: in linear values over what the camera saw, and covers nothing.
TEST(Sprites, AdditiveOnesAddLight) {
  OffscreenScene scene(kWidth, kHeight);
  DrawList list = empty_list(kPinhole);
  list.background = cv::Mat3b(kHeight, kWidth, cv::Vec3b(100, 100, 100));
  list.sprites.push_back({{0, 0, 1}, 0.3f, {0.5f, 0.5f, 0.5f, 1}, true});
  const double before = linear_light(100), added = linear_light(128);
  EXPECT_NEAR(linear_light(scene.draw(list)(60, 80)[1]), before + added, 0.01);
  list.sprites.push_back(list.sprites[0]);
  EXPECT_NEAR(linear_light(scene.draw(list)(60, 80)[1]), before + 2 * added, 0.015);
}

TEST(Meshes, EmissionAddsToWhatTheLightShows) {
  OffscreenScene scene(kWidth, kHeight);
  DrawList list = empty_list(kPinhole);
  list.ambient_light.setZero();
  list.meshes.push_back(instance_of(quad_mesh(1, 1), {0, 0, 1}, {0.5f, 0.5f, 0.5f, 1}));
  EXPECT_NEAR(scene.draw(list)(60, 80)[1], 128, 1);
  list.meshes[0].emission = 2;
  EXPECT_NEAR(linear_light(scene.draw(list)(60, 80)[1]), 2 * linear_light(128), 0.01) << "brighter than its colour";
}

// Through a see-through ball one sees its far side behind its near one, whatever the order of its triangles.
TEST(Meshes, SeeThroughThingsShowTheirBackBehindTheirFront) {
  OffscreenScene scene(kWidth, kHeight);
  cv::Mat3b pictures[2];
  for (int order = 0; order < 2; ++order) {
    auto both = std::make_shared<Mesh>();
    // Two sheets that face outwards, as the sides of a closed thing.
    Eigen::Affine3f turned = Eigen::Affine3f::Identity();
    turned.linear() = Eigen::AngleAxisf(std::numbers::pi_v<float>, Eigen::Vector3f::UnitX()).toRotationMatrix();
    const auto near = [&] {
      append(*quad_mesh(1, 1), Eigen::Translation3f(0, 0, -0.1f) * turned, {1, 0, 0, 0.5f}, both.get());
    };
    const auto far = [&] {
      append(*quad_mesh(1, 1), Eigen::Affine3f(Eigen::Translation3f(0, 0, 0.1f)), {0, 0, 1, 0.5f}, both.get());
    };
    if (order == 0) {
      near();
      far();
    } else {
      far();
      near();
    }
    both->two_sided = true;
    DrawList list = empty_list(kPinhole);
    list.meshes.push_back(instance_of(both, {0, 0, 1}, {1, 1, 1, 1}));
    pictures[order] = scene.draw(list);
  }
  EXPECT_EQ(cv::norm(pictures[0], pictures[1], cv::NORM_INF), 0);
  EXPECT_GT(pictures[0](60, 80)[2], pictures[0](60, 80)[0]);
}

// A texture that is new every frame: the old ones are given back.
TEST(Meshes, TexturesThatChangeEveryFrameDoNotPileUp) {
  OffscreenScene scene(kWidth, kHeight);
  constexpr int kFrames = 40;
  void* library = dlopen("libOSMesa.so.8", RTLD_NOLOAD | RTLD_LAZY);  // as the context has loaded it
  ASSERT_NE(library, nullptr);
  const auto loader = reinterpret_cast<void* (*)(const char*)>(dlsym(library, "OSMesaGetProcAddress"));
  const auto alive = [&](const char* question) {
    const auto is = reinterpret_cast<unsigned char (*)(unsigned)>(loader(question));
    int count = 0;
    for (unsigned name = 1; name < 400; ++name) count += is(name) != 0;
    return count;
  };
  std::pair<int, int> after_some;
  for (int frame = 0; frame < kFrames; ++frame) {
    DrawList list = empty_list(kPinhole);
    list.shadow_plane = RigidTransform();
    list.meshes.push_back(instance_of(quad_mesh(1, 1, cv::Mat4b(64, 64, cv::Vec4b(255, 0, 0, 255))), {0, 0, 1}, {}));
    scene.draw(list);
    if (frame == 4) after_some = {alive("glIsTexture"), alive("glIsBuffer")};
  }
  EXPECT_GT(after_some.first, 1);
  EXPECT_LE(alive("glIsTexture"), after_some.first + 1);
  EXPECT_LE(alive("glIsBuffer"), after_some.second + 2);
  dlclose(library);
}

// A block, and a slab that hovers over a plate, seen by a pinhole: every ray against the plain formula. Two
// millimetres are left to pixels that lie between those whose rays were walked.
TEST(OcclusionMask, IsTheDepthOfWhatStandsOnThePlane) {
  SceneSurface surface;
  surface.columns = 100;
  surface.rows = 80;
  surface.cell_m = 0.005;
  surface.corner_m = {-0.25, -0.2};
  surface.height_m.assign(8000, 0);
  surface.filled.assign(8000, 0);
  surface.known.assign(8000, 1);
  surface.version = 1;
  surface.world_from_plane = RigidTransform(exp_so3({0.3, -0.2, 0.5}), Eigen::Vector3d(1, 2, 3));
  const Eigen::AlignedBox3d block(Eigen::Vector3d(-0.1, 0, 0), Eigen::Vector3d(0, 0.1, 0.08)),
      slab(Eigen::Vector3d(0.05, -0.05, 0.06), Eigen::Vector3d(0.2, 0.05, 0.09)),
      plate(Eigen::Vector3d(0.1, -0.03, 0), Eigen::Vector3d(0.15, 0.04, 0.02));
  for (int row = 0; row < surface.rows; ++row) {
    for (int column = 0; column < surface.columns; ++column) {
      const Eigen::Vector2d at = surface.centre_of(column, row);
      for (const auto& box : {block, slab, plate}) {
        if ((at.array() < box.min().head<2>().array()).any() || (at.array() > box.max().head<2>().array()).any())
          continue;
        float& height = surface.height_m[surface.index(column, row)];
        height = std::max(height, static_cast<float>(box.max().z()));
        for (int level = 0; level < 64; ++level)
          if ((level + 0.5) * surface.cell_m > box.min().z() && (level + 0.5) * surface.cell_m < box.max().z())
            surface.filled[surface.index(column, row)] |= std::uint64_t{1} << level;
      }
    }
  }
  const RigidTransform camera_from_plane = testing::look_at({0.1, -0.5, 0.35}, {0, 0, 0.03});
  OcclusionMaskOptions options;
  options.width = kWidth;
  OcclusionMask mask(kPinhole, options);
  const cv::Mat1f depth = mask.update(surface, camera_from_plane * surface.world_from_plane.inverse(), GreyImage());
  ASSERT_EQ(depth.size(), cv::Size(kWidth, kHeight));
  const RigidTransform plane_from_camera = camera_from_plane.inverse();
  int hits = 0, wrong = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      Eigen::Vector3d ray;
      ASSERT_TRUE(kPinhole.unproject({static_cast<double>(x), static_cast<double>(y)}, &ray));
      const Eigen::Vector3d along = plane_from_camera.R * ray;
      double expected = 0;
      for (const auto& box : {block, slab, plate}) {
        const Eigen::Array3d a = (box.min() - plane_from_camera.t).array() / along.array(),
                             b = (box.max() - plane_from_camera.t).array() / along.array();
        const double in = a.min(b).maxCoeff(), out = a.max(b).minCoeff();
        if (in < out && in > 0 && (expected == 0 || in < expected)) expected = in;
      }
      hits += expected > 0;
      if ((expected > 0) != (depth(y, x) > 0) || std::abs(expected - depth(y, x)) > 2e-3) ++wrong;
    }
  }
  EXPECT_GT(hits, 1000);
  EXPECT_LE(wrong, 40) << "rays that graze an edge, and corners between four pixels that see nothing";
}

// A dark square on a bright one, which the map knows two pixels farther to the right.
TEST(OcclusionEdges, OutlinesGoToTheEdgesOfTheImage) {
  constexpr int kSize = 64;
  const cv::Rect truth(20, 18, 26, 24), known(22, 18, 26, 24);
  cv::Mat1f grey(kSize, kSize, 180.0f), depth(kSize, kSize, 0.0f), ground(kSize, kSize, 1 / 0.8f);
  grey(truth) = 60;
  depth(known) = 0.6f;
  const auto overlap = [&] {
    cv::Mat1b is = cv::Mat1b::zeros(kSize, kSize), both;
    is(truth) = 255;
    const cv::Mat1b said = depth > 0;
    return static_cast<double>(cv::countNonZero(is & said)) / cv::countNonZero(is | said);
  };
  const cv::Mat1f before = depth.clone();
  EXPECT_LT(overlap(), 0.87);
  align_to_edges(grey, ground, {}, &depth);
  EXPECT_GT(overlap(), 0.95);
  EXPECT_EQ(depth(30, 20), 0.6f) << "as near as the thing whose rim it is";
  EXPECT_EQ(depth(30, 46), 0) << "the plane again";
  // Where the image has no edge the map is believed; and at the foot of a thing, where it is as far as the plane.
  depth = before.clone();
  align_to_edges(cv::Mat1f(kSize, kSize, 100.0f), ground, {}, &depth);
  EXPECT_EQ(cv::norm(depth, before, cv::NORM_INF), 0);
  ground = 1 / 0.602f;
  align_to_edges(grey, ground, {}, &depth);
  EXPECT_EQ(cv::norm(depth, before, cv::NORM_INF), 0);
}

TEST(OcclusionEdges, RefusesOptionsThatCannotBe) {
  OcclusionMaskOptions options;
  options.edges.reach = 20;
  EXPECT_THROW(OcclusionMask(kPinhole, options), InputError);
}

}  // namespace
}  // namespace parallax
