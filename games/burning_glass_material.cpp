#include "games/burning_glass_material.h"

#include "core/check.h"

namespace parallax::burning {
namespace {

// Densities, heat capacities and conductivities: Incropera and DeWitt, Fundamentals of Heat and Mass Transfer, table
// A.3 (softwood; paper) and, for polycarbonate, Brandrup, Polymer Handbook. Losses: still air takes some 12 W/m2K from
// a warm face (convection and radiation together, the same book); paper has two faces, and wood and the disc lose to
// what lies deeper.
constexpr Substance kWood{510, 1380, 0.12, 5e-4, 0, 35};
constexpr Substance kPaper{930, 1340, 0.18, 1e-4, 0, 24};  // a sheet of 0.1 mm, warm all through
// Aluminium of 60 nm under the varnish: 237 W/mK.
constexpr Substance kDisc{1200, 1250, 0.20, 3e-4, 237 * 60e-9, 35};

Material wood() {
  Material out;
  out.kind = MaterialKind::wood;
  out.name = "wood";
  out.absorption = 0.60;  // planed softwood
  out.ignition_k = 280;   // chars from 300 degrees Celsius on (EN 1995-1-2, the charring line)
  out.char_per_s = 3;
  out.char_most_per_s = 6;
  out.smoulder_k = 40;
  out.unevenness = 0.10;
  out.smoke = 0.5;
  out.sparks = 0.35;
  return made_of(kWood, out);
}

Material paper() {
  Material out;
  out.kind = MaterialKind::paper;
  out.name = "paper";
  out.absorption = 0.25;  // white: an albedo of 0.75
  out.ignition_k = 213;   // 233 degrees Celsius
  out.char_per_s = 6;
  out.char_most_per_s = 12;
  // Smouldering cellulose gets to 450 to 600 degrees Celsius (Ohlemiller, Smoldering Combustion, SFPE Handbook of Fire
  // Protection Engineering).
  out.smoulder_k = 520;
  out.spread_k = 500;  // with the others a fifth of cellulose's heat of combustion, 16 MJ/kg: most of it is lost
  out.unevenness = 0.22;
  out.smoke = 0.9;
  out.sparks = 0.15;
  return made_of(kPaper, out);
}

Material disc() {
  Material out;
  out.kind = MaterialKind::compact_disc;
  out.name = "CD";
  out.absorption = 0.30;       // a disc has to reflect 70 percent (IEC 60908)
  out.char_absorption = 0.55;  // milky, not black
  out.ignition_k = 127;        // polycarbonate gives way at its glass transition, 147 degrees Celsius
  out.char_per_s = 5;
  out.char_most_per_s = 8;
  out.smoulder_k = 0;  // melts, which gives nothing off
  out.unevenness = 0.05;
  out.smoke = 0.15;
  out.sparks = 0;
  return made_of(kDisc, out);
}

}  // namespace

Material made_of(const Substance& substance, Material material) {
  const double capacity = substance.heat_per_area_J_m2K();
  const double along_W_K = substance.conductivity_W_mK * substance.heated_depth_m + substance.metal_sheet_W_K;
  material.warming_k_per_s = kHurry * kSunlight_W_m2 / capacity;
  material.cooling_per_s = kHurry * substance.loss_W_m2K / capacity;
  material.diffusivity = kHurry * along_W_K / capacity / (kNominalRadius_m * kNominalRadius_m);
  return material;
}

const std::array<Material, 3>& materials() {
  static const std::array<Material, 3> all = {wood(), paper(), disc()};
  return all;
}

std::vector<std::string> material_names() {
  std::vector<std::string> out;
  for (const Material& material : materials()) out.push_back(material.name);
  return out;
}

const Material& material_of(MaterialKind kind) {
  for (const Material& material : materials()) {
    if (material.kind == kind) return material;
  }
  PARALLAX_CHECK(false, "a material that is not in the table");
  return materials().front();
}

const Substance& substance_of(MaterialKind kind) {
  return kind == MaterialKind::wood ? kWood : kind == MaterialKind::paper ? kPaper : kDisc;
}

}  // namespace parallax::burning
