// CHECK: a broken promise between parts of the program is a bug; say what and stop.
// Recoverable conditions are returned statuses or exceptions (core/error.h), never a CHECK.
#pragma once

#include <sstream>
#include <stdexcept>
#include <string>

namespace parallax {

// Thrown by CHECK. Only a bug raises it; nothing below app/ catches it.
class CheckFailure : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

namespace detail {
[[noreturn]] inline void check_failed(const char* file, int line, const char* condition, const std::string& what) {
  std::ostringstream text;
  text << "internal error at " << file << ":" << line << ": " << condition;
  if (!what.empty()) text << " (" << what << ")";
  throw CheckFailure(text.str());
}
}  // namespace detail

}  // namespace parallax

// CHECK(condition, "what went wrong"): the text may be any std::string expression.
#define PARALLAX_CHECK(condition, what) \
  (static_cast<bool>(condition) ? void(0) : ::parallax::detail::check_failed(__FILE__, __LINE__, #condition, (what)))
