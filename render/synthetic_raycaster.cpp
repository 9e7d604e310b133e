#include "render/synthetic_raycaster.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/core.hpp>
#include <optional>

#include "core/check.h"
#include "render/synthetic_kernels.h"

namespace parallax {

using Eigen::Vector3d;

namespace {

// Rotated grids within the pixel, in sixteenths: one of four samples, and two that together make eight with eight
// different columns and rows. Each four average to the pixel's centre.
constexpr int kPixelOffsets[12][2] = {{-2, -6}, {6, -2}, {-6, 2}, {2, 6}, {1, 5},  {-5, 1},
                                      {-1, -5}, {5, -1}, {3, -7}, {7, 3}, {-3, 7}, {-7, -3}};
constexpr double kNearMetres = 0.005;
constexpr int kCastsBetweenLooks = 3;
constexpr int kStepGroup = 4;  // pixels that share one entry of ray_steps_

void store(const Vector3d& v, float* out) {
  for (int i = 0; i < 3; ++i) out[i] = static_cast<float>(v[i]);
}

}  // namespace

struct RayCaster::CameraSurface {
  SurfaceShape shape = SurfaceShape::rectangle;
  int id = 0;
  const Texture* texture = nullptr;
  detail::PlaneCoefficients plane{};
  detail::CylinderCoefficients cylinder{};
  float shade = 1;
  float lamp[3] = {0, 0,
                   0};  // cylinder: shade is lamp[0] cos + lamp[1] sin + lamp[2] ahead of the clamp, see shade_tile
  float texels_per_metre = 0;  // cylinder
  TileBounds bounds{};
};

struct RayCaster::Tile {
  alignas(64) float inverse_depth[kTilePixels];
  alignas(64) int ids[kTilePixels];
  float sum[4][kTilePixels];
  alignas(64) float s[kTilePixels], t[kTilePixels];
};

RayCaster::RayCaster(std::shared_ptr<const SyntheticScene> scene, const CameraModel& camera, int threads)
    : scene_(std::move(scene)), camera_(camera), threads_(std::max(1, threads)) {
  tiles_x_ = (camera.width() + kTile - 1) / kTile;
  tiles_y_ = (camera.height() + kTile - 1) / kTile;
  ray_steps_.assign(static_cast<std::size_t>(tiles_x_ * tiles_y_ * kTilePixels / kStepGroup), {0, 0, 0, 0});
  std::size_t i = 0;
  for (int tile = 0; tile < tiles_x_ * tiles_y_; ++tile) {
    const int x0 = tile % tiles_x_ * kTile, y0 = tile / tiles_x_ * kTile;
    for (int j = 0; j < kTilePixels; j += kStepGroup, ++i) {
      const Eigen::Vector2d px(x0 + j % kTile + (kStepGroup - 1) / 2.0, y0 + j / kTile);
      Vector3d left, right, up, down;
      const Eigen::Vector2d dx(0.5, 0), dy(0, 0.5);
      if (!camera.unproject(px - dx, &left) || !camera.unproject(px + dx, &right) || !camera.unproject(px - dy, &up) ||
          !camera.unproject(px + dy, &down))
        continue;
      const Vector3d u = right - left, v = down - up;
      ray_steps_[i] = {static_cast<float>(u.x()), static_cast<float>(v.x()), static_cast<float>(u.y()),
                       static_cast<float>(v.y())};
    }
  }
}

RayCaster::RayTable RayCaster::make_rays(const CameraModel& camera, double dx, double dy, int tiles_x, int tiles_y) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();
  RayTable table;
  table.x.assign(static_cast<std::size_t>(tiles_x * tiles_y * kTilePixels), kNan);
  table.y = table.x;
  for (int tile = 0; tile < tiles_x * tiles_y; ++tile) {
    TileBounds bounds{kInfinity, -kInfinity, kInfinity, -kInfinity};
    for (int j = 0; j < kTilePixels; ++j) {
      const int px = tile % tiles_x * kTile + j % kTile, py = tile / tiles_x * kTile + j / kTile;
      Vector3d ray;
      if (px >= camera.width() || py >= camera.height() || !camera.unproject({px + dx, py + dy}, &ray)) continue;
      const std::size_t i = static_cast<std::size_t>(tile * kTilePixels + j);
      const float x = table.x[i] = static_cast<float>(ray.x()), y = table.y[i] = static_cast<float>(ray.y());
      bounds = {std::min(bounds.x0, x), std::max(bounds.x1, x), std::min(bounds.y0, y), std::max(bounds.y1, y)};
    }
    table.bounds.push_back(bounds);
  }
  return table;
}

