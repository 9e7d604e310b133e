// The similarity graph against central differences, a slow dense solver and graphs whose truth is known.
#include "solver/similarity_graph.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <random>

namespace parallax {
namespace {

class SimilarityGraphTest : public ::testing::Test {
 protected:
  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(rng_); }
  Eigen::Vector3d vector(double size) { return {uniform(-size, size), uniform(-size, size), uniform(-size, size)}; }
  SimilarityTransform transform(double length, double angle, double log_scale) {
    return {std::exp(uniform(-log_scale, log_scale)), exp_so3(angle * vector(1).normalized()), vector(length)};
  }
  Matrix7d information() {
    Matrix7d root;
    for (int i = 0; i < 49; ++i) root.data()[i] = uniform(-1, 1);
    return root * root.transpose() + 0.1 * Matrix7d::Identity();
  }
  std::mt19937_64 rng_{7};
};

TEST_F(SimilarityGraphTest, TheVectorAndTheTransformAreOne) {
  for (int i = 0; i < 100; ++i) {
    const SimilarityTransform a = transform(3, uniform(0, 3.1), 2), b = similarity_of_vector(similarity_vector(a));
    EXPECT_NEAR(a.s, b.s, 1e-12 * a.s);
    EXPECT_LT((a.t - b.t).norm() + (a.R - b.R).norm(), 1e-10);
  }
}

TEST_F(SimilarityGraphTest, DerivativesAreThoseOfCentralDifferences) {
  constexpr double kStep = 1e-6;
  for (int i = 0; i < 400; ++i) {
    const SimilarityTransform b = transform(2, uniform(0, 3), 1), measured = transform(2, uniform(0, 3), 1);
    // Errors from none to nearly half a turn.
    const SimilarityTransform a = measured * transform(1, i < 20 ? 1e-6 * i : uniform(0, 3.1), 1) * b;
    Matrix7d d_a, d_b;
    similarity_residual(measured, a, b, &d_a, &d_b);
    for (int k = 0; k < 7; ++k) {
      Vector7d d = Vector7d::Zero();
      d[k] = kStep;
      const SimilarityTransform up = similarity_of_vector(d), down = similarity_of_vector(-d);
      const auto slope = [&](const SimilarityTransform& a1, const SimilarityTransform& b1,
                             const SimilarityTransform& a0, const SimilarityTransform& b0) -> Vector7d {
        return (similarity_residual(measured, a1, b1, nullptr, nullptr) -
                similarity_residual(measured, a0, b0, nullptr, nullptr)) /
               (2 * kStep);
      };
      const Vector7d in_a = slope(up * a, b, down * a, b), in_b = slope(a, up * b, a, down * b);
      EXPECT_LT((in_a - d_a.col(k)).norm(), 1e-6 * std::max(1.0, d_a.col(k).norm())) << i << " a " << k;
      EXPECT_LT((in_b - d_b.col(k)).norm(), 1e-6 * std::max(1.0, d_b.col(k).norm())) << i << " b " << k;
    }
  }
}

// Gauss-Newton on dense matrices with derivatives by differences.
double dense_reference(SimilarityGraph graph) {
  std::vector<std::size_t> moving;
  for (std::size_t i = 0; i < graph.nodes.size(); ++i)
    if (!graph.fixed[i]) moving.push_back(i);
  const auto rows = static_cast<Eigen::Index>(7 * graph.edges.size());
  const auto columns = static_cast<Eigen::Index>(7 * moving.size());
  const auto residuals = [&](const SimilarityGraph& g) {
    Eigen::VectorXd out(rows);
    for (std::size_t e = 0; e < g.edges.size(); ++e) {
      const SimilarityEdge& edge = g.edges[e];
      const Vector7d r = similarity_vector(edge.a_from_b.inverse() * g.nodes[static_cast<std::size_t>(edge.a)] *
                                           g.nodes[static_cast<std::size_t>(edge.b)].inverse());
      out.segment<7>(static_cast<Eigen::Index>(7 * e)) = edge.information.llt().matrixU() * r;
    }
    return out;
  };
  for (int iteration = 0; iteration < 30; ++iteration) {
    Eigen::MatrixXd J(rows, columns);
    for (Eigen::Index c = 0; c < columns; ++c) {
      Vector7d d = Vector7d::Zero();
      d[c % 7] = 1e-6;
      SimilarityGraph up = graph, down = graph;
      const std::size_t node = moving[static_cast<std::size_t>(c / 7)];
      up.nodes[node] = similarity_of_vector(d) * up.nodes[node];
      down.nodes[node] = similarity_of_vector(-d) * down.nodes[node];
      J.col(c) = (residuals(up) - residuals(down)) / 2e-6;
    }
    const Eigen::VectorXd step = (J.transpose() * J).ldlt().solve(-J.transpose() * residuals(graph));
    for (std::size_t k = 0; k < moving.size(); ++k)
      graph.nodes[moving[k]] =
          similarity_of_vector(step.segment<7>(static_cast<Eigen::Index>(7 * k))) * graph.nodes[moving[k]];
  }
  return 0.5 * residuals(graph).squaredNorm();
}

TEST_F(SimilarityGraphTest, TheCostIsThatOfADenseReference) {
  SimilarityGraph graph;
  for (int i = 0; i < 12; ++i) {
    graph.nodes.push_back(transform(2, uniform(0, 1), 0.3));
    graph.fixed.push_back(i == 3 ? 1 : 0);
  }
  for (int a = 0; a < 12; ++a)
    for (int b = a + 1; b < 12; ++b) {
      if (b > a + 1 && uniform(0, 1) > 0.2) continue;
      SimilarityEdge edge{a, b, {}, information()};
      edge.a_from_b = transform(0.03, 0.03, 0.03) * graph.nodes[static_cast<std::size_t>(a)] *
                      graph.nodes[static_cast<std::size_t>(b)].inverse();
      graph.edges.push_back(edge);
    }
  const double expected = dense_reference(graph);
  const SimilarityTransform kept = graph.nodes[3];
  const SimilarityGraphSummary summary = adjust_similarity_graph(&graph, {}, {});
  EXPECT_TRUE(summary.converged);
  EXPECT_GT(expected, 1e-4);
  EXPECT_LT(summary.final_cost, summary.initial_cost);
  EXPECT_NEAR(summary.final_cost, expected, 1e-6 * expected);
  EXPECT_NEAR(summary.final_cost, similarity_cost(graph), 1e-9 * expected);
  EXPECT_LT((graph.nodes[3].t - kept.t).norm(), 1e-12) << "fixed";
}

// Cameras on a circle that look outwards, as one chain that drifts in place, direction and scale.
struct Circle {
  std::vector<SimilarityTransform> truth;
  SimilarityGraph graph;
};

Circle drifting_circle(int count, double drift) {
  Circle out;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * M_PI * i / count;
    RigidTransform world_from_node;
    world_from_node.R = exp_so3({0, angle, 0});
    world_from_node.t = 2.0 * Eigen::Vector3d(std::sin(angle), 0, std::cos(angle));
    out.truth.emplace_back(world_from_node.inverse());
    out.graph.fixed.push_back(i == 0 ? 1 : 0);
  }
  Vector7d d;
  d << 0.01, -0.005, 0.01, 0.004, 0.01, -0.003, 0.01;
  out.graph.nodes.push_back(out.truth[0]);
  for (int i = 1; i < count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    SimilarityEdge edge{i, i - 1, out.truth[k] * out.truth[k - 1].inverse()};
    out.graph.nodes.push_back(similarity_of_vector(drift * d) * edge.a_from_b * out.graph.nodes.back());
    edge.a_from_b = out.graph.nodes[k] * out.graph.nodes[k - 1].inverse();
    out.graph.edges.push_back(edge);
  }
  return out;
}

