#include "app/live_games.h"

#include <algorithm>
#include <chrono>
#include <ctime>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "app/asset_folder.h"
#include "app/game_hud.h"
#include "app/game_menu_view.h"
#include "core/error.h"

namespace parallax {
namespace {

// After the end of a game, before the button begins another: whoever was still firing sees the score.
constexpr double kEndShown_s = 1.0;

std::string today() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  std::tm local{};
  localtime_r(&now, &local);
  char text[16];
  return std::strftime(text, sizeof text, "%Y-%m-%d", &local) > 0 ? text : "";
}

// Every game is another one; what is kept of it says which.
std::uint64_t new_seed() {
  return static_cast<std::uint64_t>(std::chrono::system_clock::now().time_since_epoch().count() & 0x7fffffff);
}

std::string folder_or_none(const std::string& kind) {
  try {
    return asset_folder(kind);
  } catch (const InputError&) {
    return "";
  }
}

}  // namespace

LiveGames::LiveGames(std::string store_path)
    : store_path_(std::move(store_path)), store_(read_game_store(store_path_)) {}

LiveGames::~LiveGames() = default;

GameMenu& LiveGames::menu() {
  if (!menu_) menu_.emplace(menu_games());
  return *menu_;
}

void LiveGames::next() {
  if (menu_is_open()) {
    menu_->press(MenuKey::next, &store_);
    return;
  }
  hold_game();
  std::optional<std::size_t> on;
  const std::vector<std::string>& names = game_names();
  if (session_) on = static_cast<std::size_t>(std::find(names.begin(), names.end(), session_->name()) - names.begin());
  menu().open(on);
}

void LiveGames::explain() {
  if (!session_) return;
  next();
  menu_->explain(*menu_->playing());
}

void LiveGames::press(MenuKey key, const CameraModel& lens) {
  if (!menu_is_open()) return;
  const GameStore before = settings_now();
  const MenuChoice choice = menu_->press(key, &store_);
  apply_settings(before);
  carry_out(choice, lens);
}

void LiveGames::draw_menu(const KeyBindings& keys, bool gamepad, const MakePicture& picture, const CameraModel& lens) {
  if (!menu_is_open()) return;
  if (pictures_.empty()) {
    const std::string folder = folder_or_none("games");
    for (std::size_t i = 0; i < menu_->games().size(); ++i) {
      cv::Mat image;
      if (!folder.empty())
        image = cv::imread((std::filesystem::path(folder) / (menu_->games()[i].info.name + ".jpg")).string());
      pictures_.push_back(image.empty() ? nullptr : picture(static_cast<int>(i), image));
    }
  }
  const GameStore before = settings_now();
  std::set<std::string> left;
  for (const auto& [name, state] : left_) left.insert(name);
  const MenuChoice choice = draw_game_menu({&keys, pictures_, gamepad, std::move(left)}, &*menu_, &store_);
  apply_settings(before);
  carry_out(choice, lens);
}

void LiveGames::carry_out(const MenuChoice& choice, const CameraModel& lens) {
  if (choice.kind == MenuChoice::Kind::none) return;
  fire_held_back_ = true;
  write_game_store(store_, store_path_);
  if (choice.kind == MenuChoice::Kind::leave) {
    leave();
  } else if (choice.kind == MenuChoice::Kind::play && (!session_ || session_->name() != game_names()[choice.game])) {
    leave();
    begin(game_names()[choice.game], lens);
  } else {
    release_game();
  }
}

// The menu is opened over a game: it waits.
void LiveGames::hold_game() {
  if (!session_ || session_->runner().phase() == GamePhase::paused) return;
  session_->runner().pause();
  held_by_menu_ = session_->runner().phase() == GamePhase::paused;
}

void LiveGames::release_game() {
  if (session_ && held_by_menu_ && session_->runner().phase() == GamePhase::paused) session_->runner().toggle_pause();
  held_by_menu_ = false;
}

// The games' own settings, without the scores.
GameStore LiveGames::settings_now() const {
  GameStore now;
  now.settings = store_.settings;
  return now;
}

// What can be changed in a game that is on is changed there too.
void LiveGames::apply_settings(const GameStore& before) {
  palette_.set(game_palette(store_.palette));
  if (sounds_) {
    sounds_->set_volume(store_.volume);
    sounds_->set_muted(store_.mute);
  }
  if (!session_ || store_.settings == before.settings) return;
  Game& game = session_->runner().game();
  for (const GameSetting& setting : game.info().settings) {
    const double value = own_setting(store_, game.info(), setting.name);
    if (value != own_setting(before, game.info(), setting.name)) game.set(setting.name, value);
  }
}

void LiveGames::begin(const std::string& name, const CameraModel& lens) {
  palette_.set(game_palette(store_.palette));
  if (!models_) models_ = std::make_shared<const ModelSet>(ModelSet::load(asset_folder("models")));
  if (!sounds_) sounds_ = std::make_unique<SoundPlayer>(folder_or_none("sounds"));
  sounds_->set_volume(store_.volume);
  sounds_->set_muted(store_.mute);
  session_ = std::make_unique<GameSession>(GameRequest{name, store_.options(name, new_seed())}, models_);
  if (const auto left = left_.find(name); left != left_.end()) session_->restore_when_possible(left->second);
  if (!surface_) {
    surface_ = std::make_unique<SurfaceWorker>(lens);
    mask_.emplace(lens);
    lens_ = lens;
    seen_map_ = 0;
  }
  scored_ = false;
  last_time_.reset();
}

