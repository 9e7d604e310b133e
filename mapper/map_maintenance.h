// Keeps the map sound and bounded: points that are wrong, keyframes that are wrong or not needed, points that are the
// same point (where the paper's §8 says it is weak).
#pragma once

#include <vector>

#include "map/messages.h"
#include "map/shared_map.h"
#include "mapper/mapper_options.h"

namespace parallax {

// What the tracker saw: points that are mostly outliers of the pose, or are hardly ever found, go, but not
// one that something nearer hides in the keyframes that looked for it. Old counts fade. Returns how many went.
int apply_counts(SharedMap* map, const MapperOptions& options, const PointCounts& counts);

// Another day on this map: what the tracker saw of each point before counts for little, so that what has gone since is
// noticed within seconds.
void age_counts(Map* map);

// Removes keyframes (never a fixed one): points whose source goes are given another source among their observers;
// points that keep fewer than two observers go too.
void remove_keyframes(SharedMap* map, const CameraModel& camera, const std::vector<KeyframeId>& keyframes);

// Removes the most redundant keyframe, if there is one and the map is above its limit: one whose points are nearly all
// measured by three or more others at the same or a finer level. The nearer the map is to its largest size, the less
// redundant it has to be; above that one always goes. The newest is kept. True when one was removed.
bool cull_redundant_keyframe(SharedMap* map, const CameraModel& camera, const MapperOptions& options,
                             KeyframeId newest);

// Removes keyframes of which hardly a point is left, because what they show has gone; the newest is kept. Is the fixed
// one among them, then the one with the most measurements is fixed instead. Returns how many went.
int retire_keyframes(SharedMap* map, const CameraModel& camera, const MapperOptions& options, KeyframeId newest);

// Points measured within a pixel or so of each other in the keyframe and at the same depth are one point: the better
// measured stays, and is to be looked for where only the other was measured (refined_everywhere is cleared). Returns
// how many were merged.
int merge_duplicates(SharedMap* map, KeyframeId keyframe);

}  // namespace parallax
