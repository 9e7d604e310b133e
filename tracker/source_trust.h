// Which parts of the map are where the camera sees them. A map that has drifted on a long way has, where the camera
// comes back to its beginning, two sets of points for one place, of which the older ones are predicted beside what they
// are. They say nothing about the pose, nor about how well the camera is tracked: counted as points that were not found
// they would stop the mapping just where a loop is to be closed. The same holds for what comes into view behind a wall.
//
// Judged by the keyframe that a point's patch was taken from, when it comes into view after many others have been made:
// out of place is one of whose points next to none are found while those of the others are. A few of its points are
// looked for all the same, and when they are found it is in place again. What has been in view all along is not judged.
//
// Ours, not of a paper: PTAM §5.6 counts every point that should be seen. Keeps counts only, no images and no map;
// never throws but for memory. Not thread-safe; belongs to the tracking thread.
#pragma once

#include <cstdint>
#include <vector>

#include "tracker/two_stage.h"

namespace parallax {

class SourceTrust {
 public:
  // The map was replaced: nothing is known.
  void clear() { sources_.clear(); }

  // The frame that was tracked with `result`, which is not lost. `map`: the snapshot it was tracked on.
  void update(const TwoStageResult& result, const TrackingSnapshot& map);

  // By row of the snapshot's keyframes: 1 is out of place. Keyframes that nothing is known of are taken for what the
  // nearest in age is. Valid until the next call.
  const std::vector<std::uint8_t>& out_of_place(const TrackingSnapshot& map);

 private:
  enum class State : std::uint8_t { in_place, arriving, out_of_place };
  // Of the last frames; older ones count less and less.
  struct Source {
    KeyframeId id;
    double searched = 0, agreed = 0;
    State state = State::in_place;
    std::size_t last_seen = 0;  // keyframes of the map when one of its points was last looked for; 0: never
    long frame = 0;             // when that was
  };
  Source& source(KeyframeId id);

  std::vector<Source> sources_;  // by index of the keyframe
  std::vector<std::uint8_t> rows_;
  long frame_ = 0;  // updates so far
};

}  // namespace parallax
