// The map in 3D: keyframe frusta, points coloured by level, the camera and its path, planes, and what the user has
// placed. Pure functions on values, but for the path, which belongs to the thread that draws.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "app/orbit_camera.h"
#include "map/content.h"
#include "map/tracking_snapshot.h"
#include "render/draw_list.h"
#include "tracker/tracking_types.h"

namespace parallax {

// Where the camera has been, in order, on the present map: bounded memory, for every second place is forgotten when it
// is full. Follows when the world is moved.
class CameraPath {
 public:
  explicit CameraPath(int capacity = 4096);
  void add(const TrackingResult& tracked);
  // The places in the world of this result or snapshot; gaps (lost) separate the pieces.
  std::vector<std::vector<Eigen::Vector3d>> pieces(const SimilarityTransform& world_from_first) const;
  int size() const { return static_cast<int>(places_.size()); }

 private:
  struct Place {
    Eigen::Vector3d in_first = Eigen::Vector3d::Zero();  // the first world of the map
    bool begins = false;                                 // nothing leads to it
  };
  void thin();
  std::size_t capacity_;
  int stride_ = 1, skipped_ = 0;
  bool lost_ = true;
  std::uint64_t map_version_ = 0;
  std::vector<Place> places_;
};

struct MapViewInput {
  const TrackingSnapshot* map = nullptr;    // required
  const TrackingResult* tracked = nullptr;  // null or lost: no camera is drawn
  const CameraModel* camera = nullptr;      // the real lens: the shape of the frusta; null: a plain one
  const CameraPath* path = nullptr;
  const Content* content = nullptr;
  std::optional<KeyframeId> selected;
};

DrawList map_view(const MapViewInput& input, const OrbitCamera& camera, int width, int height);

// The keyframe whose frustum was clicked: the one whose drawn lines or centre come within radius_px of the pixel, the
// nearest to the eye of those.
std::optional<KeyframeId> pick_keyframe(const MapViewInput& input, const OrbitCamera& camera, int width, int height,
                                        const Eigen::Vector2d& pixel, double radius_px = 8);

// The row of a keyframe in the snapshot; null when it is gone.
const SnapshotKeyframe* find_keyframe(const TrackingSnapshot& map, KeyframeId id);

}  // namespace parallax
