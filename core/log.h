// The one logger. Libraries log at debug level and below, through log::debug(); only app/ talks to the user, and sets
// the level and the sink. Safe from any thread. The logging library stays out of this header: it is slow to compile.
#pragma once

#include <sstream>
#include <string>

namespace parallax::log {

// "trace", "debug", "info", "warn", "error", "off"; unknown names mean "warn". Lines go to stderr.
void set_up(const std::string& level);
bool debug_enabled();
void debug_line(const std::string& text);

// The parts one after the other, as an ostream would print them. Costs nothing when debug lines are off.
template <class... Parts>
void debug(const Parts&... parts) {
  if (!debug_enabled()) return;
  std::ostringstream text;
  (text << ... << parts);
  debug_line(text.str());
}

}  // namespace parallax::log
