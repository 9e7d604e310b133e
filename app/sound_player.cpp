#include "app/sound_player.h"

#include <algorithm>
#include <exception>
#include <utility>

#include "core/log.h"

namespace parallax {
namespace {

constexpr std::size_t kMostWaiting = 64;  // cues between two looks of the thread, which are microseconds apart

}  // namespace

SoundPlayer::SoundPlayer(std::string folder) : folder_(std::move(folder)) {
  quieten_sound_libraries();
  thread_ = std::jthread([this](std::stop_token stop) { work(std::move(stop)); });
}

SoundPlayer::~SoundPlayer() = default;

void SoundPlayer::work(std::stop_token stop) {
  SoundBank sounds;
  try {
    sounds = load_sounds(folder_);
  } catch (const std::exception& error) {
    set_status(SoundState::silent, error.what());
    return;
  }
  std::string why_not;
  const std::unique_ptr<SoundMixer> mixer = stop.stop_requested() ? nullptr : SoundMixer::on_device(sounds, &why_not);
  if (mixer == nullptr) {
    set_status(SoundState::silent, why_not);
    return;
  }
  set_status(SoundState::playing, "");
  for (;;) {
    auto orders = std::make_unique<Orders>();
    double volume = 0;
    {
      MutexLock lock(mutex_);
      if (!changed_.wait(mutex_, stop, [this]() PARALLAX_REQUIRES(mutex_) { return orders_->any(); })) return;
      std::swap(orders, orders_);
      volume = muted_ ? 0 : volume_;
    }
    if (orders->stop) mixer->stop_all();
    if (orders->volume_changed) mixer->set_volume(volume);
    if (orders->listener) mixer->set_listener(*orders->listener);
    for (const GameSound& cue : orders->cues) mixer->play(cue);
  }
}

void SoundPlayer::play(const std::vector<GameSound>& cues) {
  if (cues.empty()) return;
  {
    MutexLock lock(mutex_);
    // What could not be heard in time is not to be heard late.
    if (status_.state != SoundState::playing) return;
    orders_->cues.insert(orders_->cues.end(), cues.begin(), cues.end());
    if (orders_->cues.size() > kMostWaiting) {
      orders_->cues.erase(orders_->cues.begin(), orders_->cues.end() - static_cast<std::ptrdiff_t>(kMostWaiting));
    }
  }
  changed_.notify_all();
}

void SoundPlayer::set_listener(const SoundListener& listener) {
  {
    MutexLock lock(mutex_);
    orders_->listener = listener;
  }
  changed_.notify_all();
}

void SoundPlayer::set_volume(double volume) {
  {
    MutexLock lock(mutex_);
    volume_ = volume > 0 ? std::min(volume, 1.0) : 0.0;
    orders_->volume_changed = true;
  }
  changed_.notify_all();
}

void SoundPlayer::set_muted(bool muted) {
  {
    MutexLock lock(mutex_);
    muted_ = muted;
    orders_->volume_changed = true;
  }
  changed_.notify_all();
}

double SoundPlayer::volume() const {
  MutexLock lock(mutex_);
  return volume_;
}

bool SoundPlayer::muted() const {
  MutexLock lock(mutex_);
  return muted_;
}

void SoundPlayer::stop_all() {
  {
    MutexLock lock(mutex_);
    orders_->cues.clear();
    orders_->stop = true;
  }
  changed_.notify_all();
}

SoundStatus SoundPlayer::status() const {
  MutexLock lock(mutex_);
  return status_;
}

SoundStatus SoundPlayer::wait_until_ready() const {
  MutexLock lock(mutex_);
  changed_.wait(mutex_, [this]() PARALLAX_REQUIRES(mutex_) { return status_.state != SoundState::opening; });
  return status_;
}

void SoundPlayer::set_status(SoundState state, std::string reason) {
  if (!reason.empty()) log::debug("sound: ", reason);
  {
    MutexLock lock(mutex_);
    status_ = {state, std::move(reason)};
  }
  changed_.notify_all();
}

}  // namespace parallax
