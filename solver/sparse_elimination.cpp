#include "solver/sparse_elimination.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/check.h"
#include "solver/sparse_kernels.h"
#include "solver/sparse_order.h"

namespace parallax::solver {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

constexpr std::size_t kChunk = std::size_t{1} << 16;  // doubles of elements' values allocated at a time

}  // namespace

SparseElimination::Storage SparseElimination::allocate(std::size_t size) {
  // The kernels read up to two vectors beyond the last column.
  const std::size_t bytes = (size + 16) * sizeof(double), rounded = (bytes + 63) / 64 * 64;
  auto* p = static_cast<double*>(std::aligned_alloc(64, rounded));
  PARALLAX_CHECK(p != nullptr, "out of memory");
  std::memset(p, 0, rounded);
  return Storage(p);
}

SparseElimination::SparseElimination(int block, int sides) : block_(block), sides_(sides) {
  PARALLAX_CHECK(block > 0 && sides > 0, "block and sides");
}

int SparseElimination::add_variable() {
  variables_.emplace_back();
  solution_.resize(solution_.size() + at(block_ * sides_), 0.0);
  propagated_.resize(solution_.size(), 0.0);
  moved_.push_back(0);
  row_of_.push_back(-1);
  return variables() - 1;
}

int SparseElimination::add_element(std::span<const int> variables) {
  Element e;
  e.first = static_cast<std::int64_t>(element_variables_.size());
  e.count = static_cast<int>(variables.size());
  for (const int v : variables) {
    PARALLAX_CHECK(v >= 0 && v < this->variables(), "variable of an element");
    PARALLAX_CHECK(std::count(variables.begin(), variables.end(), v) == 1, "an element's variables are distinct");
    element_variables_.push_back(v);
    Variable& variable = variables_[at(v)];
    if (variable.elements++ == 0 && variable.clique < 0 && !variable.fresh) {
      variable.fresh = true;
      fresh_.push_back(v);
    }
  }
  const std::size_t size = at((e.count * block_ + sides_) * e.count * block_);
  if (chunk_left_ < size) {
    chunk_left_ = std::max(size, kChunk);
    value_chunks_.push_back(allocate(chunk_left_));
    chunk_next_ = value_chunks_.back().get();
  }
  e.values = chunk_next_;
  chunk_next_ += size;
  chunk_left_ -= size;
  elements_.push_back(e);
  change(elements() - 1);
  return elements() - 1;
}

std::span<const int> SparseElimination::element_variables(int element) const {
  const Element& e = elements_[at(element)];
  return {element_variables_.data() + e.first, at(e.count)};
}

Eigen::Map<Eigen::MatrixXd> SparseElimination::element(int element) {
  const Element& e = elements_[at(element)];
  return {e.values, e.count * block_ + sides_, e.count * block_};
}

int SparseElimination::new_clique() {
  if (!free_cliques_.empty()) {
    const int c = free_cliques_.back();
    free_cliques_.pop_back();
    return c;
  }
  cliques_.emplace_back();
  return static_cast<int>(cliques_.size()) - 1;
}

std::vector<int> SparseElimination::find_order(const std::vector<int>& variables, const std::vector<int>& elements,
                                               const std::vector<int>& orphans, std::span<const int> late) {
  const int n = static_cast<int>(variables.size());
  for (int i = 0; i < n; ++i) row_of_[at(variables[at(i)])] = i;
  const auto for_each_set = [&](const auto& visit) {
    for (const int e : elements) visit(element_variables(e));
    for (const int o : orphans) {
      const Clique& c = cliques_[at(o)];
      visit(std::span<const int>(c.variables).subspan(at(c.eliminated)));
    }
  };
  SparseGraph graph;
  graph.begin.assign(at(n + 1), 0);
  for_each_set([&](std::span<const int> set) {
    for (const int v : set) graph.begin[at(row_of_[at(v)] + 1)] += static_cast<int>(set.size()) - 1;
  });
  for (int i = 0; i < n; ++i) graph.begin[at(i + 1)] += graph.begin[at(i)];
  graph.neighbour.resize(at(graph.begin.back()));
  std::vector<int> next(graph.begin.begin(), graph.begin.end() - 1);
  for_each_set([&](std::span<const int> set) {
    for (const int a : set)
      for (const int b : set)
        if (a != b) graph.neighbour[at(next[at(row_of_[at(a)])]++)] = row_of_[at(b)];
  });
  std::vector<int> group;
  for (const int v : late) {
    const int i = row_of_[at(v)];
    if (i < 0 || i >= n || variables[at(i)] != v) continue;
    if (group.empty()) group.assign(at(n), 0);
    group[at(i)] = 1;
  }
  // Groups are numbered without gaps.
  if (!group.empty() && std::count(group.begin(), group.end(), 1) == n) group.clear();
  std::vector<int> order = sparse_order(graph, group);
  for (int& i : order) i = variables[at(i)];
  return order;
}

