#include "core/binary_descriptor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "core/descriptor_search.h"
#include "core/fast.h"
#include "tests/core/kernel_images.h"

namespace parallax {
namespace {

constexpr int kSize = 81, kCentre = 40;

// One place: a bright wedge with its tip at the origin, on a texture of its own. Known at every real position.
class Place {
 public:
  explicit Place(std::uint32_t seed) : random_(seed), texture_(&random_, 9.0, 30.0, 24, 40.0) {
    std::uniform_real_distribution<double> unit(0, 1);
    direction_ = 2 * M_PI * unit(random_);
    opening_ = 0.5 + 0.8 * unit(random_);
  }
  double operator()(double x, double y) const {
    const double off = std::abs(std::remainder(std::atan2(y, x) - direction_, 2 * M_PI));
    const double inside = std::clamp((opening_ - off) * std::hypot(x, y) + 0.5, 0.0, 1.0);  // one pixel soft
    return 0.8 * texture_(x, y) + 50 * inside;
  }

 private:
  std::mt19937 random_;
  WaveTexture texture_;
  double direction_ = 0, opening_ = 0;
};

struct View {
  double turn = 0, scale = 1, noise = 0, gain = 1, offset = 0;
};

BinaryDescriptor describe(const Place& place, const View& view, std::uint32_t noise_seed = 1,
                          std::uint8_t* orientation = nullptr) {
  std::mt19937 random(noise_seed);
  std::normal_distribution<double> gauss;
  ExactImage out(kSize, kSize, 3);
  const double c = std::cos(view.turn) / view.scale, s = std::sin(view.turn) / view.scale;
  out.fill([&](int px, int py) {
    const double x = px - kCentre, y = py - kCentre;
    return view.gain * place(c * x + s * y, -s * x + c * y) + view.offset + view.noise * gauss(random);
  });
  BinaryDescriptor d;
  EXPECT_TRUE(describe_corner(out.image, smooth_for_descriptors(out.image), kCentre, kCentre, &d, orientation));
  return d;
}

// Sorted distances of places' views to themselves and to each other.
struct Spread {
  std::vector<int> same, other;
  int same_at(double part) const { return same[static_cast<std::size_t>(part * (same.size() - 1))]; }
  int other_at(double part) const { return other[static_cast<std::size_t>(part * (other.size() - 1))]; }
};

Spread compare(const View& view) {
  constexpr int places = 25;
  std::vector<BinaryDescriptor> plain, seen;
  for (int i = 0; i < places; ++i) {
    const Place place(100 + i);
    plain.push_back(describe(place, View{.noise = 1}, 7 + i));
    seen.push_back(describe(place, view, 900 + i));
  }
  Spread out;
  for (int i = 0; i < places; ++i)
    for (int j = 0; j < places; ++j) (i == j ? out.same : out.other).push_back(hamming(plain[i], seen[j]));
  std::sort(out.same.begin(), out.same.end());
  std::sort(out.other.begin(), out.other.end());
  return out;
}

void expect_recognised(const View& view, const char* what, int same_limit) {
  const Spread s = compare(view);
  std::printf("%-24s same: median %d, 90 %% %d; others: 1 %% %d, median %d\n", what, s.same_at(0.5), s.same_at(0.9),
              s.other_at(0.01), s.other_at(0.5));
  EXPECT_LE(s.same_at(0.9), same_limit) << what;
  EXPECT_LT(s.same_at(0.5), s.other_at(0.01)) << what;
  EXPECT_GT(s.other_at(0.5), 75) << what;
  EXPECT_GT(s.other_at(0.5), 2.5 * s.same_at(0.5)) << what;
}

TEST(Hamming, CountsDifferingBits) {
  BinaryDescriptor a, b;
  EXPECT_EQ(hamming(a, b), 0);
  b.bits = {1, 0x8000000000000000u, 0, 0xff};
  EXPECT_EQ(hamming(a, b), 10);
  EXPECT_EQ(hamming(b, a), 10);
  for (auto& w : a.bits) w = ~0ull;
  EXPECT_EQ(hamming(a, BinaryDescriptor{}), 256);
}

TEST(BinaryDescriptor, SurvivesTurns) {
  for (int degrees = 0; degrees < 360; degrees += 24)
    expect_recognised({.turn = degrees * M_PI / 180, .noise = 1}, ("turn " + std::to_string(degrees)).c_str(), 60);
}

TEST(BinaryDescriptor, TheOrientationTurnsWithTheImage) {
  for (int turned = 0; turned < kDescriptorOrientations; turned += 5) {
    int near = 0;
    for (std::uint32_t place = 0; place < 20; ++place) {
      std::uint8_t before = 0, now = 0;
      describe(Place(100 + place), {}, 1, &before);
      describe(Place(100 + place), {.turn = 2 * M_PI * turned / kDescriptorOrientations}, 1, &now);
      const int off = (now - before - turned + 2 * kDescriptorOrientations) % kDescriptorOrientations;
      near += std::min(off, kDescriptorOrientations - off) <= 1 ? 1 : 0;
    }
    EXPECT_GE(near, 18) << turned;
  }
}

TEST(BinaryDescriptor, SurvivesNoiseLightAndScale) {
  expect_recognised({.noise = 6}, "noise 6", 40);
  expect_recognised({.noise = 2, .gain = 0.5, .offset = 10}, "gain 0.5, offset 10", 40);
  expect_recognised({.noise = 2, .gain = 1.15, .offset = -15}, "gain 1.15, offset -15", 40);
  expect_recognised({.scale = 1.15, .noise = 2}, "scale 1.15", 60);
  expect_recognised({.scale = 0.85, .noise = 2}, "scale 0.85", 60);
  expect_recognised({.turn = 1.0, .scale = 1.1, .noise = 4, .gain = 0.8}, "all at once", 70);
}

// Without noise or clamping a positive gain and an offset that are whole numbers change no comparison.
TEST(BinaryDescriptor, GainAndOffsetChangeNothing) {
  std::mt19937 random(3);
  GreyImage image(60, 60), brighter(60, 60);
  for (int y = 0; y < 60; ++y)
    for (int x = 0; x < 60; ++x) {
      image(y, x) = static_cast<std::uint8_t>(random() % 110);
      brighter(y, x) = static_cast<std::uint8_t>(image(y, x) + 40);
    }
  BinaryDescriptor a, b;
  ASSERT_TRUE(describe_corner(image, smooth_for_descriptors(image), 30, 30, &a));
  ASSERT_TRUE(describe_corner(brighter, smooth_for_descriptors(brighter), 30, 30, &b));
  EXPECT_EQ(hamming(a, b), 0);
  EXPECT_NE(a.bits, BinaryDescriptor{}.bits);
}

TEST(BinaryDescriptor, BorderRule) {
  const int width = 50, height = 45;
  ExactImage image(width, height);
  std::mt19937 random(5);
  fill_random(&image, 2, &random);
  const GreyImage blurred = smooth_for_descriptors(image.image);
  ExactImage smooth(width, height);  // ends where its memory ends
  smooth.fill([&](int x, int y) { return blurred(y, x); });
  for (int y = -2; y < height + 2; ++y)
    for (int x = -2; x < width + 2; ++x) {
      BinaryDescriptor d;
      const bool inside = x >= kDescriptorBorder && y >= kDescriptorBorder && x < width - kDescriptorBorder &&
                          y < height - kDescriptorBorder;
      ASSERT_EQ(describe_corner(image.image, smooth.image, x, y, &d), inside) << x << " " << y;
    }
  const GreyImage tiny(20, 20, static_cast<std::uint8_t>(7));
  BinaryDescriptor d;
  EXPECT_FALSE(describe_corner(tiny, smooth_for_descriptors(tiny), 10, 10, &d));
}

TEST(BinaryDescriptor, SameImageSameBits) {
  const Place place(3);
  EXPECT_EQ(describe(place, View{.turn = 0.3, .noise = 3}).bits, describe(place, View{.turn = 0.3, .noise = 3}).bits);
  // Flat: nothing is brighter than anything.
  const GreyImage flat(60, 60, static_cast<std::uint8_t>(90));
  BinaryDescriptor d;
  ASSERT_TRUE(describe_corner(flat, smooth_for_descriptors(flat), 30, 30, &d));
  EXPECT_EQ(d.bits, BinaryDescriptor{}.bits);
}

TEST(DescriptorSet, GivesTheDistancesOnEveryInstructionSet) {
  std::mt19937_64 random(6);
  for (int n : {0, 1, 3, 31, 32, 33, 64, 1000}) {
    std::vector<BinaryDescriptor> all(static_cast<std::size_t>(n));
    for (auto& d : all)
      for (auto& w : d.bits) w = random();
    if (n > 2) all[1].bits = {0, 0, 0, 0}, all[2].bits = {~0ull, ~0ull, ~0ull, ~0ull};
    const DescriptorSet set(all);
    ASSERT_EQ(set.size(), n);
    for_each_simd_level([&] {
      for (int k = 0; k < 20; ++k) {
        BinaryDescriptor query;
        for (auto& w : query.bits) w = k == 0 ? 0 : k == 1 ? ~0ull : random();
        std::vector<std::uint16_t> distances;
        const int least = set.distances(query, &distances);
        ASSERT_GE(distances.size(), all.size());
        int expected = 257;
        for (std::size_t i = 0; i < all.size(); ++i) {
          ASSERT_EQ(distances[i], hamming(query, all[i])) << n << " " << i;
          expected = std::min(expected, hamming(query, all[i]));
        }
        ASSERT_EQ(least, expected) << n;
      }
    });
  }
}

}  // namespace
}  // namespace parallax
