// The part of SparseElimination that knows what has to be done anew: what a change marks, and what of the tree is taken
// apart for it.
#include <algorithm>
#include <utility>

#include "solver/sparse_elimination.h"
#include "solver/sparse_kernels.h"

namespace parallax::solver {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

constexpr int kLeastKept = 32;          // variables of a clique that stay when it is split
constexpr double kLargestSplit = 0.02;  // what a split may cost, of what it costs to eliminate the clique anew

}  // namespace

// The first of these variables that is eliminated in the clique, by its position there.
int SparseElimination::first_in(int clique, std::span<const int> variables) const {
  int first = cliques_[at(clique)].eliminated;
  for (const int v : variables)
    if (variables_[at(v)].clique == clique) first = std::min(first, variables_[at(v)].position);
  return first;
}

// From where something has changed up to the root. `position`: of the first variable of the clique that is concerned.
double SparseElimination::mark_path(int clique, int position) {
  double work = 0;
  while (clique >= 0) {
    Clique& c = cliques_[at(clique)];
    const bool known = c.marked;
    if (known) work -= marked_work_of(c);
    c.unchanged = known ? std::min(c.unchanged, position) : position;
    work += marked_work_of(c);
    if (known) break;
    c.marked = true;
    marked_.push_back(clique);
    if (c.parent >= 0) position = first_in(c.parent, std::span<const int>(c.variables).subspan(at(c.eliminated)));
    clique = c.parent;
  }
  marked_work_ += work;
  return work;
}

double SparseElimination::change(int element) {
  Element& e = elements_[at(element)];
  anything_marked_ = true;
  double work = 0;
  if (e.clique >= 0) return mark_path(e.clique, first_in(e.clique, element_variables(element)));
  if (!e.active) return 0;
  if (!e.queued) {
    e.queued = true;
    queued_.push_back(element);
  }
  for (const int v : element_variables(element))
    work += mark_path(variables_[at(v)].clique, variables_[at(v)].position);
  return work;
}

double SparseElimination::set_active(int element, bool active) {
  Element& e = elements_[at(element)];
  if (e.active == active) return 0;
  e.active = active;
  for (const int v : element_variables(element)) {
    Variable& variable = variables_[at(v)];
    variable.elements += active ? 1 : -1;
    if (active && variable.clique < 0 && !variable.fresh) {
      variable.fresh = true;
      fresh_.push_back(v);
    }
  }
  return change(element);
}

bool SparseElimination::is_marked(int element) const {
  const Element& e = elements_[at(element)];
  if (e.clique < 0) return true;
  const Clique& c = cliques_[at(e.clique)];
  return c.marked && (!is_worth_splitting(c) || first_in(e.clique, element_variables(element)) >= c.unchanged);
}

void SparseElimination::mark_all() {
  anything_marked_ = true;
  for (std::size_t i = 0; i < cliques_.size(); ++i)
    if (cliques_[i].in_use) mark_path(static_cast<int>(i), 0);
}

double SparseElimination::work_of(const Clique& c) const {
  const double own = c.eliminated * block_, rest = static_cast<double>(rows_of(c)) - own;
  return own * own * own / 6 + 0.5 * own * own * rest + 0.5 * own * rest * rest;
}

// To form anew what the first columns hand on.
double SparseElimination::work_of_split(const Clique& c) const {
  const double own = c.unchanged * block_, rest = static_cast<double>(rows_of(c)) - own;
  return 0.5 * own * rest * rest;
}

bool SparseElimination::is_worth_splitting(const Clique& c) const {
  return c.unchanged >= kLeastKept && work_of_split(c) < kLargestSplit * c.work;
}

double SparseElimination::marked_work_of(const Clique& c) const {
  return is_worth_splitting(c) ? work_of_split(c) : c.work;
}

// Variables of a clique from `first` on are to be eliminated anew.
void SparseElimination::release(Clique* c, int first, std::vector<int>* variables) {
  for (int k = first; k < c->eliminated; ++k) {
    Variable& v = variables_[at(c->variables[at(k)])];
    v.clique = -1;
    if (v.elements > 0 && !v.fresh) variables->push_back(c->variables[at(k)]);
  }
}

void SparseElimination::release(int element, std::vector<int>* elements) {
  elements_[at(element)].clique = -1;
  if (elements_[at(element)].active && !elements_[at(element)].queued) elements->push_back(element);
}