void LiveGames::leave() {
  if (menu_) menu_->close();
  held_by_menu_ = false;
  if (!session_) return;
  left_ = states();
  session_.reset();
  surface_.reset();
  mask_.reset();
  if (sounds_) sounds_->stop_all();
}

void LiveGames::change_map() {
  if (session_ && session_->runner().phase() != GamePhase::idle) leave();
  if (session_) session_->restore_when_possible("");
  left_.clear();
}

void LiveGames::bring(const std::map<std::string, std::string>& left) {
  left_ = left;
  if (!session_) return;
  // It was chosen before the map was there.
  if (const auto it = left_.find(session_->name()); it != left_.end() && session_->runner().phase() == GamePhase::idle)
    session_->restore_when_possible(it->second);
}

std::map<std::string, std::string> LiveGames::states() const {
  std::map<std::string, std::string> out = left_;
  if (!session_) return out;
  const GamePhase phase = session_->runner().phase();
  if (phase == GamePhase::over) out.erase(session_->name());
  if (phase != GamePhase::idle && phase != GamePhase::over) out[session_->name()] = session_->runner().game().save();
  return out;
}

void LiveGames::toggle_pause() {
  if (session_) session_->runner().toggle_pause();
}

void LiveGames::finish_game() {
  scored_ = true;
  over_s_ = 0;
  fire_was_up_ = false;
  const GameOptions& options = session_->runner().options();
  const int place =
      store_.add_score(session_->name(), options.difficulty, session_->runner().game().hud().score, today());
  place_ = place == 1 ? "the best score so far" : place > 1 ? "place " + std::to_string(place) : "";
  write_game_store(store_, store_path_);
}

void LiveGames::frame(const LiveFrame& frame, const GameInput& given, double ahead_s) {
  if (!session_) return;
  GameInput input = given;
  fire_held_back_ = fire_held_back_ && input.fire;
  if (fire_held_back_) input.fire = false;
  if (frame.map && frame.map->plane && frame.map->version != seen_map_) {
    seen_map_ = frame.map->version;
    surface_->update(frame.map);
  }
  session_->set_surface(surface_->surface());
  try {
    session_->frame(frame.frame, frame.tracked, frame.map.get(), input, ahead_s);
  } catch (const InputError&) {  // what was left is not of this version: begun anew
    session_->restart(session_->runner().options());
  }
  const double seconds = last_time_ ? std::chrono::duration<double>(frame.frame.time - *last_time_).count() : 0.0;
  last_time_ = frame.frame.time;
  if (session_->runner().phase() == GamePhase::over) {
    if (!scored_) finish_game();
    over_s_ += seconds;
    fire_was_up_ = fire_was_up_ || !input.fire;
    if (over_s_ > kEndShown_s && fire_was_up_ && input.fire) {
      GameOptions options = session_->runner().options();
      options.seed = new_seed();
      session_->restart(options);
      scored_ = false;
    }
  }
  std::vector<GameSound> sounds = session_->runner().take_sounds();
  for (GameSound& sound : sounds)
    if (sound.name != "countdown" && sound.name != "resume") sound.volume *= static_cast<float>(store_.effects);
  sounds_->play(sounds);
  if (session_->field() && frame.tracked.camera_from_world) {
    const RigidTransform camera_from_plane = *frame.tracked.camera_from_world * session_->field()->world_from_plane;
    sounds_->set_listener({camera_from_plane, session_->field()->radius_m});
  }
}

void LiveGames::draw(const LiveFrame& frame, DrawList* out) {
  if (!session_) return;
  const DrawnBefore before = DrawnBefore::of(*out);
  session_->draw(out);
  palette_.apply(before, out);
  if (!store_.occlusion || !session_->surface() || !frame.tracked.camera_from_world || !mask_) return;
  out->occlusion_depth = mask_->update(*session_->surface(), *frame.tracked.camera_from_world, frame.frame.grey);
}

void LiveGames::draw_interface(const PictureArea& area, const KeyBindings& keys) const {
  if (!session_ || menu_is_open()) return;
  const Game& game = session_->runner().game();
  GameHudView view{
      area, game.info().title, game.hud(), session_->status(), session_->advice(), lens_ ? &*lens_ : nullptr};
  if (session_->runner().phase() == GamePhase::over) {
    view.status += ": " + std::to_string(view.hud.score);
    if (!place_.empty()) view.status += ", " + place_;
    view.below = keys.chord_names(Action::initialise) + ": again   " + keys.chord_names(Action::next_game) + ": games";
  } else if (session_->runner().phase() == GamePhase::paused) {
    view.below = keys.chord_names(Action::game_pause) + ": go on   " + keys.chord_names(Action::help) +
                 ": how to play   " + keys.chord_names(Action::next_game) + ": games";
  }
  if (session_->runner().phase() == GamePhase::idle) view.begun = false;
  palette_.apply(&view.hud);
  draw_game_hud(view);
}

}  // namespace parallax
