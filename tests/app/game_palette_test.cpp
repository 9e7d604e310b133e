// The games' colours: told apart by people with any colour vision, and every shade of them replaced.
#include "app/game_palette.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace parallax {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// In linear light, severity 1: Machado, Oliveira, Fernandes, "A Physiologically-based Model for Simulation of Color
// Vision Deficiency", IEEE TVCG 15 (2009), supplementary table.
Matrix3d protanopia() {
  return (Matrix3d() << 0.152286, 1.052583, -0.204868, 0.114503, 0.786281, 0.099216, -0.003882, -0.048116, 1.051998)
      .finished();
}
Matrix3d deuteranopia() {
  return (Matrix3d() << 0.367322, 0.860646, -0.227968, 0.280085, 0.672501, 0.047413, -0.011820, 0.042940, 0.968881)
      .finished();
}

double linear(double c) { return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4); }

// CIE L*a*b* (1976) under D65 of a colour as it is seen.
Vector3d lab(const DrawColour& colour, const Matrix3d& seen) {
  const Vector3d light = seen * Vector3d(linear(static_cast<double>(colour.r)), linear(static_cast<double>(colour.g)),
                                         linear(static_cast<double>(colour.b)));
  Matrix3d xyz_from_rgb;
  xyz_from_rgb << 0.4124564, 0.3575761, 0.1804375, 0.2126729, 0.7151522, 0.0721750, 0.0193339, 0.1191920, 0.9503041;
  const Vector3d xyz = xyz_from_rgb * light.cwiseMax(0).cwiseMin(1);
  const Vector3d white(0.95047, 1, 1.08883);
  Vector3d f;
  for (int i = 0; i < 3; ++i) {
    const double t = xyz[i] / white[i];
    f[i] = t > 216.0 / 24389 ? std::cbrt(t) : (24389.0 / 27 * t + 16) / 116;
  }
  return {116 * f.y() - 16, 500 * (f.x() - f.y()), 200 * (f.y() - f.z())};
}

double distance(const DrawColour& a, const DrawColour& b, const Matrix3d& seen) {
  return (lab(a, seen) - lab(b, seen)).norm();
}

using Role = PaletteRole;
// What must not be taken for one another: the four critters; full and low health; marble, coin, goal and rim.
constexpr std::pair<Role, Role> kTold[] = {
    {Role::orange, Role::sky},     {Role::orange, Role::green}, {Role::orange, Role::purple},
    {Role::sky, Role::green},      {Role::sky, Role::purple},   {Role::green, Role::purple},
    {Role::sky, Role::vermillion}, {Role::green, Role::yellow}, {Role::sky, Role::yellow}};

TEST(GamePalette, SafeOnesAreToldApartUnderColourBlindness) {
  int safe = 0;
  for (const GamePalette& palette : game_palettes()) {
    double least = 1e9;
    for (const Matrix3d& seen : {Matrix3d(Matrix3d::Identity()), protanopia(), deuteranopia()})
      for (const auto& [a, b] : kTold) least = std::min(least, distance(palette.colour(a), palette.colour(b), seen));
    RecordProperty(palette.name, std::to_string(least));
    if (!palette.colour_blind_safe) {
      EXPECT_LT(least, 15) << palette.name << " could be called safe";
      continue;
    }
    ++safe;
    EXPECT_GT(least, 15) << palette.name;
  }
  EXPECT_GE(safe, 3);
}

// Three names for the same colours would be one palette.
TEST(GamePalette, SafeOnesDifferFromEachOther) {
  for (const GamePalette& a : game_palettes()) {
    for (const GamePalette& b : game_palettes()) {
      if (&a == &b || !a.colour_blind_safe || !b.colour_blind_safe) continue;
      for (const Matrix3d& seen : {protanopia(), deuteranopia()}) {
        double sum = 0;
        for (std::size_t i = 0; i < kPaletteRoles; ++i) sum += distance(a.colours[i], b.colours[i], seen);
        EXPECT_GT(sum / kPaletteRoles, 15) << a.name << " and " << b.name;
      }
    }
  }
}

