#include "solver/sparse_order.h"

#include <suitesparse/camd.h>

#include <numeric>

#include "core/check.h"

namespace parallax::solver {

std::vector<int> sparse_order(const SparseGraph& graph, std::span<const int> group) {
  const int n = graph.nodes();
  std::vector<int> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  if (n <= 1 || graph.neighbour.empty()) return order;
  PARALLAX_CHECK(group.empty() || static_cast<int>(group.size()) == n, "a group for every node");
  double control[CAMD_CONTROL], info[CAMD_INFO];
  camd_defaults(control);
  const int result = camd_order(n, graph.begin.data(), graph.neighbour.data(), order.data(), control, info,
                                group.empty() ? nullptr : group.data());
  PARALLAX_CHECK(result == CAMD_OK || result == CAMD_OK_BUT_JUMBLED, "camd_order");
  return order;
}

}  // namespace parallax::solver
