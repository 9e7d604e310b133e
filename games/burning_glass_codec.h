// Layers of the sheet as short text: runs of equal numbers, then base64 (RFC 4648). What is decoded comes from files
// that anybody may have written: everything is checked, and sizes are bounded by what the caller expects.
//
// Bytes of the stream: an unsigned LEB128 number n. Even: one number follows, which is there n / 2 times. Odd: n / 2
// numbers follow. Numbers are little-endian. Pure functions.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace parallax::burning {

std::string base64(const std::vector<std::uint8_t>& bytes);
// False when the text is not base64.
bool from_base64(const std::string& text, std::vector<std::uint8_t>* bytes);

// Floats by their bits.
std::string encode_layer(const std::vector<std::uint16_t>& values);
std::string encode_layer(const std::vector<float>& values);
// False when the text is not a layer of exactly `count` numbers.
bool decode_layer(const std::string& text, std::size_t count, std::vector<std::uint16_t>* values);
bool decode_layer(const std::string& text, std::size_t count, std::vector<float>* values);

// Cells and what they were, cells rising.
struct CellValue {
  std::uint32_t cell = 0;
  std::uint16_t value = 0;
  bool operator==(const CellValue&) const = default;
};
std::string encode_cells(const std::vector<CellValue>& cells);
// False when it is not a list of rising cells below `cell_count`.
bool decode_cells(const std::string& text, std::size_t cell_count, std::vector<CellValue>* cells);

}  // namespace parallax::burning
