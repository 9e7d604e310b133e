// What the sheet of the burning glass is made of: the substances as they are, and what the sheet does with them.
//
// Lengths are in field radii, as everywhere in this game: a diffusivity in square radii a second. Temperatures are
// kelvin above the room's. Time runs kHurry times as fast as with a real glass, and the field is taken to have
// kNominalRadius_m, since the map's scale may be a guess. Values.
#pragma once

#include <array>
#include <string>
#include <vector>

namespace parallax::burning {

enum class MaterialKind { wood, paper, compact_disc };

// A substance, in SI units, and how the sun's heat gets into it and out again.
struct Substance {
  double density_kg_m3 = 500, heat_capacity_J_kgK = 1400, conductivity_W_mK = 0.12;
  double heated_depth_m = 5e-4;  // the layer that warms up while the light is there
  double metal_sheet_W_K = 0;    // conductivity times thickness of a metal layer in it
  double loss_W_m2K = 20;        // to the air and to what lies below
  double heat_per_area_J_m2K() const { return density_kg_m3 * heat_capacity_J_kgK * heated_depth_m; }
};

struct Material {
  MaterialKind kind = MaterialKind::wood;
  std::string name;
  double absorption = 0.7;            // of sunlight by the bare sheet, one less its albedo
  double char_absorption = 0.95;      // and by what is charred
  double ignition_k = 300;            // above it the sheet chars
  double char_per_s = 4;              // share of a full char a second, 100 K above the ignition
  double char_most_per_s = 8;         // however hot
  double spread_k = 0;                // and warming of each of the four cells around by its glow and its hot gases
  double smoulder_k = 0;              // warming by what a full char gives off
  double unevenness = 0.08;           // of the ignition temperature from place to place
  double smoke = 0.5, sparks = 0.35;  // particles for each cell's worth of char
  // Of its substance (made_of).
  double warming_k_per_s = 40;  // by one sun, all of it absorbed
  double diffusivity = 5e-4;    // field radii^2 / s
  double cooling_per_s = 2;     // share of the temperature
};

inline constexpr double kSunlight_W_m2 = 1000;  // a clear sky's, straight on (air mass 1.5, ASTM G173)
inline constexpr double kHurry = 20;
inline constexpr double kNominalRadius_m = 0.2;
// Between this share of the ignition temperature and the ignition the sheet is scorched, and no more.
inline constexpr double kScorchShare = 0.75;
inline constexpr double kScorchMost = 0.18, kScorchPerSecond = 0.25;
// What radiates away is left out; this is where it would stop the rise.
inline constexpr double kHottest_k = 1400;
// A cell this cold is as cold as the room.
inline constexpr float kCold_k = 1e-4f;

// The three numbers of a material that follow from its substance.
Material made_of(const Substance& substance, Material material);

const std::array<Material, 3>& materials();
std::vector<std::string> material_names();
const Material& material_of(MaterialKind kind);
const Substance& substance_of(MaterialKind kind);

}  // namespace parallax::burning
