// Where the files the program reads when it runs are: models and sounds. Looked for in this order:
//
//   $PARALLAX_ASSETS                        when it is set, there and nowhere else
//   ../share/parallax/assets                from the program's own place, as it is installed
//   assets                                  in the tree the program was built from
//
// Safe from any thread.
#pragma once

#include <string>

namespace parallax {

struct AssetPlaces {
  std::string named;      // PARALLAX_ASSETS; empty: not set
  std::string installed;  // empty: not known
  std::string source;
};

AssetPlaces asset_places();

// The folder assets/`kind` ("models", "sounds"). Throws InputError, one line with every place that was looked at.
std::string asset_folder(const std::string& kind, const AssetPlaces& places = asset_places());

}  // namespace parallax
