// A map in a file: SQLite, one file, versioned. docs/map-files.md describes the tables.
//
// Saving is one transaction: whoever is killed, loses power or runs out of disk in the middle leaves the state that was
// saved before. Images are written once; what changes is written anew. Every row carries a checksum.
//
// Not thread-safe: one thread at a time.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "map/map_document.h"

namespace parallax {

class SqliteDatabase;

class MapFile {
 public:
  static constexpr int kVersion = 1;

  // For saving to: made when it is not there. Throws InputError when it is something else than a map file or of a later
  // version, RunError when it cannot be written. `program`: what is noted as the writer. `vfs`: as in SqliteDatabase.
  MapFile(const std::string& path, std::string program, const std::string& vfs = {});
  ~MapFile();
  MapFile(const MapFile&) = delete;
  MapFile& operator=(const MapFile&) = delete;

  // Replaces what the file holds; durable when it returns. Throws RunError ("PATH: cannot be written: ..."): the file
  // is as before then. Keyframes with an identifier that the file has are the same keyframes, unless `another_map`.
  void save(const MapDocument& document, bool another_map = false);

 private:
  void save_images(const Map& map, bool all);
  void save_keyframes(const Map& map);
  void save_points(const Map& map);
  void save_rest(const MapDocument& document);

  std::unique_ptr<SqliteDatabase> database_;
  std::string program_;
};

// A file with this and nothing else, in one step: written beside and renamed. Throws RunError.
void write_map_file(const MapDocument& document, const std::string& path, const std::string& program);

// Throws InputError ("PATH: keyframe 3: found damaged bytes, expected ...") for anything that is not a whole map.
MapDocument read_map_file(const std::string& path);
// The same, of the bytes of a file (as a recording keeps the map that its session began with).
MapDocument read_map_bytes(std::span<const std::byte> file, const std::string& name);
MapFileInfo read_map_file_info(const std::string& path);

// All that is wrong with a file, a line each, at most 50; empty: nothing. Never throws for what is in the file.
std::vector<std::string> verify_map_file(const std::string& path);

// Whether a file that begins so is a map file (SQLite, with our mark in its head).
bool is_map_file(std::string_view start);

}  // namespace parallax
