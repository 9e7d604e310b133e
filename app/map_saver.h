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

#include "app/map_library.h"
#include "app/run_session.h"
#include "core/mutex.h"
#include "map/content.h"
#include "map/map_document.h"
#include "map/shared_map.h"

namespace parallax {

// What stands on the map, as the window's thread knows it.
struct MapExtras {
  std::uint64_t map_version = 0;
  WorldStamp world;  // that the content is in
  std::vector<ContentItem> content;
  std::map<std::string, std::string> games;
  bool scale_is_known = false;
};

struct MapSaverOptions {
  std::string path;                      // may be there already; made at the first save
  std::string program;                   // noted as the writer
  std::string calibration;               // the lens, as text
  std::string name;                      // of the place
  std::vector<std::string> merged_from;  // as in MapDocument, of the map that the file holds
  // The file holds the map that the session began with: what is written to it is that map's next state.
  bool continues = false;
  MapExtras extras;  // until set_extras() is called
  // Several maps: every map has a file of its own in there, named by when it was first saved, and `path` is empty.
  // Maps of a few seconds are not kept, and of maps without a name so many. Null: `path` it is.
  std::shared_ptr<const MapLibrary> library;
  int unnamed_kept = 20;
  std::chrono::milliseconds interval{20'000};
};

// A stored map that a session goes over to. An empty path: a new map, which has no file yet.
struct MapOnFile {
  std::string path;
  std::unique_ptr<MapLock> lock;
  bool locked = false;  // it is never written
  std::uint64_t map_version = 0;
  std::shared_ptr<const MapDocument> document;  // what the file holds
};

// What the present map takes from one that it was merged with.
struct MergedIn {
  WorldState world;                          // that of the merged map, which `content` is in
  std::vector<ContentItem> content;          // beside what stands on the present map
  std::map<std::string, std::string> games;  // where the present map has none
  bool scale_is_known = false;
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
  // What the user calls the present map.
  void set_name(std::string name);

  // The session goes over to another map (with a library only). The present one is saved first, unless it is to be
  // forgotten; nothing is saved while `change` does it, which returns what the session has now, or nothing when it
  // stayed with the present map: false then. Content and games of the document are kept with the map; what
  // set_extras() says of it counts from content_is_back() on. Waits for the disk; throws RunError, and changes
  // nothing, when the present map cannot be saved.
  bool change_map(bool keep_present, const std::function<std::optional<MapOnFile>()>& change);
  void content_is_back();
  // Saves what is new at once; returns path(). Waits for the disk; throws RunError.
  std::string save_now();
  // The present map with what stands on it, as it would be saved now.
  struct Present {
    MapDocument document;
    std::uint64_t map_version = 0, world_version = 0;
  };
  Present present() const;
  // The present map becomes one with another (with a library only): it is saved to its file a last time, and `merged`
  // to a new one, which the map is kept in from then on. `change` makes the session go on with the merged map, or
  // returns nothing: nothing has changed then. Returns the file that the present map was kept in before, which nobody
  // holds any more; empty: nothing has changed. What set_extras() says counts from content_is_back() on. Waits for the
  // disk; throws RunError, and changes nothing, when one of the two cannot be saved.
  std::string merge_map(const MapDocument& merged, const std::function<std::optional<MergedIn>()>& change);
  // Locks the file of the present map once it is up to date, or unlocks it. Waits for the disk; throws RunError.
  void set_locked(bool locked);
  // Saves a last time, and ends the thread. Throws RunError when that save failed. Once.
  void finish();

  // What the user should know: a save that failed (said once until one succeeds), a file of another name. One line;
  // empty: nothing.
  std::string take_message();
  int saves() const;
  // The file that the present map is kept in; empty before the first save.
  std::string path() const;
  std::string name() const;
  // The present map's file is locked: what changes is not kept.
  bool is_locked() const;

 private:
  void run(std::stop_token stop);
  // False when there was nothing new.
  bool save() PARALLAX_REQUIRES(save_mutex_);
  void begin_file(const MapCopy& copy) PARALLAX_REQUIRES(save_mutex_);
  void drop_file() PARALLAX_REQUIRES(save_mutex_);
  void take_over(const MapDocument& merged, const MergedIn& in) PARALLAX_REQUIRES(save_mutex_);
  void put_extras(const MapCopy& copy, MapDocument* document) const PARALLAX_REQUIRES(mutex_);

  const MapSaverOptions options_;
  const std::function<MapCopy()> copy_;

  mutable Mutex mutex_;
  std::condition_variable_any wake_;
  MapExtras extras_ PARALLAX_GUARDED_BY(mutex_);
  std::uint64_t awaited_ PARALLAX_GUARDED_BY(mutex_) = 0;  // a map whose content the window has not put back yet
  std::string name_ PARALLAX_GUARDED_BY(mutex_);
  std::vector<std::string> merged_from_ PARALLAX_GUARDED_BY(mutex_);
  bool locked_ PARALLAX_GUARDED_BY(mutex_) = false, failing_ PARALLAX_GUARDED_BY(mutex_) = false;
  bool soon_ PARALLAX_GUARDED_BY(mutex_) = false;
  std::string message_ PARALLAX_GUARDED_BY(mutex_), path_ PARALLAX_GUARDED_BY(mutex_);
  int saves_ PARALLAX_GUARDED_BY(mutex_) = 0;

  // Held while something is saved, and while the session goes over to another map; taken before mutex_.
  Mutex save_mutex_;
  class Target;
  std::unique_ptr<Target> target_ PARALLAX_GUARDED_BY(save_mutex_);
  std::jthread thread_;
};

// How the map of a session is kept in `path`, from whose map it goes on when there is one: that is put into `options`.
// Throws InputError as open_initial_map() does. An empty path: nothing is kept.
MapSaverOptions begin_map_file(const std::string& path, const CameraModel& camera, RunOptions* options);

// Whether a map is more than a few seconds of trying: for maps that are kept without being asked for.
bool is_worth_keeping(const MapDocument& document);

// A name for one more map beside `path`: "desk.plxmap" gives "desk-2.plxmap", or the next number that is free.
std::string next_map_path(const std::string& path);

// The map a session begins with, checked against the lens. Throws InputError (file, found, expected).
std::shared_ptr<const MapDocument> open_initial_map(const std::string& path, const CameraModel& camera);

}  // namespace parallax
