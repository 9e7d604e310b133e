#include "app/place_vocabulary.h"

#include "app/asset_folder.h"

namespace parallax {

std::shared_ptr<const Vocabulary> place_vocabulary() {
  static const auto vocabulary =
      std::make_shared<const Vocabulary>(Vocabulary::load(asset_folder("vocabulary") + "/places.plxvoc"));
  return vocabulary;
}

}  // namespace parallax
