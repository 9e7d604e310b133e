#include "place/crf_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/check.h"

namespace parallax {
namespace {

constexpr int kMostFieldStates = 16;

// log(sum(exp(values))) without overflow.
double log_sum_exp(const double* values, int n) {
  const double most = *std::max_element(values, values + n);
  if (!std::isfinite(most)) return most;
  double sum = 0;
  for (int i = 0; i < n; ++i) sum += std::exp(values[i] - most);
  return most + std::log(sum);
}

// Upward pass of sum-product: belief[i][s] is local(i, s) and the messages of i's children; message[i][sp] that of i to
// its parent. Returns the log partition function.
double pass_upward(const TreeField& field, std::vector<double>* belief, std::vector<double>* message) {
  *belief = field.local;
  message->assign(field.local.size(), 0);
  double total = 0, terms[kMostFieldStates];
  for (int i = field.size() - 1; i >= 0; --i) {
    const int parent = field.parent[static_cast<std::size_t>(i)], states = field.states[static_cast<std::size_t>(i)];
    const double* own = belief->data() + field.index(i, 0);
    if (parent < 0) {
      total += log_sum_exp(own, states);
      continue;
    }
    for (int sp = 0; sp < field.states[static_cast<std::size_t>(parent)]; ++sp) {
      const double* pair = field.pair.data() + field.index(i, sp, 0);
      for (int s = 0; s < states; ++s) terms[s] = own[s] + pair[s];
      const double m = log_sum_exp(terms, states);
      (*message)[field.index(i, sp)] = m;
      (*belief)[field.index(parent, sp)] += m;
    }
  }
  return total;
}

}  // namespace

TreeField::TreeField(std::vector<std::int32_t> parents, int states_each)
    : most_states(states_each), parent(std::move(parents)) {
  PARALLAX_CHECK(most_states >= 1 && most_states <= kMostFieldStates, "a field of 1 to 16 states");
  for (std::size_t i = 0; i < parent.size(); ++i)
    PARALLAX_CHECK(parent[i] >= -1 && parent[i] < static_cast<std::int32_t>(i), "parents come before their children");
  states.assign(parent.size(), most_states);
  const auto k = static_cast<std::size_t>(most_states);
  local.assign(parent.size() * k, 0);
  pair.assign(parent.size() * k * k, 0);
}

double field_score(const TreeField& field, std::span<const std::int32_t> assignment) {
  double score = 0;
  for (int i = 0; i < field.size(); ++i) {
    const auto row = static_cast<std::size_t>(i);
    score += field.local_at(i, assignment[row]);
    if (field.parent[row] >= 0)
      score += field.pair_at(i, assignment[static_cast<std::size_t>(field.parent[row])], assignment[row]);
  }
  return score;
}

double best_assignment(const TreeField& field, std::vector<std::int32_t>* assignment) {
  std::vector<double> best = field.local;
  std::vector<std::int8_t> choice(field.local.size(), 0);
  assignment->assign(field.parent.size(), 0);
  double total = 0;
  for (int i = field.size() - 1; i >= 0; --i) {
    const auto row = static_cast<std::size_t>(i);
    const double* own = best.data() + field.index(i, 0);
    if (field.parent[row] < 0) {
      const double* most = std::max_element(own, own + field.states[row]);  // the first of equal ones
      (*assignment)[row] = static_cast<std::int32_t>(most - own);
      total += *most;
      continue;
    }
    for (int sp = 0; sp < field.states[static_cast<std::size_t>(field.parent[row])]; ++sp) {
      double most = -std::numeric_limits<double>::infinity();
      for (int s = 0; s < field.states[row]; ++s) {
        const double value = own[s] + field.pair_at(i, sp, s);
        if (value <= most) continue;
        most = value;
        choice[field.index(i, sp)] = static_cast<std::int8_t>(s);
      }
      best[field.index(field.parent[row], sp)] += most;
    }
  }
  for (int i = 0; i < field.size(); ++i) {
    const auto row = static_cast<std::size_t>(i);
    if (field.parent[row] >= 0)
      (*assignment)[row] = choice[field.index(i, (*assignment)[static_cast<std::size_t>(field.parent[row])])];
  }
  return total;
}

double log_partition(const TreeField& field) {
  std::vector<double> belief, message;
  return pass_upward(field, &belief, &message);
}

double field_marginals(const TreeField& field, std::vector<double>* states, std::vector<double>* pairs) {
  std::vector<double> belief, message;
  const double total = pass_upward(field, &belief, &message);
  states->assign(field.local.size(), 0);
  pairs->assign(field.pair.size(), 0);
  // Downward: with the parent's probabilities known, those of parent and child together follow.
  for (int i = 0; i < field.size(); ++i) {
    const auto row = static_cast<std::size_t>(i);
    const int parent = field.parent[row];
    const double* own = belief.data() + field.index(i, 0);
    double* probability = states->data() + field.index(i, 0);
    if (parent < 0) {
      const double sum = log_sum_exp(own, field.states[row]);
      for (int s = 0; s < field.states[row]; ++s) probability[s] = std::exp(own[s] - sum);
      continue;
    }
    for (int sp = 0; sp < field.states[static_cast<std::size_t>(parent)]; ++sp) {
      const double of_parent = (*states)[field.index(parent, sp)];
      for (int s = 0; s < field.states[row]; ++s) {
        const double p = of_parent * std::exp(own[s] + field.pair_at(i, sp, s) - message[field.index(i, sp)]);
        (*pairs)[field.index(i, sp, s)] = p;
        probability[s] += p;
      }
    }
  }
  return total;
}

}  // namespace parallax
