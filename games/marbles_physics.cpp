#include "games/marbles_physics.h"

#include <BulletCollision/CollisionDispatch/btSimulationIslandManager.h>
#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "games/game.h"

namespace parallax {
namespace {

constexpr float kTableThickness = 3;    // marbles that have fallen pass below its rim
constexpr float kObstacleDepth = 0.5f;  // blocks reach into the table, so that no gap is left
constexpr float kMarbleMass = 1;
// No marble moves further than this in a substep: what it may enter a wall by, and no wall is thin enough to be missed.
// (Sweeping shapes along the motion would do too, but what Bullet finds then depends on the history of its trees.)
constexpr float kLongestMotion = 0.08f * kMarbleRadius;
constexpr int kFewestSubsteps = 2;
constexpr float kKnockSpeed = 1.0f;  // changes of speed below this make no sound
// Contacts are solved when bodies touch, not a little before: the blocks of a wall have seams, and a marble that is
// slowed down by an edge it would only have passed over hops.
constexpr float kContactFrom = 0;

btVector3 to_bullet(const Eigen::Vector3f& v) { return {v.x(), v.y(), v.z()}; }
Eigen::Vector3f from_bullet(const btVector3& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

// The table stays; marbles are put in for a substep and taken out after it, and with them whatever Bullet remembers of
// their contacts.
struct MarblePhysics::World {
  btDefaultCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btDiscreteDynamicsWorld dynamics{&dispatcher, &broadphase, &solver, &configuration};
  btSphereShape sphere{kMarbleRadius};
  std::vector<std::unique_ptr<btCollisionShape>> shapes;
  std::vector<std::unique_ptr<btRigidBody>> table;
  std::vector<std::unique_ptr<btRigidBody>> marbles;

  World() {
    // Bodies and pairs are worked on in the order in which they were added, and all together.
    dynamics.getDispatchInfo().m_deterministicOverlappingPairs = true;
    dynamics.getSimulationIslandManager()->setSplitIslands(false);
    dynamics.setForceUpdateAllAabbs(false);
    btContactSolverInfo& info = dynamics.getSolverInfo();
    info.m_solverMode = SOLVER_SIMD | SOLVER_USE_2_FRICTION_DIRECTIONS | SOLVER_USE_WARMSTARTING;
    info.m_warmstartingFactor = 0;  // the impulses are only kept to be told
    info.m_numIterations = 20;
    info.m_splitImpulse = true;
    info.m_splitImpulsePenetrationThreshold = 0;  // taking bodies apart gives them no speed
    info.m_restitutionVelocityThreshold = 1.0f;
  }
  ~World() {
    take_marbles_out();
    for (const auto& body : table) dynamics.removeRigidBody(body.get());
  }

  void add_fixed(std::unique_ptr<btCollisionShape> shape, const btVector3& at, float friction, float restitution) {
    btRigidBody::btRigidBodyConstructionInfo info(0, nullptr, shape.get());
    info.m_startWorldTransform.setIdentity();
    info.m_startWorldTransform.setOrigin(at);
    info.m_friction = friction;
    info.m_restitution = restitution;
    auto body = std::make_unique<btRigidBody>(info);
    dynamics.addRigidBody(body.get());
    table.push_back(std::move(body));
    shapes.push_back(std::move(shape));
  }

  void put_marble_in(const MarbleMotion& marble, const Eigen::Vector3f& gravity, const MarblePhysicsOptions& options) {
    btVector3 inertia(0, 0, 0);
    sphere.calculateLocalInertia(kMarbleMass, inertia);
    btRigidBody::btRigidBodyConstructionInfo info(kMarbleMass, nullptr, &sphere, inertia);
    const Eigen::Quaternionf& q = marble.rotation;
    info.m_startWorldTransform = btTransform(btQuaternion(q.x(), q.y(), q.z(), q.w()), to_bullet(marble.position));
    info.m_friction = options.friction;
    info.m_restitution = options.marble_restitution;
    auto body = std::make_unique<btRigidBody>(info);
    body->setLinearVelocity(to_bullet(marble.velocity));
    body->setAngularVelocity(to_bullet(marble.spin));
    body->setActivationState(DISABLE_DEACTIVATION);
    body->setContactProcessingThreshold(kContactFrom);
    // One that is over the edge falls past whatever grows there: taken for one inside the table, it would come up in
    // it.
    const bool over_the_edge = marble.position.z() < 0;
    dynamics.addRigidBody(body.get(), btBroadphaseProxy::DefaultFilter,
                          over_the_edge ? 0 : btBroadphaseProxy::AllFilter);
    body->setGravity(to_bullet(gravity));
    marbles.push_back(std::move(body));
  }

  void take_marbles_out() {
    for (auto body = marbles.rbegin(); body != marbles.rend(); ++body) dynamics.removeRigidBody(body->get());
    marbles.clear();
  }

  void read_back(float kept, std::vector<MarbleMotion>* out) const {
    for (std::size_t i = 0; i < marbles.size(); ++i) {
      const btRigidBody& body = *marbles[i];
      MarbleMotion& marble = (*out)[i];
      const float speed = body.getLinearVelocity().length();
      const float share = kept * std::min(1.0f, kMarbleGreatestSpeed / std::max(speed, 1e-6f));
      marble.position = from_bullet(body.getWorldTransform().getOrigin());
      marble.velocity = share * from_bullet(body.getLinearVelocity());
      marble.spin = share * from_bullet(body.getAngularVelocity());
      const btQuaternion q = body.getWorldTransform().getRotation();
      marble.rotation = Eigen::Quaternionf(q.w(), q.x(), q.y(), q.z()).normalized();
    }
  }

  int marble_of(const btCollisionObject* object) const {
    for (std::size_t i = 0; i < marbles.size(); ++i)
      if (marbles[i].get() == object) return static_cast<int>(i);
    return -1;
  }

  // The strongest contact of each pair.
  void collect_knocks(std::vector<MarbleKnock>* knocks) const {
    for (int i = 0; i < dispatcher.getNumManifolds(); ++i) {
      const btPersistentManifold* manifold =
          const_cast<btCollisionDispatcher&>(dispatcher).getManifoldByIndexInternal(i);
      float impulse = 0;
      for (int k = 0; k < manifold->getNumContacts(); ++k)
        impulse = std::max(impulse, manifold->getContactPoint(k).getAppliedImpulse());
      if (!(impulse / kMarbleMass > kKnockSpeed)) continue;
      const int a = marble_of(manifold->getBody0()), b = marble_of(manifold->getBody1());
      knocks->push_back({a >= 0 ? a : b, a >= 0 ? b : a, impulse / kMarbleMass});
    }
  }
};

MarblePhysics::MarblePhysics(const MarblePhysicsOptions& options)
    : options_(options), world_(std::make_unique<World>()) {}

MarblePhysics::~MarblePhysics() = default;

void MarblePhysics::set_table(const Table& table) {
  PARALLAX_CHECK(table.outline.size() >= 3, "marbles: a table without an outline");
  world_ = std::make_unique<World>();

  // Shapes have no margin: the marble's radius is the margin of every contact.
  auto slab = std::make_unique<btConvexHullShape>();
  for (const Eigen::Vector2f& corner : table.outline) {
    slab->addPoint({corner.x(), corner.y(), 0}, false);
    slab->addPoint({corner.x(), corner.y(), -kTableThickness}, false);
  }
  slab->setMargin(0);
  slab->recalcLocalAabb();
  world_->add_fixed(std::move(slab), {0, 0, 0}, options_.friction, options_.table_restitution);

  for (const TableRamp& ramp : table.ramps) {
    const Eigen::Vector2f side = ramp.half_width * Eigen::Vector2f(-ramp.uphill.y(), ramp.uphill.x());
    const Eigen::Vector2f top = ramp.length * ramp.uphill, end = (ramp.length + ramp.landing) * ramp.uphill;
    auto hull = std::make_unique<btConvexHullShape>();
    for (const float sign : {-1.0f, 1.0f}) {
      const Eigen::Vector2f s = sign * side, t = s + top, e = s + end;
      hull->addPoint({s.x(), s.y(), 0}, false);
      hull->addPoint({t.x(), t.y(), ramp.height}, false);
      hull->addPoint({e.x(), e.y(), ramp.height}, false);
      hull->addPoint({e.x(), e.y(), -kObstacleDepth}, false);
      hull->addPoint({s.x(), s.y(), -kObstacleDepth}, false);
    }
    hull->setMargin(0);
    hull->recalcLocalAabb();
    world_->add_fixed(std::move(hull), {ramp.foot.x(), ramp.foot.y(), 0}, options_.friction,
                      options_.table_restitution);
  }

  for (const TableBox& box : table.boxes) {
    const Eigen::Vector2f half = 0.5f * (box.most - box.least), middle = 0.5f * (box.most + box.least);
    const float half_height = 0.5f * (box.height + kObstacleDepth);
    auto shape = std::make_unique<btBoxShape>(btVector3(half.x(), half.y(), half_height));
    shape->setMargin(0);
    world_->add_fixed(std::move(shape), {middle.x(), middle.y(), box.height - half_height}, options_.friction,
                      options_.obstacle_restitution);
  }
}

void MarblePhysics::step(const Eigen::Vector3f& gravity, std::vector<MarbleMotion>* marbles,
                         std::vector<MarbleKnock>* knocks) {
  if (marbles->empty()) return;
  // Held to its greatest speed, a marble is never faster than this; what it gains on the way is in the least number.
  float fastest = 0;
  for (const MarbleMotion& marble : *marbles) fastest = std::max(fastest, marble.velocity.norm());
  const float tick_s = static_cast<float>(kGameTick_s);
  const float motion = std::min(fastest, kMarbleGreatestSpeed) * tick_s;
  const int substeps = std::max(kFewestSubsteps, static_cast<int>(std::ceil(motion / kLongestMotion)));
  const float step_s = tick_s / static_cast<float>(substeps);
  for (int substep = 0; substep < substeps; ++substep) {
    for (const MarbleMotion& marble : *marbles) world_->put_marble_in(marble, gravity, options_);
    world_->solver.reset();
    world_->dynamics.stepSimulation(step_s, 0);
    if (knocks) world_->collect_knocks(knocks);
    world_->read_back(std::max(0.0f, 1 - options_.resistance * step_s), marbles);
    world_->take_marbles_out();
  }
}

}  // namespace parallax
