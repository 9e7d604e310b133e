// `--set NAME=VALUE`: options by name, for experiments.
#pragma once

#include <map>
#include <string>
#include <variant>
#include <vector>

namespace parallax {

using SettingTarget = std::variant<int*, double*, bool*>;
using SettingTargets = std::map<std::string, SettingTarget>;

// Throws InputError for an unknown name (naming the known ones) or a value that is no number. Ranges are the options'
// own affair: validate() them afterwards.
void apply_named_settings(const std::vector<std::string>& settings, const SettingTargets& targets);

}  // namespace parallax
