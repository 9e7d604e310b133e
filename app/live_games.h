// The games in the live window: which one is on, what it is played with, its sounds, and what the real things on the
// table hide of it.
//
// The window's thread. Nothing here waits: the surface of the table and the sounds have threads of their own, and
// models are loaded when the first game begins.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "app/augmented_interface.h"
#include "app/game_controls.h"
#include "app/game_session.h"
#include "app/game_store.h"
#include "app/live_session.h"
#include "app/sound_player.h"
#include "app/surface_worker.h"
#include "render/occlusion_mask.h"

namespace parallax {

class LiveGames {
 public:
  // `store_path`: where scores and left games are kept; empty: nowhere.
  explicit LiveGames(std::string store_path);
  ~LiveGames();  // leaves the game; what cannot be written is lost
  LiveGames(const LiveGames&) = delete;
  LiveGames& operator=(const LiveGames&) = delete;

  bool playing() const { return session_ != nullptr; }
  // The next game: none, swarm, burning glass, marbles, none... Returns what to say. A game that was left goes on.
  std::string next(const CameraModel& lens);
  // Keeps the game's state for the next time.
  void leave();
  void toggle_pause();

  // A new frame; `input` is what keys and gamepad say now. `ahead_s`: from the frame's time to when it is seen.
  void frame(const LiveFrame& frame, const GameInput& input, double ahead_s);
  // What to append to the picture of that frame, and to write over it.
  void draw(const LiveFrame& frame, DrawList* out);
  void draw_interface(const PictureArea& area) const;

 private:
  void begin(const std::string& name, const CameraModel& lens);
  void finish_game();

  std::string store_path_;
  GameStore store_;
  std::shared_ptr<const ModelSet> models_;
  std::unique_ptr<SoundPlayer> sounds_;
  std::unique_ptr<GameSession> session_;
  std::unique_ptr<SurfaceWorker> surface_;
  std::optional<OcclusionMask> mask_;
  std::uint64_t seen_map_ = 0;
  bool scored_ = false;
  double over_s_ = 0;  // since the game ended
  bool fire_was_up_ = false;
  std::optional<Timestamp> last_time_;
  std::string place_;  // "3rd best"...
};

}  // namespace parallax
