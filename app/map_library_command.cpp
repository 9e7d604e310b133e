// `parallax map list`, `name`, `lock`, `unlock`, `unmerge` and `delete`: the maps that the program keeps by itself.
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "app/command.h"
#include "app/map_library.h"
#include "app/map_merge_record.h"
#include "core/error.h"

namespace parallax {
namespace {

namespace fs = std::filesystem;

// The folder of a map is its library.
MapLibrary library_of(const std::string& path) {
  if (!fs::exists(path)) throw InputError(path + ": found no such file, expected a map file");
  return MapLibrary(fs::absolute(path).parent_path().string());
}

void list_maps(std::string folder) {
  if (folder.empty()) folder = map_library_folder();
  if (folder.empty()) throw InputError("map list: found no home folder, expected --maps FOLDER");
  check_map_folder(folder);
  const std::vector<LibraryMap> maps = MapLibrary(folder).list();
  if (maps.empty()) std::cout << folder << ": no maps\n";
  for (const LibraryMap& map : maps) {
    std::cout << map.path << "\n  " << map.title;
    if (!map.problem.empty()) {
      std::cout << ": " << map.problem << '\n';
      continue;
    }
    std::cout << ": " << map.info.keyframes << " keyframes, " << map.info.points << " points, " << map.info.content
              << " things on it, " << map.info.games << " games, images of " << map.width << 'x' << map.height
              << (map.info.merged_from.size() > 1 ? ", merged from " + std::to_string(map.info.merged_from.size()) : "")
              << (map.locked ? ", locked" : "") << (map.in_use ? ", in use" : "") << ", saved " << map.info.saved
              << '\n';
  }
}

}  // namespace

void add_map_library_commands(CLI::App* command) {
  {
    auto folder = std::make_shared<std::string>();
    CLI::App* sub = command->add_subcommand("list", "List the maps that are kept by themselves, the newest first");
    sub->add_option("--maps", *folder, "Folder; default: the user's own");
    sub->callback([folder] { list_maps(*folder); });
  }
  {
    auto path = std::make_shared<std::string>(), name = std::make_shared<std::string>();
    CLI::App* sub = command->add_subcommand("name", "Give a map a name; an empty one takes it away");
    sub->add_option("map", *path, "Map file")->required();
    sub->add_option("name", *name, "The name, one line")->required();
    sub->callback([path, name] { library_of(*path).rename(*path, *name); });
  }
  for (const bool lock : {true, false}) {
    auto path = std::make_shared<std::string>();
    CLI::App* sub =
        command->add_subcommand(lock ? "lock" : "unlock", lock ? "Lock a map: it is known again, and never written"
                                                               : "Unlock a map: it adapts and is saved again");
    sub->add_option("map", *path, "Map file")->required();
    sub->callback([path, lock] {
      library_of(*path);
      MapLibrary::set_locked(*path, lock);
    });
  }
  {
    auto path = std::make_shared<std::string>();
    CLI::App* sub = command->add_subcommand(
        "unmerge", "Undo the merge of two maps: both are as they were before, the merged one goes to the trash");
    sub->add_option("map", *path, "Merged map file")->required();
    sub->callback([path] {
      const UndoneMerge undone = undo_merge(library_of(*path), fs::absolute(*path).string());
      std::cout << undone.pair.base << '\n' << undone.pair.other << '\n';
    });
  }
  auto path = std::make_shared<std::string>();
  CLI::App* sub = command->add_subcommand(
      "delete", "Move a map to the trash folder beside it (" + std::to_string(MapLibrary::kTrashDays) + " days)");
  sub->add_option("map", *path, "Map file")->required();
  sub->callback([path] { std::cout << library_of(*path).remove(fs::absolute(*path).string()) << '\n'; });
}

}  // namespace parallax
