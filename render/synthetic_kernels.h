// Inner loops of the synthetic ray caster: one surface against a run of rays (x, y, 1), keeping the nearest hit.
// Depth is kept as its inverse (0: nothing yet), which is linear in the ray for a plane.
#pragma once

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

}  // namespace parallax::detail
