// The games' sounds, played by a thread of their own: opening a sound device may take seconds, and nobody who plays a
// cue waits for it. Without a device, or without the files, everything is silent and status() says why.
//
// All members may be called from any thread; none waits for the device.
#pragma once

#include <condition_variable>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "app/sound_mixer.h"
#include "core/mutex.h"

namespace parallax {

enum class SoundState { opening, playing, silent };

struct SoundStatus {
  SoundState state = SoundState::opening;
  std::string reason;  // one line, when silent
};

class SoundPlayer {
 public:
  // `folder`: assets/sounds. The files are read and the device is opened on the player's thread. Make it before other
  // threads that read the environment (quieten_sound_libraries()).
  explicit SoundPlayer(std::string folder);
  ~SoundPlayer();  // ends what is heard; waits for a device that is just being opened
  SoundPlayer(const SoundPlayer&) = delete;
  SoundPlayer& operator=(const SoundPlayer&) = delete;

  // Cues that come faster than they can be started are dropped, the oldest first.
  void play(const std::vector<GameSound>& cues) PARALLAX_EXCLUDES(mutex_);
  void set_listener(const SoundListener& listener) PARALLAX_EXCLUDES(mutex_);
  // 0..1, at first 1; what is muted keeps its volume.
  void set_volume(double volume) PARALLAX_EXCLUDES(mutex_);
  void set_muted(bool muted) PARALLAX_EXCLUDES(mutex_);
  double volume() const PARALLAX_EXCLUDES(mutex_);
  bool muted() const PARALLAX_EXCLUDES(mutex_);
  // Ends what is heard now: a game was left.
  void stop_all() PARALLAX_EXCLUDES(mutex_);

  SoundStatus status() const PARALLAX_EXCLUDES(mutex_);
  // Waits until the device is open or is known to be absent.
  SoundStatus wait_until_ready() const PARALLAX_EXCLUDES(mutex_);

 private:
  // What is to be done, the newest of each kind.
  struct Orders {
    std::vector<GameSound> cues;
    std::optional<SoundListener> listener;
    bool volume_changed = false;
    bool stop = false;
    bool any() const { return !cues.empty() || listener || volume_changed || stop; }
  };

  void work(std::stop_token stop);
  void set_status(SoundState state, std::string reason) PARALLAX_EXCLUDES(mutex_);

  const std::string folder_;
  mutable Mutex mutex_;
  mutable std::condition_variable_any changed_;
  std::unique_ptr<Orders> orders_ PARALLAX_GUARDED_BY(mutex_) = std::make_unique<Orders>();
  double volume_ PARALLAX_GUARDED_BY(mutex_) = 1;
  bool muted_ PARALLAX_GUARDED_BY(mutex_) = false;
  SoundStatus status_ PARALLAX_GUARDED_BY(mutex_);
  std::jthread thread_;  // last: ends before what it uses
};

}  // namespace parallax
