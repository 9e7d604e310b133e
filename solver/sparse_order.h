// In which order the unknowns of a sparse symmetric system are eliminated, so that the factor stays sparse: constrained
// approximate minimum degree (Amestoy, Davis and Duff 2004; SuiteSparse's CAMD).
#pragma once

#include <span>
#include <vector>

namespace parallax::solver {

// A symmetric graph by rows: the neighbours of i are neighbour[begin[i]] up to neighbour[begin[i + 1]], each named from
// both sides; repetitions and i itself among them do no harm.
struct SparseGraph {
  std::vector<int> begin{0};
  std::vector<int> neighbour;
  int nodes() const { return static_cast<int>(begin.size()) - 1; }
};

// order[k] is the node eliminated k-th. `group` (empty, or one a node): nodes of a lower group come before those of a
// higher one; groups are numbered from 0. Deterministic.
std::vector<int> sparse_order(const SparseGraph& graph, std::span<const int> group);

}  // namespace parallax::solver
