// How numbers lie in the blobs of map files and session databases: little-endian, no padding, matrices row by row as
// doubles. Internal to the files' schemas; plain functions on values, safe from any thread.
#pragma once

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <span>
#include <vector>

#include "core/se3.h"

namespace parallax {

static_assert(std::endian::native == std::endian::little, "map files and session databases are little-endian");

template <class T>
void append(T value, std::vector<std::byte>* bytes) {
  const std::size_t before = bytes->size();
  bytes->resize(before + sizeof value);
  std::memcpy(bytes->data() + before, &value, sizeof value);
}

template <class Matrix>
void append_rows(const Matrix& matrix, std::vector<std::byte>* bytes) {
  for (int row = 0; row < matrix.rows(); ++row)
    for (int column = 0; column < matrix.cols(); ++column) append<double>(matrix(row, column), bytes);
}

// Takes values off the front. The bytes outlive it. False: too few are left, or (take_rows) a number is not finite.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) : bytes_(bytes) {}

  template <class T>
  bool take(T* value) {
    if (bytes_.size() < sizeof(T)) return false;
    std::memcpy(value, bytes_.data(), sizeof(T));
    bytes_ = bytes_.subspan(sizeof(T));
    return true;
  }
  template <class Matrix>
  bool take_rows(Matrix* matrix) {
    for (int row = 0; row < matrix->rows(); ++row)
      for (int column = 0; column < matrix->cols(); ++column) {
        double value = 0;
        if (!take(&value) || !std::isfinite(value)) return false;
        (*matrix)(row, column) = value;
      }
    return true;
  }
  bool at_end() const { return bytes_.empty(); }

 private:
  std::span<const std::byte> bytes_;
};

inline std::vector<std::byte> pack(const RigidTransform& transform) {  // R row by row, t: 12 doubles
  std::vector<std::byte> out;
  append_rows(transform.R, &out);
  append_rows(transform.t, &out);
  return out;
}
inline std::vector<std::byte> pack(const SimilarityTransform& transform) {  // s, R, t: 13 doubles
  std::vector<std::byte> out;
  append(transform.s, &out);
  append_rows(transform.R, &out);
  append_rows(transform.t, &out);
  return out;
}

}  // namespace parallax