const RayCaster::RayTable& RayCaster::rays(int offset) {
  auto& table = tables_[static_cast<std::size_t>(offset)];
  if (!table) {
    const double dx = offset == kOffsets ? 0 : kPixelOffsets[offset][0] / 16.0;
    const double dy = offset == kOffsets ? 0 : kPixelOffsets[offset][1] / 16.0;
    table = std::make_unique<RayTable>(make_rays(camera_, dx, dy, tiles_x_, tiles_y_));
  }
  return *table;
}

namespace {

struct RayRectangle {
  double x0 = 1e30, x1 = -1e30, y0 = 1e30, y1 = -1e30;
  void add(const Vector3d& p) {
    x0 = std::min(x0, p.x() / p.z()), x1 = std::max(x1, p.x() / p.z());
    y0 = std::min(y0, p.y() / p.z()), y1 = std::max(y1, p.y() / p.z());
  }
  // The part of a segment in front of the near plane.
  void add_segment(const Vector3d& a, const Vector3d& b) {
    if (a.z() >= kNearMetres) add(a);
    if (b.z() >= kNearMetres) add(b);
    if ((a.z() >= kNearMetres) != (b.z() >= kNearMetres)) add(a + (b - a) * ((kNearMetres - a.z()) / (b.z() - a.z())));
  }
  bool empty() const { return x0 > x1; }
};

}  // namespace

