// A monocular map hung on the stereo sessions: its keyframes are recognised among theirs, and the similarity transform
// that carries it into a session's frame gives it its scale in metres. What is placed on a desk is then known in the
// building, and the reverse.
//
// Descriptors at the map's measured points are matched with the features of alike keyframes that have a depth; three
// pairs make a hypothesis (Umeyama 1991), reprojection into both images of the pair decides, and all that agree refine
// it together. Several keyframes of the map have to agree. Plain functions; one thread.
#pragma once

#include <cstdint>
#include <string>

#include "map/map.h"
#include "place/stereo_scene.h"
#include "sessions/session_database.h"

namespace parallax {

struct MapAttachmentOptions {
  int candidates = 5;             // session keyframes asked, for each keyframe of the map
  int max_keyframes = 40;         // of the map that are asked, spread evenly
  int max_distance = 70;          // bits of 256
  double ratio = 0.85;            // nearest descriptor to the second nearest
  double tolerance_px = 3;        // of level 0, times the feature's scale
  double least_disparity_px = 4;  // of what makes a hypothesis
  int rounds = 400;               // of RANSAC
  int least_inliers = 15;         // of a keyframe
  int least_keyframes = 2;        // of the map that agree
  std::uint64_t seed = 1;
  StereoSceneOptions scene;

  // Throws InputError when a value is out of range.
  void validate() const;
};

struct MapAttachment {
  bool ok = false;
  std::string reason;           // when not ok: what a user can do about it
  AttachedMap map;              // name and path are the caller's
  int asked = 0, agreeing = 0;  // keyframes of the map
  int inliers = 0;              // pairs of point and feature
  double rms_px = 0;
};

// Against all sessions of the database. Changes nothing.
MapAttachment attach_map(const Map& map, SessionDatabase* database, const Vocabulary& vocabulary,
                         const MapAttachmentOptions& options = {});

}  // namespace parallax
