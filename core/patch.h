// 8x8 patch kernels of the tracker and mapper (PTAM §5.3): affine-warped templates, zero-mean SSD, and sub-pixel
// alignment by inverse composition over translation and mean intensity (Baker and Matthews 2001).
//
// A patch's centre is at its pixel (4, 4) in template coordinates: the template pixel (i, j) samples
// centre + (i - 4, j - 4); so an 8x8 block whose top-left pixel is (x, y) is centred on (x + 4, y + 4).
// Vectorised (SSE2, AVX2, AVX-512 at run time); each has a `_scalar` reference that gives the same result to rounding.
// Plain functions on plain values; safe from any thread.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "core/image.h"

namespace parallax {

struct CornerList;

inline constexpr int kPatchSize = 8;
inline constexpr int kPatchPixels = kPatchSize * kPatchSize;

// A search template: pixels and the sums that zero-mean SSD needs.
struct PatchTemplate {
  alignas(64) std::array<std::uint8_t, kPatchPixels> pixels{};
  int sum = 0;          // of the pixels
  int sum_squares = 0;  // of the squared pixels
};

// Fills sum and sum_squares from pixels.
void finish_template(PatchTemplate* t);

// Samples an 8x8 template from `source` by bilinear interpolation at centre + source_from_template * (i - 4, j - 4).
// Returns false when any sample lies outside the image. centre is in pixels of `source` (its own level).
bool warp_patch(const GreyImage& source, const Eigen::Vector2d& centre, const Eigen::Matrix2d& source_from_template,
                PatchTemplate* out);
bool warp_patch_scalar(const GreyImage& source, const Eigen::Vector2d& centre,
                       const Eigen::Matrix2d& source_from_template, PatchTemplate* out);

// Copies the 8x8 block centred on the integer pixel; false when it leaves the image.
bool copy_patch(const GreyImage& source, int x, int y, PatchTemplate* out);

// Zero-mean sum of squared differences between the template and the 8x8 block centred on (x, y):
// sum((I - mean I) - (T - mean T))^2, rounded down. The block must lie inside the image (4 <= x <= width - 4,
// 4 <= y <= height - 4); not checked.
int zmssd(const PatchTemplate& t, const GreyImage& image, int x, int y);
int zmssd_scalar(const PatchTemplate& t, const GreyImage& image, int x, int y);

// The best corner of a list inside a circle: evaluates zmssd at every corner of `corners` (of the image's own level)
// within `radius` pixels of (cx, cy) whose 8x8 block lies inside the image. Returns the lowest score and puts its
// position at (*best_x, *best_y), the first in row order among equals; when no score is at or below `threshold` it
// returns a value above `threshold` and leaves the position as it was. This is the tracker's inner loop (PTAM §5.3).
int best_zmssd(const PatchTemplate& t, const GreyImage& image, const CornerList& corners, double cx, double cy,
               double radius, int threshold, int* best_x, int* best_y);

// What inverse composition precomputes from a template: gradients (central differences inside, one-sided at the rim)
// and the inverse of the 3x3 normal matrix over (dx, dy, mean).
struct AlignmentTemplate {
  alignas(64) std::array<float, kPatchPixels> intensity{};
  alignas(64) std::array<float, kPatchPixels> dx{}, dy{};
  Eigen::Matrix3f inverse_normal = Eigen::Matrix3f::Zero();
  // Inverse of the 2x2 translation information (mean marginalised), per squared grey level of noise: the covariance of
  // the found position in px^2 at the template's level is grey_noise^2 times this.
  Eigen::Matrix2f covariance = Eigen::Matrix2f::Zero();
  bool valid = false;  // false when the normal matrix is near singular: no texture to align
};
void prepare_alignment(const PatchTemplate& t, AlignmentTemplate* out);

// As warp_patch() and prepare_alignment() in one, better for measuring: samples 10x10 in floating point (nothing is
// rounded to 8 bits, and the gradients are central differences everywhere). Returns false, out->valid false, when one
// of these samples lies outside the image. True with out->valid false: no texture.
bool warp_alignment_template(const GreyImage& source, const Eigen::Vector2d& centre,
                             const Eigen::Matrix2d& source_from_template, AlignmentTemplate* out);
bool warp_alignment_template_scalar(const GreyImage& source, const Eigen::Vector2d& centre,
                                    const Eigen::Matrix2d& source_from_template, AlignmentTemplate* out);

struct AlignmentResult {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  // pixels of the image's own level
  float mean_difference = 0;                           // image minus template, grey levels
  float rms_residual = 0;                              // grey levels, after the mean difference is removed
  int iterations = 0;
  bool converged = false;
};

// Refines `start` (pixels of `image`) until the update is below 0.01 px or `max_iterations` are done. Not converged
// when the window leaves the image, the position moves by more than `max_shift_px` from the start, or the iterations
// end without an update below 0.03 px.
AlignmentResult align_patch(const AlignmentTemplate& t, const GreyImage& image, const Eigen::Vector2d& start,
                            int max_iterations = 10, double max_shift_px = 2.5);
AlignmentResult align_patch_scalar(const AlignmentTemplate& t, const GreyImage& image, const Eigen::Vector2d& start,
                                   int max_iterations = 10, double max_shift_px = 2.5);

}  // namespace parallax
