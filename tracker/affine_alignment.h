// Sub-pixel alignment of a 15x15 window under an affine warp, gain and offset, by inverse composition (Baker and
// Matthews 2004). More accurate and slower than the 8x8 kernels of core/patch.h: for the few hundred matches that found
// a map.
//
// Works on smoothed float images of one size, level-0 pixels. Plain values; safe from any thread.
#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>

namespace parallax {

inline constexpr int kWindowHalf = 7;
inline constexpr int kWindowStride = 16;  // 15 samples and an empty one a row
inline constexpr int kWindowRows = 2 * kWindowHalf + 1;
inline constexpr int kWindowFloats = kWindowStride * kWindowRows;

// A grey image as float, smoothed a little: interpolation between its pixels then has next to no bias.
cv::Mat1f smooth_for_alignment(const cv::Mat1b& image);

// A window of the first image with what inverse composition precomputes. Gain and offset are marginalised.
class AffineTemplate {
 public:
  // The window centred on `centre`; false when it leaves the image or holds too little texture.
  bool prepare(const cv::Mat1f& image, const Eigen::Vector2d& centre);

  struct Result {
    Eigen::Vector2d position = Eigen::Vector2d::Zero();
    Eigen::Matrix2d linear = Eigen::Matrix2d::Identity();  // image_from_window
    double correlation = 0;                                // of the aligned windows, weighted
    bool converged = false;
  };
  // Aligns over the position alone, with `linear` held, or (`affine`) over all six parameters. A pixel d of the window
  // appears at position + linear * d / (1 + perspective . d): with the perspective of a slanted surface (1 / px) known,
  // the position has no bias towards where the window grows.
  Result align(const cv::Mat1f& image, const Eigen::Vector2d& start, const Eigen::Matrix2d& linear, bool affine,
               int max_iterations, const Eigen::Vector2d& perspective = Eigen::Vector2d::Zero()) const;

 private:
  using Window = std::array<float, kWindowFloats>;
  alignas(64) Window intensity_{};                // weighted zero mean
  alignas(64) std::array<Window, 6> steepest_{};  // weighted, gain and offset projected out
  Eigen::Matrix<double, 6, 6> information_ = Eigen::Matrix<double, 6, 6>::Zero();
  double variance_sum_ = 0;  // weighted sum of squares of intensity_
};

}  // namespace parallax