double worst_centre(const Circle& circle) {
  double worst = 0;
  for (std::size_t i = 0; i < circle.truth.size(); ++i)
    worst = std::max(worst, (circle.truth[i].inverse().t - circle.graph.nodes[i].inverse().t).norm());
  return worst;
}

TEST_F(SimilarityGraphTest, AGraphWithoutNoiseIsTheTruth) {
  Circle circle = drifting_circle(40, 1);
  for (SimilarityEdge& edge : circle.graph.edges)
    edge.a_from_b =
        circle.truth[static_cast<std::size_t>(edge.a)] * circle.truth[static_cast<std::size_t>(edge.b)].inverse();
  circle.graph.edges.push_back({0, 39, circle.truth[0] * circle.truth[39].inverse()});
  ASSERT_GT(worst_centre(circle), 0.3);
  const SimilarityGraphSummary summary = adjust_similarity_graph(&circle.graph, {}, {});
  EXPECT_TRUE(summary.converged);
  EXPECT_LT(summary.final_cost, 1e-15);
  EXPECT_LT(worst_centre(circle), 1e-7);
}

TEST_F(SimilarityGraphTest, ADriftingCircleCloses) {
  Circle circle = drifting_circle(40, 1);
  const double before = worst_centre(circle);
  SimilarityEdge loop{0, 39, circle.truth[0] * circle.truth[39].inverse(), 1e4 * Matrix7d::Identity()};
  circle.graph.edges.push_back(loop);
  ASSERT_GT(before, 0.3);
  const SimilarityGraphSummary summary = adjust_similarity_graph(&circle.graph, {}, {});
  EXPECT_TRUE(summary.converged);
  EXPECT_LT(summary.iterations, 30);
  const auto& n = circle.graph.nodes;
  EXPECT_LT(similarity_residual(loop.a_from_b, n[0], n[39], nullptr, nullptr).norm(), 1e-3) << "closed";
  EXPECT_LT(worst_centre(circle), 0.25 * before);
  for (const SimilarityTransform& node : n) EXPECT_NEAR(node.s, 1.0, 0.12);
}

