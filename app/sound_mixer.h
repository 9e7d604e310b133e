// Plays the sounds of games with OpenAL, on the computer's loudspeakers or into memory.
//
// A cue with a position is heard from there: the listener is the camera (its x to the right), and distances count in
// radii of the playing field, since the map's scale may be a guess. At most kVoices sound at once; a new cue takes the
// place of the oldest.
//
// Belongs to the thread that made it: OpenAL's current context is that thread's.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/sound_bank.h"
#include "core/se3.h"
#include "games/game.h"

namespace parallax {

struct SoundListener {
  std::optional<RigidTransform> camera_from_plane;  // nothing: everything is heard from everywhere
  double radius_m = 0.2;                            // of the playing field
};

class SoundMixer {
 public:
  static constexpr std::size_t kVoices = 24;
  static constexpr std::size_t kVoicesOfOneSound = 6;

  // On the device that the system prefers. Null when there is none; `why_not` says what was missing. May take long.
  static std::unique_ptr<SoundMixer> on_device(const SoundBank& sounds, std::string* why_not);
  // Heard by nobody: render() gives what would be heard. Null when OpenAL cannot do that.
  static std::unique_ptr<SoundMixer> in_memory(const SoundBank& sounds, int rate_hz, std::string* why_not);
  ~SoundMixer();
  SoundMixer(const SoundMixer&) = delete;
  SoundMixer& operator=(const SoundMixer&) = delete;

  // Unknown names, and volumes and pitches that are no numbers, make no sound.
  void play(const GameSound& cue);
  void set_listener(const SoundListener& listener);
  // 0 silent, 1 as made; in between as loud as the ear takes it (the amplitude goes with the square).
  void set_volume(double volume);
  void stop_all();
  std::size_t voices_playing() const;

  // The next samples, left and right in turn, -1..1; empty on a device.
  std::vector<float> render(int samples);

 private:
  struct Implementation;
  explicit SoundMixer(std::unique_ptr<Implementation> implementation);
  std::unique_ptr<Implementation> implementation_;
};

// Keeps OpenAL and ALSA from writing to stderr when there is no device. Sets a variable of the environment: call it
// before other threads read that, and before the first mixer is made.
void quieten_sound_libraries();

}  // namespace parallax
