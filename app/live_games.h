// The games in the live window: the menu, which one is on, what it is played with, its sounds, and what the real things
// on the table hide of it.
//
// The window's thread. Nothing here waits: the surface of the table and the sounds have threads of their own, and
// models are loaded when the first game begins.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/augmented_interface.h"
#include "app/game_controls.h"
#include "app/game_menu.h"
#include "app/game_palette.h"
#include "app/game_session.h"
#include "app/game_store.h"
#include "app/live_session.h"
#include "app/sound_player.h"
#include "app/surface_worker.h"
#include "render/occlusion_mask.h"

namespace parallax {

class LiveGames {
 public:
  // `store_path`: where scores and settings are kept; empty: nowhere.
  explicit LiveGames(std::string store_path);
  ~LiveGames();  // the game that is on ends with it
  LiveGames(const LiveGames&) = delete;
  LiveGames& operator=(const LiveGames&) = delete;

  bool playing() const { return session_ != nullptr; }
  bool menu_is_open() const { return menu_ && menu_->is_open(); }
  // Opens the menu at the next game, or goes on to the next card. A game that is on waits, and goes on after a
  // count-down when the menu closes.
  void next();
  // Opens the explanation of the game that is on.
  void explain();
  // A press in the menu. Throws InputError when a game's models cannot be loaded.
  void press(MenuKey key, const CameraModel& lens);
  // Ends the game; its state is kept for the next time that it is played on this map. Closes the menu.
  void leave();
  void toggle_pause();
  // A game belongs to the map that it is played on. Those that were left on the map that is shown now, to go on with;
  // and those left or being played, to keep with it.
  void bring(const std::map<std::string, std::string>& left);
  std::map<std::string, std::string> states() const;
  // What the game being played leaves to be kept (Game::picture()).
  cv::Mat4b picture() const { return session_ ? session_->runner().game().picture() : cv::Mat4b(); }
  // The map that is shown has become another: a game that has begun ends, and what was left there is not the new one's.
  void change_map();

  // A new frame; `input` is what keys and gamepad say now. `ahead_s`: from the frame's time to when it is seen.
  void frame(const LiveFrame& frame, const GameInput& input, double ahead_s);
  // What to append to the picture of that frame, and to write over it.
  void draw(const LiveFrame& frame, DrawList* out);
  void draw_interface(const PictureArea& area, const KeyBindings& keys) const;
  // The menu, when it is open; `picture` makes a texture of an image, once for each key from 0 on.
  using MakePicture = std::function<void*(int key, const cv::Mat& image)>;
  void draw_menu(const KeyBindings& keys, bool gamepad, const MakePicture& picture, const CameraModel& lens);

 private:
  GameMenu& menu();
  void begin(const std::string& name, const CameraModel& lens);
  void carry_out(const MenuChoice& choice, const CameraModel& lens);
  void hold_game();
  void release_game();
  GameStore settings_now() const;
  void apply_settings(const GameStore& before);
  void finish_game();

  std::string store_path_;
  GameStore store_;
  std::map<std::string, std::string> left_;  // by game: Game::save() on the map that is shown
  std::optional<GameMenu> menu_;             // once it was opened
  bool held_by_menu_ = false;                // the game waits for the menu to close
  bool fire_held_back_ = false;              // the button that closed the menu is no shot
  std::vector<void*> pictures_;
  PaletteFilter palette_;
  std::shared_ptr<const ModelSet> models_;
  std::unique_ptr<SoundPlayer> sounds_;
  std::unique_ptr<GameSession> session_;
  std::unique_ptr<SurfaceWorker> surface_;
  std::optional<OcclusionMask> mask_;
  std::optional<CameraModel> lens_;  // of the game that is on
  std::uint64_t seen_map_ = 0;
  bool scored_ = false;
  double over_s_ = 0;  // since the game ended
  bool fire_was_up_ = false;
  std::optional<Timestamp> last_time_;
  std::string place_;  // "3rd best"...
};

}  // namespace parallax
