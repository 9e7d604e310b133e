// Two maps put into one world and one set of identifiers, and what stands in it carried along when it is adjusted.
//
// Plain functions on plain values, safe from any thread.
#pragma once

#include <utility>
#include <vector>

#include "map/content.h"
#include "mapper/keyframe_matching.h"

namespace parallax {

struct JoinedMaps {
  Map map;  // a's world; a's identifiers as they were
  // What became of b's, by index; not valid where b has none.
  std::vector<KeyframeId> keyframe_of_b;
  std::vector<PointId> point_of_b;
};

// b's keyframes and points follow a's with fresh identifiers; b's datum is free. Planes of b that a has already (the
// same plane, however far it reaches) are not taken twice; the dominant one is a's, else b's.
JoinedMaps join_maps(const Map& a, Map b, const SimilarityTransform& a_from_b);

// Pairs become one point each: a's, measured where either was. Returns how many.
int fuse_points(JoinedMaps* joined, const std::vector<PointPair>& pairs);

// What places are moved by when a map is adjusted: the points near them know. Made before, asked after.
class SurfaceMotion {
 public:
  // A point that was at this place (world) and goes by this identifier afterwards.
  void add(PointId id, const Eigen::Vector3d& before) { points_.emplace_back(id, before); }
  // Takes what stood at the place before (world) to where it stands now; the identity where no point is left.
  SimilarityTransform at(const Map& now, const Eigen::Vector3d& place) const;

 private:
  std::vector<std::pair<PointId, Eigen::Vector3d>> points_;
};

// The transform that took most of the points from the one place to the other (rows matched); the identity when there
// are fewer than three or they lie on a line.
SimilarityTransform fit_similarity(std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> from_to);

}  // namespace parallax
