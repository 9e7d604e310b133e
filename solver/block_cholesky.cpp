#include "solver/block_cholesky.h"

#include <atomic>

#include "core/check.h"

namespace parallax::solver {

BlockCholesky::BlockCholesky(const AdjacencyBits& graph, const std::vector<int>& order, int dimension,
                             const SolverKernels& kernels)
    : dimension_(dimension), nodes_(graph.nodes()), tile_count_(0), kernels_(kernels) {
  PARALLAX_CHECK(dimension > 0 && dimension <= kTile, "block dimension");
  PARALLAX_CHECK(static_cast<int>(order.size()) == nodes_, "order and graph of different size");
  const int group = blocks_per_tile(dimension);
  tile_count_ = (nodes_ + group - 1) / group;
  const auto n = static_cast<std::size_t>(tile_count_);
  for (int k = 0; k < nodes_; ++k) {
    tile_of_.push_back(k / group);
    local_of_.push_back(k % group * dimension);
  }
  tile_at_.assign(n * n, -1);
  column_.resize(n);
  row_.resize(n);
  const AdjacencyBits fill = tile_fill(graph, order, group, nullptr);
  std::int64_t next = 0;
  for (int j = 0; j < tile_count_; ++j)
    for (int i = j; i < tile_count_; ++i) {
      if (i != j && !fill.test(i, j)) continue;
      tile_at_[static_cast<std::size_t>(i) * n + static_cast<std::size_t>(j)] = next;
      next += kTileSize;
      if (i == j) continue;
      column_[static_cast<std::size_t>(j)].push_back(i);
      row_[static_cast<std::size_t>(i)].push_back(j);
    }
  storage_size_ = static_cast<std::size_t>(next);
  tiles_.reset(new double[storage_size_]);
}

double BlockCholesky::fill() const {
  return static_cast<double>(storage_size_ / kTileSize) / (0.5 * tile_count_ * (tile_count_ + 1.0));
}

void BlockCholesky::finish_matrix() {
  const int group = blocks_per_tile(dimension_);
  for (int t = 0; t < tile_count_; ++t) {
    const int used = std::min(group, nodes_ - t * group) * dimension_;
    for (int i = used; i < kTile; ++i) tile(t, t)[i * kTile + i] = 1.0;
  }
}

BlockCholesky::Result BlockCholesky::factor(WorkTeam& team, const Interruption& stop) {
  std::atomic<bool> stopped{false}, failed{false};
  const auto n = static_cast<std::size_t>(tile_count_);
  team.run([&](int member) {
    const int members = team.members();
    for (int j = 0; j < tile_count_; ++j) {
      const auto& below = column_[static_cast<std::size_t>(j)];
      const auto& left = row_[static_cast<std::size_t>(j)];
      // Left-looking: tiles of column j take what the columns before leave them. Dealt out in turn, diagonal first.
      const int count = static_cast<int>(below.size()) + 1;
      for (int k = member; k < count; k += members) {
        const int i = k == 0 ? j : below[static_cast<std::size_t>(k - 1)];
        double* c = tile(i, j);
        int polled = 0;
        for (const int m : left) {
          const std::int64_t a = tile_at_[static_cast<std::size_t>(i) * n + static_cast<std::size_t>(m)];
          if (a < 0) continue;
          kernels_.tile_multiply(c, tiles_.get() + a, tile(j, m));
          if ((++polled & 7) == 0 && stop.requested()) {
            stopped = true;
            break;
          }
        }
        if (stopped.load(std::memory_order_relaxed)) break;
        if (stop.requested()) stopped = true;
      }
      team.meet();
      if (member == 0 && !stopped && !kernels_.tile_factor(tile(j, j))) failed = true;
      team.meet();
      if (stopped || failed) return;
      for (int k = member; k + 1 < count; k += members)
        kernels_.tile_solve(tile(below[static_cast<std::size_t>(k)], j), tile(j, j));
      team.meet();
    }
  });
  return failed ? Result::not_positive : stopped ? Result::stopped : Result::done;
}

void BlockCholesky::solve(double* x) const {
  for (int j = 0; j < tile_count_; ++j) {
    const double* l = tile(j, j);
    double* y = x + j * kTile;
    for (int k = 0; k < kTile; ++k) {
      y[k] /= l[k * kTile + k];
      for (int i = k + 1; i < kTile; ++i) y[i] -= l[k * kTile + i] * y[k];
    }
    for (const int i : column_[static_cast<std::size_t>(j)]) kernels_.tile_apply(x + i * kTile, tile(i, j), y);
  }
  for (int j = tile_count_ - 1; j >= 0; --j) {
    const double* l = tile(j, j);
    double* y = x + j * kTile;
    for (const int i : column_[static_cast<std::size_t>(j)])
      kernels_.tile_apply_transposed(y, tile(i, j), x + i * kTile);
    for (int k = kTile - 1; k >= 0; --k) {
      double s = y[k];
      for (int i = k + 1; i < kTile; ++i) s -= l[k * kTile + i] * y[i];
      y[k] = s / l[k * kTile + k];
    }
  }
}

}  // namespace parallax::solver
