#include "render/imgui_fonts.h"

#include <imgui.h>

#include <cmath>
#include <filesystem>

namespace parallax {
namespace {
constexpr const char* kFont = "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf";  // Debian's fonts-dejavu-core
constexpr float kFontSize_px = 16, kOwnFontSize_px = 13;
}  // namespace

void load_interface_font(float pixel_scale) {
  ImFontAtlas* atlas = ImGui::GetIO().Fonts;
  atlas->Clear();
  atlas->SetTexID(nullptr);
  // Latin letters, Greek for sigmas and micros, and a few arrows and marks.
  static const ImWchar ranges[] = {0x0020, 0x00ff, 0x0370, 0x03ff, 0x2010, 0x2026, 0x2190, 0x2193, 0x2212, 0x2212, 0};
  std::error_code ignored;
  if (std::filesystem::exists(kFont, ignored)) {
    atlas->AddFontFromFileTTF(kFont, std::round(kFontSize_px * pixel_scale), nullptr, ranges);
  } else {
    ImFontConfig config;
    config.SizePixels = std::round(kOwnFontSize_px * pixel_scale);
    atlas->AddFontDefault(&config);
  }
  atlas->Build();
}

}  // namespace parallax
