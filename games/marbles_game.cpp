#include "games/marbles_game.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/check.h"
#include "core/error.h"

namespace parallax {
namespace {

constexpr int kReady_ticks = 3 * kGameTicksPerSecond / 2;
constexpr int kDone_ticks = 2 * kGameTicksPerSecond;
constexpr int kNews_ticks = 2 * kGameTicksPerSecond;
constexpr int kRespawn_ticks = 3 * kGameTicksPerSecond / 4;
constexpr int kKeysHold_ticks = kGameTicksPerSecond / 4;
constexpr int kTrapped_ticks = 5 * kGameTicksPerSecond;
constexpr int kTrappedEvery_ticks = kGameTicksPerSecond / 2;
constexpr int kRollSoundEvery_ticks = kGameTicksPerSecond / 4;

constexpr float kTiltRate = 1.5f;                      // sine of the tilt a second
constexpr float kDeadZone = 0.026f;                    // radians of the camera's attitude that are no tilt
constexpr float kLeastKey = 0.01f;                     // moves below this are none
constexpr float kDropHeight = 2;                       // above the start
constexpr float kLostBelow = -4;                       // a marble this far under the table is lost
constexpr float kFarthest = 400;                       // and one this far from anything
constexpr float kCoinReach = 1.0f;                     // of a marble's centre from a coin, along the table
constexpr float kCoinReachUp = 1.2f;                   // and above what it lies on
constexpr float kFlickReach = 5;                       // of the cross-hairs from a marble
constexpr float kLeastFlick = 4, kGreatestFlick = 26;  // speeds
constexpr float kTrappedReach = 1.5f;                  // a marble further than this from where it can roll is trapped
constexpr float kInside = 0.06f;                       // marbles deeper in a block than this are lifted out
constexpr std::size_t kMostSounds = 32;
constexpr double kLeastUnitShare = 0.02, kGreatestUnitShare = 50;  // of a saved unit to the field's

std::uint64_t mix(std::uint64_t value) {  // the finaliser of SplitMix64 (Steele et al. 2014)
  value += 0x9e3779b97f4a7c15ULL;
  value = (value ^ (value >> 30)) * 0xbf58476d1ce4e5b9ULL;
  value = (value ^ (value >> 27)) * 0x94d049bb133111ebULL;
  return value ^ (value >> 31);
}

// Roll to the right and pitch downwards of a camera, radians.
Eigen::Vector2f attitude_of(const RigidTransform& camera_from_plane) {
  const Eigen::Matrix3d& R = camera_from_plane.R;
  return Eigen::Vector2d(-std::asin(std::clamp(R(0, 2), -1.0, 1.0)), std::atan2(-R(2, 2), -R(1, 2))).cast<float>();
}

Eigen::Vector2f left_of(const Eigen::Vector2f& v) { return {-v.y(), v.x()}; }

}  // namespace

int marbles_level_ticks(GameDifficulty difficulty, int level_number) {
  const int full_s = difficulty == GameDifficulty::easy ? 180 : difficulty == GameDifficulty::normal ? 120 : 80;
  const int gone_s = std::min(3 * (level_number - 1), full_s / 3);
  return (full_s - gone_s) * kGameTicksPerSecond;
}

void MarblesGame::start(const PlayingField& field, const GameOptions& options) {
  state_ = MarblesState();
  sounds_.clear();
  field_ = field;
  state_.seed = options.seed;
  state_.difficulty = options.difficulty;
  state_.seated = options.seated;
  state_.colour_blind_safe = options.colour_blind_safe;
  state_.lives = options.difficulty == GameDifficulty::easy ? 5 : 3;
  for (const auto& [name, value] : options.settings) set(name, value);
  begin_level();
}

void MarblesGame::set(const std::string& setting, double value) {
  if (!std::isfinite(value)) return;
  for (const GameSetting& known : info().settings) {
    if (known.name != setting) continue;
    const double kept = std::clamp(value, known.least, known.most);
    if (setting == "control") state_.control = static_cast<MarblesControl>(std::lround(kept));
    if (setting == "sensitivity") state_.sensitivity = kept;
    if (setting == "loose_marbles") state_.loose_marbles = static_cast<int>(std::lround(kept));
    if (setting == "outlines") state_.outlines = std::lround(kept) != 0;
  }
}

void MarblesGame::begin_level() {
  const double radius_m = field_.radius_m > 0 && std::isfinite(field_.radius_m) ? field_.radius_m : 0.2;
  state_.unit_m = radius_m / kMarblesFieldRadius;
  const int number = state_.level_number, hardness = static_cast<int>(state_.difficulty);
  MarblesLevelWishes wishes;
  wishes.seed = mix(mix(state_.seed) + static_cast<std::uint64_t>(number));
  wishes.coins = std::min(kMarblesMostCoins, 3 + 2 * hardness + (number - 1) / 2);
  wishes.ramps = hardness == 2 ? 3 : 2;
  wishes.loose = state_.loose_marbles;
  wishes.goal_radius =
      std::max(0.8f, 1.6f - 0.3f * static_cast<float>(hardness) - 0.02f * static_cast<float>(number - 1));

  state_.with_obstacles = true;
  ground_ = read_ground(field_, state_.unit_m);
  bool made = make_marbles_level(ground_, wishes, &state_.level);
  if (!made) {
    state_.with_obstacles = false;
    ground_ = read_ground(field_, state_.unit_m, false);
    made = make_marbles_level(ground_, wishes, &state_.level);
  }
  PARALLAX_CHECK(made, "marbles: no level on an empty table");

  state_.marbles.assign(1, MarbleMotion());
  for (const Eigen::Vector2f& place : state_.level.loose) {
    state_.marbles.emplace_back();
    state_.marbles.back().position << place, kMarbleRadius;
  }
  put_player_at_start();
  rebuild_table();
  state_.ticks_left = marbles_level_ticks(state_.difficulty, number);
  state_.tilt.setZero();
  state_.level_attitude.reset();
  state_.respawn_ticks = state_.trapped_ticks = state_.keys_ticks = state_.charge_ticks = 0;
  enter_phase(MarblesPhase::ready, state_.with_obstacles ? MarblesNews::level : MarblesNews::no_room);
  play("wave_begins", 0.7f, 1, nullptr);
}

void MarblesGame::enter_phase(MarblesPhase phase, MarblesNews news) {
  state_.phase = phase;
  state_.phase_ticks = 0;
  state_.news = news;
  state_.news_ticks = kNews_ticks;
}

void MarblesGame::put_player_at_start() {
  MarbleMotion& marble = state_.marbles.front();
  marble = MarbleMotion();
  marble.position << state_.level.start, state_.level.start_height + kMarbleRadius + kDropHeight;
}

void MarblesGame::rebuild_table() {
  table_.outline = ground_.outline;
  table_.boxes = merge_boxes(ground_);
  table_.ramps = state_.level.ramps;
  physics_.set_table(table_);
  walk_ = make_walk_map(ground_, state_.level.ramps);
  edges_ = obstacle_edges(ground_);
  ways_ = Ways();
}

void MarblesGame::lift_marbles_out() {
  for (MarbleMotion& marble : state_.marbles)
    // Each block lifts a marble at most once, lowest first or not: a few rounds are enough to come to rest.
    for (bool lifted = true; lifted;) {
      lifted = false;
      for (const TableBox& box : table_.boxes) {
        const Eigen::Vector3f least(box.least.x(), box.least.y(), -1);
        const Eigen::Vector3f most(box.most.x(), box.most.y(), box.height);
        const Eigen::Vector3f nearest = marble.position.cwiseMax(least).cwiseMin(most);
        if ((marble.position - nearest).norm() > kMarbleRadius - kInside) continue;
        if (marble.position.z() >= box.height + kMarbleRadius - kInside) continue;
        if (marble.position.z() < 0) continue;  // over the edge, on its way down
        marble.position.z() = box.height + kMarbleRadius;
        lifted = true;
      }
    }
}

void MarblesGame::change_field(const PlayingField& field) {
  // Scaled: all keeps its place on the table. Grown: all keeps its size until the next level.
  const double radius_m = field.radius_m > 0 && std::isfinite(field.radius_m) ? field.radius_m : 0.2;
  state_.unit_m = std::clamp(state_.unit_m * length_factor(field_, field),
                             kLeastUnitShare * radius_m / kMarblesFieldRadius, radius_m / kMarblesFieldRadius);
  field_ = field;
  const auto mend = [&](bool with_obstacles) {
    ground_ = read_ground(field_, state_.unit_m, with_obstacles);
    MarblesLevel mended = state_.level;
    if (!mend_marbles_level(ground_, &mended)) return false;
    state_.level = mended;
    state_.with_obstacles = with_obstacles;
    return true;
  };
  if (!mend(true)) PARALLAX_CHECK(mend(false), "marbles: no room on an empty table");
  rebuild_table();
  lift_marbles_out();
}

void MarblesGame::restore(const std::string& text, const PlayingField& field) {
  const MarblesState state = marbles_from_text(text);
  const double share = state.unit_m * kMarblesFieldRadius / field.radius_m;
  if (!(share >= kLeastUnitShare && share <= kGreatestUnitShare))
    throw InputError("saved game of marbles: unit_m: found " + std::to_string(state.unit_m) +
                     ", expected a size that fits a field of radius " + std::to_string(field.radius_m));
  state_ = state;
  sounds_.clear();
  field_ = field;
  change_field(field);
}

void MarblesGame::follow_camera(const GameInput& input) {
  const bool has_camera = input.camera_from_plane.has_value() && input.camera_from_plane->R.allFinite();
  Eigen::Vector2f wanted = Eigen::Vector2f::Zero();  // to the right, away
  if (has_camera) {
    const Eigen::Vector2d right = input.camera_from_plane->R.row(0).head<2>();
    if (right.norm() > 0.2) state_.heading = right.normalized().cast<float>();
    const Eigen::Vector2f attitude = attitude_of(*input.camera_from_plane);
    // The second button makes the present attitude the level one.
    if (!state_.level_attitude || input.act) state_.level_attitude = attitude;
    if (state_.control == MarblesControl::camera && !state_.seated)
      for (int k = 0; k < 2; ++k) {
        float turn = std::remainder(attitude[k] - (*state_.level_attitude)[k], 2 * static_cast<float>(M_PI));
        turn = std::copysign(std::max(0.0f, std::abs(turn) - kDeadZone), turn);
        turn *= static_cast<float>(state_.sensitivity);
        wanted[k] = std::sin(std::clamp(turn, -0.5f, 0.5f));
      }
  }
  Eigen::Vector2f keys = input.move.allFinite() ? Eigen::Vector2f(input.move.cast<float>()) : Eigen::Vector2f::Zero();
  if (keys.norm() > 1) keys.normalize();
  if (keys.norm() > kLeastKey) state_.keys_ticks = kKeysHold_ticks;
  if (state_.keys_ticks > 0) {
    --state_.keys_ticks;
    wanted = kMarblesGreatestTilt * keys;
  }
  if (wanted.norm() > kMarblesGreatestTilt) wanted *= kMarblesGreatestTilt / wanted.norm();
  if (state_.phase != MarblesPhase::playing) wanted.setZero();
  const Eigen::Vector2f target = wanted.x() * state_.heading + wanted.y() * left_of(state_.heading);
  const Eigen::Vector2f change = target - state_.tilt;
  const float most = kTiltRate * static_cast<float>(kGameTick_s);
  state_.tilt += change.norm() > most ? Eigen::Vector2f(change * (most / change.norm())) : change;
}

void MarblesGame::flick(const GameInput& input) {
  if (input.fire && state_.phase == MarblesPhase::playing) {
    state_.charge_ticks = std::min(state_.charge_ticks + 1, kMarblesFullCharge_ticks);
    return;
  }
  const int charge = state_.charge_ticks;
  state_.charge_ticks = 0;
  if (charge == 0 || !input.camera_from_plane || state_.phase != MarblesPhase::playing) return;
  const RigidTransform plane_from_camera = input.camera_from_plane->inverse();
  const Eigen::Vector3d axis = plane_from_camera.R.col(2);
  Eigen::Vector2d cross_hairs_m;
  if (!axis.allFinite() || !meets_plane(plane_from_camera.t, axis, &cross_hairs_m)) return;
  const Eigen::Vector2f cross_hairs = (cross_hairs_m / state_.unit_m).cast<float>();
  MarbleMotion* nearest = nullptr;
  float least = kFlickReach;
  for (std::size_t i = 0; i < state_.marbles.size(); ++i) {
    if (i == 0 && state_.respawn_ticks > 0) continue;
    const float distance = (state_.marbles[i].position.head<2>() - cross_hairs).norm();
    if (distance < least) least = distance, nearest = &state_.marbles[i];
  }
  if (!nearest) return;
  Eigen::Vector2f direction = axis.head<2>().cast<float>();
  if (direction.norm() > 0.15f)
    direction.normalize();
  else
    direction = left_of(state_.heading);  // seen from straight above: away from the viewer
  const float share = static_cast<float>(charge) / static_cast<float>(kMarblesFullCharge_ticks);
  nearest->velocity.head<2>() += direction * (kLeastFlick + share * (kGreatestFlick - kLeastFlick));
  play("fire", 0.4f + 0.6f * share, 0.8f + 0.4f * share, &nearest->position);
}

void MarblesGame::roll() {
  const float down = std::sqrt(1 - state_.tilt.squaredNorm());
  const Eigen::Vector3f gravity = kMarblesGravity * Eigen::Vector3f(state_.tilt.x(), state_.tilt.y(), -down);
  std::vector<MarbleKnock> knocks;
  if (state_.respawn_ticks > 0) {
    // The player's marble is nowhere.
    std::vector<MarbleMotion> others(state_.marbles.begin() + 1, state_.marbles.end());
    physics_.step(gravity, &others, &knocks);
    std::copy(others.begin(), others.end(), state_.marbles.begin() + 1);
    for (MarbleKnock& knock : knocks) knock.marble += 1;
  } else {
    physics_.step(gravity, &state_.marbles, &knocks);
  }
  const auto loudest = std::max_element(knocks.begin(), knocks.end(),
                                        [](const MarbleKnock& a, const MarbleKnock& b) { return a.speed < b.speed; });
  if (loudest != knocks.end()) {
    const bool glass = loudest->other >= 0;
    play("knock", std::min(1.0f, loudest->speed / 20), glass ? 1.3f : 1.0f,
         &state_.marbles[static_cast<std::size_t>(loudest->marble)].position);
  }
  const MarbleMotion& player = state_.marbles.front();
  const float speed = player.velocity.head<2>().norm();
  if (state_.phase_ticks % kRollSoundEvery_ticks == 0 && state_.respawn_ticks == 0 && speed > 1.5f)
    play("roll", std::min(0.6f, speed / 25), 0.8f + std::min(0.6f, speed / 40), &player.position);
}

bool MarblesGame::goal_is_open() const {
  return std::all_of(state_.level.coins.begin(), state_.level.coins.end(),
                     [](const MarblesCoin& coin) { return coin.taken; });
}

void MarblesGame::collect() {
  for (std::size_t i = 0; i < state_.marbles.size(); ++i) {
    if (i == 0 && state_.respawn_ticks > 0) continue;
    const Eigen::Vector3f& at = state_.marbles[i].position;
    for (MarblesCoin& coin : state_.level.coins) {
      if (coin.taken || (at.head<2>() - coin.place).norm() > kCoinReach) continue;
      if (at.z() < coin.height || at.z() > coin.height + kCoinReachUp) continue;
      coin.taken = true;
      state_.score += 100 * (coin.height > 0 ? 2 : 1);
      play("coin", 0.9f, 1, &at);
    }
  }
  if (!goal_is_open() || state_.respawn_ticks > 0) return;
  const Eigen::Vector3f& at = state_.marbles.front().position;
  if ((at.head<2>() - state_.level.goal).norm() > state_.level.goal_radius) return;
  if (at.z() < state_.level.goal_height || at.z() > state_.level.goal_height + kCoinReachUp) return;
  state_.score +=
      500 + 10 * (state_.ticks_left / kGameTicksPerSecond) + 50 * static_cast<std::int64_t>(state_.marbles.size() - 1);
  enter_phase(MarblesPhase::done, MarblesNews::done);
  play("goal", 1, 1, &at);
}

void MarblesGame::lose_life(MarblesNews news) {
  --state_.lives;
  state_.charge_ticks = state_.trapped_ticks = 0;
  if (state_.lives <= 0) {
    state_.lives = 0;
    enter_phase(MarblesPhase::over, MarblesNews::over);
    play("game_over", 1, 1, nullptr);
    return;
  }
  state_.news = news;
  state_.news_ticks = kNews_ticks;
  state_.respawn_ticks = kRespawn_ticks;
  put_player_at_start();
  play("player_hurt", 0.8f, 1, nullptr);
}

void MarblesGame::look_after_lost_marbles() {
  const auto lost = [](const MarbleMotion& marble) {
    return !marble.position.allFinite() || !marble.velocity.allFinite() || !marble.spin.allFinite() ||
           !marble.rotation.coeffs().allFinite() || marble.position.z() < kLostBelow ||
           marble.position.cwiseAbs().maxCoeff() > kFarthest;
  };
  std::vector<MarbleMotion>& marbles = state_.marbles;
  marbles.erase(std::remove_if(marbles.begin() + 1, marbles.end(), lost), marbles.end());
  if (state_.respawn_ticks > 0) {
    --state_.respawn_ticks;
  } else if (lost(marbles.front())) {
    if (state_.phase == MarblesPhase::playing)
      lose_life(MarblesNews::lost);
    else
      put_player_at_start();
  }
}

void MarblesGame::look_after_trapped_marble() {
  if (state_.phase_ticks % kTrappedEvery_ticks != 0 || state_.respawn_ticks > 0) return;
  const auto start = walk_.cell_at(state_.level.start);
  const int area = start ? walk_.area[*start] : -1;
  const Eigen::Vector3f& at = state_.marbles.front().position;
  const auto near = area < 0 ? std::nullopt : walk_.nearest_drivable(at.head<2>(), kTrappedReach, area);
  // A marble that lies higher than the way beside it stands on something.
  if (near && std::abs(at.z() - kMarbleRadius - walk_.height[*near]) < kDropHeight + 1) {
    state_.trapped_ticks = 0;
    return;
  }
  state_.trapped_ticks += kTrappedEvery_ticks;
  if (state_.trapped_ticks < kTrapped_ticks) return;
  state_.trapped_ticks = 0;
  put_player_at_start();
  state_.news = MarblesNews::put_back;
  state_.news_ticks = kNews_ticks;
  play("jump", 0.7f, 1, nullptr);
}

void MarblesGame::step(const GameInput& input) {
  ++state_.phase_ticks;
  if (state_.news_ticks > 0 && --state_.news_ticks == 0) state_.news = MarblesNews::none;
  if (state_.phase == MarblesPhase::over) {
    state_.phase_ticks = 0;
    return;
  }
  follow_camera(input);
  flick(input);
  roll();
  look_after_lost_marbles();
  switch (state_.phase) {
    case MarblesPhase::ready:
      if (state_.phase_ticks >= kReady_ticks) {
        enter_phase(MarblesPhase::playing, MarblesNews::none);
        state_.level_attitude.reset();
      }
      break;
    case MarblesPhase::playing:
      collect();
      if (state_.phase != MarblesPhase::playing) break;
      look_after_trapped_marble();
      if (--state_.ticks_left > 0) break;
      state_.ticks_left = marbles_level_ticks(state_.difficulty, state_.level_number);
      lose_life(MarblesNews::time_up);
      break;
    case MarblesPhase::done:
      if (state_.phase_ticks < kDone_ticks) break;
      state_.level_number = std::min(state_.level_number + 1, 1'000'000);
      begin_level();
      break;
    case MarblesPhase::over:
      break;
  }
}

void MarblesGame::play(const std::string& sound, float volume, float pitch, const Eigen::Vector3f* place) {
  if (sounds_.size() >= kMostSounds) return;
  GameSound out{sound, volume, pitch, std::nullopt};
  if (place) out.position_m = place->cast<double>() * state_.unit_m;
  sounds_.push_back(out);
}

std::vector<GameSound> MarblesGame::take_sounds() {
  std::vector<GameSound> out;
  out.swap(sounds_);
  return out;
}

// The goal; moved when it could not be reached any more.
std::optional<GameLandmark> MarblesGame::landmark() const {
  GameLandmark out;
  const Eigen::Vector3f goal(state_.level.goal.x(), state_.level.goal.y(), state_.level.goal_height);
  out.number = static_cast<std::uint64_t>(state_.level_number);
  for (int k = 0; k < 3; ++k) out.number = mix(out.number ^ std::bit_cast<std::uint32_t>(goal[k]));
  out.position_m = goal.cast<double>() * state_.unit_m;
  return out;
}

std::uint64_t MarblesGame::state_hash() const {
  std::uint64_t hash = 0xcbf29ce484222325ULL;  // FNV-1a of the saved state
  for (const char byte : save()) hash = (hash ^ static_cast<unsigned char>(byte)) * 0x100000001b3ULL;
  return hash;
}

std::unique_ptr<Game> make_marbles() { return std::make_unique<MarblesGame>(); }

}  // namespace parallax
