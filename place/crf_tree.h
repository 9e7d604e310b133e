// Exact inference on a tree of discrete variables: the best assignment (max-product) and the partition function
// (sum-product) by belief propagation (Pearl 1988), O(n k^2) for n variables of k states.
//
// Plain values and functions, safe from any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace parallax {

// Logarithms of potentials. Parents come before their children; -1: a root (there may be several). Variable i has
// states[i] states, 1 to `most_states`.
struct TreeField {
  int most_states = 1;
  std::vector<std::int32_t> parent, states;
  std::vector<double> local;  // [i][state], strides of most_states
  std::vector<double> pair;   // [i][state of the parent][state of i]; of a root: not used

  // Variables with all states and zero potentials.
  TreeField(std::vector<std::int32_t> parents, int most_states);
  int size() const { return static_cast<int>(parent.size()); }
  double& local_at(int i, int state) { return local[index(i, state)]; }
  double local_at(int i, int state) const { return local[index(i, state)]; }
  double& pair_at(int i, int parent_state, int state) { return pair[index(i, parent_state, state)]; }
  double pair_at(int i, int parent_state, int state) const { return pair[index(i, parent_state, state)]; }

  std::size_t index(int i, int state) const {
    return static_cast<std::size_t>(i) * static_cast<std::size_t>(most_states) + static_cast<std::size_t>(state);
  }
  std::size_t index(int i, int parent_state, int state) const {
    return index(i, parent_state) * static_cast<std::size_t>(most_states) + static_cast<std::size_t>(state);
  }
};

// Sum of the log potentials of an assignment.
double field_score(const TreeField& field, std::span<const std::int32_t> assignment);

// The assignment of the greatest score, and that score; of equally good ones the one with the lower states.
double best_assignment(const TreeField& field, std::vector<std::int32_t>* assignment);

// log of the sum of exp(score) over all assignments.
double log_partition(const TreeField& field);

// The same, with the probabilities of states, laid out as `local`, and of states of parent and child, laid out as
// `pair` (zero where a state or a parent does not exist).
double field_marginals(const TreeField& field, std::vector<double>* states, std::vector<double>* pairs);

}  // namespace parallax
