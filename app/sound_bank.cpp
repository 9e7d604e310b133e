#include "app/sound_bank.h"

#include <sndfile.h>

#include <filesystem>
#include <memory>
#include <system_error>

#include "core/error.h"

namespace parallax {
namespace {

constexpr sf_count_t kLongest_s = 10;
constexpr int kSlowest_hz = 8'000, kFastest_hz = 96'000;

SoundClip load(const std::string& path) {
  SF_INFO info{};
  const std::unique_ptr<SNDFILE, int (*)(SNDFILE*)> file(sf_open(path.c_str(), SFM_READ, &info), sf_close);
  if (file == nullptr) throw InputError(path + ": found no sound that can be read, expected a WAV file");
  if (info.channels != 1 || info.samplerate < kSlowest_hz || info.samplerate > kFastest_hz || info.frames < 1 ||
      info.frames > kLongest_s * info.samplerate) {
    throw InputError(path + ": found " + std::to_string(info.frames) + " samples of " + std::to_string(info.channels) +
                     " channels at " + std::to_string(info.samplerate) + " Hz, expected one channel, at most " +
                     std::to_string(kLongest_s) + " s");
  }
  SoundClip clip;
  clip.rate_hz = info.samplerate;
  clip.samples.resize(static_cast<std::size_t>(info.frames));
  const sf_count_t read = sf_read_short(file.get(), clip.samples.data(), info.frames);
  if (read != info.frames) {
    throw InputError(path + ": found " + std::to_string(read) + " samples, expected " + std::to_string(info.frames));
  }
  return clip;
}

}  // namespace

SoundBank load_sounds(const std::string& folder) {
  namespace fs = std::filesystem;
  std::error_code error;
  SoundBank out;
  fs::directory_iterator files(folder, error);
  if (error) throw InputError(folder + ": found no folder that can be read, expected one with sounds (*.wav)");
  for (; files != fs::directory_iterator(); files.increment(error)) {
    if (files->path().extension() == ".wav") out[files->path().stem().string()] = load(files->path().string());
  }
  if (error) throw InputError(folder + ": found a folder that cannot be read to its end, expected sounds (*.wav)");
  return out;
}

}  // namespace parallax
