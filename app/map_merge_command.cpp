// `parallax map merge`: maps of one place, made apart, become one.
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <memory>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "app/command.h"
#include "app/map_merge_record.h"
#include "app/place_vocabulary.h"
#include "camera/calibration_file.h"
#include "core/error.h"
#include "map/map_file.h"
#include "mapper/map_merge.h"

namespace parallax {
namespace {

struct MergeArguments {
  std::vector<std::string> maps;
  std::string output;
};

struct MapToMerge {
  std::string path;
  MapDocument document;
  CameraModel camera;
  std::vector<std::string> origin;  // what merged_from says of it
};

MapToMerge read_map(const std::string& path) {
  if (!std::filesystem::exists(path)) throw InputError(path + ": found no such file, expected a map file");
  MapToMerge out;
  out.path = path;
  out.document = read_map_file(path);
  out.camera = parse_calibration(out.document.calibration, path + ": calibration");
  out.origin = merge_origin(path, out.document);
  out.document.merged_from.clear();
  return out;
}

void check_arguments(const MergeArguments& args) {
  if (args.maps.size() < 2) throw InputError("map merge: found one map, expected two or more");
  std::error_code error;
  for (const std::string& path : args.maps)
    if (std::filesystem::equivalent(path, args.output, error))
      throw InputError("--output " + args.output + ": found one of the maps to merge, expected another file");
}

// Every map that finds a place in what was merged so far; those that do not are tried again while others do.
int merge(const MergeArguments& args) {
  check_arguments(args);
  std::vector<MapToMerge> maps;
  for (const std::string& path : args.maps) maps.push_back(read_map(path));
  MapToMerge merged = std::move(maps.front());
  maps.erase(maps.begin());
  for (const MapToMerge& map : maps)
    if (!(map.camera == merged.camera))
      throw InputError(map.path + ": found another lens than in " + merged.path + ", expected maps of one camera");
  std::string reason;
  for (bool progress = true; progress && !maps.empty();) {
    progress = false;
    for (std::size_t i = 0; i < maps.size();) {
      MapMergeResult result =
          merge_maps(merged.document, maps[i].document, merged.camera, place_vocabulary(), MapMergeOptions());
      if (!result.merged) {
        reason = maps[i].path + ": not merged: " + result.reason;
        ++i;
        continue;
      }
      std::cout << maps[i].path << ": merged: " << result.alignments << " places agree, " << result.points_fused
                << " points fused, " << result.common_points << " points seen in both, " << result.measurements_added
                << " measurements added, " << result.keyframes_removed << " keyframes removed; its scale is "
                << std::setprecision(4) << result.base_from_other.s << " of the first map's\n";
      merged.document = std::move(result.document);
      merged.origin.insert(merged.origin.end(), maps[i].origin.begin(), maps[i].origin.end());
      maps.erase(maps.begin() + static_cast<std::ptrdiff_t>(i));
      progress = true;
    }
  }
  if (!maps.empty()) throw RunError(reason);
  merged.document.merged_from = merged.origin;
  write_map_file(merged.document, args.output, std::string("parallax ") + PARALLAX_VERSION);
  std::cout << args.output << ": " << merged.document.map.keyframes.size() << " keyframes, "
            << merged.document.map.points.size() << " points, " << merged.document.content.size() << " things placed, "
            << merged.document.games.size() << " games\n";
  return kExitDone;
}

}  // namespace

void add_map_merge_command(CLI::App* command, int* exit_code) {
  auto args = std::make_shared<MergeArguments>();
  CLI::App* sub = command->add_subcommand("merge", "Merge maps of one place; the files given are not changed");
  sub->add_option("maps", args->maps, "Map files; the first one's world is kept")->required();
  sub->add_option("--output", args->output, "Map file to write")->required();
  sub->callback([args, exit_code] { *exit_code = merge(*args); });
}

}  // namespace parallax
