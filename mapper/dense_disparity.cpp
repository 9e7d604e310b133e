#include "mapper/dense_disparity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <opencv2/calib3d.hpp>

#include "core/check.h"
#include "core/error.h"

namespace parallax {
namespace {

constexpr double kWidestShare = 0.25;  // of the width that a disparity may have
constexpr double kFixedPoint = 16;     // of OpenCV's disparities
constexpr int kHalf = 3;               // the refinement's window is 7x7 pixels
constexpr int kSmoothness = 8;         // P1 a pixel of the block, as OpenCV recommends; P2 is four times that
constexpr int kPreFilterCap = 31;      // of the horizontal gradient
constexpr double kFarthestStep = 1;    // pixels that the refinement may go

// Sum of squared differences, means taken out, of the windows at (x, y) and (x - disparity, y).
double difference(const GreyImage& left, const GreyImage& right, int x, int y, int disparity) {
  int sum = 0, squares = 0;
  for (int v = -kHalf; v <= kHalf; ++v) {
    const std::uint8_t* a = left.ptr(y + v) + x - kHalf;
    const std::uint8_t* b = right.ptr(y + v) + x - disparity - kHalf;
    for (int u = 0; u <= 2 * kHalf; ++u) {
      const int d = a[u] - b[u];
      sum += d;
      squares += d * d;
    }
  }
  constexpr double pixels = (2 * kHalf + 1) * (2 * kHalf + 1);
  return squares - sum * static_cast<double>(sum) / pixels;
}

// Sum over the window of squared differences between a pixel and the next one in the row.
double row_contrast(const GreyImage& left, int x, int y) {
  int squares = 0;
  for (int v = -kHalf; v <= kHalf; ++v) {
    const std::uint8_t* a = left.ptr(y + v) + x - kHalf;
    for (int u = 0; u < 2 * kHalf; ++u) squares += (a[u + 1] - a[u]) * (a[u + 1] - a[u]);
  }
  return squares;
}

// Between the pixels; 0 when there is nothing to hold on to.
double refined(const GreyImage& left, const GreyImage& right, int x, int y, double found, double least_contrast) {
  int whole = static_cast<int>(std::lround(found));
  if (y < kHalf || y + kHalf >= left.rows || x - kHalf < 0 || x + kHalf >= left.cols) return 0;
  if (x - whole - 1 - kHalf < 0 || x - whole + 1 + kHalf >= left.cols) return 0;
  constexpr double pixels = (2 * kHalf + 1) * (2 * kHalf);
  if (row_contrast(left, x, y) < pixels * least_contrast * least_contrast) return 0;
  std::array<double, 3> cost{};
  for (int i = -1; i <= 1; ++i) cost[static_cast<std::size_t>(i + 1)] = difference(left, right, x, y, whole + i);
  const double bend = cost[0] - 2 * cost[1] + cost[2];
  if (!(bend > 0)) return 0;
  const double step = 0.5 * (cost[0] - cost[2]) / bend;
  if (std::abs(step) > kFarthestStep) return 0;
  return whole + step;
}

}  // namespace

struct DenseDisparity::Matcher {
  cv::Ptr<cv::StereoSGBM> library;
  cv::Mat left, right, fixed, scratch;
};

void DisparityOptions::validate() const {
  const auto need = [](bool good, const char* field, const char* expected) {
    if (!good) throw InputError(std::string("dense disparity: ") + field + ": expected " + expected);
  };
  need(nearest_m > 0.01 && nearest_m < 100, "nearest_m", "0.01 to 100");
  need(block_px >= 1 && block_px <= 21 && block_px % 2 == 1, "block_px", "an odd number from 1 to 21");
  need(left_right_px > 0, "left_right_px", "more than 0");
  need(uniqueness_percent >= 0 && uniqueness_percent < 100, "uniqueness_percent", "0 to 99");
  need(least_speckle_px >= 0, "least_speckle_px", "0 or more");
  need(least_contrast >= 0, "least_contrast", "0 or more");
}

DenseDisparity::DenseDisparity(const StereoCamera& camera, const DisparityOptions& options)
    : camera_(camera), options_(options), matcher_(std::make_unique<Matcher>()) {
  options_.validate();
  // The library searches multiples of 16.
  const int most = std::max(16, static_cast<int>(kWidestShare * camera.width) / 16 * 16);
  range_ = std::clamp(static_cast<int>(std::ceil(camera.disparity_px(options.nearest_m) / 16)) * 16, 16, most);
  const int block = options.block_px * options.block_px;
  matcher_->library = cv::StereoSGBM::create(0, range_, options.block_px, kSmoothness * block, 4 * kSmoothness * block,
                                             cvRound(options.left_right_px), kPreFilterCap, options.uniqueness_percent,
                                             0, 0, cv::StereoSGBM::MODE_SGBM);
}

DenseDisparity::~DenseDisparity() = default;

cv::Mat1f DenseDisparity::compute(const GreyImage& left, const GreyImage& right) {
  PARALLAX_CHECK(left.cols == camera_.width && left.rows == camera_.height && right.size() == left.size(),
                 "images of the rectified camera's size");
  // The library leaves out as many columns on the left as it searches: room for them is put there.
  Matcher& m = *matcher_;
  cv::copyMakeBorder(left, m.left, 0, 0, range_, 0, cv::BORDER_REPLICATE);
  cv::copyMakeBorder(right, m.right, 0, 0, range_, 0, cv::BORDER_REPLICATE);
  m.library->compute(m.left, m.right, m.fixed);
  cv::filterSpeckles(m.fixed, 0, options_.least_speckle_px, kFixedPoint, m.scratch);
  cv::Mat1f disparity(left.size(), 0.0F);
  for (int y = 0; y < left.rows; ++y) {
    const auto* found = m.fixed.ptr<std::int16_t>(y) + range_;
    for (int x = 0; x < left.cols; ++x)
      if (found[x] > 0)
        disparity(y, x) =
            static_cast<float>(refined(left, right, x, y, found[x] / kFixedPoint, options_.least_contrast));
  }
  return disparity;
}

}  // namespace parallax
