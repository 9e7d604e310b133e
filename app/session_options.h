// All options that decide what a session computes, as text that is exact to the last bit: what a recording carries so
// that its replay runs with the same.
#pragma once

#include <string>

#include "app/run_session.h"

namespace parallax {

// "name value" a line, numbers in hexadecimal floating point.
std::string exact_text(const RunOptions& options);
// Throws InputError ("NAME: options, line N: found X, expected Y") for anything that exact_text does not make, and for
// values the options refuse.
RunOptions parse_exact_options(const std::string& text, const std::string& name);

}  // namespace parallax
