// Draws a synthetic scene through any camera model, by casting rays: one ray table a sample, tiles that look only at
// the surfaces they can see, branch-free inverse-depth tests over a tile (compiled for SSE2, AVX2 and AVX-512, same
// results to the last bit).
//
// A picture is the average of several samples, each from a pose of its own within the exposure and at an offset of its
// own within the pixel, so that motion blur and anti-aliasing come together. Level of detail is chosen per sample with
// a staggered offset, which averages to trilinear filtering.
//
// Owned by one source; not thread-safe. Results do not depend on the number of threads.
#pragma once

#include <array>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "core/camera_model.h"
#include "core/se3.h"
#include "render/synthetic_scene.h"

namespace parallax {

class RayCaster {
 public:
  static constexpr int kMinSamples = 4;
  static constexpr int kMaxSamples = 32;

  // threads: 1, or how many stripes OpenCV's pool may work on at a time.
  RayCaster(std::shared_ptr<const SyntheticScene> scene, const CameraModel& camera, int threads = 1);

  // One sample a pose, evenly spread over the exposure; the number of poses is a multiple of 4, so that the offsets
  // within the pixel average to its centre. Values 0..255, not yet rounded; pixels that see nothing, or that the lens
  // does not reach, are 0. `colour` may be null.
  void render(std::span<const RigidTransform> camera_from_world, cv::Mat1f* grey, cv::Mat3f* colour);

  // Depth along z in metres through the centre of each pixel; 0 where nothing is seen.
  cv::Mat1f depth(const RigidTransform& camera_from_world);

  const CameraModel& camera() const { return camera_; }

 private:
  static constexpr int kTile = 32;
  static constexpr int kTilePixels = kTile * kTile;
  static constexpr int kOffsets = 12;  // within the pixel: 4 for frames of four samples, 8 for the others

  struct TileBounds {
    float x0, x1, y0, y1;  // over the rays (x, y, 1)
  };
  // Rays (x, y, 1) of every pixel, tile after tile; NaN where there is none.
  struct RayTable {
    std::vector<float> x, y;
    std::vector<TileBounds> bounds;
  };
  struct CameraSurface;  // a surface in the camera frame, ready for the kernels
  struct Tile;           // scratch of one tile

  const RayTable& rays(int offset);
  static RayTable make_rays(const CameraModel& camera, double dx, double dy, int tiles_x, int tiles_y);
  std::vector<CameraSurface> surfaces_in(const RigidTransform& camera_from_world) const;
  static void cast_tile(const RayTable& table, int tile, const std::vector<CameraSurface>& surfaces, Tile* scratch);
  template <int Channels>
  void shade_tile(const RayTable& table, int tile, const std::vector<CameraSurface>& surfaces, float lod_factor,
                  Tile* scratch) const;
  // The same for planes and grey alone, many pixels at a time; false: there is something else in the tile.
  bool shade_planes(const RayTable& table, int tile, const std::vector<CameraSurface>& surfaces, float lod_factor,
                    Tile* scratch) const;
  template <int Channels>
  void render_tile(int tile, std::span<const RayTable* const> tables,
                   std::span<const std::vector<CameraSurface>> samples, cv::Mat1f* grey, cv::Mat3f* colour) const;
  template <typename Body>
  void for_each_tile(const Body& body) const;

  std::shared_ptr<const SyntheticScene> scene_;
  CameraModel camera_;
  int threads_ = 1;
  int tiles_x_ = 0, tiles_y_ = 0;
  std::array<std::unique_ptr<RayTable>, kOffsets + 1> tables_;  // the last: pixel centres
  // Per tile row of 4 pixels: how far the ray moves per pixel, {dx/du, dx/dv, dy/du, dy/dv}.
  std::vector<std::array<float, 4>> ray_steps_;
};

}  // namespace parallax
