// What a game costs a frame: the simulation's tick and the drawing off-screen at 640x480, four samples a pixel, for
// Swarm with a horde of 0 to 200 critters on the screen, a level of Marbles, and a burning glass at work.
//
//   bench_game_drawing [FRAMES]
//
// Columns: milliseconds of a tick of the simulation (median), of making the list, of drawing it (median and 95th
// percentile, without and with reading the pixels back), instances of meshes, those that cast shadows, triangles,
// sprites and lines. Every instance is a draw call, every shadow another one; sprites and lines are one each.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>

#include "games/burning_glass.h"
#include "games/marbles_game.h"
#include "games/swarm_draw.h"
#include "games/swarm_rules.h"
#include "games/swarm_simulation.h"
#include "render/gl_context.h"
#include "render/model_set.h"
#include "render/scene_renderer.h"

using namespace parallax;

namespace {

constexpr int kWidth = 640, kHeight = 480;
constexpr double kRadius_m = 0.25;

// From the player's side of the table.
RigidTransform camera_from_plane() {
  const Eigen::Vector3d eye(0, -0.5, 0.45), z = (-eye).normalized(), x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d R;
  R.row(0) = x;
  R.row(1) = z.cross(x);
  R.row(2) = z;
  return {R, -R * eye};
}

double milliseconds(const std::function<void()>& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
}

double part_of(std::vector<double> values, double part) {
  std::sort(values.begin(), values.end());
  return values.empty() ? 0 : values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1))];
}

void measure(const char* name, int frames, const std::function<void()>& tick,
             const std::function<void(DrawList*)>& draw) {
  OffscreenContext context(kWidth, kHeight);
  SceneRenderer renderer;
  std::vector<double> ticks, listing, drawing, reading;
  DrawList list;
  for (int frame = 0; frame < frames + 2; ++frame) {
    double tick_ms = 0;
    for (int k = 0; k < 4; ++k) tick_ms += milliseconds(tick) / 4;
    list = DrawList();
    list.camera = CameraModel(CameraModelKind::fov, kWidth, kHeight, {375, 376}, {322.3, 237.1}, {0.9}, 1);
    list.background = cv::Mat3b(kHeight, kWidth, cv::Vec3b(120, 130, 140));
    list.camera_from_world = camera_from_plane();
    const double listing_ms = milliseconds([&] { draw(&list); });
    const double drawing_ms = milliseconds([&] {
      renderer.draw(list, {0, 0, kWidth, kHeight});
      read_framebuffer(1, 1);  // waits for the picture
    });
    const double reading_ms = milliseconds([&] { read_framebuffer(kWidth, kHeight); });
    if (frame < 2) continue;  // shaders, uploads
    ticks.push_back(tick_ms);
    listing.push_back(listing_ms);
    drawing.push_back(drawing_ms);
    reading.push_back(drawing_ms + reading_ms);
  }
  std::size_t triangles = 0, shadows = 0;
  for (const MeshInstance& instance : list.meshes) {
    if (instance.mesh) triangles += instance.mesh->indices.size() / 3;
    shadows += instance.casts_shadow;
  }
  std::printf("%-20s %8.3f %8.3f %8.2f %8.2f %8.2f %8zu %8zu %10zu %8zu %8zu\n", name, part_of(ticks, 0.5),
              part_of(listing, 0.5), part_of(drawing, 0.5), part_of(drawing, 0.95), part_of(reading, 0.5),
              list.meshes.size(), shadows, triangles, list.sprites.size(), list.world_lines.size());
}

void measure_swarm(int critters, int frames, const ModelSet& models) {
  using namespace swarm;
  const PlayingField field = empty_field(kRadius_m);
  Simulation game;
  game.start(field, {});
  State& state = game.edit_state();
  state.wave.pause_ticks = 0;
  state.wave.to_release = {1, 0, 0, 0};
  state.wave.release_ticks = ticks(59);
  for (int k = 0; k < critters; ++k) {
    Critter critter;
    critter.kind = static_cast<CritterKind>(k % kKinds);
    critter.phase = CritterPhase::walking;
    const double angle = 2.399963 * k, reach = 0.3 + 0.6 * std::sqrt(k / 200.0);
    critter.position = reach * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    critter.health = critter.full_health = 900;
    state.critters.push_back(critter);
  }
  GameInput input;
  input.camera_from_plane = camera_from_plane();
  input.fire = true;
  const auto tick = [&] {
    game.edit_state().robot.health = kFullHealth;
    game.step(input);
  };
  const std::string name = "swarm, " + std::to_string(critters);
  CritterPoses poses;
  measure(name.c_str(), frames, tick, [&](DrawList* list) { draw_swarm(game, field, models, &poses, list); });
}

}  // namespace

int main(int argc, char** argv) {
  const int frames = argc > 1 ? std::max(1, std::atoi(argv[1])) : 60;
  const ModelSet models = ModelSet::load(PARALLAX_SOURCE_DIR "/assets/models");
  std::printf("%-20s %8s %8s %8s %8s %8s %8s %8s %10s %8s %8s\n", "scene", "tick ms", "list ms", "draw ms", "95 %",
              "+ read", "meshes", "shadows", "triangles", "sprites", "lines");
  for (const int critters : {0, 20, 50, 100, 200}) measure_swarm(critters, frames, models);

  GameInput input;
  input.camera_from_plane = camera_from_plane();
  MarblesGame marbles;
  marbles.start(empty_field(kRadius_m), {});
  measure(
      "marbles", frames, [&] { marbles.step(marbles.scripted_input(input.camera_from_plane)); },
      [&](DrawList* list) { marbles.draw(models, list); });
  BurningGlass glass;
  GameOptions paper;
  paper.settings = {{"material", 1}};
  glass.start(empty_field(kRadius_m), paper);
  for (int k = 0; k < 600; ++k) glass.step(glass.scripted_input(input.camera_from_plane));
  measure(
      "burning glass, paper", frames, [&] { glass.step(glass.scripted_input(input.camera_from_plane)); },
      [&](DrawList* list) { glass.draw(models, list); });
}
