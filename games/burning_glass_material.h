// What the sheet is made of, as the heat and the eye know it. The map's scale may be a guess, so lengths are in field
// radii: a diffusivity in square radii a second. Temperatures are kelvin above the room's.
#pragma once

#include <array>
#include <string>
#include <vector>

namespace parallax::burning {

enum class MaterialKind { wood, paper, compact_disc };

struct Material {
  MaterialKind kind = MaterialKind::wood;
  std::string name;
  double absorption = 0.7;     // of sunlight by the bare sheet; what is charred takes kCharAbsorption
  double diffusivity = 5e-4;   // field radii^2 / s
  double cooling_per_s = 2;    // to the air, share of the temperature
  double ignition_k = 300;     // above it the sheet chars
  double char_per_s = 4;       // share of a full char a second, 100 K above the ignition
  double char_most_per_s = 8;  // however hot
  double smoulder_k = 0;       // given off by a full char: it warms the neighbours
  double unevenness = 0.08;    // of the ignition temperature from place to place
};

inline constexpr double kCharAbsorption = 0.95;
// Kelvin a second for each sun: that of a thin dark sheet, low enough for a hand to aim.
inline constexpr double kSunWarming_k_per_s = 40;
// Between this share of the ignition temperature and the ignition the sheet is scorched, and no more.
inline constexpr double kScorchShare = 0.75;
inline constexpr double kScorchMost = 0.18, kScorchPerSecond = 0.25;
// What radiates away is left out; this is where it would stop the rise.
inline constexpr double kHottest_k = 1400;
// A cell this cold is as cold as the room.
inline constexpr float kCold_k = 1e-4f;

const std::array<Material, 3>& materials();
std::vector<std::string> material_names();
const Material& material_of(MaterialKind kind);

}  // namespace parallax::burning