std::vector<RayCaster::CameraSurface> RayCaster::surfaces_in(const RigidTransform& camera_from_world) const {
  std::vector<CameraSurface> out;
  const auto& surfaces = scene_->surfaces();
  out.reserve(surfaces.size());
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const Surface& surface = surfaces[i];
    CameraSurface s;
    s.shape = surface.shape;
    s.id = static_cast<int>(out.size());
    s.texture = &scene_->texture(surface.texture);
    const Vector3d p = camera_from_world * surface.origin, u = camera_from_world.R * surface.u,
                   v = camera_from_world.R * surface.v;
    RayRectangle bounds;
    if (surface.shape == SurfaceShape::cylinder) {
      const double radius = u.norm(), height = v.norm();
      const Vector3d e1 = u / radius, axis = v / height, e2 = e1.cross(axis);
      const Vector3d* axes[3] = {&e1, &e2, &axis};
      for (int k = 0; k < 3; ++k) {
        store(*axes[k], s.cylinder.d[k]);
        s.cylinder.o[k] = static_cast<float>(-axes[k]->dot(p));
      }
      s.cylinder.radius_squared = static_cast<float>(radius * radius);
      s.cylinder.height = static_cast<float>(height);
      s.texels_per_metre = static_cast<float>(s.texture->height() / height);
      // The mantle's shade is taken between its values at four sides: cheap, smooth, and the same inside and outside.
      const Vector3d w1 = surface.u / radius, w2 = w1.cross(Vector3d(surface.v / height));
      const double a = SyntheticScene::shading(w1), b = SyntheticScene::shading(-w1), c = SyntheticScene::shading(w2),
                   d = SyntheticScene::shading(-w2);
      s.lamp[0] = static_cast<float>((a - b) / 2), s.lamp[1] = static_cast<float>((c - d) / 2);
      s.lamp[2] = static_cast<float>((a + b + c + d) / 4);
      Vector3d corner[8];
      for (int k = 0; k < 8; ++k)
        corner[k] = p + (k & 1 ? radius : -radius) * e1 + (k & 2 ? radius : -radius) * e2 + (k & 4 ? 1.0 : 0.0) * v;
      for (int k = 0; k < 8; ++k)
        for (const int bit : {1, 2, 4})
          if (!(k & bit)) bounds.add_segment(corner[k], corner[k | bit]);
    } else {
      const Vector3d n = u.cross(v);
      const double offset = n.dot(p);
      if (std::abs(offset) < 1e-9 * n.norm() || (offset < 0 && !surface.two_sided)) continue;
      const Vector3d w = n / offset;
      const Vector3d us = v.cross(n) / u.dot(v.cross(n)), vs = n.cross(u) / v.dot(n.cross(u));
      store(w, s.plane.w);
      store(us - us.dot(p) * w, s.plane.s);
      store(vs - vs.dot(p) * w, s.plane.t);
      const Vector3d outwards = -(surface.u.cross(surface.v)).normalized();
      s.shade = static_cast<float>(surface.brightness > 0 ? surface.brightness : SyntheticScene::shading(outwards));
      const Vector3d corner[4] = {p, p + u, p + u + v, p + v};
      for (int k = 0; k < 4; ++k) bounds.add_segment(corner[k], corner[(k + 1) % 4]);
    }
    if (bounds.empty()) continue;
    constexpr double kMargin = 1e-5;
    s.bounds = {static_cast<float>(bounds.x0 - kMargin), static_cast<float>(bounds.x1 + kMargin),
                static_cast<float>(bounds.y0 - kMargin), static_cast<float>(bounds.y1 + kMargin)};
    out.push_back(s);
  }
  return out;
}

void RayCaster::cast_tile(const RayTable& table, int tile, const std::vector<CameraSurface>& surfaces, Tile* scratch) {
  std::fill_n(scratch->inverse_depth, kTilePixels, 0.0f);
  std::fill_n(scratch->ids, kTilePixels, -1);
  const float* x = table.x.data() + static_cast<std::ptrdiff_t>(tile) * kTilePixels;
  const float* y = table.y.data() + static_cast<std::ptrdiff_t>(tile) * kTilePixels;
  const TileBounds& b = table.bounds[static_cast<std::size_t>(tile)];
  // A plane that is farther in all of the tile than whatever is there already is left out: no pixel would change.
  float farthest = 0;
  int casts = 0;
  const float reach_x = std::max(std::abs(b.x0), std::abs(b.x1)), reach_y = std::max(std::abs(b.y0), std::abs(b.y1));
  for (const CameraSurface& s : surfaces) {
    if (s.bounds.x0 > b.x1 || s.bounds.x1 < b.x0 || s.bounds.y0 > b.y1 || s.bounds.y1 < b.y0) continue;
    if (s.shape != SurfaceShape::cylinder) {
      constexpr float kRounding = 1e-6f;
      const float* w = s.plane.w;
      const float nearest = w[0] * (w[0] > 0 ? b.x1 : b.x0) + w[1] * (w[1] > 0 ? b.y1 : b.y0) + w[2];
      const float margin = kRounding * (std::abs(w[0]) * reach_x + std::abs(w[1]) * reach_y + std::abs(w[2]));
      if (nearest + margin < farthest) continue;
    }
    if (++casts % kCastsBetweenLooks == 0) farthest = detail::smallest(scratch->inverse_depth, kTilePixels);
    switch (s.shape) {
      case SurfaceShape::rectangle:
        detail::cast_rectangle(x, y, kTilePixels, s.plane, s.id, scratch->inverse_depth, scratch->ids);
        break;
      case SurfaceShape::disc:
        detail::cast_disc(x, y, kTilePixels, s.plane, s.id, scratch->inverse_depth, scratch->ids);
        break;
      case SurfaceShape::cylinder:
        detail::cast_cylinder(x, y, kTilePixels, s.cylinder, s.id, scratch->inverse_depth, scratch->ids);
        break;
    }
  }
}