// Adds the part of a dense lower triangle that lies in block rows from `first_row` on of the clique to what it hands
// on.
void SparseElimination::add_tail(const double* values, int stride, std::span<const int> variables, int first_row,
                                 Clique* c) const {
  const int n = static_cast<int>(variables.size()), size = static_cast<int>(c->variables.size());
  const auto target = [&](int row, int column) {
    return c->handed_on.get() + static_cast<std::ptrdiff_t>((column - first_row) * block_) * c->handed_stride +
           (row - first_row) * block_;
  };
  for (int j = 0; j < n; ++j) {
    const int column = row_of_[at(variables[at(j)])];
    if (column < first_row) continue;
    const double* from = values + static_cast<std::ptrdiff_t>(j * block_) * stride;
    for (int i = j; i < n; ++i) {
      const int row = row_of_[at(variables[at(i)])];
      if (row < first_row) continue;
      double* to = target(std::max(row, column), std::min(row, column));
      for (int q = 0; q < block_; ++q)
        for (int p = i == j ? q : 0; p < block_; ++p)
          to[row >= column ? q * c->handed_stride + p : p * c->handed_stride + q] += from[q * stride + i * block_ + p];
    }
    double* to = target(size, column);
    for (int q = 0; q < block_; ++q)
      for (int p = 0; p < sides_; ++p) to[q * c->handed_stride + p] += from[q * stride + n * block_ + p];
  }
}

// What comes before the change stays a clique of its own, with the columns that it has; the rest is listed.
void SparseElimination::split(int clique, std::vector<int>* variables, std::vector<int>* elements,
                              std::vector<int>* orphans) {
  Clique& c = cliques_[at(clique)];
  const int kept = c.unchanged, rest = rows_of(c) - kept * block_;
  c.handed_stride = sparse_padded(rest);
  c.handed_on = allocate(at(c.handed_stride) * at(rest));
  for (std::size_t i = 0; i < c.variables.size(); ++i) row_of_[at(c.variables[i])] = static_cast<int>(i);
  const auto enters_early = [&](std::span<const int> set) {
    return std::any_of(set.begin(), set.end(), [&](int v) { return row_of_[at(v)] < kept; });
  };
  std::vector<int> own_elements, own_children;
  for (const int e : c.elements) {
    if (!enters_early(element_variables(e))) {
      release(e, elements);
      continue;
    }
    own_elements.push_back(e);
    add_tail(elements_[at(e)].values, elements_[at(e)].count * block_ + sides_, element_variables(e), kept, &c);
  }
  for (const int i : c.children) {
    const Clique& child = cliques_[at(i)];
    const auto separator = std::span<const int>(child.variables).subspan(at(child.eliminated));
    if (!enters_early(separator)) {
      if (!child.marked) orphans->push_back(i);
      continue;
    }
    own_children.push_back(i);
    add_tail(child.handed_on.get(), child.handed_stride, separator, kept, &c);
  }
  sparse_kernels().reduce(c.handed_on.get(), c.handed_stride, c.panel.get() + kept * block_, c.stride, rest,
                          kept * block_);
  release(&c, kept, variables);
  factor_size_ -= static_cast<std::int64_t>(c.stride) * (c.eliminated - kept) * block_;
  factor_work_ -= c.work;
  c.eliminated = kept;
  c.elements = std::move(own_elements);
  c.children = std::move(own_children);
  c.work = work_of(c);
  factor_work_ += c.work;
  orphans->push_back(clique);
}

// Removes the marked cliques; what they held is listed.
void SparseElimination::take_apart(std::vector<int>* variables, std::vector<int>* elements, std::vector<int>* orphans) {
  std::vector<int> removed, parted;
  for (const int i : marked_) {
    Clique& c = cliques_[at(i)];
    if (is_worth_splitting(c)) {
      parted.push_back(i);
      split(i, variables, elements, orphans);
      continue;
    }
    removed.push_back(i);
    release(&c, 0, variables);
    for (const int e : c.elements) release(e, elements);
    for (const int child : c.children)
      if (!cliques_[at(child)].marked) orphans->push_back(child);
  }
  std::vector<int> kept;
  for (const int r : roots_)
    if (!cliques_[at(r)].marked) kept.push_back(r);
  roots_ = std::move(kept);
  for (const int i : parted) cliques_[at(i)].marked = false;
  for (const int i : removed) {
    factor_work_ -= cliques_[at(i)].work;
    factor_size_ -= static_cast<std::int64_t>(cliques_[at(i)].stride) * cliques_[at(i)].eliminated * block_;
    cliques_[at(i)] = Clique();
    free_cliques_.push_back(i);
  }
  marked_.clear();
  for (const int v : fresh_) {
    variables_[at(v)].fresh = false;
    if (variables_[at(v)].elements > 0 && variables_[at(v)].clique < 0) variables->push_back(v);
  }
  fresh_.clear();
  for (const int e : queued_) {
    elements_[at(e)].queued = false;
    if (elements_[at(e)].active) elements->push_back(e);
  }
  queued_.clear();
  std::sort(variables->begin(), variables->end());
  variables->erase(std::unique(variables->begin(), variables->end()), variables->end());
  std::sort(elements->begin(), elements->end());
  std::sort(orphans->begin(), orphans->end(),
            [&](int a, int b) { return cliques_[at(a)].number < cliques_[at(b)].number; });
}

}  // namespace parallax::solver
