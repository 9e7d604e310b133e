// Sub-pixel alignment on a texture whose value is known at every real position.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <limits>

#include "core/patch.h"
#include "tests/core/kernel_images.h"

namespace parallax {
namespace {

constexpr int kImageSize = 26;
const Eigen::Matrix2d kIdentity = Eigen::Matrix2d::Identity();

struct Pair {
  ExactImage first{kImageSize, kImageSize}, second{kImageSize, kImageSize};
  Eigen::Vector2d shift;  // second(x + shift) shows what first(x) shows

  Pair(std::mt19937* random, double shortest_wave, double noise_grey, double offset = 0) {
    std::uniform_real_distribution<double> unit(0, 1);
    std::normal_distribution<double> noise(0, 1);
    const WaveTexture texture(random, shortest_wave, 40.0, 24, 25.0);
    shift = {unit(*random), unit(*random)};
    first.fill([&](int x, int y) { return texture(x, y) + noise_grey * noise(*random); });
    second.fill(
        [&](int x, int y) { return texture(x - shift.x(), y - shift.y()) + offset + noise_grey * noise(*random); });
  }
};

TEST(AlignPatch, FindsSubPixelShiftsWithoutBias) {
  std::mt19937 random(20);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (const double noise : {0.0, 2.0}) {
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    double squared = 0, predicted = 0;
    int count = 0;
    for (int trial = 0; trial < 600; ++trial) {
      const Pair pair(&random, 5.0, noise);
      const Eigen::Vector2d centre =
          Eigen::Vector2d(13, 13) + (trial % 2) * 0.5 * Eigen::Vector2d(unit(random), unit(random));
      AlignmentTemplate t;
      ASSERT_TRUE(warp_alignment_template(pair.first.image, centre, kIdentity, &t));
      ASSERT_TRUE(t.valid);
      const Eigen::Vector2d truth = centre + pair.shift;
      const AlignmentResult r =
          align_patch(t, pair.second.image, truth + 0.4 * Eigen::Vector2d(unit(random), unit(random)));
      if (!r.converged) continue;
      ++count;
      mean += r.position - truth;
      squared += (r.position - truth).squaredNorm();
      // Both images are noisy, and rounded to whole grey levels.
      predicted += 2 * (noise * noise + 1.0 / 12) * t.covariance.trace();
    }
    EXPECT_GE(count, 595);
    mean /= count;
    const double rms = std::sqrt(squared / count / 2), bound = std::sqrt(predicted / count / 2);
    EXPECT_LT(mean.norm(), 0.01);
    RecordProperty("rms_px", std::to_string(rms));
    // 0.03 px is what interpolating between the pixels of this texture costs by itself.
    EXPECT_LT(rms, std::hypot(1.15 * bound, 0.03)) << "noise " << noise << ", bound " << bound;
  }
}

TEST(AlignPatch, FollowsAChangeOfBrightness) {
  std::mt19937 random(21);
  for (int trial = 0; trial < 20; ++trial) {
    const Pair pair(&random, 8.0, 0.0, 25.0);
    AlignmentTemplate t;
    ASSERT_TRUE(warp_alignment_template(pair.first.image, {13, 13}, kIdentity, &t));
    const AlignmentResult r = align_patch(t, pair.second.image, {13.5, 13.5});
    ASSERT_TRUE(r.converged);
    EXPECT_LT((r.position - pair.shift - Eigen::Vector2d(13, 13)).norm(), 0.2);
    EXPECT_NEAR(r.mean_difference, 25.0, 1.5);
    EXPECT_LT(r.rms_residual, 3.0);
    EXPECT_GT(r.iterations, 0);
  }
}

TEST(AlignPatch, GivesTheSameBitsAtEveryInstructionSet) {
  std::mt19937 random(22);
  std::uniform_real_distribution<double> unit(-1, 1);
  int converged = 0, refused = 0;
  for (int trial = 0; trial < 400; ++trial) {
    const Pair pair(&random, 5.0, 2.0);
    PatchTemplate pixels;
    ASSERT_TRUE(copy_patch(pair.first.image, 13, 13, &pixels));
    AlignmentTemplate t;
    prepare_alignment(pixels, &t);
    const double reach = trial % 4 == 0 ? 11.0 : 1.5;
    const Eigen::Vector2d start = Eigen::Vector2d(13.5, 13.5) + reach * Eigen::Vector2d(unit(random), unit(random));
    const AlignmentResult truth = align_patch_scalar(t, pair.second.image, start);
    ++(truth.converged ? converged : refused);
    for_each_simd_level([&] {
      const AlignmentResult r = align_patch(t, pair.second.image, start);
      EXPECT_EQ(r.converged, truth.converged);
      EXPECT_EQ(r.iterations, truth.iterations);
      EXPECT_EQ(r.position, truth.position);
      EXPECT_EQ(r.mean_difference, truth.mean_difference);
      EXPECT_EQ(r.rms_residual, truth.rms_residual);
    });
  }
  EXPECT_GT(converged, 200);
  EXPECT_GT(refused, 20);
}

TEST(AlignmentTemplate, GradientsAndNormalMatrixAreRight) {
  std::mt19937 random(23);
  PatchTemplate pixels;
  for (auto& p : pixels.pixels) p = static_cast<std::uint8_t>(random());
  finish_template(&pixels);
  AlignmentTemplate t;
  prepare_alignment(pixels, &t);
  ASSERT_TRUE(t.valid);
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  for (int j = 0; j < 8; ++j) {
    for (int i = 0; i < 8; ++i) {
      const auto at = [&](int u, int v) {
        return static_cast<double>(pixels.pixels[static_cast<std::size_t>(8 * v + u)]);
      };
      const double dx = i == 0   ? at(1, j) - at(0, j)
                        : i == 7 ? at(7, j) - at(6, j)
                                 : 0.5 * (at(i + 1, j) - at(i - 1, j));
      const double dy = j == 0   ? at(i, 1) - at(i, 0)
                        : j == 7 ? at(i, 7) - at(i, 6)
                                 : 0.5 * (at(i, j + 1) - at(i, j - 1));
      EXPECT_EQ(t.dx[static_cast<std::size_t>(8 * j + i)], static_cast<float>(dx));
      EXPECT_EQ(t.dy[static_cast<std::size_t>(8 * j + i)], static_cast<float>(dy));
      const Eigen::Vector3d g(dx, dy, 1);
      normal += g * g.transpose();
    }
  }
  const Eigen::Matrix3d inverse = normal.inverse();
  EXPECT_LT((t.inverse_normal.cast<double>() - inverse).norm(), 1e-5 * inverse.norm());
  // The translation block of the inverse is the inverse information once the mean is marginalised.
  EXPECT_LT((t.covariance.cast<double>() - inverse.topLeftCorner<2, 2>()).norm(), 1e-5 * inverse.norm());
}

TEST(AlignPatch, RefusesWhatCannotBeAligned) {
  ExactImage flat(kImageSize, kImageSize), ramp(kImageSize, kImageSize);
  flat.fill([](int, int) { return 90; });
  ramp.fill([](int x, int) { return 5 * x; });  // an edge: free to slide in y
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::mt19937 random(24);
  const Pair pair(&random, 6.0, 0.0);
  for_each_simd_level([&] {
    AlignmentTemplate t;
    for (const ExactImage* image : {&flat, &ramp}) {
      ASSERT_TRUE(warp_alignment_template(image->image, {13, 13}, kIdentity, &t));
      EXPECT_FALSE(t.valid);
      EXPECT_FALSE(align_patch(t, image->image, {13, 13}).converged);
      PatchTemplate pixels;
      ASSERT_TRUE(copy_patch(image->image, 13, 13, &pixels));
      prepare_alignment(pixels, &t);
      EXPECT_FALSE(t.valid);
    }
    ASSERT_TRUE(warp_alignment_template(pair.first.image, {13, 13}, kIdentity, &t));
    for (const Eigen::Vector2d& start :
         {Eigen::Vector2d(3.9, 13), Eigen::Vector2d(13, 3.9), Eigen::Vector2d(22.1, 13), Eigen::Vector2d(13, 22.1),
          Eigen::Vector2d(-50, 13), Eigen::Vector2d(1e12, 13), Eigen::Vector2d(nan, 13), Eigen::Vector2d(13, nan)}) {
      EXPECT_FALSE(align_patch(t, pair.second.image, start).converged);
    }
    EXPECT_FALSE(align_patch(t, GreyImage(), {13, 13}).converged);
    EXPECT_FALSE(align_patch(t, pair.second.image, {13, 13}, 0).converged);
    // The position lies more than 0.1 px from this start.
    EXPECT_FALSE(
        align_patch(t, pair.second.image, Eigen::Vector2d(13, 13) + pair.shift + Eigen::Vector2d(0.5, 0), 10, 0.1)
            .converged);
  });
}

}  // namespace
}  // namespace parallax
