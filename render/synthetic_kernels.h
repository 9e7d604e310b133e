// Inner loops of the synthetic ray caster: one surface against a run of rays (x, y, 1), keeping the nearest hit.
// Depth is kept as its inverse (0: nothing yet), which is linear in the ray for a plane.
#pragma once

#include <cstddef>
#include <cstdint>

namespace parallax::detail {

// Inverse depth, and the picture coordinates s, t in 0..1 times inverse depth: each is c[0] x + c[1] y + c[2].
struct PlaneCoefficients {
  float w[3], s[3], t[3];
};
// The lateral surface of a cylinder. Ray and camera centre in the cylinder's axes: component i of the ray is
// d[i][0] x + d[i][1] y + d[i][2], of the camera o[i]; axis 2 runs down from the top rim.
struct CylinderCoefficients {
  float d[3][3], o[3];
  float radius_squared, height;
};

void cast_rectangle(const float* x, const float* y, int n, const PlaneCoefficients& c, int id, float* inverse_depth,
                    int* ids);
void cast_disc(const float* x, const float* y, int n, const PlaneCoefficients& c, int id, float* inverse_depth,
               int* ids);
void cast_cylinder(const float* x, const float* y, int n, const CylinderCoefficients& c, int id, float* inverse_depth,
                   int* ids);

// Where rays that hit a plane at these inverse depths meet its picture: texels of level 0, within it.
void plane_texels(const float* x, const float* y, const float* inverse_depth, int n, const PlaneCoefficients& c,
                  float width, float height, float* s, float* t);

// A level of a picture as Texture keeps it: one byte a texel, with its border (render/synthetic_texture.h).
struct GreyTexels {
  const std::uint8_t* data;
  std::ptrdiff_t step;  // bytes from row to row
  float scale;          // from level 0
};
// Adds `shade` times the bilinear value at each (s, t), as Texture::sample() gives it to the last bit.
void add_grey_texels(const GreyTexels& texels, const float* s, const float* t, int n, float shade, float* sum);

// The smallest of n numbers, none of which is negative.
float smallest(const float* values, int n);

}  // namespace parallax::detail
