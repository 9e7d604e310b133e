// Cameras that several tests look through.
#pragma once

#include "core/camera_model.h"

namespace parallax::testing {

// Of each kind: 0 pinhole, 1 radtan, 2 Kannala-Brandt, 3 FOV.
inline CameraModel lens(int kind) {
  switch (kind) {
    case 0:
      return CameraModel(CameraModelKind::pinhole, 640, 480, {500, 505}, {320, 238});
    case 1:
      return CameraModel(CameraModelKind::radtan, 640, 480, {500, 505}, {320, 238},
                         {-0.2, 0.05, 1e-3, -5e-4, 0.01, 0.02, -0.01, 0.001}, 8);
    case 2:
      return CameraModel(CameraModelKind::kannala_brandt, 640, 480, {400, 405}, {320, 238},
                         {0.02, -0.01, 0.003, -0.001}, 4);
    default:
      return CameraModel(CameraModelKind::fov, 640, 480, {400, 405}, {320, 238}, {0.9}, 1);
  }
}

// The wide FOV lens PTAM was made for.
inline CameraModel wide_lens() { return {CameraModelKind::fov, 640, 480, {375.0, 376.0}, {321.4, 238.2}, {0.9}, 1}; }

}  // namespace parallax::testing
