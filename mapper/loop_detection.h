// Places that the camera has come back to without the map knowing: keyframes that look alike but share no points.
// Every keyframe is remembered by its visual words; a keyframe that was alike an unconnected part of the map several
// times in a row is compared with it by geometry (mapper/keyframe_matching), and only that makes it a loop.
//
// Not thread-safe; belongs to the mapping thread. The map is read under its lock for microseconds, and copied (a
// millisecond or two) only when words have raised a suspicion.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "map/shared_map.h"
#include "mapper/keyframe_matching.h"
#include "place/place_memory.h"

namespace parallax {

struct LoopDetectionOptions {
  // Keyframes that share so many points are connected; connected ones, and those connected to them, are no candidates.
  int connected_points = 15;
  // A candidate is at least this part as alike as connected keyframes are (their median).
  double min_similarity_part = 0.25;
  double min_similarity = 0.03;
  int candidates = 4;   // the most alike, a keyframe
  int consistent = 2;   // keyframes in a row that were alike the same part of the map
  int comparisons = 2;  // by geometry, a keyframe at most
  PlaceAlignmentOptions alignment;
  int min_pairs = 40;         // points that geometry has to agree about
  double max_sigma_px = 2.0;  // robust scale of the alignment's errors, level-0 pixels

  // Throws InputError when a value is out of range.
  void validate() const;
};

struct LoopCandidate {
  KeyframeId old_keyframe, new_keyframe;
  PlaceAlignment alignment;  // a: around the old one; b: around the new one
};

struct LoopDetectionStatistics {
  int words = 0;                        // keyframes that were looked up
  int alike = 0;                        // of those, alike an unconnected part of the map
  int compared = 0;                     // comparisons by geometry
  int found = 0;                        // that agreed
  double words_ms = 0, compare_ms = 0;  // in all
};

class LoopDetection {
 public:
  LoopDetection(std::shared_ptr<const Vocabulary> vocabulary, const CameraModel& camera,
                const LoopDetectionOptions& options, std::uint64_t seed);

  // A keyframe that joined the map: looked up when its turn comes.
  void add(KeyframeId keyframe) { waiting_.push_back(keyframe); }

  // One unit of work: a keyframe is remembered (two milliseconds) or looked up, and compared where that is called for
  // (some ten milliseconds a comparison). Nothing found is an empty answer; `idle` is set when nothing is left to do.
  std::optional<LoopCandidate> step(const SharedMap& map, bool* idle);

  const LoopDetectionStatistics& statistics() const { return statistics_; }

 private:
  // The part of the map that a candidate stands for, and how often in a row it was alike.
  struct Suspicion {
    std::vector<KeyframeId> group;  // sorted
    int count = 0;
  };
  void forget();
  void follow(const SharedMap& map);
  void remember(const SharedMap& map, KeyframeId keyframe);
  std::optional<LoopCandidate> look_up(const SharedMap& map, KeyframeId keyframe);

  std::shared_ptr<const Vocabulary> vocabulary_;
  CameraModel camera_;
  LoopDetectionOptions options_;
  std::mt19937_64 rng_;
  LoopDetectionStatistics statistics_;

  PlaceMemory memory_;  // entries are the indices of keyframes
  std::uint64_t map_version_ = 0;
  std::vector<KeyframeId> remembered_, missing_;  // of the map as it is
  std::vector<KeyframeId> waiting_;               // in order
  std::vector<Suspicion> suspicions_;             // of the keyframe looked up last
};

// How many points each keyframe shares with the given one, by keyframe index; 0 for those that are gone.
std::vector<int> shared_points(const Map& map, KeyframeId keyframe);

}  // namespace parallax