TEST(GamePalette, TheSimulationKnowsRedAndGreen) {
  const DrawColour red{0.75f, 0.25f, 0.1f, 1}, green{0.45f, 0.5f, 0.05f, 1};
  EXPECT_GT(distance(red, green, Matrix3d::Identity()), 2.5 * distance(red, green, deuteranopia()));
  const DrawColour white{1, 1, 1, 1};
  EXPECT_LT(distance(white, {0.999f, 0.999f, 0.999f, 1}, protanopia()), 1);
}

TEST(GamePalette, EveryShadeIsReplacedAndNothingElse) {
  const GamePalette& drawn = game_palettes().front();
  const GamePalette& other = game_palette("tol_muted");
  ASSERT_EQ(other.name, "tol_muted");
  EXPECT_EQ(game_palette("no such").name, drawn.name);
  for (std::size_t i = 0; i < kPaletteRoles; ++i) {
    DrawColour faint = drawn.colours[i];
    faint.a = 0.25f;
    const DrawColour now = recoloured(faint, other);
    EXPECT_NEAR(now.r, other.colours[i].r, 0.004f);
    EXPECT_NEAR(now.g, other.colours[i].g, 0.004f);
    EXPECT_NEAR(now.b, other.colours[i].b, 0.004f);
    EXPECT_EQ(now.a, 0.25f);
    EXPECT_LT(distance(recoloured(faint, drawn), faint, Matrix3d::Identity()), 0.5);
  }
  for (const DrawColour& kept : {DrawColour{1, 1, 1, 1}, DrawColour{0, 0, 0, 1}, DrawColour{0.5f, 0.5f, 0.52f, 1}}) {
    const DrawColour now = recoloured(kept, other);
    EXPECT_EQ(now.r, kept.r);
    EXPECT_EQ(now.b, kept.b);
  }
}

TEST(GamePalette, TheFilterChangesWhatTheGameDrewOnly) {
  const GamePalette& drawn = game_palettes().front();
  auto mesh = std::make_shared<Mesh>();
  mesh->vertices.resize(3);
  mesh->vertices[0].colour = drawn.colour(Role::green);
  mesh->indices = {0, 1, 2};
  DrawList list;
  Sprite spark;
  spark.colour = drawn.colour(Role::orange);
  list.sprites.push_back(spark);  // somebody else's
  const DrawnBefore before = DrawnBefore::of(list);
  const auto draw = [&] {
    list.meshes = {MeshInstance{mesh, Eigen::Affine3f::Identity(), drawn.colour(Role::sky), 0, true}};
    list.sprites.resize(1);
    list.sprites.push_back(spark);
  };
  PaletteFilter filter;
  draw();
  filter.apply(before, &list);
  EXPECT_EQ(list.meshes[0].mesh, mesh) << "the first palette is what games draw with";
  filter.set(game_palette("tol_vibrant"));
  filter.apply(before, &list);
  const GamePalette& vibrant = game_palette("tol_vibrant");
  EXPECT_EQ(list.sprites[0].colour.r, drawn.colour(Role::orange).r);
  EXPECT_NEAR(list.sprites[1].colour.g, vibrant.colour(Role::orange).g, 0.004f);
  EXPECT_NEAR(list.meshes[0].tint.g, vibrant.colour(Role::sky).g, 0.004f);
  const auto first = list.meshes[0].mesh;
  EXPECT_NEAR(first->vertices[0].colour.b, vibrant.colour(Role::green).b, 0.004f);
  EXPECT_EQ(first->vertices[1].colour.b, 1);
  draw();
  filter.apply(before, &list);
  EXPECT_EQ(list.meshes[0].mesh, first) << "made once";
}

}  // namespace
}  // namespace parallax
