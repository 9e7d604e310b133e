#include "sessions/session_graph.h"

#include <gtest/gtest.h>

#include "solver/chi_square.h"
#include "tests/sessions/simulated_sessions.h"

namespace parallax {
namespace {

using testing::simulate_encounter;
using testing::simulate_session;
using testing::SimulatedSession;

void add(const SimulatedSession& session, SessionGraph* graph) {
  graph->add_session(session.number);
  for (const StereoConstraint& c : session.constraints) graph->add_constraint(session.number, c);
}

double distance(const RigidTransform& a, const RigidTransform& b) { return (a.inverse() * b).log().norm(); }

// Where the truth has a keyframe, told in the frame of `session`.
RigidTransform truth_in(const SimulatedSession& session, const SimulatedSession& other, int keyframe) {
  return session.global_from_session.inverse() * other.global_from_camera[static_cast<std::size_t>(keyframe)];
}

TEST(SessionGraph, WithoutNoiseSessionsMeetExactly) {
  const SimulatedSession a = simulate_session(1, 100, 0, 0, 1), b = simulate_session(2, 120, 9, 0, 2),
                         c = simulate_session(3, 80, 30, 0, 3);
  SessionGraph graph;
  for (const SimulatedSession* s : {&a, &b, &c}) add(*s, &graph);
  std::mt19937_64 rng(1);
  // The later two meet first; the first joins them.
  graph.add_encounter(simulate_encounter(1, b, 100, c, 16, 0, &rng));
  EXPECT_EQ(graph.component(3), 2);
  graph.update();
  EXPECT_LT(distance(graph.global_from_camera({3, 40}), truth_in(b, c, 40)), 1e-6);
  graph.add_encounter(simulate_encounter(2, a, 50, b, 14, 0, &rng));
  EXPECT_EQ(graph.component(2), 1);
  EXPECT_EQ(graph.component(3), 1);
  graph.update();
  graph.optimise();
  for (const auto& [session, keyframes] : {std::pair{&a, 100}, {&b, 120}, {&c, 80}})
    for (int i = 0; i < keyframes; i += 7)
      EXPECT_LT(distance(graph.global_from_camera({session->number, i}), truth_in(a, *session, i)), 1e-6);
  // Each keeps its own frame.
  EXPECT_LT(distance(graph.session_from_camera({3, 0}), RigidTransform()), 1e-6);
}

TEST(SessionGraph, UndoTakesApartAndRedoJoinsAgain) {
  const SimulatedSession a = simulate_session(1, 100, 0, 1, 1), b = simulate_session(2, 100, 5, 1, 2);
  SessionGraph graph;
  add(a, &graph);
  add(b, &graph);
  graph.optimise();
  const RigidTransform alone = graph.session_from_camera({2, 99});
  std::mt19937_64 rng(1);
  for (int i = 0; i < 60; i += 10) graph.add_encounter(simulate_encounter(i + 1, a, i + 20, b, i, 1, &rng));
  graph.optimise();
  const RigidTransform together = graph.global_from_camera({2, 99});
  EXPECT_GT(distance(alone, graph.session_from_camera({2, 99})), 1e-4);
  for (int i = 0; i < 60; i += 10) graph.set_active(i + 1, false);
  EXPECT_EQ(graph.component(2), 2);
  graph.optimise();
  EXPECT_LT(distance(graph.session_from_camera({2, 99}), alone), 1e-6);
  EXPECT_LT(distance(graph.global_from_session(2), RigidTransform()), 1e-9);
  for (int i = 0; i < 60; i += 10) graph.set_active(i + 1, true);
  EXPECT_EQ(graph.component(2), 1);
  graph.optimise();
  EXPECT_LT(distance(graph.global_from_camera({2, 99}), together), 1e-5);
}

// The anchors' way of telling an encounter (Eq. 6) changes nothing about the answer: one graph whose poses are all in
// the global frame has the same optimum.
TEST(SessionGraph, AgreesWithOneGraphOfGlobalPoses) {
  const SimulatedSession a = simulate_session(1, 60, 0, 1, 21), b = simulate_session(2, 60, 5, 1, 22);
  SessionGraph graph;
  add(a, &graph);
  add(b, &graph);
  IncrementalPoseGraph one;
  const Matrix6d held = testing::simulated_covariance(1e-4, 1e-4);
  for (const SimulatedSession* s : {&a, &b})
    for (int i = 0; i < 60; ++i) one.add_pose(truth_in(a, *s, i));
  one.add_prior(0, {}, held);
  for (int i = 0; i < 59; ++i) {
    const auto at = static_cast<std::size_t>(i);
    one.add_constraint(i, i + 1, a.constraints[at].from_from_to, a.constraints[at].covariance);
    one.add_constraint(60 + i, 61 + i, b.constraints[at].from_from_to, b.constraints[at].covariance);
  }
  std::mt19937_64 rng(1);
  for (int i = 0; i < 40; i += 5) {
    const Encounter e = simulate_encounter(i + 1, a, i + 20, b, i, 1, &rng);
    graph.add_encounter(e);
    one.add_constraint(i + 20, 60 + i, e.found_from_query, e.covariance, RobustKernel::huber);
  }
  graph.optimise();
  one.optimise();
  for (int i = 0; i < 60; ++i) {
    EXPECT_LT(distance(graph.global_from_camera({1, i}), one.pose(i)), 1e-5);
    EXPECT_LT(distance(graph.global_from_camera({2, i}), one.pose(60 + i)), 1e-5);
  }
}

// Normalised estimation error squared of global poses over many runs lies within its bounds.
TEST(SessionGraph, ReportedCovariancesAreConsistent) {
  constexpr int kRuns = 60;
  double sum = 0;
  int count = 0;
  for (int run = 0; run < kRuns; ++run) {
    const SimulatedSession a = simulate_session(1, 40, 0, 1, 100 + static_cast<std::uint64_t>(run)),
                           b = simulate_session(2, 40, 3, 1, 900 + static_cast<std::uint64_t>(run));
    SessionGraphOptions options;
    options.kernel = RobustKernel::none;
    SessionGraph graph(options);
    add(a, &graph);
    add(b, &graph);
    std::mt19937_64 rng(static_cast<std::uint64_t>(run));
    graph.add_encounter(simulate_encounter(1, a, 14, b, 2, 1, &rng));
    graph.add_encounter(simulate_encounter(2, a, 32, b, 20, 1, &rng));
    graph.optimise();
    Matrix6d covariance;
    ASSERT_TRUE(graph.covariance({2, 35}, &covariance));
    const Vector6d error = (truth_in(a, b, 35) * graph.global_from_camera({2, 35}).inverse()).log();
    sum += error.dot(covariance.ldlt().solve(error));
    count += 6;
  }
  const ChiSquareBounds bounds = chi_square_bounds_95(count);
  EXPECT_GT(sum, bounds.low);
  EXPECT_LT(sum, bounds.high);
}

TEST(SessionGraph, ConstraintsThatCameBeforeArePassedOver) {
  const SimulatedSession a = simulate_session(1, 10, 0, 1, 1);
  SessionGraph graph;
  graph.add_session(1);
  EXPECT_TRUE(graph.add_constraint(1, a.constraints[0]));
  EXPECT_FALSE(graph.add_constraint(1, a.constraints[0]));
  EXPECT_EQ(graph.poses(1), 2);
  EXPECT_TRUE(graph.contains({1, 1}));
  EXPECT_FALSE(graph.contains({1, 2}));
  EXPECT_FALSE(graph.contains({2, 0}));
}

}  // namespace
}  // namespace parallax
