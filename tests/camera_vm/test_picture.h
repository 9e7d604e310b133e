// The moving picture that the simulated camera shows when it is given no film, and that the capture check knows: waves
// of brightness, smooth enough to survive JPEG, another phase every frame.
#pragma once

namespace parallax::camera_vm {

inline constexpr int kPhases = 64;

// Grey level of pixel (x, y) of a frame of that phase (frame number modulo kPhases).
inline int test_picture_level(int x, int y, int phase) {
  const int along = (x + 2 * y + 8 * phase) % 512;
  const int wave = along < 256 ? along : 511 - along;
  return 16 + wave * 7 / 8;  // 16 to 239
}

}  // namespace parallax::camera_vm
