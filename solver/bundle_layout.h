// The observations of a bundle adjustment in the order its inner loops want them: cameras in order of elimination, then
// the fixed ones; points by their first camera; observations of adjusted and of fixed cameras apart, each by point.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/interruption.h"
#include "solver/bundle_adjustment.h"
#include "solver/elimination_order.h"
#include "solver/solver_kernels.h"

namespace parallax::solver {

struct ObservationList {
  std::vector<double> u, v, inverse_sigma;
  std::vector<std::int32_t> camera, point, begin, source;  // source: index of the observation in the problem
  ObservationArrays arrays() {
    return {u.data(), v.data(), inverse_sigma.data(), camera.data(), point.data(), begin.data()};
  }
  int size() const { return begin.empty() ? 0 : begin.back(); }
};

struct BundleLayout {
  std::vector<int> camera_source;  // internal camera -> camera of the problem
  std::vector<int> point_source;   // internal point -> point of the problem; points without observations are left out
  int free_cameras = 0;            // the first so many are adjusted
  AdjacencyBits graph{0};          // of the adjusted cameras, in the order they have in the problem
  std::vector<int> order;          // order[k]: node of the graph eliminated k-th (internal camera k)
  ObservationList free, fixed;
  std::vector<int> chunk;  // chunk i is points [chunk[i], chunk[i + 1])
  int largest_chunk = 0;   // observations of both lists in it

  // False when stopped on the way. `group`: cameras a tile.
  bool build(int cameras, std::span<const std::uint8_t> camera_fixed, int points,
             std::span<const BundleObservation> observations, int group, const Interruption& stop);
};

}  // namespace parallax::solver
