// Draws the list of the stored maps (app/maps_panel) with Dear ImGui, in the middle of the display; legible and
// complete at 640x480.
//
// Between ImGui::NewFrame() and ImGui::Render(); the window's thread.
#pragma once

#include <functional>

#include "app/key_bindings.h"
#include "app/maps_panel.h"

namespace parallax {

// Makes a texture of an image, once for each key from 0 on.
using MakeMapPicture = std::function<void*(int key, const cv::Mat& image)>;

// Draws nothing when it is closed. What a click chose is carried out on the panel, and returned.
MapsChoice draw_maps_panel(const MakeMapPicture& picture, const std::string& note, MapsPanel* panel);

}  // namespace parallax
