#include "core/fast.h"

#include <algorithm>

#include "core/check.h"
#include "core/fast_rows.h"

namespace parallax {
namespace {

using detail::FastRow;

void find_corners(const GreyImage& image, int threshold, FastRow find_in_row, CornerList* out) {
  PARALLAX_CHECK(out != nullptr, "fast_corners needs a list to fill");
  PARALLAX_CHECK(image.cols <= INT16_MAX && image.rows <= INT16_MAX, "corners are held in 16 bits");
  threshold = std::clamp(threshold, 0, 255);
  const int height = image.rows, width = image.cols;
  std::vector<Corner>& corners = out->corners;
  out->rows.assign(static_cast<std::size_t>(height) + 1, 0);
  // Every row may write as many corners as it has pixels; what is too much is cut off at the end.
  const std::size_t room = static_cast<std::size_t>(width) + detail::kFastRowSlack;
  std::size_t count = 0;
  for (int y = 0; y < height; ++y) {
    out->rows[static_cast<std::size_t>(y)] = static_cast<int>(count);
    if (y < 3 || y + 3 >= height || width < 7) continue;
    if (corners.size() < count + room) corners.resize(std::max(2 * corners.size(), count + room));
    const Corner* end = find_in_row(image.ptr(y), image.step[0], width, y, threshold, corners.data() + count);
    count = static_cast<std::size_t>(end - corners.data());
  }
  out->rows[static_cast<std::size_t>(height)] = static_cast<int>(count);
  corners.resize(count);
}

}  // namespace

void fast_corners(const GreyImage& image, int threshold, CornerList* out) {
  find_corners(image, threshold, detail::fast_row(), out);
}

void fast_corners_scalar(const GreyImage& image, int threshold, CornerList* out) {
  find_corners(image, threshold, detail::fast_row_scalar, out);
}

}  // namespace parallax
