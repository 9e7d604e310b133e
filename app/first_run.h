// What the window asks when nothing is known of the camera's lens. Dear ImGui; the window's thread.
#pragma once

#include <string>

namespace parallax {

enum class FirstRunChoice { none, calibrate, estimate };

// Drawn over the camera's image. `camera` names it.
FirstRunChoice draw_first_run(const std::string& camera);

}  // namespace parallax
