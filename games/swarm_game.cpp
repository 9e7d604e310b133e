// Swarm as a Game: names, words and the conversion to metres; the rules are in games/swarm_simulation.
#include <algorithm>
#include <cmath>

#include "games/game.h"
#include "games/swarm_archive.h"
#include "games/swarm_draw.h"
#include "games/swarm_player.h"
#include "games/swarm_rules.h"
#include "games/swarm_simulation.h"

namespace parallax {
namespace {

GameInfo swarm_info() {
  GameInfo info;
  info.name = "swarm";
  info.title = "Swarm";
  info.explanation = {
      "Tock, the desk's clockwork guard, is alone.",
      "The Crumblings climb in over the edges:",
      "Nippers come in packs, Sidlers go for your",
      "back, Hoppets leap, Dribblers spit.",
      "Aim with the camera: a bolt flies at the ring.",
      "Quick kills in a row multiply the points;",
      "being hurt ends the row.",
      "Drive over what they drop: health, rapid fire,",
      "shield, bomb. Real things give cover.",
      "Seated: the dial turns the ring for you.",
  };
  info.fire_does = "shoots at the ring";
  info.act_does = "sets off a bomb";
  info.move_does = "drives the robot";
  info.dial_does = "turns the aim (seated)";
  GameSetting horde;
  horde.name = "horde";
  horde.label = "Size of the horde";
  horde.least = 0.5;
  horde.most = 2;
  horde.initial = 1;
  GameSetting assist;
  assist.name = "aim_assist";
  assist.label = "Aim assist";
  assist.least = 0;
  assist.most = 1;
  assist.initial = 0;
  info.settings = {horde, assist};
  return info;
}

class SwarmGame : public Game {
 public:
  const GameInfo& info() const override {
    static const GameInfo info = swarm_info();
    return info;
  }

  void start(const PlayingField& field, const GameOptions& options) override {
    field_ = field;
    simulation_.start(field, options);
  }
  void change_field(const PlayingField& field) override {
    field_ = field;
    simulation_.change_field(field);
  }
  void set(const std::string& setting, double value) override { simulation_.set(setting, value); }
  void step(const GameInput& input) override { simulation_.step(input); }
  GameInput scripted_input(const std::optional<RigidTransform>& camera_from_plane) const override {
    return swarm::play_patiently(simulation_.state(), simulation_.ground(), camera_from_plane);
  }
  bool is_over() const override { return simulation_.state().over; }
  GameHud hud() const override;
  std::vector<GameSound> take_sounds() override;
  void draw(const ModelSet& models, DrawList* out) const override {
    draw_swarm(simulation_, field_, models, &poses_, out);
  }
  std::optional<GameLandmark> landmark() const override {
    const Eigen::Vector2d at = simulation_.state().home * simulation_.unit_m();
    return GameLandmark{1, {at.x(), at.y(), 0}};
  }
  std::string save() const override { return swarm::save_state(simulation_.state()); }
  void restore(const std::string& text, const PlayingField& field) override {
    swarm::State state = swarm::restore_state(text);
    field_ = field;
    simulation_.restore(std::move(state), field);
  }
  std::uint64_t state_hash() const override {
    return swarm::hash_of(simulation_.state()) ^ (simulation_.ground().hash() * 31);
  }

 private:
  PlayingField field_;
  swarm::Simulation simulation_;
  mutable swarm::CritterPoses poses_;  // made for pictures: no part of the state
};

std::string seconds_left(const char* what, int ticks_left) {
  return std::string(what) + " " + std::to_string((ticks_left + kGameTicksPerSecond - 1) / kGameTicksPerSecond) + " s";
}

GameHud SwarmGame::hud() const {
  const swarm::State& state = simulation_.state();
  GameHud hud;
  hud.score = state.score;
  hud.cross_hairs = !state.seated;
  hud.lines.push_back("wave " + std::to_string(state.wave.number));
  int left = static_cast<int>(state.critters.size());
  for (const int count : state.wave.to_release) left += count;
  hud.lines.push_back(std::to_string(left) + (left == 1 ? " critter" : " critters"));
  const int times = swarm::multiplier(state.chain);
  if (times > 1) hud.lines.push_back("combo x" + std::to_string(times));
  if (state.robot.bombs > 0) hud.lines.push_back("bombs " + std::to_string(state.robot.bombs));
  if (state.robot.shield_ticks > 0) hud.lines.push_back(seconds_left("shield", state.robot.shield_ticks));
  if (state.robot.rapid_ticks > 0) hud.lines.push_back(seconds_left("rapid fire", state.robot.rapid_ticks));
  const double health = static_cast<double>(state.robot.health) / swarm::kFullHealth;
  hud.gauges.push_back({"health", health, swarm::health_colour(health, state.colour_blind_safe)});
  if (state.over) {
    hud.message = "Tock is down in wave " + std::to_string(state.wave.number);
  } else if (state.wave.pause_ticks > 0) {
    hud.message = "Wave " + std::to_string(state.wave.number);
    for (int k = 0; k < swarm::kKinds; ++k) {
      const swarm::KindRules& rules = swarm::rules_of(static_cast<swarm::CritterKind>(k));
      if (rules.first_wave == state.wave.number) hud.message += std::string(": here come the ") + rules.name;
    }
  }
  return hud;
}

std::vector<GameSound> SwarmGame::take_sounds() {
  std::vector<GameSound> sounds;
  for (const swarm::Heard& heard : simulation_.take_sounds()) {
    const Eigen::Vector2d at = heard.position * simulation_.unit_m();
    sounds.push_back({heard.name, heard.volume, heard.pitch, Eigen::Vector3d(at.x(), at.y(), 0)});
  }
  return sounds;
}

}  // namespace

std::unique_ptr<Game> make_swarm() { return std::make_unique<SwarmGame>(); }

}  // namespace parallax