namespace {

// The footprint of a pixel on the picture of a plane, squared texels. sn, tn: where on the picture, 0..1.
float plane_footprint(const detail::PlaneCoefficients& c, const std::array<float, 4>& step, float sn, float tn, float z,
                      float width, float height) {
  const float sx = (c.s[0] - sn * c.w[0]) * z * width, sy = (c.s[1] - sn * c.w[1]) * z * width;
  const float tx = (c.t[0] - tn * c.w[0]) * z * height, ty = (c.t[1] - tn * c.w[1]) * z * height;
  const float su = sx * step[0] + sy * step[2], sv = sx * step[1] + sy * step[3];
  const float tu = tx * step[0] + ty * step[2], tv = tx * step[1] + ty * step[3];
  return std::max(std::abs(su * tv - sv * tu), 0.25f * std::max(su * su + tu * tu, sv * sv + tv * tv));
}

// floor(log2(sqrt(footprint * factor))) from the exponent.
int level_of(float footprint, float lod_factor) {
  const int exponent = static_cast<int>(std::bit_cast<std::uint32_t>(footprint * lod_factor) >> 23) - 127;
  return std::clamp(exponent >= 0 ? exponent / 2 : 0, 0, kTextureLevels - 1);
}

}  // namespace

bool RayCaster::shade_planes(const RayTable& table, int tile, const std::vector<CameraSurface>& surfaces,
                             float lod_factor, Tile* scratch) const {
  const float* xs = table.x.data() + static_cast<std::ptrdiff_t>(tile) * kTilePixels;
  const float* ys = table.y.data() + static_cast<std::ptrdiff_t>(tile) * kTilePixels;
  const auto* steps = ray_steps_.data() + static_cast<std::ptrdiff_t>(tile) * (kTilePixels / kStepGroup);
  const int* ids = scratch->ids;
  for (int i = 0; i < kTilePixels; ++i)
    if (ids[i] >= 0 && surfaces[static_cast<std::size_t>(ids[i])].shape == SurfaceShape::cylinder) return false;
  int last_id = -1, last_group = -1, level = 0;
  for (int begin = 0, end = 0; begin < kTilePixels; begin = end) {
    const int id = ids[begin];
    for (end = begin + 1; end < kTilePixels && ids[end] == id;) ++end;
    if (id < 0) continue;
    const CameraSurface& surface = surfaces[static_cast<std::size_t>(id)];
    const auto& c = surface.plane;
    const float width = static_cast<float>(surface.texture->width()),
                height = static_cast<float>(surface.texture->height());
    detail::plane_texels(xs + begin, ys + begin, scratch->inverse_depth + begin, end - begin, c, width, height,
                         scratch->s + begin, scratch->t + begin);
    // Stretches of one level.
    int first = begin, stretch_level = -1;
    const auto flush = [&](int to) {
      if (to == first) return;
      const cv::Mat& grey = surface.texture->grey(stretch_level);
      detail::add_grey_texels(
          {grey.data, static_cast<std::ptrdiff_t>(grey.step[0]), surface.texture->scale(stretch_level)},
          scratch->s + first, scratch->t + first, to - first, surface.shade, scratch->sum[0] + first);
      first = to;
    };
    for (int i = begin; i < end; i = (i / kStepGroup + 1) * kStepGroup) {
      if (id != last_id || i / kStepGroup != last_group) {
        const float x = xs[i], y = ys[i], z = 1.0f / scratch->inverse_depth[i];
        const float sn = (c.s[0] * x + c.s[1] * y + c.s[2]) * z, tn = (c.t[0] * x + c.t[1] * y + c.t[2]) * z;
        level = level_of(plane_footprint(c, steps[i / kStepGroup], sn, tn, z, width, height), lod_factor);
        last_id = id, last_group = i / kStepGroup;
      }
      if (level != stretch_level) {
        flush(i);
        stretch_level = level;
      }
    }
    flush(end);
  }
  return true;
}

