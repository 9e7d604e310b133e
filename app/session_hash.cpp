#include "app/session_hash.h"

#include <type_traits>

#include "core/checksum.h"

namespace parallax {
namespace {

class Hash {
 public:
  template <class T>
  void add(T value) {
    static_assert(std::is_arithmetic_v<T> || std::is_enum_v<T>);
    sum_ = checksum(&value, sizeof value, sum_);
  }
  template <class Scalar, int rows, int columns>
  void add(const Eigen::Matrix<Scalar, rows, columns>& matrix) {
    sum_ = checksum(matrix.data(), sizeof(Scalar) * rows * columns, sum_);
  }
  void add(const RigidTransform& transform) {
    add(transform.R);
    add(transform.t);
  }
  void add(const SimilarityTransform& transform) {
    add(transform.s);
    add(transform.R);
    add(transform.t);
  }
  template <class Tag>
  void add(Identifier<Tag> id) {
    add(id.session);
    add(id.index);
  }
  void add(const Plane& plane) {
    add(plane.world_from_plane);
    add(plane.extent_m);
  }
  std::uint64_t sum() const { return sum_; }

 private:
  std::uint64_t sum_ = 1;
};

}  // namespace

std::uint64_t hash_of(const TrackingResult& result) {
  Hash hash;
  hash.add(result.frame);
  hash.add(result.time.count());
  hash.add(result.state);
  hash.add(result.quality);
  hash.add(result.camera_from_world.has_value());
  if (result.camera_from_world) hash.add(*result.camera_from_world);
  hash.add(result.map_version);
  hash.add(result.world_from_first);
  for (int level = 0; level < kPyramidLevels; ++level) {
    hash.add(result.attempted[static_cast<std::size_t>(level)]);
    hash.add(result.found[static_cast<std::size_t>(level)]);
  }
  hash.add(result.sigma);
  hash.add(result.keyframe_proposed);
  return hash.sum();
}

std::uint64_t hash_of(const Map& map) {
  Hash hash;
  hash.add(map.keyframes.size());
  for (const Keyframe& kf : map.keyframes) {
    hash.add(kf.id);
    hash.add(kf.frame);
    hash.add(kf.time.count());
    hash.add(kf.camera_from_world);
    hash.add(kf.mean_depth);
    hash.add(static_cast<std::uint64_t>(kf.measurements.size()));
    for (const Measurement& m : kf.measurements) {
      hash.add(m.point);
      hash.add(m.pixel);
      hash.add(m.sigma_px);
      hash.add(m.level);
      hash.add(m.source);
    }
  }
  hash.add(map.points.size());
  for (const MapPoint& p : map.points) {
    hash.add(p.id);
    hash.add(p.position);
    hash.add(p.normal);
    hash.add(p.source);
    hash.add(p.source_level);
    hash.add(p.source_pixel);
    hash.add(p.searched);
    hash.add(p.found);
  }
  hash.add(map.plane.has_value());
  if (map.plane) hash.add(*map.plane);
  for (const Plane& plane : map.planes) hash.add(plane);
  return hash.sum();
}

}  // namespace parallax
