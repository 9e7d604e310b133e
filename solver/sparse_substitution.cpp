// The part of SparseElimination that uses the factor: substitution, and what is taken from its inverse.
#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "solver/sparse_elimination.h"
#include "solver/sparse_kernels.h"

namespace parallax::solver {
namespace {

std::size_t at(int i) { return static_cast<std::size_t>(i); }

}  // namespace

Eigen::Map<const Eigen::MatrixXd> SparseElimination::solution(int variable) const {
  return {solution_.data() + at(variable) * at(block_ * sides_), block_, sides_};
}

void SparseElimination::clear_solution(int variable) {
  const std::size_t size = at(block_ * sides_), first = at(variable) * size;
  std::fill_n(solution_.begin() + static_cast<std::ptrdiff_t>(first), size, 0.0);
  std::fill_n(propagated_.begin() + static_cast<std::ptrdiff_t>(first), size, 0.0);
}

// L^T x = -y, where the rows of x that belong to the variables above are known. values: rows of the clique x sides.
void SparseElimination::solve_clique(const Clique& c, double* values) const {
  const int own = c.eliminated * block_, rows = static_cast<int>(c.variables.size()) * block_;
  for (int side = 0; side < sides_; ++side) {
    double* x = values + static_cast<std::ptrdiff_t>(side) * rows;
    for (int j = 0; j < own; ++j) x[j] = -c.panel[static_cast<std::ptrdiff_t>(j) * c.stride + rows + side];
    sparse_kernels().substitute(c.panel.get(), rows, own, c.stride, x);
  }
}

void SparseElimination::solve(double above, std::vector<int>* changed, std::span<const double> scale) {
  changed->clear();
  PARALLAX_CHECK(up_to_date(), "the factor is not up to date");
  std::vector<int> stack, moved;
  for (const int r : roots_)
    if (cliques_[at(r)].fresh || above <= 0) stack.push_back(r);
  std::vector<double> x;
  const std::size_t size = at(block_ * sides_);
  while (!stack.empty()) {
    Clique& c = cliques_[at(stack.back())];
    stack.pop_back();
    c.fresh = false;
    const int rows = static_cast<int>(c.variables.size()) * block_;
    x.resize(at(rows * sides_));
    for (std::size_t i = at(c.eliminated); i < c.variables.size(); ++i)
      for (int side = 0; side < sides_; ++side)
        std::copy_n(solution_.data() + at(c.variables[i]) * size + at(side * block_), block_,
                    x.data() + at(side * rows) + i * at(block_));
    solve_clique(c, x.data());
    for (int i = 0; i < c.eliminated; ++i) {
      const int v = c.variables[at(i)];
      double *to = solution_.data() + at(v) * size, *last = propagated_.data() + at(v) * size;
      double difference = 0, most = 0;
      for (int side = 0; side < sides_; ++side)
        for (int p = 0; p < block_; ++p) {
          const double value = x[at(side * rows + i * block_ + p)];
          const int q = side * block_ + p;
          difference = std::max(difference, std::abs(value - to[q]));
          const double weight = scale.empty() ? 1 : scale[at(v * block_ + p)];
          most = std::max(most, weight * std::abs(value - last[q]));
          to[q] = value;
        }
      if (difference > 0) changed->push_back(v);
      if (most > above) {
        std::copy_n(to, size, last);
        moved_[at(v)] = 1;
        moved.push_back(v);
      }
    }
    for (const int i : c.children) {
      const Clique& child = cliques_[at(i)];
      bool visit = child.fresh || above <= 0;
      for (std::size_t k = at(child.eliminated); k < child.variables.size() && !visit; ++k)
        visit = moved_[at(child.variables[k])] != 0;
      if (visit) stack.push_back(i);
    }
  }
  for (const int v : moved) moved_[at(v)] = 0;
}

std::vector<int> SparseElimination::path_of(std::span<const int> variables) const {
  std::vector<int> path;
  for (const int v : variables)
    for (int c = variables_[at(v)].clique; c >= 0; c = cliques_[at(c)].parent) path.push_back(c);
  const auto earlier = [&](int a, int b) { return cliques_[at(a)].number < cliques_[at(b)].number; };
  std::sort(path.begin(), path.end(), earlier);
  path.erase(std::unique(path.begin(), path.end()), path.end());
  return path;
}

Eigen::MatrixXd SparseElimination::inverse_block(std::span<const int> variables) const {
  PARALLAX_CHECK(up_to_date(), "the factor is not up to date");
  // H^-1 = L^-T L^-1: columns of L^-1 have values on the way from their variable to the root only.
  const std::vector<int> path = path_of(variables);
  const int sides = static_cast<int>(variables.size()) * block_;
  std::vector<int> row(variables_.size(), -1);
  int rows = 0;
  for (const int i : path)
    for (int k = 0; k < cliques_[at(i)].eliminated; ++k) {
      row[at(cliques_[at(i)].variables[at(k)])] = rows;
      rows += block_;
    }
  Eigen::MatrixXd b = Eigen::MatrixXd::Zero(rows, sides);
  for (std::size_t i = 0; i < variables.size(); ++i) {
    PARALLAX_CHECK(row[at(variables[i])] >= 0, "a variable without elements");
    b.block(row[at(variables[i])], static_cast<int>(i) * block_, block_, block_).setIdentity();
  }
  int at_row = 0;
  for (const int i : path) {
    const Clique& c = cliques_[at(i)];
    const int own = c.eliminated * block_, all = static_cast<int>(c.variables.size()) * block_;
    const Eigen::Map<const Eigen::MatrixXd, Eigen::Aligned64, Eigen::OuterStride<>> panel(
        c.panel.get(), all, own, Eigen::OuterStride<>(c.stride));
    auto y = b.middleRows(at_row, own);
    panel.topRows(own).triangularView<Eigen::Lower>().solveInPlace(y);
    at_row += own;
    if (all == own) continue;
    const Eigen::MatrixXd handed = panel.bottomRows(all - own) * y;
    for (std::size_t k = at(c.eliminated); k < c.variables.size(); ++k)
      b.middleRows(row[at(c.variables[k])], block_) -=
          handed.middleRows((static_cast<int>(k) - c.eliminated) * block_, block_);
  }
  Eigen::MatrixXd inverse = b.transpose() * b;
  return inverse;
}

void SparseElimination::solve_in_place(Eigen::VectorXd* b) const {
  PARALLAX_CHECK(up_to_date(), "the factor is not up to date");
  PARALLAX_CHECK(b->size() == static_cast<Eigen::Index>(variables_.size()) * block_, "size of the right-hand side");
  const std::vector<int> order = in_order();
  Eigen::VectorXd x;
  const auto load = [&](const Clique& c) {
    x.resize(static_cast<Eigen::Index>(c.variables.size()) * block_);
    for (std::size_t k = 0; k < c.variables.size(); ++k)
      x.segment(static_cast<int>(k) * block_, block_) = b->segment(c.variables[k] * block_, block_);
  };
  const auto panel_of = [&](const Clique& c) {
    return Eigen::Map<const Eigen::MatrixXd, Eigen::Aligned64, Eigen::OuterStride<>>(
        c.panel.get(), x.size(), c.eliminated * block_, Eigen::OuterStride<>(c.stride));
  };
  for (const int i : order) {
    const Clique& c = cliques_[at(i)];
    load(c);
    const auto panel = panel_of(c);
    const Eigen::Index own = panel.cols(), rest = x.size() - own;
    panel.topRows(own).triangularView<Eigen::Lower>().solveInPlace(x.head(own));
    x.tail(rest) -= panel.bottomRows(rest) * x.head(own);
    for (std::size_t k = 0; k < c.variables.size(); ++k)
      b->segment(c.variables[k] * block_, block_) = x.segment(static_cast<int>(k) * block_, block_);
  }
  for (auto i = order.rbegin(); i != order.rend(); ++i) {
    const Clique& c = cliques_[at(*i)];
    load(c);
    const auto panel = panel_of(c);
    const Eigen::Index own = panel.cols(), rest = x.size() - own;
    x.head(own) -= panel.bottomRows(rest).transpose() * x.tail(rest);
    panel.topRows(own).transpose().triangularView<Eigen::Upper>().solveInPlace(x.head(own));
    for (int k = 0; k < c.eliminated; ++k)
      b->segment(c.variables[at(k)] * block_, block_) = x.segment(k * block_, block_);
  }
}

}  // namespace parallax::solver
