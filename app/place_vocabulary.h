// The visual words the program comes with: assets/vocabulary/places.plxvoc (made by scripts/make-vocabulary).
//
// Safe from any thread.
#pragma once

#include <memory>

#include "place/vocabulary.h"

namespace parallax {

// Read once, when it is first asked for (some 10 ms); never null. Throws InputError when the file is not there or
// damaged.
std::shared_ptr<const Vocabulary> place_vocabulary();

}  // namespace parallax
