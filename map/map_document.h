// All that a map file holds: the map, the lens it was made with, and what stands on it.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "map/content.h"
#include "map/map.h"

namespace parallax {

// A value. Frames: the map's world, metres of it.
struct MapDocument {
  Map map;
  std::string calibration;      // the lens, as a calibration file of our own form
  std::string name;             // what the user calls the place; may be empty
  bool scale_is_known = false;  // the user has set it; else 10 cm between the first two views (PTAM §6.1)
  std::vector<ContentItem> content;
  std::map<std::string, std::string> games;  // by game: Game::save()
  std::vector<std::string> merged_from;      // what it was put together from, a line each; empty: one map
};

// What is said of a map file without reading the whole of it.
struct MapFileInfo {
  int version = 0;  // of the schema
  int keyframes = 0, points = 0, content = 0, games = 0;
  std::int64_t bytes = 0;
  std::string name, program, created, saved;  // times: "2026-11-22T14:05:09Z"
  bool scale_is_known = false;
  std::vector<std::string> merged_from;
};

}  // namespace parallax