// The cliques of the new top in order of elimination; row_of_ of a variable is its place in `order` meanwhile.
std::vector<int> SparseElimination::build_cliques(const std::vector<int>& order, const std::vector<int>& elements,
                                                  const std::vector<int>& orphans) {
  const int n = static_cast<int>(order.size());
  for (int k = 0; k < n; ++k) row_of_[at(order[at(k)])] = k;
  const auto first_of = [&](std::span<const int> set) {
    int first = n;
    for (const int v : set) first = std::min(first, row_of_[at(v)]);
    return first;
  };
  const auto separator = [&](int o) {
    const Clique& c = cliques_[at(o)];
    return std::span<const int>(c.variables).subspan(at(c.eliminated));
  };
  // Lists by the first variable, as chains.
  struct Chains {
    std::vector<int> head, next;
    Chains(int lists, std::size_t items) : head(at(lists), -1), next(items, -1) {}
    void add(int list, int item) {
      next[at(item)] = head[at(list)];
      head[at(list)] = item;
    }
  };
  Chains element_at(n + 1, elements.size()), orphan_at(n + 1, orphans.size()), child_at(n + 1, at(n));
  for (std::size_t i = 0; i < elements.size(); ++i)
    element_at.add(first_of(element_variables(elements[i])), static_cast<int>(i));
  for (std::size_t i = 0; i < orphans.size(); ++i) orphan_at.add(first_of(separator(orphans[i])), static_cast<int>(i));

  struct Supernode {
    int size = 1, top = -1, first = -1, last = -1;  // chain of places through `following`
    double zeros = 0;
  };
  std::vector<Supernode> supernode(at(n));
  std::vector<int> begin(at(n) + 1, 0), pool, stamp(at(n), -1), following(at(n), -1), parent(at(n), -1);
  std::vector<std::uint8_t> merged(at(n), 0);
  for (int k = 0; k < n; ++k) {
    const auto add = [&](int place) {
      if (place <= k || stamp[at(place)] == k) return;
      stamp[at(place)] = k;
      pool.push_back(place);
    };
    for (int i = element_at.head[at(k)]; i >= 0; i = element_at.next[at(i)])
      for (const int v : element_variables(elements[at(i)])) add(row_of_[at(v)]);
    for (int i = orphan_at.head[at(k)]; i >= 0; i = orphan_at.next[at(i)])
      for (const int v : separator(orphans[at(i)])) add(row_of_[at(v)]);
    for (int c = child_at.head[at(k)]; c >= 0; c = child_at.next[at(c)])
      for (int i = begin[at(c)]; i < begin[at(c + 1)]; ++i) add(pool[at(i)]);
    begin[at(k + 1)] = static_cast<int>(pool.size());
    const int above = begin[at(k + 1)] - begin[at(k)];
    if (above > 0) {
      parent[at(k)] = *std::min_element(pool.begin() + begin[at(k)], pool.end());
      child_at.add(parent[at(k)], k);
    }
    // Children whose columns are nearly those of this one join it.
    Supernode& s = supernode[at(k)];
    s.top = k;
    for (int c = child_at.head[at(k)]; c >= 0; c = child_at.next[at(c)]) {
      const Supernode& child = supernode[at(c)];
      const double added = static_cast<double>(child.size) * (s.size + above - (begin[at(c + 1)] - begin[at(c)]));
      const int size = s.size + child.size;
      const double total = 0.5 * size * (size + 1.0) + static_cast<double>(size) * above;
      const double most = size * block_ <= 24 ? 0.4 : size * block_ <= 60 ? 0.2 : size * block_ <= 120 ? 0.1 : 0.05;
      if (s.zeros + child.zeros + added > most * total && added > 0) continue;
      s.zeros += child.zeros + added;
      s.size = size;
      merged[at(c)] = 1;
      if (s.first < 0)
        s.first = child.first;
      else
        following[at(s.last)] = child.first;
      s.last = child.last;
    }
    if (s.first < 0)
      s.first = k;
    else
      following[at(s.last)] = k;
    s.last = k;
  }

  std::vector<int> made, clique_at(at(n), -1);
  for (int k = 0; k < n; ++k) {
    if (merged[at(k)]) continue;
    const int id = new_clique();
    Clique& c = cliques_[at(id)];
    c.in_use = c.fresh = true;
    c.number = next_number_++;
    c.eliminated = supernode[at(k)].size;
    for (int p = supernode[at(k)].first; p >= 0; p = following[at(p)]) {
      c.variables.push_back(order[at(p)]);
      clique_at[at(p)] = id;
      variables_[at(order[at(p)])].clique = id;
      variables_[at(order[at(p)])].position = static_cast<int>(c.variables.size()) - 1;
      if (p == k) break;
    }
    std::sort(pool.begin() + begin[at(k)], pool.begin() + begin[at(k + 1)]);
    for (int i = begin[at(k)]; i < begin[at(k + 1)]; ++i) c.variables.push_back(order[at(pool[at(i)])]);
    c.work = work_of(c);
    made.push_back(id);
  }
  for (int k = 0; k < n; ++k) {
    if (merged[at(k)]) continue;
    const int id = clique_at[at(k)];
    if (parent[at(k)] < 0) {
      roots_.push_back(id);
    } else {
      const int above = clique_at[at(parent[at(k)])];
      cliques_[at(id)].parent = above;
      cliques_[at(above)].children.push_back(id);
    }
  }
  for (const int e : elements) {
    const int id = clique_at[at(first_of(element_variables(e)))];
    elements_[at(e)].clique = id;
    cliques_[at(id)].elements.push_back(e);
  }
  for (const int o : orphans) {
    const int id = clique_at[at(first_of(separator(o)))];
    cliques_[at(o)].parent = id;
    cliques_[at(id)].children.push_back(o);
  }
  return made;
}

