// The maps that the program keeps by itself: a folder with a file a map ($XDG_DATA_HOME/parallax/maps). The folder is
// all there is to it: a map that is copied into it belongs to it. A map without write permission is locked: it is never
// written. What is deleted goes to the folder `.trash` in it for some days. Files that are no map files are shown with
// the reason and never touched.
//
// Stateless: several programs may use one folder. Safe from any thread. What the disk refuses is a RunError; what
// cannot be asked of a file is an InputError that names it.
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "app/map_lock.h"
#include "core/camera_model.h"
#include "core/image.h"
#include "map/map_document.h"

namespace parallax {

struct LibraryMap {
  std::string path, file;  // file: its name in the folder
  std::string name;        // what the user calls it; empty: it has none
  std::string title;       // for the user: the name, else when it was made, else the file
  std::string problem;     // why it cannot be used, one sentence; empty: it can
  MapFileInfo info;
  std::string lens;           // calibration, in our own form
  int width = 0, height = 0;  // of its images
  bool locked = false;
  bool in_use = false;  // a program keeps its map in it now

  bool fits(const CameraModel& camera) const;
};

// A file that was there with this content: changes when it is written.
struct MapStamp {
  std::int64_t bytes = -1, modified_ns = -1;
  bool operator==(const MapStamp&) const = default;
};
MapStamp map_stamp(const std::string& path);

// Throws InputError when there is something else than a folder. One that is not there yet is made when it is needed.
void check_map_folder(const std::string& path);

class MapLibrary {
 public:
  explicit MapLibrary(std::string folder) : folder_(std::move(folder)) {}
  const std::string& folder() const { return folder_; }

  // All that lies in the folder: usable maps, the newest first, then what is none, by name.
  std::vector<LibraryMap> list() const;
  // The map files among them, by name alone: nothing is opened.
  std::vector<std::string> paths() const;
  LibraryMap describe(const std::string& path) const;

  // A name that no map has, and the lock that keeps it ours.
  struct NewMap {
    std::string path;
    std::unique_ptr<MapLock> lock;
  };
  NewMap new_map() const;

  // Gives it a name, cleaned of what is no text, at most 60 bytes; empty: it has none. Not for locked maps and those
  // in use by another program (`own` is ours).
  void rename(const std::string& path, const std::string& name, bool own = false) const;
  static void set_locked(const std::string& path, bool locked);

  // Where remove() would put it now.
  std::string place_in_trash(const std::string& path) const;
  // To the trash; returns where it lies there. Not for locked maps and those in use.
  std::string remove(const std::string& path, bool own = false) const;
  // Back from the trash, under its old name or the next that is free; returns its path.
  std::string restore(const std::string& trashed) const;
  // What lies in the trash for longer than kTrashDays goes for good.
  void empty_old_trash() const;
  static constexpr int kTrashDays = 7;
  static constexpr const char* kTrash = ".trash";
  static constexpr const char* kMergeRecord = ".merge";  // end of the name of a note there (app/map_merge_record)

  // Of the maps without a name that are neither locked nor in use, the newest so many stay; the others go to the
  // trash. Returns their titles. `spared` stays.
  std::vector<std::string> keep_newest_unnamed(int at_most, const std::string& spared) const;

 private:
  std::string folder_;
};

// $XDG_DATA_HOME/parallax/maps; empty when there is no home.
std::string map_library_folder();

bool is_locked_map(const std::string& path);

// A small picture of the place: the image of a keyframe in the middle of its time. Throws InputError.
GreyImage read_map_picture(const std::string& path, int width_px);

// A name as it is kept: one line of text, without blanks at the ends.
std::string clean_map_name(const std::string& name);

}  // namespace parallax
