// The rules of Swarm: one tick after another. games/swarm_game makes a Game of it.
//
// Owns its state. Deterministic: the same state, ground and inputs give the same states to the last bit.
#pragma once

#include <string>
#include <vector>

#include "games/swarm_critters.h"
#include "games/swarm_ground.h"
#include "games/swarm_neighbours.h"
#include "games/swarm_state.h"

namespace parallax::swarm {

// A spark of a hit: only to be seen.
struct Spark {
  Eigen::Vector3d position = Eigen::Vector3d::Zero(), velocity = Eigen::Vector3d::Zero();
  int ticks_left = 0, ticks = 1;
  double size = 0.02;
  int colour = 0;  // 0 warm (a bolt), 1 cold (spit), 2 of the robot, 3 pale (dust, smoke)
};

struct Heard {
  const char* name = "";
  float volume = 1, pitch = 1;
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
};

class Simulation {
 public:
  void start(const PlayingField& field, const GameOptions& options);
  // All stays where it is on the table; what is not on the ground any more is put there. A field that has grown is
  // taken as the measure of things when the next wave begins.
  void change_field(const PlayingField& field);
  void set(const std::string& setting, double value);
  // A state from outside, its numbers within bounds (games/swarm_archive).
  void restore(State state, const PlayingField& field);

  void step(const GameInput& input);

  const State& state() const { return state_; }
  State& edit_state() { return state_; }  // for tests
  const Ground& ground() const { return ground_; }
  // Of length, in metres of the map.
  double unit_m() const { return ground_.radius_m(); }
  const std::vector<Spark>& sparks() const { return sparks_; }
  int blast_ticks() const { return blast_ticks_; }
  const Eigen::Vector2d& blast_position() const { return blast_position_; }
  std::vector<Heard> take_sounds();

 private:
  void lay_ground();
  void change_unit(double share);
  void settle();
  void look(const GameInput& input);
  void assist();
  void move_robot(const GameInput& input);
  void shoot(const GameInput& input);
  void fly_bolts();
  void fly_spits();
  void explode();
  void release();
  void act_on_deeds();
  void take_pickups();
  void bury();
  void end_tick();
  void hurt_robot(int damage, const Eigen::Vector2d& from);
  void hit(Critter* critter, int damage);
  double assist_radius() const;
  void hear(const char* name, const Eigen::Vector2d& position, float volume = 1, float pitch = 1);
  void scatter(const Eigen::Vector3d& position, int count, int colour, double speed);
  void age_sparks();

  State state_;
  PlayingField field_;
  Ground ground_;
  Neighbours neighbours_;
  std::vector<CritterDeed> deeds_;
  std::vector<Spark> sparks_;
  std::uint64_t spark_random_ = 1;
  int blast_ticks_ = 0;
  Eigen::Vector2d blast_position_ = Eigen::Vector2d::Zero();
  std::vector<Heard> sounds_;
};

inline int counted_down(int value) { return value > 0 ? value - 1 : 0; }

// A camera's axes on the table: to the right, and where its optical axis meets the plane (units of the radius). False
// when the axis does not meet it.
bool view_right(const RigidTransform& camera_from_plane, Eigen::Vector2d* right);
bool view_sight(const RigidTransform& camera_from_plane, double radius_m, Eigen::Vector2d* sight);

}  // namespace parallax::swarm
