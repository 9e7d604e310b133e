// On which of the stored maps the camera is (PTAMM: Castle, Klein, Murray 2008, §4.3). The words of a frame say which
// keyframes of which maps look alike; the relocaliser, on the very snapshot that the tracker would use, says whether
// and where. A map is found when two frames running agree.
//
// Bounded in memory: words of all keyframes are kept, images of a few maps only. Not thread-safe: one thread steps it.
#pragma once

#include <list>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "app/map_library.h"
#include "core/frame.h"
#include "map/map_document.h"
#include "map/tracking_snapshot.h"
#include "place/place_memory.h"
#include "tracker/frame_features.h"
#include "tracker/relocaliser.h"
#include "tracker/two_stage.h"

namespace parallax {

struct MapFinderOptions {
  int keyframes_asked = 12;  // the most alike by words, of all maps
  int maps_verified = 2;     // of those, in one frame
  int maps_in_memory = 3;    // with their images
};

struct FoundMap {
  std::string path;
  MapStamp stamp;  // of the file that `document` was read from
  std::shared_ptr<const MapDocument> document;
  RigidTransform camera_from_world;  // of the frame it was found with
};

class MapFinder {
 public:
  // The vocabulary is not empty.
  MapFinder(const CameraModel& camera, const TrackerOptions& tracker, std::shared_ptr<const Vocabulary> vocabulary,
            const MapFinderOptions& options = {});

  // The files that may hold maps. What has changed since it was learned is forgotten, and learned anew.
  void set_files(const std::vector<std::string>& paths);
  // Reads the next file that is not known; false when all are. Files that are no whole maps of this lens are known
  // too: they have no words. Milliseconds for a small map, a second for a very large one.
  bool learn_one();
  // Maps that were learned and fit.
  int maps() const;

  // One frame; some tens of milliseconds. `except`: the file of the present map, or all that are not asked for. The
  // same frame again is no evidence.
  std::optional<FoundMap> look(const Frame& frame, const std::string& except) {
    return look(frame, std::set<std::string>{except});
  }
  std::optional<FoundMap> look(const Frame& frame, const std::set<std::string>& except);
  // A map was found with one frame, and the next will say.
  bool has_candidate() const { return candidate_.has_value(); }
  // Where the camera was is no help any more.
  void forget_candidate() { candidate_.reset(); }

 private:
  struct Known {
    MapStamp stamp;
    std::vector<int> entries;  // in the memory
  };
  struct Loaded {
    std::string path;
    MapStamp stamp;
    std::shared_ptr<const MapDocument> document;
    std::shared_ptr<const TrackingSnapshot> snapshot;
    std::unique_ptr<Relocaliser> relocaliser;
    std::unique_ptr<TwoStageTracker> two_stage;
  };
  struct Candidate {
    std::string path;
    int frame = -1;
    RigidTransform camera_from_world;
  };

  void forget(const std::string& path);
  std::shared_ptr<const MapDocument> read(const std::string& path) const;
  Loaded* load(const std::string& path);
  std::optional<RigidTransform> verify(Loaded* map, const FrameImages& images, const RigidTransform& hint) const;

  CameraModel camera_;
  TrackerOptions tracker_options_;
  MapFinderOptions options_;
  PlaceMemory memory_;
  FrameFeatures features_;
  std::map<std::string, Known> known_;
  std::vector<std::string> to_learn_;                      // the next one last
  std::map<int, std::pair<std::string, KeyframeId>> row_;  // of an entry
  int next_entry_ = 0;
  std::list<Loaded> loaded_;  // the one used last first
  std::optional<Candidate> candidate_;
};

}  // namespace parallax
