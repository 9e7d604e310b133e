#include "solver/block_cholesky.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <numeric>
#include <random>

#include "core/cpu_dispatch.h"

namespace parallax::solver {
namespace {

struct RandomSystem {
  AdjacencyBits graph{0};
  Eigen::MatrixXd matrix;  // in the numbering of the graph
};

// A chain of nodes with random further links, block values random, diagonally dominant enough to be definite.
RandomSystem random_system(int nodes, int dimension, double links, std::mt19937& random) {
  RandomSystem s;
  s.graph = AdjacencyBits(nodes);
  const int n = nodes * dimension;
  s.matrix = Eigen::MatrixXd::Zero(n, n);
  std::normal_distribution<double> gauss;
  std::uniform_real_distribution<double> uniform(0, 1);
  for (int i = 0; i < nodes; ++i)
    for (int j = 0; j < i; ++j) {
      if (j != i - 1 && uniform(random) > links) continue;
      s.graph.set(i, j);
      s.graph.set(j, i);
      const Eigen::MatrixXd a =
          Eigen::MatrixXd::NullaryExpr(2 * dimension, 2 * dimension, [&] { return gauss(random); });
      const Eigen::MatrixXd m = a * a.transpose();
      const int p[2] = {i * dimension, j * dimension};
      for (int x = 0; x < 2; ++x)
        for (int y = 0; y < 2; ++y)
          s.matrix.block(p[x], p[y], dimension, dimension) +=
              m.block(x * dimension, y * dimension, dimension, dimension);
    }
  s.matrix.diagonal().array() += 1e-3;
  return s;
}

void load(const RandomSystem& s, const std::vector<int>& order, int dimension, BlockCholesky* system) {
  std::fill(system->tiles(), system->tiles() + system->size(), 0.0);
  const int nodes = s.graph.nodes(), d = dimension;
  for (int a = 0; a < nodes; ++a)
    for (int b = 0; b <= a; ++b) {
      const auto block = s.matrix.block(order[std::size_t(a)] * d, order[std::size_t(b)] * d, d, d);
      if (block.isZero(0)) continue;
      const std::int64_t at = system->tile_at()[system->tile_of()[a] * system->tile_count() + system->tile_of()[b]];
      ASSERT_GE(at, 0);
      double* to = system->tiles() + at + system->local_of()[b] * kTile + system->local_of()[a];
      for (int c = 0; c < d; ++c)
        for (int r = 0; r < d; ++r) to[c * kTile + r] = block(r, c);
    }
  system->finish_matrix();
}

TEST(BlockCholesky, SolvesAsEigenDoesAtEveryInstructionSet) {
  std::mt19937 random(3);
  std::normal_distribution<double> gauss;
  const SimdLevel highest = supported_simd_level();
  for (int level = 0; level <= int(highest); ++level) {
    set_simd_level(SimdLevel(level));
    for (const int dimension : {6, 9})
      for (const int nodes : {1, 5, 8, 9, 23, 60})
        for (const double links : {0.0, 0.05, 1.0})
          for (const int threads : {1, 2}) {
            const RandomSystem s = random_system(nodes, dimension, links, random);
            const SolverKernels& kernels = solver_kernels(dimension == 6 ? Lens::pinhole : Lens::bal);
            const std::vector<int> order = elimination_order(s.graph, blocks_per_tile(dimension));
            BlockCholesky system(s.graph, order, dimension, kernels);
            if (nodes == 1 || s.matrix.size() == 0) {
              RandomSystem one = s;
              one.matrix.setIdentity();
              load(one, order, dimension, &system);
              WorkTeam team(threads);
              EXPECT_EQ(system.factor(team, {}), BlockCholesky::Result::done);
              continue;
            }
            load(s, order, dimension, &system);
            WorkTeam team(threads);
            ASSERT_EQ(system.factor(team, {}), BlockCholesky::Result::done);
            const Eigen::VectorXd b = Eigen::VectorXd::NullaryExpr(nodes * dimension, [&] { return gauss(random); });
            std::vector<double> x(std::size_t(system.rows()), 0.0);
            for (int k = 0; k < nodes; ++k)
              for (int i = 0; i < dimension; ++i)
                x[std::size_t(system.row_of(k) + i)] = b[order[std::size_t(k)] * dimension + i];
            system.solve(x.data());
            const Eigen::VectorXd expected = s.matrix.llt().solve(b);
            for (int k = 0; k < nodes; ++k)
              for (int i = 0; i < dimension; ++i)
                EXPECT_NEAR(x[std::size_t(system.row_of(k) + i)], expected[order[std::size_t(k)] * dimension + i],
                            1e-7 * (1 + expected.norm()));
          }
  }
  set_simd_level(highest);
}

TEST(BlockCholesky, SaysWhenTheMatrixIsNotPositive) {
  std::mt19937 random(5);
  RandomSystem s = random_system(20, 6, 0.2, random);
  s.matrix(50, 50) = -1;
  std::vector<int> order(20);
  std::iota(order.begin(), order.end(), 0);
  BlockCholesky system(s.graph, order, 6, solver_kernels(Lens::pinhole));
  load(s, order, 6, &system);
  WorkTeam team(2);
  EXPECT_EQ(system.factor(team, {}), BlockCholesky::Result::not_positive);
}

TEST(BlockCholesky, StopsWhenAsked) {
  std::mt19937 random(5);
  const RandomSystem s = random_system(60, 6, 0.5, random);
  std::vector<int> order(60);
  std::iota(order.begin(), order.end(), 0);
  BlockCholesky system(s.graph, order, 6, solver_kernels(Lens::pinhole));
  load(s, order, 6, &system);
  WorkTeam team(1);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(system.factor(team, stop.get_token()), BlockCholesky::Result::stopped);
}

TEST(EliminationOrder, IsAPermutationThatSavesWorkOnAShuffledChain) {
  std::mt19937 random(7);
  const int n = 200;
  std::vector<int> shuffled(n);
  std::iota(shuffled.begin(), shuffled.end(), 0);
  std::shuffle(shuffled.begin(), shuffled.end(), random);
  AdjacencyBits graph(n);
  for (int i = 0; i < n; ++i)
    for (int j = std::max(0, i - 4); j < i; ++j) {
      graph.set(shuffled[std::size_t(i)], shuffled[std::size_t(j)]);
      graph.set(shuffled[std::size_t(j)], shuffled[std::size_t(i)]);
    }
  std::vector<int> given(n);
  std::iota(given.begin(), given.end(), 0);
  double work_given = 0, work = 0;
  tile_fill(graph, given, 8, &work_given);
  for (const auto& order :
       {elimination_order(graph, 8), minimum_degree_order(graph), reverse_cuthill_mckee_order(graph)}) {
    std::vector<int> sorted = order;
    std::sort(sorted.begin(), sorted.end());
    EXPECT_EQ(sorted, given);
    tile_fill(graph, order, 8, &work);
    EXPECT_LT(work, 0.5 * work_given);
  }
}

}  // namespace
}  // namespace parallax::solver
