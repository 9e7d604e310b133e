// Hamming distances of one binary descriptor to very many: what matching without a prior spends its time on.
//
// Vectorised (AVX2, AVX-512 chosen at run time, core/cpu_dispatch.h); every instruction set gives the same numbers.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/binary_descriptor.h"

namespace parallax {

// A fixed set of descriptors, laid out so that the distances of 32 of them are computed together. Immutable once made,
// then safe from any thread.
class DescriptorSet {
 public:
  DescriptorSet() = default;
  explicit DescriptorSet(std::span<const BinaryDescriptor> descriptors);

  int size() const { return size_; }
  // The distance of `query` to each descriptor, in order (distances->size() is size() rounded up to a multiple of 32;
  // what is beyond size() repeats the last). Returns the least, 257 when the set is empty.
  int distances(const BinaryDescriptor& query, std::vector<std::uint16_t>* distances) const;

  static constexpr int kBlock = 32;

 private:
  // word[w][k][i] is word w of descriptor 4 i + k of the block.
  struct alignas(64) Block {
    std::uint64_t word[4][4][8];
  };
  std::vector<Block> blocks_;
  int size_ = 0;

  static int scan_scalar(const Block* blocks, std::size_t n, const BinaryDescriptor& query, std::uint16_t* out);
  static int scan_avx2(const Block* blocks, std::size_t n, const BinaryDescriptor& query, std::uint16_t* out);
  static int scan_avx512(const Block* blocks, std::size_t n, const BinaryDescriptor& query, std::uint16_t* out);
};

}  // namespace parallax
