// The one logger. Libraries log at debug level and below; only app/ talks to the user.
#pragma once

#include <spdlog/spdlog.h>

namespace parallax {
namespace log = spdlog;
}  // namespace parallax
