// In which order the cameras of a bundle adjustment are eliminated: the one, of those tried, that leaves the tiled
// factorisation the least work.
#pragma once

#include <cstdint>
#include <vector>

namespace parallax::solver {

// A symmetric graph as rows of bits; node i is not its own neighbour.
class AdjacencyBits {
 public:
  explicit AdjacencyBits(int nodes = 0) : nodes_(nodes), words_((nodes + 63) / 64) {
    bits_.assign(static_cast<std::size_t>(nodes) * static_cast<std::size_t>(words_), 0);
  }
  int nodes() const { return nodes_; }
  int words() const { return words_; }
  std::uint64_t* row(int i) { return bits_.data() + static_cast<std::size_t>(i) * static_cast<std::size_t>(words_); }
  const std::uint64_t* row(int i) const {
    return bits_.data() + static_cast<std::size_t>(i) * static_cast<std::size_t>(words_);
  }
  void set(int i, int j) { row(i)[j / 64] |= std::uint64_t{1} << (j % 64); }
  bool test(int i, int j) const { return (row(i)[j / 64] >> (j % 64)) & 1; }

 private:
  int nodes_, words_;
  std::vector<std::uint64_t> bits_;
};

// order[k] is the node eliminated k-th: the better, by tile operations for `group` nodes a tile, of the given order,
// minimum degree, and reverse Cuthill-McKee. The graph need not be connected. Deterministic.
std::vector<int> elimination_order(const AdjacencyBits& graph, int group);

// Each alone, for tests and for comparison.
std::vector<int> minimum_degree_order(const AdjacencyBits& graph);
std::vector<int> reverse_cuthill_mckee_order(const AdjacencyBits& graph);

// Graph of tiles (groups of consecutive nodes of the order) with the fill that factorisation adds; and the number of
// tile multiplications it takes.
AdjacencyBits tile_fill(const AdjacencyBits& graph, const std::vector<int>& order, int group, double* operations);

}  // namespace parallax::solver
