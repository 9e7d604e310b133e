// Marbles (after PTAM section 8.2: virtual things that run into real ones): marbles roll on the mapped table and
// against the real things on it. The player tilts the table with the camera or the keys, or flicks a marble; coins are
// to be collected, then the goal opens.
//
// The rules; physics, ground, level, saving and drawing have files of their own. Inside, all is in marbles' diameters
// (marbles_ground.h). The contract is that of games/game.h.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "games/game.h"
#include "games/marbles_ground.h"
#include "games/marbles_level.h"
#include "games/marbles_physics.h"
#include "games/marbles_state.h"
#include "games/marbles_walk.h"

namespace parallax {

// Diameters a second squared: marbles of 14 mm fall as on the moon, so that a player can follow.
inline constexpr float kMarblesGravity = 120;
inline constexpr float kMarblesGreatestTilt = 0.26f;  // sine of 15 degrees
inline constexpr int kMarblesFullCharge_ticks = kGameTicksPerSecond;
// The time for a level of a number.
int marbles_level_ticks(GameDifficulty difficulty, int level_number);

class MarblesGame : public Game {
 public:
  const GameInfo& info() const override;
  void start(const PlayingField& field, const GameOptions& options) override;
  void change_field(const PlayingField& field) override;
  void set(const std::string& setting, double value) override;
  void step(const GameInput& input) override;
  GameInput scripted_input(const std::optional<RigidTransform>& camera_from_plane) const override;
  bool is_over() const override { return state_.phase == MarblesPhase::over; }
  GameHud hud() const override;
  std::vector<GameSound> take_sounds() override;
  void draw(const ModelSet& models, DrawList* out) const override;
  std::optional<GameLandmark> landmark() const override;
  std::string save() const override { return marbles_to_text(state_); }
  void restore(const std::string& text, const PlayingField& field) override;
  std::uint64_t state_hash() const override;

  // For tests and tools.
  const MarblesState& state() const { return state_; }
  const TableGround& ground() const { return ground_; }
  const WalkMap& walk() const { return walk_; }
  const Table& table() const { return table_; }

 private:
  void begin_level();
  void enter_phase(MarblesPhase phase, MarblesNews news);
  void put_player_at_start();
  // The table as the physics and the ways see it, made of the ground and the level's ramps.
  void rebuild_table();
  void lift_marbles_out();
  void follow_camera(const GameInput& input);
  void flick(const GameInput& input);
  void roll();
  void collect();
  void look_after_lost_marbles();
  void look_after_trapped_marble();
  void lose_life(MarblesNews news);
  void play(const std::string& sound, float volume, float pitch, const Eigen::Vector3f* place);
  bool goal_is_open() const;
  double to_m(float units) const { return units * state_.unit_m; }

  PlayingField field_;
  MarblesState state_;
  TableGround ground_;
  Table table_;
  WalkMap walk_;
  MarblePhysics physics_;
  std::vector<GameSound> sounds_;
  std::vector<TableEdge> edges_;  // of what stands on the table, for drawing

  // The ways to one place, kept for the scripted player; made anew whenever the place or the table is another.
  struct Ways {
    std::size_t target = 0;
    std::vector<float> length;
  };
  mutable Ways ways_;
};

}  // namespace parallax