// Adds a dense lower triangle over `variables`, right-hand sides in its last rows, to the front of c. row_of_ holds the
// block row of each variable in the front.
template <int B>
void SparseElimination::assemble(Clique* c, const double* values, int stride, std::span<const int> variables) {
  const int block = B > 0 ? B : block_, n = static_cast<int>(variables.size());
  const int size = static_cast<int>(c->variables.size());
  rows_.clear();
  for (const int v : variables) rows_.push_back(row_of_[at(v)]);
  const auto column = [&](int j, int* first) -> double* {  // of the front: where block column j starts, its first row
    if (j < c->eliminated) {
      *first = 0;
      return c->panel.get() + static_cast<std::ptrdiff_t>(j * block) * c->stride;
    }
    *first = c->eliminated * block;
    return c->handed_on.get() + static_cast<std::ptrdiff_t>((j - c->eliminated) * block) * c->handed_stride;
  };
  for (int j = 0; j < n; ++j) {
    const int column_row = rows_[at(j)];
    const double* from = values + static_cast<std::ptrdiff_t>(j * block) * stride;
    int first = 0;
    double* to = column(column_row, &first);
    const int to_stride = column_row < c->eliminated ? c->stride : c->handed_stride;
    double* diagonal = to + column_row * block - first;
    for (int q = 0; q < block; ++q)
      for (int p = q; p < block; ++p) diagonal[q * to_stride + p] += from[q * stride + j * block + p];
    for (int i = j + 1; i < n; ++i) {
      const int row = rows_[at(i)];
      const double* s = from + i * block;
      if (row > column_row) {
        double* t = to + row * block - first;
        for (int q = 0; q < block; ++q)
          for (int p = 0; p < block; ++p) t[q * to_stride + p] += s[q * stride + p];
      } else {
        int other_first = 0;
        double* other = column(row, &other_first);
        const int other_stride = row < c->eliminated ? c->stride : c->handed_stride;
        double* t = other + column_row * block - other_first;
        for (int q = 0; q < block; ++q)
          for (int p = 0; p < block; ++p) t[p * other_stride + q] += s[q * stride + p];
      }
    }
    double* t = to + size * block - first;
    const double* s = from + n * block;
    for (int q = 0; q < block; ++q)
      for (int p = 0; p < sides_; ++p) t[q * to_stride + p] += s[q * stride + p];
  }
}

