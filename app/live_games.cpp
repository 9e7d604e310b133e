#include "app/live_games.h"

#include <algorithm>
#include <chrono>
#include <ctime>

#include "app/asset_folder.h"
#include "app/game_hud.h"
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

LiveGames::~LiveGames() {
  try {
    leave();
  } catch (const std::exception&) {  // a full disk: the program is ending
  }
}

std::string LiveGames::next(const CameraModel& lens) {
  const std::vector<std::string>& names = game_names();
  std::size_t following = 0;
  if (session_) {
    following = static_cast<std::size_t>(std::find(names.begin(), names.end(), session_->name()) - names.begin()) + 1;
    leave();
  }
  if (following >= names.size()) return "no game";
  begin(names[following], lens);
  return session_->runner().game().info().title;
}

void LiveGames::begin(const std::string& name, const CameraModel& lens) {
  if (!models_) models_ = std::make_shared<const ModelSet>(ModelSet::load(asset_folder("models")));
  if (!sounds_) sounds_ = std::make_unique<SoundPlayer>(folder_or_none("sounds"));
  sounds_->set_volume(store_.volume);
  sounds_->set_muted(store_.mute);
  session_ = std::make_unique<GameSession>(GameRequest{name, store_.options(name, new_seed())}, models_);
  if (const auto left = store_.left.find(name); left != store_.left.end()) {
    session_->restore_when_possible(left->second);
    store_.left.erase(left);
  }
  if (!surface_) {
    surface_ = std::make_unique<SurfaceWorker>(lens);
    mask_.emplace(lens);
    seen_map_ = 0;
  }
  scored_ = false;
  last_time_.reset();
}

void LiveGames::leave() {
  if (!session_) return;
  const GamePhase phase = session_->runner().phase();
  if (phase != GamePhase::idle && phase != GamePhase::over)
    store_.left[session_->name()] = session_->runner().game().save();
  session_.reset();
  surface_.reset();
  mask_.reset();
  if (sounds_) sounds_->stop_all();
  write_game_store(store_, store_path_);
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

void LiveGames::frame(const LiveFrame& frame, const GameInput& input, double ahead_s) {
  if (!session_) return;
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
  sounds_->play(session_->runner().take_sounds());
  if (session_->field() && frame.tracked.camera_from_world) {
    const RigidTransform camera_from_plane = *frame.tracked.camera_from_world * session_->field()->world_from_plane;
    sounds_->set_listener({camera_from_plane, session_->field()->radius_m});
  }
}

void LiveGames::draw(const LiveFrame& frame, DrawList* out) {
  if (!session_) return;
  session_->draw(out);
  if (!store_.occlusion || !session_->surface() || !frame.tracked.camera_from_world || !mask_) return;
  out->occlusion_depth = mask_->update(*session_->surface(), *frame.tracked.camera_from_world, frame.frame.grey);
}

void LiveGames::draw_interface(const PictureArea& area) const {
  if (!session_) return;
  const Game& game = session_->runner().game();
  GameHudView view{area, game.info().title, game.hud(), session_->status()};
  if (session_->runner().phase() == GamePhase::over) {
    view.status += ": " + std::to_string(view.hud.score);
    if (!place_.empty()) view.status += ", " + place_;
  }
  draw_game_hud(view);
}

}  // namespace parallax
