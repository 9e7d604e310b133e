// Who is near whom: critters by the cell of a grid they are in. Units of the field's radius. What is visited, and in
// which order, depends on the critters alone.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "games/swarm_state.h"

namespace parallax::swarm {

class Neighbours {
 public:
  void rebuild(const std::vector<Critter>& critters) {
    starts_.fill(0);
    cells_.resize(critters.size());
    order_.resize(critters.size());
    for (std::size_t i = 0; i < critters.size(); ++i) {
      const Eigen::Vector2d& at = critters[i].position;
      cells_[i] = line_of(at.y()) * kSide + line_of(at.x());
      ++starts_[static_cast<std::size_t>(cells_[i]) + 1];
    }
    for (std::size_t i = 1; i < starts_.size(); ++i) starts_[i] += starts_[i - 1];
    auto next = starts_;
    for (std::size_t i = 0; i < critters.size(); ++i)
      order_[static_cast<std::size_t>(next[static_cast<std::size_t>(cells_[i])]++)] = static_cast<int>(i);
  }

  // visit(index) for every critter that may lie within `radius`, and some that do not.
  template <class Visit>
  void near(const Eigen::Vector2d& position, double radius, Visit&& visit) const {
    const int first_column = line_of(position.x() - radius), last_column = line_of(position.x() + radius);
    const int first_row = line_of(position.y() - radius), last_row = line_of(position.y() + radius);
    for (int row = first_row; row <= last_row; ++row) {
      const int begin = starts_[static_cast<std::size_t>(row * kSide + first_column)];
      const int end = starts_[static_cast<std::size_t>(row * kSide + last_column) + 1];
      for (int i = begin; i < end; ++i) visit(static_cast<std::size_t>(order_[static_cast<std::size_t>(i)]));
    }
  }

 private:
  static constexpr int kSide = 32;
  static constexpr double kCell = 0.125, kHalf = kSide * kCell / 2;
  static int line_of(double coordinate) {
    return static_cast<int>(std::clamp((coordinate + kHalf) / kCell, 0.0, kSide - 1.0));
  }

  std::array<int, static_cast<std::size_t>(kSide) * kSide + 1> starts_{};
  std::vector<int> cells_, order_;
};

}  // namespace parallax::swarm
