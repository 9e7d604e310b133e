// The interface's font: DejaVu Sans where it is installed, else the one that Dear ImGui brings.
#pragma once

namespace parallax {

// Replaces the fonts of the current Dear ImGui context and builds their atlas (an off-screen context needs that before
// its first frame; Window does it by itself). `pixel_scale`: pixels of the framebuffer for one of an ordinary screen, 2
// on a high-DPI one.
void load_interface_font(float pixel_scale);

}  // namespace parallax
