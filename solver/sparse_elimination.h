// A sparse symmetric positive definite system H x = -g whose Cholesky factor is kept up to date while elements come, go
// and change: a tree of supernodes (cliques), each with its columns of the factor and with what it hands on to its
// parent. A change re-eliminates only the cliques between the changed elements and the root, in a new order; all
// subtrees below are kept and enter with what they had handed on. Of a large clique where a change enters late, the
// columns before it are kept too, as a clique of their own. This is the Bayes tree of iSAM2 (Kaess et al., IJRR
// 2012) as a multifrontal factorisation (Duff and Reid 1983).
//
// Variables have `block` unknowns each; an element is a dense symmetric matrix over a few variables with `sides` right
// hand sides. Identifiers are dense from 0. Values only, one thread. Same calls, same bits. Internal to solver/.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <span>
#include <vector>

#include "core/interruption.h"

namespace parallax::solver {

class SparseElimination {
 public:
  explicit SparseElimination(int block, int sides = 1);

  int block() const { return block_; }
  int add_variable();
  int variables() const { return static_cast<int>(variables_.size()); }

  // Distinct variables. Values start at zero; the element takes part until it is taken out.
  int add_element(std::span<const int> variables);
  int elements() const { return static_cast<int>(elements_.size()); }
  std::span<const int> element_variables(int element) const;
  // Column-major, (n block + sides) x (n block) for n variables: the lower triangle of its share of H (columns as the
  // variables were named) with its g in the last rows. Write all of it, then call change().
  Eigen::Map<Eigen::MatrixXd> element(int element);
  // Its values have changed, or are about to, or it goes in or out: the next update() sees to it. Returns the
  // arithmetic (multiply-adds) of the cliques that have to be done anew for it beyond those already marked.
  double change(int element);
  double set_active(int element, bool active);
  bool active(int element) const { return elements_[static_cast<std::size_t>(element)].active; }
  // Whether update() will assemble this element anew anyway.
  bool is_marked(int element) const;
  // Multiply-adds of everything marked since the last update().
  double marked_work() const { return marked_work_; }

  struct Outcome {
    int variables = 0;  // eliminated anew
    int cliques = 0;
    double work = 0;  // multiply-adds done
    int lost = 0;     // pivots that were not positive: these unknowns stay at zero
    bool stopped = false;
  };
  // Brings the factor up to date. The variables in `late` are eliminated last among those done anew. Stopped:
  // everything is marked, and the next update() starts from nothing.
  Outcome update(std::span<const int> late = {}, const Interruption& stop = {});
  // For values that were written without change(): the same cliques once more, all of them. Needs an up-to-date factor.
  // Stopped: as update().
  Outcome refactor(const Interruption& stop = {});
  // Marks everything; the order of elimination is found anew over all variables.
  void mark_all();

  // Brings the solution up to date: where the factor changed, and down from there as far as values changed by more than
  // `above` in any unknown (0: everywhere), each times its scale where one is given (block a variable). Lists the
  // variables that have new values (the order is that of the tree).
  void solve(double above, std::vector<int>* changed, std::span<const double> scale = {});
  // Of a variable: block x sides; zero for one without elements.
  Eigen::Map<const Eigen::MatrixXd> solution(int variable) const;
  // Moves the origin of a variable's unknowns: its solution is zero from now on. All its elements have to be changed.
  void clear_solution(int variable);

  // The block of H^-1 that belongs to these variables, in their order. All must take part in elements, and the factor
  // be up to date.
  Eigen::MatrixXd inverse_block(std::span<const int> variables) const;
  // H x = b for any b, rows block * variable: in place, one column. Variables without elements are left alone.
  void solve_in_place(Eigen::VectorXd* b) const;

  bool up_to_date() const { return !anything_marked_; }
  bool takes_part(int variable) const { return variables_[static_cast<std::size_t>(variable)].elements > 0; }
  double factor_work() const { return factor_work_; }        // multiply-adds of the whole factorisation
  std::int64_t factor_size() const { return factor_size_; }  // doubles in the factor's columns

 private:
  struct Free {
    void operator()(double* p) const { std::free(p); }
  };
  using Storage = std::unique_ptr<double[], Free>;

  struct Variable {
    int clique = -1;
    int position = 0;  // among those eliminated there
    int elements = 0;  // that take part
    bool fresh = false;
  };
  struct Element {
    std::int64_t first = 0;  // in element_variables_
    double* values = nullptr;
    int count = 0;
    int clique = -1;  // where it is assembled
    bool active = true, queued = false;
  };
  struct Clique {
    std::vector<int> variables;  // eliminated here, then those that follow above
    int eliminated = 0;
    int unchanged = 0;  // of a marked one: so many of its first variables come before all that has changed
    int parent = -1;
    std::vector<int> children, elements;
    Storage panel, handed_on;
    int stride = 0, handed_stride = 0;
    double work = 0;
    std::int64_t number = 0;  // parents have higher ones than their children
    bool marked = false, fresh = false, in_use = false;
  };

  static Storage allocate(std::size_t size);
  int rows_of(const Clique& c) const { return static_cast<int>(c.variables.size()) * block_ + sides_; }
  double mark_path(int clique, int position);
  int first_in(int clique, std::span<const int> variables) const;
  double work_of_split(const Clique& c) const;
  bool is_worth_splitting(const Clique& c) const;
  double marked_work_of(const Clique& c) const;
  void split(int clique, std::vector<int>* variables, std::vector<int>* elements, std::vector<int>* orphans);
  void release(Clique* c, int first, std::vector<int>* variables);
  void release(int element, std::vector<int>* elements);
  void add_tail(const double* values, int stride, std::span<const int> variables, int first_row, Clique* c) const;
  double work_of(const Clique& c) const;
  void take_apart(std::vector<int>* variables, std::vector<int>* elements, std::vector<int>* orphans);
  std::vector<int> find_order(const std::vector<int>& variables, const std::vector<int>& elements,
                              const std::vector<int>& orphans, std::span<const int> late);
  std::vector<int> build_cliques(const std::vector<int>& order, const std::vector<int>& elements,
                                 const std::vector<int>& orphans);
  template <int B>
  void assemble(Clique* c, const double* values, int stride, std::span<const int> variables);
  void add_values(Clique* c, const double* values, int stride, std::span<const int> variables);
  int eliminate(Clique* c);
  void solve_clique(const Clique& c, double* values) const;
  int new_clique();
  std::vector<int> in_order() const;  // all cliques, children before parents
  std::vector<int> path_of(std::span<const int> variables) const;

  int block_, sides_;
  std::vector<Variable> variables_;
  std::vector<Element> elements_;
  std::vector<int> element_variables_;
  std::vector<Storage> value_chunks_;
  std::size_t chunk_left_ = 0;
  double* chunk_next_ = nullptr;
  std::vector<Clique> cliques_;
  std::vector<int> free_cliques_, roots_, marked_, queued_, fresh_;
  std::vector<double> solution_, propagated_;
  std::vector<std::uint8_t> moved_;
  std::vector<int> row_of_;  // scratch, a variable
  std::vector<int> rows_;    // scratch, of assemble()
  std::int64_t next_number_ = 0, factor_size_ = 0;
  double marked_work_ = 0, factor_work_ = 0;
  bool anything_marked_ = false;
};

}  // namespace parallax::solver
