#include "app/named_settings.h"

#include <cmath>

#include "core/error.h"

namespace parallax {

void apply_named_settings(const std::vector<std::string>& settings, const SettingTargets& targets) {
  for (const std::string& setting : settings) {
    const auto equals = setting.find('=');
    const std::string name = setting.substr(0, equals);
    const auto it = targets.find(name);
    if (equals == std::string::npos || it == targets.end()) {
      std::string known;
      for (const auto& [key, target] : targets) known += (known.empty() ? "" : ", ") + key;
      throw InputError("--set: found '" + setting + "', expected NAME=VALUE with NAME one of " + known);
    }
    const std::string text = setting.substr(equals + 1);
    double value = NAN;
    std::size_t used = 0;
    try {
      value = std::stod(text, &used);
    } catch (const std::exception&) {
      used = 0;
    }
    const bool whole = std::holds_alternative<double*>(it->second) || value == std::floor(value);
    if (text.empty() || used != text.size() || !std::isfinite(value) || !whole || std::abs(value) > 1e9)
      throw InputError("--set " + name + ": found '" + text + "', expected a number");
    std::visit([&](auto* target) { *target = static_cast<std::remove_pointer_t<decltype(target)>>(value); },
               it->second);
  }
}

}  // namespace parallax
