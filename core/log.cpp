#include "core/log.h"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

namespace parallax::log {

void set_up(const std::string& level) {
  auto logger = spdlog::get("parallax");
  if (!logger) logger = spdlog::stderr_color_mt("parallax");
  spdlog::set_default_logger(logger);
  spdlog::set_pattern("%H:%M:%S.%e %^%l%$ %v");
  const auto parsed = spdlog::level::from_str(level);
  spdlog::set_level(parsed == spdlog::level::off && level != "off" ? spdlog::level::warn : parsed);
}

bool debug_enabled() { return spdlog::should_log(spdlog::level::debug); }
void debug_line(const std::string& text) { spdlog::debug("{}", text); }

}  // namespace parallax::log
