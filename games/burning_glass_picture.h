// How char and light look: textures for the sheet. RGBA (red first), sRGB-encoded, straight alpha; row 0 is the side of
// the highest y, as a picture that is seen from above with y up.
//
// Twice as fine as the sheet's cells, with the material's own grain between them. A BurnPicture belongs to one thread.
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "games/burning_glass_sheet.h"

namespace parallax::burning {

inline constexpr int kPictureScale = 2;
inline constexpr int kPictureSize = kSheetCells * kPictureScale;

// The char on the sheet as a picture that is brought up to date where the sheet changed.
class BurnPicture {
 public:
  BurnPicture() : picture_(kPictureSize, kPictureSize, cv::Vec4b(0, 0, 0, 0)) {}
  // Paints the cells of the box again, and their neighbours.
  void paint(const Material& material, const std::vector<std::uint16_t>& charred, const SheetBox& box);
  const cv::Mat4b& picture() const { return picture_; }

 private:
  cv::Mat4b picture_;
};

// The light on the sheet and the glow of what is hot, by cells: kSheetCells a side. `rays` is how many the light was
// sampled with: fewer of them are smoothed more.
cv::Mat4b light_picture(const std::vector<float>& concentration, const SheetBox& lit, int rays,
                        const std::vector<float>& temperature_k, const SheetBox& warm);

}  // namespace parallax::burning
