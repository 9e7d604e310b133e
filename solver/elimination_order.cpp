#include "solver/elimination_order.h"

#include <algorithm>
#include <bit>
#include <numeric>

namespace parallax::solver {
namespace {

int count_bits(const std::uint64_t* row, int words) {
  int n = 0;
  for (int w = 0; w < words; ++w) n += std::popcount(row[w]);
  return n;
}

template <class Visit>
void for_each_bit(const std::uint64_t* row, int words, const Visit& visit) {
  for (int w = 0; w < words; ++w)
    for (std::uint64_t bits = row[w]; bits != 0; bits &= bits - 1) visit(64 * w + std::countr_zero(bits));
}

}  // namespace

std::vector<int> minimum_degree_order(const AdjacencyBits& graph) {
  const int n = graph.nodes(), words = graph.words();
  AdjacencyBits rest = graph;
  std::vector<int> degree(static_cast<std::size_t>(n)), order;
  for (int i = 0; i < n; ++i) degree[static_cast<std::size_t>(i)] = count_bits(rest.row(i), words);
  std::vector<char> done(static_cast<std::size_t>(n), 0);
  std::vector<int> neighbours;
  while (static_cast<int>(order.size()) < n) {
    int best = -1;
    for (int i = 0; i < n; ++i)
      if (!done[static_cast<std::size_t>(i)] &&
          (best < 0 || degree[static_cast<std::size_t>(i)] < degree[static_cast<std::size_t>(best)]))
        best = i;
    neighbours.clear();
    for_each_bit(rest.row(best), words, [&](int j) { neighbours.push_back(j); });
    done[static_cast<std::size_t>(best)] = 1;
    order.push_back(best);
    // A clique remains, whose members are done as soon as one of them is reached: once everything left is one clique,
    // any order will do.
    const int left = n - static_cast<int>(order.size());
    if (static_cast<int>(neighbours.size()) == left) {
      order.insert(order.end(), neighbours.begin(), neighbours.end());
      break;
    }
    for (const int j : neighbours) {
      std::uint64_t* row = rest.row(j);
      for (int w = 0; w < words; ++w) row[w] |= rest.row(best)[w];
      row[j / 64] &= ~(std::uint64_t{1} << (j % 64));
      row[best / 64] &= ~(std::uint64_t{1} << (best % 64));
      degree[static_cast<std::size_t>(j)] = count_bits(row, words);
    }
  }
  return order;
}

std::vector<int> reverse_cuthill_mckee_order(const AdjacencyBits& graph) {
  const int n = graph.nodes(), words = graph.words();
  std::vector<int> degree(static_cast<std::size_t>(n)), order;
  for (int i = 0; i < n; ++i) degree[static_cast<std::size_t>(i)] = count_bits(graph.row(i), words);
  std::vector<char> seen(static_cast<std::size_t>(n), 0);
  const auto by_degree = [&](int a, int b) {
    const int da = degree[static_cast<std::size_t>(a)], db = degree[static_cast<std::size_t>(b)];
    return da != db ? da < db : a < b;
  };
  std::vector<int> next;
  for (;;) {
    int start = -1;
    for (int i = 0; i < n; ++i)
      if (!seen[static_cast<std::size_t>(i)] && (start < 0 || by_degree(i, start))) start = i;
    if (start < 0) break;
    std::size_t head = order.size();
    order.push_back(start);
    seen[static_cast<std::size_t>(start)] = 1;
    for (; head < order.size(); ++head) {
      next.clear();
      for_each_bit(graph.row(order[head]), words, [&](int j) {
        if (!seen[static_cast<std::size_t>(j)]) next.push_back(j);
      });
      std::sort(next.begin(), next.end(), by_degree);
      for (const int j : next) seen[static_cast<std::size_t>(j)] = 1;
      order.insert(order.end(), next.begin(), next.end());
    }
  }
  std::reverse(order.begin(), order.end());
  return order;
}

AdjacencyBits tile_fill(const AdjacencyBits& graph, const std::vector<int>& order, int group, double* operations) {
  const int n = graph.nodes(), tiles = (n + group - 1) / group;
  std::vector<int> tile_of(static_cast<std::size_t>(n));
  for (int k = 0; k < n; ++k) tile_of[static_cast<std::size_t>(order[static_cast<std::size_t>(k)])] = k / group;
  AdjacencyBits fill(tiles);
  for (int i = 0; i < n; ++i) {
    const int t = tile_of[static_cast<std::size_t>(i)];
    for_each_bit(graph.row(i), graph.words(), [&](int j) {
      if (tile_of[static_cast<std::size_t>(j)] != t) fill.set(t, tile_of[static_cast<std::size_t>(j)]);
    });
  }
  double work = 0;
  std::vector<std::uint64_t> below(static_cast<std::size_t>(fill.words()));
  for (int k = 0; k < tiles; ++k) {
    // Those after k among the neighbours become one clique.
    for (int w = 0; w < fill.words(); ++w) {
      std::uint64_t mask = ~std::uint64_t{0};
      if (64 * w + 63 <= k) mask = 0;
      if (64 * w <= k && k < 64 * w + 63) mask = ~std::uint64_t{0} << (k % 64 + 1);
      below[static_cast<std::size_t>(w)] = fill.row(k)[w] & mask;
    }
    const double count = count_bits(below.data(), fill.words());
    work += 0.5 * count * (count + 1) + 0.6 * count + 0.8;
    for_each_bit(below.data(), fill.words(), [&](int j) {
      for (int w = 0; w < fill.words(); ++w) fill.row(j)[w] |= below[static_cast<std::size_t>(w)];
      fill.row(j)[j / 64] &= ~(std::uint64_t{1} << (j % 64));
    });
  }
  if (operations) *operations = work;
  return fill;
}

std::vector<int> elimination_order(const AdjacencyBits& graph, int group) {
  const int n = graph.nodes();
  std::vector<int> best(static_cast<std::size_t>(n));
  std::iota(best.begin(), best.end(), 0);
  if (n <= 2 * group) return best;
  double edges = 0;
  for (int i = 0; i < n; ++i) edges += count_bits(graph.row(i), graph.words());
  constexpr double kDense = 0.8;  // beyond this nothing is to be gained
  if (edges > kDense * n * (n - 1.0)) return best;
  double least = 0;
  tile_fill(graph, best, group, &least);
  for (auto make : {minimum_degree_order, reverse_cuthill_mckee_order}) {
    std::vector<int> candidate = make(graph);
    double work = 0;
    tile_fill(graph, candidate, group, &work);
    if (work < least) {
      least = work;
      best = std::move(candidate);
    }
  }
  return best;
}

}  // namespace parallax::solver
