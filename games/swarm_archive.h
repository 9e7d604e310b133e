// A game of Swarm as JSON text, and as one number.
#pragma once

#include <cstdint>
#include <string>

#include "games/swarm_state.h"

namespace parallax::swarm {

std::string save_state(const State& state);
// Throws InputError (one line: which value, what was found, what was expected) for anything that save_state() would not
// write: other or missing keys, wrong types, numbers that are out of bounds or not finite, lists that are too long.
State restore_state(const std::string& text);
std::uint64_t hash_of(const State& state);

}  // namespace parallax::swarm
