// Heat and char on the sheet. One explicit step of
//   dT/dt = D (Txx + Tyy) - k T + w a C + s dB/dt
// on the grid (forward in time, centred in space; LeVeque, Finite Difference Methods, section 9.1): D diffusivity, k
// cooling, C the light's concentration, w the warming by one sun, a the absorption, B the char, s what charring
// gives off. Stable while 4 D dt / h^2 + k dt <= 1; longer steps are cut. No heat crosses the sheet's border.
//
// Where the temperature is above the ignition, char grows with the excess; just below it the sheet is scorched. In the
// dark a cell chars a little less than its neighbours did, and gives off as much less: a glow that runs on dies out.
//
// Temperatures in kelvin above the room, char 0..kFullChar. A value; one thread at a time.
#pragma once

#include <cstdint>
#include <vector>

#include "games/burning_glass_grid.h"
#include "games/burning_glass_material.h"
#include "games/burning_glass_optics.h"

namespace parallax::burning {

inline constexpr std::uint16_t kFullChar = 65535;

class Sheet {
 public:
  Sheet() { clear(1); }

  // Cold and blank. The seed gives the material's unevenness.
  void clear(std::uint64_t seed);

  struct Step {
    double charred = 0;      // cells' worth of char that were added
    float hottest_k = 0;     // anywhere
    int hottest_index = 0;   // the cell of it
    SheetBox changed;        // where char was added
    bool by_light = false;   // some of it where the light is, not by heat that was left
    std::vector<int> fresh;  // cells that charred, at most a few dozen of them, for smoke
  };
  // `light` may be null: dark. `warming` scales the sun.
  const Step& advance(const Material& material, const LightOnSheet* light, double warming, double dt_s);

  // No more heat, char as it is.
  void cool();

  const std::vector<float>& temperature_k() const { return temperature_; }
  const std::vector<std::uint16_t>& charred() const { return char_; }
  const SheetBox& warm() const { return warm_; }
  const Step& last() const { return step_; }
  std::uint64_t seed() const { return seed_; }

  // Both of kSheetSize; temperatures finite, 0..kHottest_k.
  void set_temperature(std::vector<float> temperature_k);
  void set_char(std::vector<std::uint16_t> charred);

  // How many steps an interval is cut into for the material.
  static int steps_for(const Material& material, double dt_s);

 private:
  void find_warm(const SheetBox& within);
  void conduct(const Material& material, const SheetBox& box, double dt_s);
  void take_light(const Material& material, const LightOnSheet& light, double warming, double dt_s);
  double most_by_glow(int column, int row) const;
  void burn(const Material& material, const LightOnSheet* light, double dt_s);

  std::vector<float> temperature_, next_, unevenness_;
  std::vector<std::uint16_t> char_;
  SheetBox warm_;
  struct Gift {
    std::size_t cell;
    float heat_k;
  };
  std::vector<Gift> gifts_;  // of charring cells to their neighbours, during a step
  Step step_;
  std::uint64_t seed_ = 1;
};

}  // namespace parallax::burning