TEST_F(SimilarityGraphTest, AKernelLetsAWrongEdgeGo) {
  Circle circle = drifting_circle(40, 0);
  for (SimilarityEdge& edge : circle.graph.edges) edge.information *= 1e4;
  for (int i = 0; i + 2 < 40; ++i) {
    const auto k = static_cast<std::size_t>(i);
    circle.graph.edges.push_back(
        {i, i + 2, circle.truth[k] * circle.truth[k + 2].inverse(), 1e4 * Matrix7d::Identity()});
  }
  SimilarityEdge wrong{0, 20, transform(1, 0.5, 0.2), 1e4 * Matrix7d::Identity()};
  Circle plain = circle;
  plain.graph.edges.push_back(wrong);
  wrong.kernel = RobustKernel::tukey;
  circle.graph.edges.push_back(wrong);
  adjust_similarity_graph(&plain.graph, {}, {});
  adjust_similarity_graph(&circle.graph, {}, {});
  EXPECT_GT(worst_centre(plain), 0.1);
  EXPECT_LT(worst_centre(circle), 1e-9);
}

TEST_F(SimilarityGraphTest, ItStopsWhenAskedTo) {
  Circle circle = drifting_circle(40, 1);
  circle.graph.edges.push_back({0, 39, circle.truth[0] * circle.truth[39].inverse()});
  const Interruption stop = Interruption::at_poll(1);
  const SimilarityGraphSummary summary = adjust_similarity_graph(&circle.graph, {}, stop);
  EXPECT_TRUE(summary.stopped);
  EXPECT_EQ(summary.final_cost, summary.initial_cost);
}

}  // namespace
}  // namespace parallax
