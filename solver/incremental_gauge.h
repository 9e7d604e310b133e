// Which poses of a graph are determined by its measurements, and which have to be held for the rest to be.
//
// A pose is an unknown transform between two frames: the one it is expressed in (left) and its own (right). Factors
// tell which frames are the same (a constraint's poses share their left frame; an anchor's own frame is that of the
// poses behind it) and between which the transform was measured (a prior's two, the own frames of a constraint's
// poses). A pose is determined when a chain of measurements joins its two frames. Internal to solver/.
#pragma once

#include <span>
#include <vector>

namespace parallax::solver {

class IncrementalGauge {
 public:
  void add_pose();
  int poses() const { return static_cast<int>(parent_.size()) / 2; }
  // Forgets every measurement.
  void clear();

  void add_prior(int pose) { join(left(pose), right(pose)); }
  void add_constraint(int from, int to) {
    join(left(from), left(to));
    join(right(from), right(to));
  }
  void add_encounter(int anchor_from, int from, int anchor_to, int to) {
    join(left(anchor_from), left(anchor_to));
    join(right(anchor_from), left(from));
    join(right(anchor_to), left(to));
    join(right(from), right(to));
  }

  bool determined(int pose) const { return find(left(pose)) == find(right(pose)); }
  // Whether a^-1 * b is known for two poses of one frame.
  bool relative_determined(int a, int b) const {
    return (find(left(a)) == find(left(b)) && find(right(a)) == find(right(b))) || (determined(a) && determined(b));
  }
  // The fewest of `poses` (taken in that order) that have to be held for all of them to be determined.
  std::vector<int> to_hold(std::span<const int> poses) const;

 private:
  static int left(int pose) { return 2 * pose; }
  static int right(int pose) { return 2 * pose + 1; }
  int find(int frame) const;
  void join(int a, int b);

  std::vector<int> parent_, size_;
};

}  // namespace parallax::solver
