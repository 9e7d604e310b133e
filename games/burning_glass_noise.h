// Seeded numbers of the burning glass: a generator and a smooth noise that are the same with every library.
// Values; one thread at a time.
#pragma once

#include <cmath>
#include <cstdint>

namespace parallax::burning {

// SplitMix64 (Steele, Lea and Flood, Fast splittable pseudorandom number generators, OOPSLA 2014).
inline std::uint64_t mix_bits(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

class Generator {
 public:
  explicit Generator(std::uint64_t seed = 1) : state_(seed) {}
  std::uint64_t next() { return mix_bits(state_++); }
  // [0, 1)
  double uniform() { return static_cast<double>(next() >> 11) * 0x1p-53; }
  double uniform(double least, double most) { return least + (most - least) * uniform(); }

 private:
  std::uint64_t state_;
};

// A number in [0, 1) that belongs to a place of a lattice.
inline float lattice_noise(int x, int y, std::uint64_t seed) {
  const std::uint64_t key = (static_cast<std::uint64_t>(static_cast<std::uint32_t>(x)) << 32) |
                            static_cast<std::uint64_t>(static_cast<std::uint32_t>(y));
  return static_cast<float>(mix_bits(key ^ mix_bits(seed)) >> 40) * 0x1p-24f;
}

// Between the numbers of the lattice, smoothly; [0, 1).
inline float smooth_noise(float x, float y, std::uint64_t seed) {
  const float fx = std::floor(x), fy = std::floor(y);
  const int ix = static_cast<int>(fx), iy = static_cast<int>(fy);
  float u = x - fx, v = y - fy;
  u = u * u * (3 - 2 * u);
  v = v * v * (3 - 2 * v);
  const float low = lattice_noise(ix, iy, seed) * (1 - u) + lattice_noise(ix + 1, iy, seed) * u;
  const float high = lattice_noise(ix, iy + 1, seed) * (1 - u) + lattice_noise(ix + 1, iy + 1, seed) * u;
  return low * (1 - v) + high * v;
}

}  // namespace parallax::burning
