// Random numbers that are the same with every C++ library (the distributions of the standard's are not).
#pragma once

#include <cstdint>
#include <random>

namespace parallax {

class MarblesRandom {
 public:
  explicit MarblesRandom(std::uint64_t seed) : engine_(seed) {}
  // In [0, 1).
  float share() { return static_cast<float>(engine_() >> 40) * 0x1p-24f; }
  // In [0, count); the bias of the remainder is below 2^-40 for the counts of a table.
  std::size_t below(std::size_t count) { return static_cast<std::size_t>(engine_() % count); }

 private:
  std::mt19937_64 engine_;
};

}  // namespace parallax