void SparseElimination::add_values(Clique* c, const double* values, int stride, std::span<const int> variables) {
  if (block_ == 6)
    assemble<6>(c, values, stride, variables);
  else if (block_ == 3)
    assemble<3>(c, values, stride, variables);
  else
    assemble<0>(c, values, stride, variables);
}

int SparseElimination::eliminate(Clique* c) {
  const int rows = rows_of(*c), own = c->eliminated * block_, rest = rows - own;
  c->stride = sparse_padded(rows);
  c->handed_stride = sparse_padded(rest);
  c->panel = allocate(at(c->stride) * at(own));
  c->handed_on = allocate(at(c->handed_stride) * at(rest));
  for (std::size_t i = 0; i < c->variables.size(); ++i) row_of_[at(c->variables[i])] = static_cast<int>(i);
  for (const int e : c->elements)
    add_values(c, elements_[at(e)].values, elements_[at(e)].count * block_ + sides_, element_variables(e));
  for (const int i : c->children) {
    const Clique& child = cliques_[at(i)];
    add_values(c, child.handed_on.get(), child.handed_stride,
               std::span<const int>(child.variables).subspan(at(child.eliminated)));
  }
  const SparseKernels& kernels = sparse_kernels();
  const int lost = kernels.factor_panel(c->panel.get(), rows, own, c->stride);
  kernels.reduce(c->handed_on.get(), c->handed_stride, c->panel.get() + own, c->stride, rest, own);
  return lost;
}

SparseElimination::Outcome SparseElimination::update(std::span<const int> late, const Interruption& stop) {
  Outcome outcome;
  if (!anything_marked_) return outcome;
  std::vector<int> variables, elements, orphans;
  take_apart(&variables, &elements, &orphans);
  outcome.variables = static_cast<int>(variables.size());
  const std::vector<int> order = find_order(variables, elements, orphans, late);
  const std::vector<int> made = build_cliques(order, elements, orphans);
  outcome.cliques = static_cast<int>(made.size());
  marked_work_ = 0;
  anything_marked_ = false;
  for (const int i : made) {
    factor_work_ += cliques_[at(i)].work;
    factor_size_ +=
        static_cast<std::int64_t>(sparse_padded(rows_of(cliques_[at(i)]))) * cliques_[at(i)].eliminated * block_;
  }
  for (const int i : made) {
    if (stop.requested()) {
      outcome.stopped = true;
      mark_all();
      return outcome;
    }
    Clique& c = cliques_[at(i)];
    outcome.lost += eliminate(&c);
    outcome.work += c.work;
  }
  return outcome;
}

std::vector<int> SparseElimination::in_order() const {
  std::vector<int> order;
  for (std::size_t i = 0; i < cliques_.size(); ++i)
    if (cliques_[i].in_use) order.push_back(static_cast<int>(i));
  std::sort(order.begin(), order.end(), [&](int l, int r) { return cliques_[at(l)].number < cliques_[at(r)].number; });
  return order;
}

SparseElimination::Outcome SparseElimination::refactor(const Interruption& stop) {
  PARALLAX_CHECK(up_to_date(), "the factor is not up to date");
  Outcome outcome;
  for (const int i : in_order()) {
    if (stop.requested()) {
      outcome.stopped = true;
      mark_all();
      return outcome;
    }
    Clique& c = cliques_[at(i)];
    c.fresh = true;
    outcome.lost += eliminate(&c);
    outcome.work += c.work;
    outcome.variables += c.eliminated;
    ++outcome.cliques;
  }
  return outcome;
}

}  // namespace parallax::solver
