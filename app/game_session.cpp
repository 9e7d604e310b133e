#include "app/game_session.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "app/game_store.h"
#include "core/check.h"
#include "core/error.h"
#include "core/parse_text.h"

namespace parallax {
namespace {

constexpr double kOldestBefore_s = 0.2;
constexpr double kLongestSettling_s = 8;

std::unique_ptr<Game> needed(const std::string& name) {
  auto game = make_game(name);
  PARALLAX_CHECK(game != nullptr, "no game is called " + name);
  return game;
}

[[noreturn]] void refuse(const std::string& found, const std::string& expected) {
  throw InputError("--game: found '" + found + "', expected " + expected);
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

double number(const std::string& pair, const std::string& value) {
  double parsed = 0;
  if (!parse_number(value, &parsed)) refuse(pair, "a number behind the =");
  return parsed;
}

void set_option(const std::string& pair, const GameInfo& info, GameOptions* options) {
  const auto equals = pair.find('=');
  if (equals == std::string::npos) refuse(pair, "NAME=VALUE");
  const std::string name = pair.substr(0, equals), value = pair.substr(equals + 1);
  if (name == "seed") {
    const double seed = number(pair, value);
    if (seed < 0 || seed > 9e15 || seed != std::floor(seed)) refuse(pair, "a whole number from 0 on");
    options->seed = static_cast<std::uint64_t>(seed);
  } else if (name == "difficulty") {
    const auto given = difficulty_of(value);
    if (!given) refuse(pair, "difficulty easy, normal or hard");
    options->difficulty = *given;
  } else if (name == "seated" || name == "colour_blind_safe") {
    if (value != "0" && value != "1") refuse(pair, "0 or 1");
    (name == "seated" ? options->seated : options->colour_blind_safe) = value == "1";
  } else {
    const auto setting =
        std::find_if(info.settings.begin(), info.settings.end(), [&](const auto& s) { return s.name == name; });
    if (setting == info.settings.end()) {
      std::vector<std::string> names{"seed", "difficulty", "seated", "colour_blind_safe"};
      for (const GameSetting& s : info.settings) names.push_back(s.name);
      refuse(pair, "one of " + listed(names));
    }
    const auto choice = std::find(setting->choices.begin(), setting->choices.end(), value);
    if (choice != setting->choices.end()) {
      options->settings.emplace_back(name, static_cast<double>(choice - setting->choices.begin()));
      return;
    }
    if (!setting->choices.empty()) refuse(pair, "one of " + listed(setting->choices));
    const double parsed = number(pair, value);
    if (parsed < setting->least || parsed > setting->most)
      refuse(pair, "a number from " + std::to_string(setting->least) + " to " + std::to_string(setting->most));
    options->settings.emplace_back(name, parsed);
  }
}

}  // namespace

const std::vector<std::string>& game_names() {
  static const std::vector<std::string> names{"swarm", "burning_glass", "marbles"};
  return names;
}

std::unique_ptr<Game> make_game(const std::string& name) {
  if (name == "swarm") return make_swarm();
  if (name == "burning_glass") return make_burning_glass();
  if (name == "marbles") return make_marbles();
  return nullptr;
}

GameRequest parse_game_request(const std::string& text) {
  GameRequest request;
  const auto question = text.find('?');
  request.name = text.substr(0, question);
  const auto game = make_game(request.name);
  if (!game) refuse(text, listed(game_names()));
  if (question == std::string::npos) return request;
  std::string rest = text.substr(question + 1);
  while (!rest.empty()) {
    const auto end = std::min(rest.find('&'), rest.size());
    set_option(rest.substr(0, end), game->info(), &request.options);
    rest.erase(0, end + 1);
  }
  return request;
}

RigidTransform predict_pose(const RigidTransform& camera_from_field, const std::optional<RigidTransform>& before,
                            double between_s, double ahead_s) {
  ahead_s = std::min(ahead_s, kFarthestPrediction_s);
  if (!before || !(between_s > 0) || between_s > kOldestBefore_s || !(ahead_s > 0)) return camera_from_field;
  const Vector6d step = (camera_from_field * before->inverse()).log();
  return RigidTransform::exp(step * (ahead_s / between_s)) * camera_from_field;
}

GameSession::GameSession(const GameRequest& request, std::shared_ptr<const ModelSet> models)
    : name_(request.name), options_(request.options), runner_(needed(request.name)), models_(std::move(models)) {}

void GameSession::restart(const GameOptions& options) {
  options_ = options;
  saved_.clear();
  if (field_.field()) {
    runner_.start(*field_.field(), options_);
  } else {
    runner_ = GameRunner(needed(name_));
  }
}

void GameSession::restore_when_possible(std::string saved) {
  saved_ = std::move(saved);
  if (field_.field()) begin();
}

void GameSession::begin() {
  if (saved_.empty()) {
    runner_.start(*field_.field(), options_);
    return;
  }
  const std::string text = std::exchange(saved_, {});
  runner_.start(*field_.field(), options_);
  runner_.game().restore(text, *field_.field());
  runner_.resume(options_);
}

void GameSession::set_surface(std::shared_ptr<const SceneSurface> surface) {
  if (surface == surface_) return;
  surface_ = std::move(surface);
  surface_is_new_ = true;
}

void GameSession::frame(const Frame& frame, const TrackingResult& tracked, const TrackingSnapshot* map,
                        GameInput controls, double ahead_s) {
  const double seconds = last_time_ ? std::chrono::duration<double>(frame.time - *last_time_).count() : 0.0;
  last_time_ = frame.time;
  // A table that is not looked at from more sides is played on as it is known, after a while.
  settling_s_ = field_.settling() ? settling_s_ + seconds : 0.0;
  bool changed = map != nullptr && field_.update(*map, settling_s_ > kLongestSettling_s);
  if (surface_is_new_ && field_.field()) {
    field_.set_surface(surface_);
    surface_is_new_ = false;
    changed = true;
  }
  tracked_ = tracked.camera_from_world.has_value() && map != nullptr;
  if (!field_.field()) {
    last_pose_.reset();
    return;
  }
  if (runner_.phase() == GamePhase::idle) {
    begin();
  } else if (changed) {
    runner_.change_field(*field_.field());
  }
  controls.camera_from_plane.reset();
  if (tracked_) {
    const RigidTransform pose = *tracked.camera_from_world * field_.field()->world_from_plane;
    camera_from_world_ = *tracked.camera_from_world;
    // A pose in other metres says nothing about how the camera moves.
    if (map->map_version != last_map_version_ || field_.field()->scale != last_scale_) last_pose_.reset();
    last_scale_ = field_.field()->scale;
    controls.camera_from_plane = predict_pose(pose, last_pose_, seconds, ahead_s);
    last_pose_ = pose;
    last_map_version_ = map->map_version;
  } else {
    last_pose_.reset();
  }
  runner_.advance(seconds, controls);
}

void GameSession::draw(DrawList* out) const {
  if (!tracked_ || !field_.field() || runner_.phase() == GamePhase::idle) return;
  runner_.game().draw(*models_, out);
}

std::optional<GameSight> GameSession::sight() const {
  if (!tracked_ || !field_.field() || runner_.phase() == GamePhase::idle || !last_time_) return std::nullopt;
  const auto landmark = runner_.game().landmark();
  if (!landmark) return std::nullopt;
  const auto fields = static_cast<std::uint64_t>(field_.field()->number);
  return GameSight{*last_time_, landmark->number ^ (fields << 56), camera_from_world_,
                   field_.field()->world_from_plane * landmark->position_m};
}

std::string GameSession::status() const {
  switch (runner_.phase()) {
    case GamePhase::idle:
      return field_.settling() ? "mapping the table..."
                               : "look at the table from all sides: the game begins when it is mapped";
    case GamePhase::lost:
      return "paused: tracking is lost";
    case GamePhase::paused:
      return "paused";
    case GamePhase::resuming:
      return std::to_string(static_cast<int>(std::ceil(runner_.resumes_in_s())));
    case GamePhase::over:
      return "game over";
    case GamePhase::playing:
      break;
  }
  return "";
}

std::string GameSession::advice() const {
  if (runner_.phase() == GamePhase::lost) return "move the camera back to where it has been";
  return runner_.phase() == GamePhase::idle && field_.settling() ? "slide the camera to the side, and round the table"
                                                                 : "";
}

}  // namespace parallax
