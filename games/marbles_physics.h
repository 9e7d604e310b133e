// Marbles on a table: rigid balls that roll, collide and fall, by the Bullet library, which stays behind this header.
//
// Units: the marble's diameter is 1 (kMarbleRadius = 0.5), seconds. Frame: the plane's, z up, the table's top is z = 0.
// What a step does depends on nothing but the table, the gravity and the marbles handed in: the world keeps no contact
// from one step to the next, so that a state that was saved goes on to the last bit as the one that was not. One thread
// at a time.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <memory>
#include <vector>

namespace parallax {

inline constexpr float kMarbleRadius = 0.5f;
// Marbles are held to this speed: faster than anything in the game needs.
inline constexpr float kMarbleGreatestSpeed = 50;

struct MarbleMotion {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  // of the centre
  Eigen::Vector3f velocity = Eigen::Vector3f::Zero();
  Eigen::Vector3f spin = Eigen::Vector3f::Zero();                // radians a second
  Eigen::Quaternionf rotation = Eigen::Quaternionf::Identity();  // plane from marble
};

// A block that stands on the table, its sides along the axes.
struct TableBox {
  Eigen::Vector2f least = Eigen::Vector2f::Zero(), most = Eigen::Vector2f::Zero();
  float height = 1;
};

// A ramp: from the middle of its foot `length` uphill to `height`, then `landing` further on the level.
struct TableRamp {
  Eigen::Vector2f foot = Eigen::Vector2f::Zero();
  Eigen::Vector2f uphill = Eigen::Vector2f::UnitX();  // of length 1
  float length = 6, landing = 1, half_width = 1.5f, height = 1;
};

struct Table {
  std::vector<Eigen::Vector2f> outline;  // convex, counter-clockwise; nothing below it
  std::vector<TableBox> boxes;
  std::vector<TableRamp> ramps;
};

// A marble has hit something during a step.
struct MarbleKnock {
  int marble = 0;
  int other = -1;   // another marble, or -1: the table or what stands on it
  float speed = 0;  // change of its speed
};

struct MarblePhysicsOptions {
  float resistance = 0.15f;  // rolling resistance, share of the speed lost a second
  float friction = 0.8f;     // of each body; a contact has the product
  float marble_restitution = 0.9f;
  float table_restitution = 0.35f;    // of a contact: the product with the marble's
  float obstacle_restitution = 0.6f;  // likewise
};

class MarblePhysics {
 public:
  explicit MarblePhysics(const MarblePhysicsOptions& options = {});
  ~MarblePhysics();
  MarblePhysics(const MarblePhysics&) = delete;
  MarblePhysics& operator=(const MarblePhysics&) = delete;

  void set_table(const Table& table);
  // One tick of the games. `knocks` may be null.
  void step(const Eigen::Vector3f& gravity, std::vector<MarbleMotion>* marbles, std::vector<MarbleKnock>* knocks);

 private:
  struct World;
  MarblePhysicsOptions options_;
  std::unique_ptr<World> world_;
};

}  // namespace parallax
