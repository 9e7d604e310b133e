// A loop is closed: the keyframes between the two sides are bent by a similarity graph so that the sides meet
// (Strasdat, Montiel and Davison, RSS 2010), the points follow their source keyframes, what both sides know is made
// one, and where they meet it is adjusted. All of it happens on a copy, which takes the map's place only when it passes
// every check: a loop that does not is refused with nothing changed. Bundle adjustment of everything is the caller's
// next work.
//
// The older side stays where it is, and with it the gauge.
#pragma once

#include <memory>
#include <string>

#include "map/world_warp.h"
#include "mapper/loop_detection.h"
#include "mapper/mapper_options.h"

namespace parallax {

struct LoopClosingOptions {
  // Keyframes that share so many points are joined in the graph; a spanning tree joins the others.
  int edge_points = 30;
  int window_keyframes = 5;  // of a side that are searched for the other side's points, the matched one included
  // Points that both sides must measure in the closed map, after those that disagree were taken out.
  int min_joint_points = 40;
  // The median error of the measurements of the closed map, over all of it and in any one keyframe: at most this much
  // more than before, in standard deviations of a measurement. Bundle adjustment comes afterwards.
  double max_error_growth = 2.0, max_keyframe_error_growth = 6.0;
  double max_scale_change = 2.5;  // of any keyframe, as a factor either way

  // Throws InputError when a value is out of range.
  void validate() const;
};

struct LoopReport {
  bool closed = false;
  std::string reason;            // when refused: one sentence
  double drift_m = 0;            // how far the newer side was off where they meet
  double drift_scale = 1;        // and its scale, as a factor
  int keyframes = 0, edges = 0;  // of the graph
  int points_fused = 0, measurements_added = 0, joint_points = 0;
  double error_before = 0, error_after = 0;  // median, standard deviations of a measurement
  double graph_ms = 0, fuse_ms = 0, adjust_ms = 0, commit_ms = 0;
};

// The closed map and how the world moved; the map is empty when it was refused.
struct LoopCorrection {
  Map map;
  std::shared_ptr<const WorldWarp> warp;
  LoopReport report;
};

// Pure function of the map; `world_from_first` is that of its world.
LoopCorrection correct_loop(const Map& map, const SimilarityTransform& world_from_first, const CameraModel& camera,
                            const MapperOptions& mapper, const LoopCandidate& loop, const LoopClosingOptions& options);

// The same for the map that the threads share, on the mapping thread; publishes when it was closed.
LoopReport close_loop(SharedMap* map, const CameraModel& camera, const MapperOptions& mapper, const LoopCandidate& loop,
                      const LoopClosingOptions& options);

}  // namespace parallax
