// The sounds of assets/sounds in memory.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace parallax {

struct SoundClip {
  int rate_hz = 22050;
  std::vector<std::int16_t> samples;  // one channel
};

using SoundBank = std::map<std::string, SoundClip>;  // by file name, without extension

// Every *.wav of the folder. Throws InputError when the folder is absent or a file cannot be used: "FILE: found X,
// expected Y". Safe from any thread.
SoundBank load_sounds(const std::string& folder);

}  // namespace parallax
