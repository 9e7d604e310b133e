// A sparse symmetric positive definite system in 48 x 48 tiles, and its Cholesky factorisation: the reduced camera
// system of bundle adjustment. Only the tiles that the graph and its fill need exist; a tile is dense, so a
// well-connected map is factored as a dense matrix would be.
//
// Nodes (cameras) of `dimension` unknowns are numbered in order of elimination; 48 / dimension of them share a tile,
// and rows that are left over hold 1 on the diagonal. Values only; not for several threads at once but through its
// team.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/interruption.h"
#include "solver/elimination_order.h"
#include "solver/solver_kernels.h"
#include "solver/work_team.h"

namespace parallax::solver {

class BlockCholesky {
 public:
  // `graph` in the original numbering, order[k] the node eliminated k-th.
  BlockCholesky(const AdjacencyBits& graph, const std::vector<int>& order, int dimension, const SolverKernels& kernels);

  int tile_count() const { return tile_count_; }
  int rows() const { return tile_count_ * kTile; }
  std::size_t size() const { return storage_size_; }  // doubles in the tiles
  double fill() const;                                // tiles that exist over all of the triangle

  // For the kernels: offset of tile (row, column) of the lower triangle at [row * tile_count + column], -1: not there.
  const std::int64_t* tile_at() const { return tile_at_.data(); }
  const std::int32_t* tile_of() const { return tile_of_.data(); }    // of the k-th node
  const std::int32_t* local_of() const { return local_of_.data(); }  // its first row in the tile
  int row_of(int node) const {
    return tile_of_[static_cast<std::size_t>(node)] * kTile + local_of_[static_cast<std::size_t>(node)];
  }

  // Owned storage of the tiles; the factor replaces the matrix.
  double* tiles() { return tiles_.get(); }
  // The 1s of rows that no node uses; call when the matrix is complete.
  void finish_matrix();

  enum class Result { done, stopped, not_positive };
  // Factors in place. Polls `stop` every few dozen microseconds.
  Result factor(WorkTeam& team, const Interruption& stop);
  // Solves in place; `x` has rows() elements.
  void solve(double* x) const;

 private:
  double* tile(int row, int column) {
    return tiles_.get() + tile_at_[static_cast<std::size_t>(row) * static_cast<std::size_t>(tile_count_) +
                                   static_cast<std::size_t>(column)];
  }
  const double* tile(int row, int column) const { return const_cast<BlockCholesky*>(this)->tile(row, column); }

  int dimension_, nodes_, tile_count_;
  const SolverKernels& kernels_;
  std::vector<std::int64_t> tile_at_;
  std::vector<std::int32_t> tile_of_, local_of_;
  std::vector<std::vector<int>> column_;  // rows below the diagonal that exist in a column
  std::vector<std::vector<int>> row_;     // columns left of the diagonal that exist in a row
  std::size_t storage_size_ = 0;
  std::unique_ptr<double[]> tiles_;
};

}  // namespace parallax::solver
