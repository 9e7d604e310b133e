#include "solver/incremental_gauge.h"

#include <map>
#include <utility>

namespace parallax::solver {

void IncrementalGauge::add_pose() {
  for (int side = 0; side < 2; ++side) {
    parent_.push_back(static_cast<int>(parent_.size()));
    size_.push_back(1);
  }
}

void IncrementalGauge::clear() {
  for (std::size_t i = 0; i < parent_.size(); ++i) {
    parent_[i] = static_cast<int>(i);
    size_[i] = 1;
  }
}

int IncrementalGauge::find(int frame) const {
  // Joined by size: never deep.
  while (parent_[static_cast<std::size_t>(frame)] != frame) frame = parent_[static_cast<std::size_t>(frame)];
  return frame;
}

void IncrementalGauge::join(int a, int b) {
  a = find(a);
  b = find(b);
  if (a == b) return;
  if (size_[static_cast<std::size_t>(a)] < size_[static_cast<std::size_t>(b)]) std::swap(a, b);
  parent_[static_cast<std::size_t>(b)] = a;
  size_[static_cast<std::size_t>(a)] += size_[static_cast<std::size_t>(b)];
}

std::vector<int> IncrementalGauge::to_hold(std::span<const int> poses) const {
  std::vector<int> held;
  std::map<int, int> above;  // among the roots of the measured frames
  const auto top = [&](int frame) {
    for (auto it = above.find(frame); it != above.end(); it = above.find(frame)) frame = it->second;
    return frame;
  };
  for (const int pose : poses) {
    const int a = top(find(left(pose))), b = top(find(right(pose)));
    if (a == b) continue;
    above[a] = b;
    held.push_back(pose);
  }
  return held;
}

}  // namespace parallax::solver
