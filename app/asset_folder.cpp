#include "app/asset_folder.h"

#include <cstdlib>
#include <filesystem>
#include <system_error>
#include <vector>

#include "core/error.h"

namespace parallax {

namespace fs = std::filesystem;

AssetPlaces asset_places() {
  AssetPlaces places;
  if (const char* named = std::getenv("PARALLAX_ASSETS")) places.named = named;
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  if (!error) places.installed = (program.parent_path() / PARALLAX_ASSETS_FROM_PROGRAM).lexically_normal().string();
  places.source = PARALLAX_SOURCE_ASSETS;
  return places;
}

std::string asset_folder(const std::string& kind, const AssetPlaces& places) {
  std::vector<std::string> folders{places.installed, places.source};
  if (!places.named.empty()) folders = {places.named};
  std::string looked;
  for (const std::string& folder : folders) {
    if (folder.empty()) continue;
    const fs::path wanted = fs::path(folder) / kind;
    std::error_code error;
    if (fs::is_directory(wanted, error)) return wanted.string();
    looked += (looked.empty() ? "" : " and ") + wanted.string();
  }
  throw InputError("assets: found no folder " + (looked.empty() ? kind : looked) + ", expected the program's " + kind +
                   "; PARALLAX_ASSETS names the folder they are in");
}

}  // namespace parallax
