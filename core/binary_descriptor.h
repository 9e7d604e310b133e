// Rotated binary descriptors (after BRIEF, Calonder et al. 2010, with the intensity-centroid orientation of ORB, Rublee
// et al. 2011): 256 brightness comparisons around a corner, turned with it. The test pattern is our own (seeded,
// Gaussian).
#pragma once

#include <array>
#include <bit>
#include <cstdint>

#include "core/image.h"

namespace parallax {

struct BinaryDescriptor {
  std::array<std::uint64_t, 4> bits{};
};

inline int hamming(const BinaryDescriptor& a, const BinaryDescriptor& b) {
  int distance = 0;
  for (int i = 0; i < 4; ++i) distance += std::popcount(a.bits[i] ^ b.bits[i]);
  return distance;
}

// The orientation of a corner is one of so many steps of a full turn.
inline constexpr int kDescriptorOrientations = 32;

// Pixels around the corner that must lie inside the image.
inline constexpr int kDescriptorBorder = 17;

// What describe() samples: the image averaged over 5x5 pixels.
GreyImage smooth_for_descriptors(const GreyImage& image);

// The descriptor of the corner at (x, y); `image` gives the orientation, `smooth` the comparisons (both of the corner's
// own level). False too near the border. `orientation`, when given, receives the step that the pattern was turned by, x
// towards y.
bool describe_corner(const GreyImage& image, const GreyImage& smooth, int x, int y, BinaryDescriptor* out,
                     std::uint8_t* orientation = nullptr);

}  // namespace parallax