template <int Channels>
void RayCaster::shade_tile(const RayTable& table, int tile, const std::vector<CameraSurface>& surfaces,
                           float lod_factor, Tile* scratch) const {
  const float* xs = table.x.data() + static_cast<std::ptrdiff_t>(tile) * kTilePixels;
  const float* ys = table.y.data() + static_cast<std::ptrdiff_t>(tile) * kTilePixels;
  const auto* steps = ray_steps_.data() + static_cast<std::ptrdiff_t>(tile) * (kTilePixels / kStepGroup);
  int last_id = -1, last_group = -1, level = 0;
  for (int i = 0; i < kTilePixels; ++i) {
    const int id = scratch->ids[i];
    if (id < 0) continue;
    const CameraSurface& surface = surfaces[static_cast<std::size_t>(id)];
    const float x = xs[i], y = ys[i], z = 1.0f / scratch->inverse_depth[i];
    const float width = static_cast<float>(surface.texture->width()),
                height = static_cast<float>(surface.texture->height());
    const bool new_level = id != last_id || i / kStepGroup != last_group;
    const auto& step = steps[i / kStepGroup];
    float s, t, shade = surface.shade, footprint = 1;  // squared, in texels
    if (surface.shape == SurfaceShape::cylinder) {
      const auto& c = surface.cylinder;
      const float d0 = c.d[0][0] * x + c.d[0][1] * y + c.d[0][2], d1 = c.d[1][0] * x + c.d[1][1] * y + c.d[1][2];
      const float d2 = c.d[2][0] * x + c.d[2][1] * y + c.d[2][2];
      const float p0 = c.o[0] + z * d0, p1 = c.o[1] + z * d1;
      const float turn = std::atan2(p1, p0) * (0.5f * std::numbers::inv_pi_v<float>);
      s = (turn < 0 ? turn + 1 : turn) * width;
      t = (c.o[2] + z * d2) / c.height * height;
      const float radius = std::sqrt(c.radius_squared);
      shade = (surface.lamp[0] * p0 + surface.lamp[1] * p1) / radius + surface.lamp[2];
      if (new_level) {
        const float cosine = std::abs(p0 * d0 + p1 * d1) / (radius * std::sqrt(d0 * d0 + d1 * d1 + d2 * d2));
        const float area = std::abs(step[0] * step[3] - step[1] * step[2]);
        const float minor = surface.texels_per_metre * surface.texels_per_metre * z * z * area;
        const float c1 = std::max(cosine, 0.05f);
        footprint = std::max(minor / c1, 0.25f * minor / (c1 * c1));
      }
    } else {
      const auto& c = surface.plane;
      const float sn = (c.s[0] * x + c.s[1] * y + c.s[2]) * z, tn = (c.t[0] * x + c.t[1] * y + c.t[2]) * z;
      s = sn * width, t = tn * height;
      if (new_level) footprint = plane_footprint(c, step, sn, tn, z, width, height);
    }
    if (new_level) {
      level = level_of(footprint, lod_factor);
      last_id = id, last_group = i / kStepGroup;
    }
    float value[Channels];
    surface.texture->sample<Channels>(std::clamp(s, 0.0f, width), std::clamp(t, 0.0f, height), level, value);
    for (int c = 0; c < Channels; ++c) scratch->sum[c][i] += shade * value[c];
  }
}

