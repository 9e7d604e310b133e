// Which program writes a map of the library: a lock that the system gives back when its owner ends, however it ends.
//
// Movable, not thread-safe. A lock is a file in the folder `.locks` beside the map; the map itself is not opened.
#pragma once

#include <memory>
#include <string>

namespace parallax {

class MapLock {
 public:
  // Null when another program (or another part of this one) has it, or the folder cannot be written.
  static std::unique_ptr<MapLock> try_take(const std::string& map_path);
  // Whether somebody has it now.
  static bool is_taken(const std::string& map_path);
  ~MapLock();
  MapLock(const MapLock&) = delete;
  MapLock& operator=(const MapLock&) = delete;

 private:
  MapLock(int file, std::string path) : file_(file), path_(std::move(path)) {}

  int file_;
  std::string path_;  // of the lock
};

}  // namespace parallax
