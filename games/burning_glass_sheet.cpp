#include "games/burning_glass_sheet.h"

#include <cmath>
#include <utility>

#include "core/check.h"
#include "games/burning_glass_noise.h"

namespace parallax::burning {
namespace {

constexpr double kStableShare = 0.9;    // of the bound
constexpr double kHandedOn = 0.95;      // of a char, by a glow that runs on in the dark
constexpr double kGlowPerSecond = 1.5;  // share of a full char, at the most, by that glow
constexpr float kLit = 1;               // suns: more is not the dark
constexpr float kBurningLight = 3;      // suns: less makes no char of its own
constexpr std::size_t kFreshMost = 32;

double diffusivity_in_cells(const Material& material) {
  const double cells_a_radius = kSheetCells / 2.0;
  return material.diffusivity * cells_a_radius * cells_a_radius;
}

}  // namespace

void Sheet::clear(std::uint64_t seed) {
  seed_ = seed;
  temperature_.assign(kSheetSize, 0.0f);
  next_.assign(kSheetSize, 0.0f);
  char_.assign(kSheetSize, 0);
  unevenness_.resize(kSheetSize);
  for (int row = 0; row < kSheetCells; ++row) {
    for (int column = 0; column < kSheetCells; ++column) {
      const float x = static_cast<float>(column), y = static_cast<float>(row);
      const float coarse = smooth_noise(x / 7, y / 7, seed), fine = lattice_noise(column, row, seed + 1);
      unevenness_[SheetGrid::index(column, row)] = 1.2f * (coarse - 0.5f) + 0.8f * (fine - 0.5f);  // -1..1
    }
  }
  warm_ = SheetBox();
  step_ = Step();
}

void Sheet::cool() {
  std::fill(temperature_.begin(), temperature_.end(), 0.0f);
  warm_ = SheetBox();
  step_.hottest_k = 0;
}

void Sheet::set_temperature(std::vector<float> temperature_k) {
  PARALLAX_CHECK(temperature_k.size() == kSheetSize, "temperatures for another sheet");
  temperature_ = std::move(temperature_k);
  find_warm(SheetBox::all());
  step_ = Step();
}

void Sheet::set_char(std::vector<std::uint16_t> charred) {
  PARALLAX_CHECK(charred.size() == kSheetSize, "char for another sheet");
  char_ = std::move(charred);
}

void Sheet::find_warm(const SheetBox& within) {
  SheetBox box;
  for (int row = within.bottom; row < within.top; ++row) {
    const float* cells = temperature_.data() + SheetGrid::index(0, row);
    int left = within.left, right = within.right;
    while (left < right && cells[left] == 0) ++left;
    if (left == right) continue;
    while (cells[right - 1] == 0) --right;
    box.include(SheetBox{left, row, right, row + 1});
  }
  warm_ = box;
}

int Sheet::steps_for(const Material& material, double dt_s) {
  const double load = (4 * diffusivity_in_cells(material) + material.cooling_per_s) * dt_s / kStableShare;
  return std::max(1, static_cast<int>(std::ceil(load)));
}

void Sheet::conduct(const Material& material, const SheetBox& box, double dt_s) {
  // What the air takes is exact however long the step is; what flows to the neighbours is explicit.
  const double cooled = std::exp(-material.cooling_per_s * dt_s), share = diffusivity_in_cells(material) * dt_s;
  const float spread = static_cast<float>(cooled * share);
  const float keep = static_cast<float>(cooled * (1 - 4 * share));
  for (int row = box.bottom; row < box.top; ++row) {
    const float* here = temperature_.data() + SheetGrid::index(0, row);
    const float* below = row > 0 ? here - kSheetCells : here;
    const float* above = row + 1 < kSheetCells ? here + kSheetCells : here;
    float* out = next_.data() + SheetGrid::index(0, row);
    const auto at = [&](int column, int left, int right) {
      const float value = keep * here[column] + spread * (here[left] + here[right] + below[column] + above[column]);
      out[column] = value < kCold_k ? 0.0f : value;
    };
    int begin = box.left, end = box.right;
    if (begin == 0) at(begin++, 0, 1);
    if (end == kSheetCells) {
      --end;
      at(end, end - 1, end);
    }
    for (int column = begin; column < end; ++column) at(column, column - 1, column + 1);
  }
  for (int row = box.bottom; row < box.top; ++row) {
    const std::size_t from = SheetGrid::index(box.left, row),
                      to = SheetGrid::index(0, row) + static_cast<std::size_t>(box.right);
    std::copy(next_.begin() + static_cast<std::ptrdiff_t>(from), next_.begin() + static_cast<std::ptrdiff_t>(to),
              temperature_.begin() + static_cast<std::ptrdiff_t>(from));
  }
}

void Sheet::take_light(const Material& material, const LightOnSheet& light, double warming, double dt_s) {
  const float gain = static_cast<float>(material.warming_k_per_s * warming * dt_s);
  const float bare = static_cast<float>(material.absorption),
              more = static_cast<float>(material.char_absorption) - bare;
  for (int row = light.box.bottom; row < light.box.top; ++row) {
    for (int column = light.box.left; column < light.box.right; ++column) {
      const std::size_t i = SheetGrid::index(column, row);
      const float black = static_cast<float>(char_[i]) / kFullChar;
      const float value = temperature_[i] + gain * (bare + more * black) * light.concentration[i];
      temperature_[i] = std::min(value, static_cast<float>(kHottest_k));
    }
  }
}

// As far as the glow can char a cell in the dark: a little less than the most charred of its neighbours.
double Sheet::most_by_glow(int column, int row) const {
  std::uint16_t most = 0;
  const std::size_t i = SheetGrid::index(column, row);
  if (column > 0) most = std::max(most, char_[i - 1]);
  if (column + 1 < kSheetCells) most = std::max(most, char_[i + 1]);
  if (row > 0) most = std::max(most, char_[i - kSheetCells]);
  if (row + 1 < kSheetCells) most = std::max(most, char_[i + kSheetCells]);
  return std::max(kScorchMost, kHandedOn * most / kFullChar);
}

void Sheet::burn(const Material& material, const LightOnSheet* light, double dt_s) {
  const float ignition = static_cast<float>(material.ignition_k);
  const float uneven = static_cast<float>(material.unevenness);
  const float scorch = static_cast<float>(kScorchShare);
  const float least = scorch * ignition * (1 - uneven);
  for (int row = warm_.bottom; row < warm_.top; ++row) {
    for (int column = warm_.left; column < warm_.right; ++column) {
      const std::size_t i = SheetGrid::index(column, row);
      const float temperature = temperature_[i];
      if (temperature > step_.hottest_k) {
        step_.hottest_k = temperature;
        step_.hottest_index = static_cast<int>(i);
      }
      if (temperature < least || char_[i] == kFullChar) continue;
      const float own_ignition = ignition * (1 + uneven * unevenness_[i]);
      double rate = 0, most = 1;
      if (temperature > own_ignition) {
        rate = std::min(material.char_per_s * (temperature - own_ignition) / 100, material.char_most_per_s);
        if (light == nullptr || light->concentration[i] < kLit) {
          most = most_by_glow(column, row);
          rate = std::min(rate, kGlowPerSecond);
        }
      } else if (temperature > scorch * own_ignition) {
        rate = kScorchPerSecond;
        most = kScorchMost;
      }
      const int before = char_[i];
      const int after = static_cast<int>(std::min(before + rate * dt_s * kFullChar, most * kFullChar));
      if (after <= before) continue;
      char_[i] = static_cast<std::uint16_t>(after);
      const double added = static_cast<double>(after - before) / kFullChar;
      step_.charred += added;
      step_.changed.include(column, row);
      step_.by_light = step_.by_light || (light != nullptr && light->concentration[i] > kBurningLight);
      if (rate > kScorchPerSecond && step_.fresh.size() < kFreshMost) step_.fresh.push_back(static_cast<int>(i));
      temperature_[i] =
          std::min(temperature + static_cast<float>(material.smoulder_k * added), static_cast<float>(kHottest_k));
      if (rate <= kScorchPerSecond || material.spread_k <= 0) continue;
      // To all eight neighbours, so that what spreads keeps no corners: over a straight edge a cell gets a little more
      // than one whole gift.
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) {
          const int x = column + dx, y = row + dy;
          if ((dx == 0 && dy == 0) || x < 0 || y < 0 || x >= kSheetCells || y >= kSheetCells) continue;
          const double part = dx == 0 || dy == 0 ? 0.58 : 0.29;
          gifts_.push_back({SheetGrid::index(x, y), static_cast<float>(part * material.spread_k * added)});
        }
    }
  }
  // After all cells, so that the order in which they are looked at has no effect.
  for (const Gift& gift : gifts_) {
    temperature_[gift.cell] = std::min(temperature_[gift.cell] + gift.heat_k, static_cast<float>(kHottest_k));
    warm_.include(static_cast<int>(gift.cell % kSheetCells), static_cast<int>(gift.cell / kSheetCells));
  }
  gifts_.clear();
}

const Sheet::Step& Sheet::advance(const Material& material, const LightOnSheet* light, double warming, double dt_s) {
  step_.charred = 0;
  step_.hottest_k = 0;
  step_.hottest_index = 0;
  step_.changed = SheetBox();
  step_.by_light = false;
  step_.fresh.clear();
  const int steps = steps_for(material, dt_s);
  SheetBox reach = warm_;
  for (int i = 0; i < steps; ++i) {
    reach = reach.grown(1);
    if (!reach.empty()) conduct(material, reach, dt_s / steps);
  }
  if (light != nullptr && !light->box.empty()) {
    take_light(material, *light, warming, dt_s);
    reach.include(light->box);
  }
  if (!reach.empty()) find_warm(reach);
  burn(material, light, dt_s);
  return step_;
}

}  // namespace parallax::burning