template <int Channels>
void RayCaster::render_tile(int tile, std::span<const RayTable* const> tables,
                            std::span<const std::vector<CameraSurface>> samples, cv::Mat1f* grey,
                            cv::Mat3f* colour) const {
  Tile scratch;
  for (int c = 0; c < Channels; ++c) std::fill_n(scratch.sum[c], kTilePixels, 0.0f);
  const int n = static_cast<int>(samples.size());
  // A sample stands for a quarter of a pixel's area (the samples beyond four are there for blur): half the footprint.
  // Its level is rounded down from log2(half footprint) + 0.5 + a staggered offset in (-0.5, 0.5).
  for (int i = 0; i < n; ++i) {
    const float stagger = (static_cast<float>(i % kMinSamples) + 0.5f) / kMinSamples - 0.5f;
    const float lod_factor = std::exp2(2.0f * (-1.0f + 0.5f + stagger));
    const auto& surfaces = samples[static_cast<std::size_t>(i)];
    const RayTable& table = *tables[static_cast<std::size_t>(i)];
    cast_tile(table, tile, surfaces, &scratch);
    if (Channels == 1 && shade_planes(table, tile, surfaces, lod_factor, &scratch)) continue;
    shade_tile<Channels>(table, tile, surfaces, lod_factor, &scratch);
  }
  const float scale = 1.0f / static_cast<float>(n);
  const int x0 = tile % tiles_x_ * kTile, y0 = tile / tiles_x_ * kTile;
  const int columns = std::min(kTile, camera_.width() - x0), rows = std::min(kTile, camera_.height() - y0);
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      const int i = r * kTile + c;
      (*grey)(y0 + r, x0 + c) = scratch.sum[Channels - 1][i] * scale;
      if constexpr (Channels == 4)
        (*colour)(y0 + r, x0 + c) = {scratch.sum[0][i] * scale, scratch.sum[1][i] * scale, scratch.sum[2][i] * scale};
    }
}

template <typename Body>
void RayCaster::for_each_tile(const Body& body) const {
  const cv::Range all(0, tiles_x_ * tiles_y_);
  const auto run = [&](const cv::Range& range) {
    for (int tile = range.start; tile < range.end; ++tile) body(tile);
  };
  if (threads_ == 1)
    run(all);
  else
    cv::parallel_for_(all, run, threads_);
}

void RayCaster::render(std::span<const RigidTransform> camera_from_world, cv::Mat1f* grey, cv::Mat3f* colour) {
  PARALLAX_CHECK(!camera_from_world.empty() && camera_from_world.size() % 4 == 0, "samples come in fours");
  std::vector<std::vector<CameraSurface>> samples;
  std::vector<const RayTable*> tables;
  for (std::size_t i = 0; i < camera_from_world.size(); ++i) {
    samples.push_back(surfaces_in(camera_from_world[i]));
    const int sample = static_cast<int>(i);
    tables.push_back(&rays(camera_from_world.size() == 4 ? sample : 4 + sample % 8));
  }
  grey->create(camera_.height(), camera_.width());
  if (colour) colour->create(camera_.height(), camera_.width());
  for_each_tile([&](int tile) {
    if (colour)
      render_tile<4>(tile, tables, samples, grey, colour);
    else
      render_tile<1>(tile, tables, samples, grey, nullptr);
  });
}

cv::Mat1f RayCaster::depth(const RigidTransform& camera_from_world) {
  const auto surfaces = surfaces_in(camera_from_world);
  const RayTable& table = rays(kOffsets);
  cv::Mat1f out(camera_.height(), camera_.width());
  for_each_tile([&](int tile) {
    Tile scratch;
    cast_tile(table, tile, surfaces, &scratch);
    const int x0 = tile % tiles_x_ * kTile, y0 = tile / tiles_x_ * kTile;
    for (int r = 0; r < std::min(kTile, camera_.height() - y0); ++r)
      for (int c = 0; c < std::min(kTile, camera_.width() - x0); ++c) {
        const float w = scratch.inverse_depth[r * kTile + c];
        out(y0 + r, x0 + c) = w > 0 ? 1.0f / w : 0.0f;
      }
  });
  return out;
}

}  // namespace parallax
