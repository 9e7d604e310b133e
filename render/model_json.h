// The JSON part of a binary glTF file, looked at before the library reads it: its depth, the number of its entries and
// whether all of its data is in the file. The library trusts all three.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace parallax {

// Throws InputError: "FILE: found X, expected Y", one line.
void check_model_json(std::span<const std::uint8_t> bytes, const std::string& file);

// The same, for other things found in a model.
[[noreturn]] void refuse_model(const std::string& file, const std::string& found, const std::string& expected);

// Text of the file as it may stand in a message: one line, not long, in quotes.
std::string quoted_from_model(const std::string& text);

}  // namespace parallax
