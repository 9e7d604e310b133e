// What is drawn over a camera image, as plain data: whoever composes a picture (the AR view, the map view, games) fills
// one of these, and render/scene_renderer draws it, in a window or off-screen. No OpenGL here.
//
// Frames: world, metres. Screen positions: pixels of the camera's image, level 0, centre of the top-left pixel (0, 0).
// Colours: sRGB-encoded 0..1 with straight alpha. A value: build it on any thread, hand it over by move.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "core/se3.h"

namespace parallax {

struct DrawColour {
  float r = 1, g = 1, b = 1, a = 1;
};

struct MeshVertex {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();
  Eigen::Vector2f uv = Eigen::Vector2f::Zero();
  DrawColour colour;
};

// Triangles in a frame of their own (metres, counter-clockwise seen from outside). Immutable once shared: the renderer
// keeps what it uploaded for as long as somebody holds the pointer.
struct Mesh {
  std::vector<MeshVertex> vertices;
  std::vector<std::uint32_t> indices;  // three a triangle
  cv::Mat4b texture;                   // RGBA, sRGB-encoded; empty: white
  bool two_sided = false;
};

struct MeshInstance {
  std::shared_ptr<const Mesh> mesh;
  Eigen::Affine3f world_from_model = Eigen::Affine3f::Identity();
  DrawColour tint;
  float emission = 0;        // share of its colour that it gives off by itself; above 1 it shines brighter than that
  bool casts_shadow = true;  // a soft contact shadow on the shadow plane
};

// A straight line of the world, bent as the lens bends it.
struct WorldLine {
  Eigen::Vector3f a = Eigen::Vector3f::Zero(), b = Eigen::Vector3f::Zero();
  DrawColour colour;
  float width_px = 1.5f;
};

struct WorldPoint {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();
  DrawColour colour;
  float size_px = 4;  // diameter
};

struct ScreenLine {
  Eigen::Vector2f a_px = Eigen::Vector2f::Zero(), b_px = Eigen::Vector2f::Zero();
  DrawColour colour;
  float width_px = 1.5f;
};

struct ScreenPoint {
  Eigen::Vector2f px = Eigen::Vector2f::Zero();
  DrawColour colour;
  float size_px = 4;
  bool ring = false;  // an outline instead of a disc
};

// A square grid on z = 0 of the plane's frame, centred on its origin.
struct PlaneGrid {
  RigidTransform world_from_plane;
  double half_extent_m = 0.2;
  int cells = 10;  // along each side
  DrawColour colour;
};

// A soft round spot that always faces the camera: smoke, sparks, glow. At r radii from its middle it has (1 - r^2)^2 of
// its colour's alpha.
struct Sprite {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();
  float radius_m = 0.01f;
  DrawColour colour;
  bool additive = false;  // adds light (colour times alpha, in linear light) instead of covering
};

struct DrawList {
  cv::Mat background;  // CV_8UC3 (BGR) or CV_8UC1, of the camera's size; empty: background_colour
  DrawColour background_colour{0.1f, 0.11f, 0.13f, 1};
  CameraModel camera;
  std::optional<RigidTransform> camera_from_world;  // nothing: only the screen items are drawn
  std::optional<RigidTransform> shadow_plane;       // world_from_plane: where contact shadows fall
  // Light of the scene as estimated from the image (render/light_estimate): linear, 1 is a fully lit white wall.
  Eigen::Vector3f ambient_light = Eigen::Vector3f::Constant(1);

  std::vector<PlaneGrid> grids;
  // Meshes without transparency in colour, texture or tint are drawn first and hide each other by depth; the others
  // come after them, farthest middle first, each with its back faces before its front faces. They hide nothing by
  // depth.
  std::vector<MeshInstance> meshes;
  // What real things hide in this frame, as render/occlusion_mask makes it: their depth along the camera's z, metres,
  // spread over the camera's image, of any size; 0: nothing is hidden here. Meshes, sprites and shadows behind it are
  // not seen; grids, lines and points are.
  cv::Mat1f occlusion_depth;
  std::vector<Sprite> sprites;  // drawn last of the world's things, farthest first
  std::vector<WorldLine> world_lines;
  std::vector<WorldPoint> world_points;
  std::vector<ScreenLine> screen_lines;
  std::vector<ScreenPoint> screen_points;
};

}  // namespace parallax
