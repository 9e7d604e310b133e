// What the player sees of the burning glass: sheet, light, sun, rim, and the lines of text.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "games/burning_glass.h"
#include "games/burning_glass_info.h"
#include "render/mesh_shapes.h"

namespace parallax {

using namespace burning;

namespace {

constexpr float kBurnHeight = 0.0015f, kLightHeight = 0.003f;  // over the plane, field radii
constexpr double kBeamLength = 0.55;                           // of the line towards the sun, field radii
constexpr double kSunAt = 0.62, kSunSize = 0.16;               // along that line, field radii
constexpr double kHidesView_rad = 0.14;                        // nearer to the view's axis the sun fades
constexpr int kRimSegments = 72;
constexpr DrawColour kSunlight{1.0f, 0.86f, 0.45f, 1.0f};
constexpr DrawColour kBlue{0.34f, 0.71f, 0.91f, 1}, kOrange{0.90f, 0.62f, 0.0f, 1}, kVermillion{0.84f, 0.37f, 0.0f, 1};

Eigen::Affine3f single_precision(const RigidTransform& transform) {
  Eigen::Affine3f out = Eigen::Affine3f::Identity();
  out.linear() = transform.R.cast<float>();
  out.translation() = transform.t.cast<float>();
  return out;
}

// Brightness of the focus on a logarithmic scale: 0 the bare sun, 1 all light in the picture of the sun.
double focus_share(double peak, double focal_length, double diameter) {
  const double best = diameter / (focal_length * kSunDiameter_rad);
  return std::clamp(std::log(std::max(1.0, peak)) / std::log(std::max(2.0, 0.6 * best * best)), 0.0, 1.0);
}

std::string with_number(const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

DrawColour between(const DrawColour& a, const DrawColour& b, float share) {
  return {a.r + share * (b.r - a.r), a.g + share * (b.g - a.g), a.b + share * (b.b - a.b), a.a + share * (b.a - a.a)};
}

}  // namespace

std::string BurningGlass::advice() const {
  if (!camera_from_plane_) return "Look at the table";
  if (covered_) return "";
  if (!sheet_.last().fresh.empty()) return "";
  const LightPath path(lens_of(*camera_from_plane_), towards_sun());
  const Eigen::Vector3d lens = lens_of(*camera_from_plane_).centre_m;
  if (!(lens.z() > 0)) return "";
  const Eigen::Vector2d spot = (lens - towards_sun() * (lens.z() / towards_sun().z())).head<2>();
  if (path.facing() < 0.5) return "Turn the sun: it meets the lens from the side";
  if (spot.cwiseAbs().maxCoeff() > grid_.half_extent_m) return "The light falls beside the field";
  // How far from the focus, as the share of the lens's width that the light still has.
  const double miss = path.focus_m().z() / (lens.z() - path.focus_m().z());
  if (miss > 0.06) return "Lower the camera";
  if (miss < -0.06) return "Raise the camera";
  return "";
}

GameHud BurningGlass::hud() const {
  GameHud out;
  out.score = std::count_if(sheet_.charred().begin(), sheet_.charred().end(), [](auto c) { return c > kFullChar / 2; });
  const double to_degrees = 180 / std::numbers::pi;
  out.lines.push_back(material().name + (controls_.lens_shape == 0 ? "" : ", simple glass"));
  out.lines.push_back(with_number("focal length %.2f", controls_.focal_length));
  out.lines.push_back(with_number("sun %.0f deg high", controls_.elevation_rad * to_degrees));
  out.lines.push_back("strokes " + std::to_string(strokes_.count()));
  if (covered_) out.lines.push_back("lens covered");
  const double focus = focus_share(light_.peak, controls_.focal_length, controls_.lens_diameter);
  const double heat = std::clamp(sheet_.last().hottest_k / (1.5 * material().ignition_k), 0.0, 1.0);
  const bool burns = sheet_.last().hottest_k > material().ignition_k;
  out.gauges.push_back({"focus", focus, kBlue});
  out.gauges.push_back({"heat", heat, burns ? kVermillion : kOrange});
  out.message = advice();
  return out;
}

void BurningGlass::draw(const ModelSet& models, DrawList* out) const {
  draw_sheet(out);
  draw_sun(models, out);
  particles_.draw(single_precision(field_.world_from_plane), grid_.half_extent_m, out);
  draw_rim(out);
}

void BurningGlass::draw_sheet(DrawList* out) const {
  if (pictures_.version != shown_version_ || pictures_.burn_mesh == nullptr) {
    const float side = static_cast<float>(2 * grid_.half_extent_m);
    if (!pictures_.stale.empty() || pictures_.burn_mesh == nullptr) {
      pictures_.burn.paint(material(), sheet_.charred(), pictures_.stale);
      pictures_.stale = SheetBox();
      pictures_.burn_mesh = quad_mesh(side, side, pictures_.burn.picture().clone(), false);
    }
    pictures_.light_mesh = quad_mesh(
        side, side,
        light_picture(shown_, shown_box_, kRaysPerTick * kTicksPerPicture, sheet_.temperature_k(), sheet_.warm()),
        false);
    pictures_.version = shown_version_;
  }
  const Eigen::Affine3f world_from_plane = single_precision(field_.world_from_plane);
  const float radius = static_cast<float>(grid_.half_extent_m);
  MeshInstance instance;
  instance.casts_shadow = false;
  instance.mesh = pictures_.burn_mesh;
  instance.world_from_model = world_from_plane * Eigen::Translation3f(0, 0, kBurnHeight * radius);
  out->meshes.push_back(instance);
  instance.mesh = pictures_.light_mesh;
  instance.emission = 1;
  instance.world_from_model = world_from_plane * Eigen::Translation3f(0, 0, kLightHeight * radius);
  out->meshes.push_back(instance);
  // The brightest place shines into the eye.
  if (sheet_.last().hottest_k > 0.6 * material().ignition_k && light_.peak > 20) {
    const int cell = sheet_.last().hottest_index;
    const Eigen::Vector2d at = grid_.centre_of(cell % kSheetCells, cell / kSheetCells);
    const float share = std::min(1.0f, sheet_.last().hottest_k / static_cast<float>(2 * material().ignition_k));
    Sprite glare;
    glare.position = world_from_plane *
                     Eigen::Vector3f(static_cast<float>(at.x()), static_cast<float>(at.y()), 2 * kLightHeight * radius);
    glare.additive = true;
    glare.radius_m = radius * (0.035f + 0.03f * share);
    glare.colour = {1, 0.78f, 0.42f, 0.55f * share};
    out->sprites.push_back(glare);
  }
}

// The sun stands at the end of its beam on the table: a beam that is seen as a point runs along the view.
void BurningGlass::draw_sun(const ModelSet& models, DrawList* out) const {
  const Eigen::Vector3d towards = towards_sun();
  const double radius = grid_.half_extent_m;
  Eigen::Vector2d foot = Eigen::Vector2d::Zero();
  double fade = 1;
  if (camera_from_plane_) {
    const Eigen::Vector3d lens = lens_of(*camera_from_plane_).centre_m;
    if (lens.z() > 0) foot = (lens - towards * (lens.z() / towards.z())).head<2>();
    if (!(foot.norm() < 1.5 * radius)) foot *= 1.5 * radius / foot.norm();
    const Eigen::Vector3d base(foot.x(), foot.y(), 0);
    const Eigen::Vector3d eye = (base - lens).normalized(), to_sun = (base + kSunAt * radius * towards - lens);
    const double angle = std::acos(std::clamp(eye.dot(to_sun.normalized()), -1.0, 1.0));
    // Neither across the view of the spot nor into the lens.
    fade =
        std::clamp(angle / kHidesView_rad - 0.6, 0.0, 1.0) * std::clamp(to_sun.norm() / (0.3 * radius) - 1, 0.0, 1.0);
  }
  if (fade < 0.02) return;
  const Eigen::Affine3f world_from_plane = single_precision(field_.world_from_plane);
  const Eigen::Vector3d base(foot.x(), foot.y(), 0);
  const Eigen::Vector3d sideways = towards.unitOrthogonal(), upwards = towards.cross(sideways);
  for (int i = 0; i < 5; ++i) {
    const double angle = 2 * std::numbers::pi * i / 4;
    const double offset = i == 4 ? 0 : 0.035 * radius;
    Eigen::Vector3d start = base + offset * (std::cos(angle) * sideways + std::sin(angle) * upwards);
    start -= towards * (start.z() / towards.z());  // down to the table
    WorldLine line;
    line.a = world_from_plane * Eigen::Vector3f((start + 0.04 * radius * towards).cast<float>());
    line.b = world_from_plane *
             Eigen::Vector3f((base + (start - base) * 0.4 + kBeamLength * radius * towards).cast<float>());
    line.colour = kSunlight;
    line.colour.a = static_cast<float>((i == 4 ? 0.75 : 0.35) * fade);
    line.width_px = i == 4 ? 1.8f : 1.2f;
    out->world_lines.push_back(line);
  }
  Eigen::Affine3f plane_from_sun = Eigen::Affine3f::Identity();
  const float size = static_cast<float>(kSunSize * radius);
  const Eigen::Vector3d at = base + kSunAt * radius * towards;
  plane_from_sun.translate(Eigen::Vector3f(at.cast<float>() - Eigen::Vector3f(0, 0, size / 2))).scale(size);
  DrawColour tint{1, 1, 1, static_cast<float>(fade)};
  if (!models.contains("sun")) tint = {1, 0.8f, 0.25f, static_cast<float>(fade)};
  const std::size_t first = out->meshes.size();
  draw_model(models.model("sun"), world_from_plane * plane_from_sun, tint, 1, {}, out);
  for (std::size_t i = first; i < out->meshes.size(); ++i) out->meshes[i].casts_shadow = false;
  Sprite halo;
  halo.position = world_from_plane * Eigen::Vector3f(at.cast<float>());
  halo.radius_m = 1.3f * size;
  halo.additive = true;
  halo.colour = {1, 0.75f, 0.3f, static_cast<float>(0.35 * fade)};
  out->sprites.push_back(halo);
}

void BurningGlass::draw_rim(DrawList* out) const {
  const double width = out->camera.width(), height = out->camera.height();
  if (!(width > 0 && height > 0)) return;
  // A larger lens has a wider rim; what is inside it is seen through the glass.
  const double share = (controls_.lens_diameter - kLeastDiameter) / (kMostDiameter - kLeastDiameter);
  const double radius = (0.34 + 0.13 * std::clamp(share, 0.0, 1.0)) * std::min(width, height);
  const float focus = static_cast<float>(focus_share(light_.peak, controls_.focal_length, controls_.lens_diameter));
  const DrawColour steel = between({0.80f, 0.84f, 0.88f, 0.85f}, {1.0f, 0.70f, 0.25f, 0.95f}, focus * focus);
  const Eigen::Vector2d centre = out->camera.centre_px();
  const auto ring = [&](double ring_radius, const DrawColour& colour, float line_width, double from, double to) {
    const int segments = std::max(1, static_cast<int>(std::ceil(kRimSegments * (to - from))));
    const auto at = [&](int i) {
      const double angle = 2 * std::numbers::pi * (from + (to - from) * i / segments);
      return Eigen::Vector2f((centre + ring_radius * Eigen::Vector2d(std::cos(angle), std::sin(angle))).cast<float>());
    };
    for (int i = 0; i < segments; ++i) {
      ScreenLine line;
      line.a_px = at(i);
      line.b_px = at(i + 1);
      line.colour = colour;
      line.width_px = line_width;
      out->screen_lines.push_back(line);
    }
  };
  const float scale = static_cast<float>(height / 480);
  ring(radius, {0.10f, 0.11f, 0.13f, 0.55f}, 6 * scale, 0, 1);
  ring(radius, steel, 3 * scale, 0, 1);
  ring(radius - 5 * scale, {1, 1, 1, 0.25f}, 1.2f * scale, 0, 1);
  ring(radius - 9 * scale, {1, 1, 1, 0.55f}, 2 * scale, 0.55, 0.68);  // a reflection in the glass
  if (covered_) ring(0.985 * radius, {0.05f, 0.05f, 0.06f, 0.8f}, 10 * scale, 0, 1);
}

}  // namespace parallax
