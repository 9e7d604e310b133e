#include "games/burning_glass_material.h"

#include "core/check.h"

namespace parallax::burning {

// The order of the temperatures and conductivities is that of the real things (wood chars from about 280 to 300 degrees
// Celsius, paper from about 230, polycarbonate gives way near 250 and carries a metal layer); their sizes were chosen
// for play: see docs/games/burning_glass.md.
const std::array<Material, 3>& materials() {
  static const std::array<Material, 3> all = {
      Material{MaterialKind::wood, "wood", 0.70, 4e-4, 4.0, 280, 4, 8, 40, 0.10},
      Material{MaterialKind::paper, "paper", 0.55, 3e-4, 3.2, 210, 6, 12, 330, 0.22},
      Material{MaterialKind::compact_disc, "CD", 0.60, 6e-4, 4.5, 230, 5, 8, 0, 0.05},
  };
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

}  // namespace parallax::burning
