#include "app/game_palette.h"

#include <algorithm>
#include <cmath>

namespace parallax {
namespace {

// Of the angle between two mixtures of light: within 1.8 degrees they are the same.
constexpr float kSameMixture = 0.9995f;
constexpr float kDarkest = 1e-4f;  // linear light

DrawColour colour_of_code(unsigned rgb) {
  const auto part = [&](int shift) { return static_cast<float>((rgb >> shift) & 0xff) / 255; };
  return {part(16), part(8), part(0), 1};
}

// IEC 61966-2-1.
float linear(float c) { return c <= 0.04045f ? c / 12.92f : std::pow((c + 0.055f) / 1.055f, 2.4f); }
float encoded(float c) {
  c = std::clamp(c, 0.0f, 1.0f);
  return c <= 0.0031308f ? 12.92f * c : 1.055f * std::pow(c, 1 / 2.4f) - 0.055f;
}
Eigen::Vector3f light_of(const DrawColour& c) { return {linear(c.r), linear(c.g), linear(c.b)}; }

GamePalette palette(const char* name, const char* title, bool safe, const std::array<unsigned, kPaletteRoles>& rgb) {
  GamePalette out{name, title, safe, {}};
  std::transform(rgb.begin(), rgb.end(), out.colours.begin(), colour_of_code);
  return out;
}

}  // namespace

const std::vector<GamePalette>& game_palettes() {
  static const std::vector<GamePalette> all{
      palette("okabe_ito", "Okabe and Ito", true,
              {0xe69f00, 0x56b4e9, 0x009e73, 0xf0e442, 0x0072b2, 0xd55e00, 0xcc79a7}),
      palette("tol_muted", "Tol, muted", true, {0x999933, 0x88ccee, 0x44aa99, 0xddcc77, 0x332288, 0xcc6677, 0x882255}),
      palette("tol_vibrant", "Tol, vibrant", true,
              {0xee7733, 0x33bbee, 0x0077bb, 0xbbbbbb, 0x009988, 0xcc3311, 0xee3377}),
      palette("vivid", "vivid", false, {0xf27326, 0x735af2, 0x59d940, 0xffe01a, 0x2040ff, 0xf21f1a, 0xf2408c}),
  };
  return all;
}

const GamePalette& game_palette(const std::string& name) {
  const auto& all = game_palettes();
  const auto found = std::find_if(all.begin(), all.end(), [&](const GamePalette& p) { return p.name == name; });
  return found == all.end() ? all.front() : *found;
}

DrawColour recoloured(const DrawColour& colour, const GamePalette& palette) {
  static const std::array<Eigen::Vector3f, kPaletteRoles> drawn = [] {
    std::array<Eigen::Vector3f, kPaletteRoles> out;
    std::transform(game_palettes().front().colours.begin(), game_palettes().front().colours.end(), out.begin(),
                   light_of);
    return out;
  }();
  const Eigen::Vector3f light = light_of(colour);
  if (light.norm() < kDarkest) return colour;
  for (std::size_t role = 0; role < kPaletteRoles; ++role) {
    if (light.dot(drawn[role]) < kSameMixture * light.norm() * drawn[role].norm()) continue;
    const Eigen::Vector3f wanted = light_of(palette.colours[role]) * (light.norm() / drawn[role].norm());
    return {encoded(wanted.x()), encoded(wanted.y()), encoded(wanted.z()), colour.a};
  }
  return colour;
}

DrawnBefore DrawnBefore::of(const DrawList& list) {
  return {list.meshes.size(),       list.sprites.size(),      list.world_lines.size(),
          list.world_points.size(), list.screen_lines.size(), list.screen_points.size()};
}

void PaletteFilter::set(const GamePalette& palette) {
  if (palette_ == &palette) return;
  palette_ = &palette;
  made_.clear();
}

std::shared_ptr<const Mesh> PaletteFilter::recoloured_mesh(const std::shared_ptr<const Mesh>& mesh) {
  if (!mesh || !mesh->texture.empty()) return mesh;
  if (const auto found = made_.find(mesh); found != made_.end()) return found->second;
  auto made = std::make_shared<Mesh>(*mesh);
  bool changed = false;
  for (MeshVertex& vertex : made->vertices) {
    const DrawColour before = vertex.colour;
    vertex.colour = recoloured(before, *palette_);
    changed |= vertex.colour.r != before.r || vertex.colour.g != before.g || vertex.colour.b != before.b;
  }
  return made_[mesh] = changed ? made : mesh;
}

void PaletteFilter::apply(const DrawnBefore& before, DrawList* list) {
  if (palette_ == &game_palettes().front()) return;
  // Meshes that nobody draws any more: a game that was left, and what is made anew every frame.
  std::erase_if(made_,
                [](const auto& entry) { return entry.first.use_count() == (entry.first == entry.second ? 2 : 1); });
  const auto change = [&](auto* items, std::size_t from, auto member) {
    for (std::size_t i = from; i < items->size(); ++i) (*items)[i].*member = recoloured((*items)[i].*member, *palette_);
  };
  for (std::size_t i = before.meshes; i < list->meshes.size(); ++i)
    list->meshes[i].mesh = recoloured_mesh(list->meshes[i].mesh);
  change(&list->meshes, before.meshes, &MeshInstance::tint);
  change(&list->sprites, before.sprites, &Sprite::colour);
  change(&list->world_lines, before.world_lines, &WorldLine::colour);
  change(&list->world_points, before.world_points, &WorldPoint::colour);
  change(&list->screen_lines, before.screen_lines, &ScreenLine::colour);
  change(&list->screen_points, before.screen_points, &ScreenPoint::colour);
}

void PaletteFilter::apply(GameHud* hud) const {
  for (GameGauge& gauge : hud->gauges) gauge.colour = recoloured(gauge.colour, *palette_);
}

}  // namespace parallax
