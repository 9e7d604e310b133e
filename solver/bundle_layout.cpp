#include "solver/bundle_layout.h"

#include <algorithm>

namespace parallax::solver {
namespace {

using std::size_t;

// Counts to running starts, one element more than counts.
std::vector<std::int32_t> starts(const std::vector<std::int32_t>& count) {
  std::vector<std::int32_t> begin(count.size() + 1, 0);
  for (size_t i = 0; i < count.size(); ++i) begin[i + 1] = begin[i] + count[i];
  return begin;
}

void resize(ObservationList* list, int n) {
  const size_t padded = static_cast<size_t>(n + kLanePadding);
  for (auto* values : {&list->u, &list->v, &list->inverse_sigma}) values->assign(padded, 0.0);
  for (auto* values : {&list->camera, &list->point, &list->source}) values->assign(padded, 0);
}

void fill(ObservationList* list, int at, const BundleObservation& o, int camera, int point, int source) {
  const auto i = static_cast<size_t>(at);
  list->u[i] = o.pixel.x();
  list->v[i] = o.pixel.y();
  list->inverse_sigma[i] = 1.0 / o.sigma_px;
  list->camera[i] = camera * kCameraStride;
  list->point[i] = point * 3;
  list->source[i] = source;
}

}  // namespace

bool BundleLayout::build(int cameras, std::span<const std::uint8_t> camera_fixed, int points,
                         std::span<const BundleObservation> observations, int group, const Interruption& stop) {
  constexpr int kPoll = 2047;  // observations or points between two looks at the stop token, less one
  const int n = static_cast<int>(observations.size());
  const auto stopped = [&](int i) { return (i & kPoll) == 0 && stop.requested(); };

  std::vector<char> seen(static_cast<size_t>(cameras), 0);
  std::vector<std::int32_t> count(static_cast<size_t>(points), 0);
  for (int i = 0; i < n; ++i) {
    if (stopped(i)) return false;
    const BundleObservation& o = observations[static_cast<size_t>(i)];
    seen[static_cast<size_t>(o.pose)] = 1;
    ++count[static_cast<size_t>(o.point)];
  }
  std::vector<int> node(static_cast<size_t>(cameras), -1), node_source;  // of adjusted cameras
  for (int c = 0; c < cameras; ++c)
    if (seen[static_cast<size_t>(c)] && !camera_fixed[static_cast<size_t>(c)]) {
      node[static_cast<size_t>(c)] = static_cast<int>(node_source.size());
      node_source.push_back(c);
    }
  free_cameras = static_cast<int>(node_source.size());

  // Observation indices by point of the problem.
  const std::vector<std::int32_t> begin = starts(count);
  std::vector<std::int32_t> of_point(static_cast<size_t>(n));
  {
    std::vector<std::int32_t> next(begin.begin(), begin.end() - 1);
    for (int i = 0; i < n; ++i) {
      if (stopped(i)) return false;
      const BundleObservation& o = observations[static_cast<size_t>(i)];
      of_point[static_cast<size_t>(next[static_cast<size_t>(o.point)]++)] = i;
    }
  }
  const auto of = [&](int p) {
    return std::span<std::int32_t>(of_point).subspan(
        static_cast<size_t>(begin[static_cast<size_t>(p)]),
        static_cast<size_t>(begin[static_cast<size_t>(p) + 1] - begin[static_cast<size_t>(p)]));
  };
  const auto node_of = [&](std::int32_t i) {
    return node[static_cast<size_t>(observations[static_cast<size_t>(i)].pose)];
  };

  // Which adjusted cameras share a point.
  graph = AdjacencyBits(free_cameras);
  if (free_cameras > group) {
    std::vector<std::uint64_t> mask(static_cast<size_t>(graph.words()));
    for (int p = 0; p < points; ++p) {
      if ((p & 255) == 0 && stop.requested()) return false;
      std::fill(mask.begin(), mask.end(), 0);
      for (const std::int32_t i : of(p))
        if (const int c = node_of(i); c >= 0) mask[static_cast<size_t>(c / 64)] |= std::uint64_t{1} << (c % 64);
      for (const std::int32_t i : of(p))
        if (const int c = node_of(i); c >= 0)
          for (int w = 0; w < graph.words(); ++w) graph.row(c)[w] |= mask[static_cast<size_t>(w)];
    }
    for (int c = 0; c < free_cameras; ++c) graph.row(c)[c / 64] &= ~(std::uint64_t{1} << (c % 64));
  }
  order = elimination_order(graph, group);

  std::vector<int> internal(static_cast<size_t>(cameras), -1);  // camera of the problem -> internal
  camera_source.clear();
  for (const int k : order) {
    internal[static_cast<size_t>(node_source[static_cast<size_t>(k)])] = static_cast<int>(camera_source.size());
    camera_source.push_back(node_source[static_cast<size_t>(k)]);
  }
  for (int c = 0; c < cameras; ++c)
    if (internal[static_cast<size_t>(c)] < 0 && seen[static_cast<size_t>(c)]) {
      internal[static_cast<size_t>(c)] = static_cast<int>(camera_source.size());
      camera_source.push_back(c);
    }

  // Points by their first camera, so that neighbours in memory touch the same blocks.
  const auto camera_of = [&](std::int32_t i) {
    return internal[static_cast<size_t>(observations[static_cast<size_t>(i)].pose)];
  };
  std::vector<std::int32_t> first(static_cast<size_t>(points), -1), bucket(camera_source.size(), 0);
  int used = 0;
  for (int p = 0; p < points; ++p) {
    if (stopped(p)) return false;
    int lowest = -1;
    for (const std::int32_t i : of(p)) {
      const int c = camera_of(i);
      if (lowest < 0 || c < lowest) lowest = c;
    }
    first[static_cast<size_t>(p)] = lowest;
    if (lowest >= 0) {
      ++bucket[static_cast<size_t>(lowest)];
      ++used;
    }
  }
  std::vector<std::int32_t> next = starts(bucket);
  point_source.assign(static_cast<size_t>(used), 0);
  for (int p = 0; p < points; ++p)
    if (first[static_cast<size_t>(p)] >= 0)
      point_source[static_cast<size_t>(next[static_cast<size_t>(first[static_cast<size_t>(p)])]++)] = p;

  free.begin.assign(static_cast<size_t>(used) + 1, 0);
  fixed.begin.assign(static_cast<size_t>(used) + 1, 0);
  for (int q = 0; q < used; ++q) {
    if (stopped(q)) return false;
    int free_count = 0;
    const auto list = of(point_source[static_cast<size_t>(q)]);
    for (const std::int32_t i : list) free_count += node_of(i) >= 0;
    free.begin[static_cast<size_t>(q) + 1] = free.begin[static_cast<size_t>(q)] + free_count;
    fixed.begin[static_cast<size_t>(q) + 1] =
        fixed.begin[static_cast<size_t>(q)] + static_cast<int>(list.size()) - free_count;
  }
  resize(&free, free.size());
  resize(&fixed, fixed.size());
  chunk.assign(1, 0);
  largest_chunk = 0;
  int chunk_size = 0;
  for (int q = 0; q < used; ++q) {
    if ((q & 255) == 0 && stop.requested()) return false;
    const auto list = of(point_source[static_cast<size_t>(q)]);
    const int size = static_cast<int>(list.size());
    if (chunk_size > 0 && chunk_size + size > kChunkObservations) {
      chunk.push_back(q);
      chunk_size = 0;
    }
    chunk_size += size;
    largest_chunk = std::max(largest_chunk, chunk_size);
    // By internal camera (short lists, often sorted already); equal cameras in the order given.
    for (int a = 1; a < size; ++a) {
      const std::int32_t i = list[static_cast<size_t>(a)];
      const int c = camera_of(i);
      int b = a;
      for (; b > 0 && camera_of(list[static_cast<size_t>(b - 1)]) > c; --b)
        list[static_cast<size_t>(b)] = list[static_cast<size_t>(b - 1)];
      list[static_cast<size_t>(b)] = i;
    }
    int at_free = free.begin[static_cast<size_t>(q)], at_fixed = fixed.begin[static_cast<size_t>(q)];
    for (const std::int32_t i : list) {
      const BundleObservation& o = observations[static_cast<size_t>(i)];
      const int c = camera_of(i);
      if (c < free_cameras) {
        fill(&free, at_free++, o, c, q, i);
      } else {
        fill(&fixed, at_fixed++, o, c, q, i);
      }
    }
  }
  if (used > 0) chunk.push_back(used);
  return true;
}

}  // namespace parallax::solver
