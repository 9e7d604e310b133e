// Keeps the map of a session in a file while it goes on: a thread of its own copies the map now and then and writes it
// in one transaction. Tracking and mapping wait for the copy at most, never for the disk.
//
// Every public member is safe from any thread.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "app/run_session.h"
#include "core/mutex.h"
#include "map/content.h"
#include "map/map_document.h"
#include "map/shared_map.h"

namespace parallax {

// What stands on the map, as the window's thread knows it.
struct MapExtras {
  std::uint64_t map_version = 0;
  SimilarityTransform world_from_first;  // of the world that the content is in
  std::vector<ContentItem> content;
  std::map<std::string, std::string> games;
  bool scale_is_known = false;
};

struct MapSaverOptions {
  std::string path;         // may be there already; made at the first save
  std::string program;      // noted as the writer
  std::string calibration;  // the lens, as text
  std::string name;         // of the place
  // The file holds the map that the session began with: what is written to it is that map's next state.
  bool continues = false;
  MapExtras extras;  // until set_extras() is called
  std::chrono::milliseconds interval{20'000};
};

class MapSaver {
 public:
  // `copy` gives the map as it is (SharedMap::copy) until finish() returns.
  MapSaver(const MapSaverOptions& options, std::function<MapCopy()> copy);
  ~MapSaver();  // without a last save
  MapSaver(const MapSaver&) = delete;
  MapSaver& operator=(const MapSaver&) = delete;

  void set_extras(MapExtras extras);
  // Soon, not at the next interval.
  void save_soon();
  // Saves a last time, and ends the thread. Throws RunError when that save failed. Once.
  void finish();

  // What the user should know: a save that failed (said once until one succeeds), a file of another name. One line;
  // empty: nothing.
  std::string take_message();
  int saves() const;
  // The file that the present map is kept in; empty before the first save.
  std::string path() const;

 private:
  void run(std::stop_token stop);
  // False when there was nothing new.
  bool save();

  const MapSaverOptions options_;
  const std::function<MapCopy()> copy_;

  mutable Mutex mutex_;
  std::condition_variable_any wake_;
  MapExtras extras_ PARALLAX_GUARDED_BY(mutex_);
  bool soon_ PARALLAX_GUARDED_BY(mutex_) = false;
  std::string message_ PARALLAX_GUARDED_BY(mutex_), path_ PARALLAX_GUARDED_BY(mutex_);
  int saves_ PARALLAX_GUARDED_BY(mutex_) = 0;

  // The saver's thread, and finish() once that has ended.
  class Target;
  std::unique_ptr<Target> target_;
  bool failing_ = false;
  std::jthread thread_;
};

// How the map of a session is kept in `path`, from whose map it goes on when there is one: that is put into `options`.
// Throws InputError as open_initial_map() does. An empty path: nothing is kept.
MapSaverOptions begin_map_file(const std::string& path, const CameraModel& camera, RunOptions* options);

// A name for one more map beside `path`: "desk.plxmap" gives "desk-2.plxmap", or the next number that is free.
std::string next_map_path(const std::string& path);

// The map a session begins with, checked against the lens. Throws InputError (file, found, expected).
std::shared_ptr<const MapDocument> open_initial_map(const std::string& path, const CameraModel& camera);

}  // namespace parallax
