// Errors a person can act on: a bad file, a bad setting, an unusable option. Thrown anywhere, caught in app/, printed
// as one line, exit code 2.
#pragma once

#include <stdexcept>
#include <string>

namespace parallax {

// Bad input. The message is one line that names the file, the line or key, what was found and what was expected.
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// The input was fine but the work could not be done: a full disk, an output that cannot be written. Exit code 1.
class RunError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace parallax
