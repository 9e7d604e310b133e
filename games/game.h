// What every game is to the program: rules that are stepped at a fixed rate, and a picture, sounds and numbers of their
// state. No OpenGL, no wall clock, no files: the same start, seed and inputs give the same states to the last bit.
//
// One thread at a time. The program owns the games, turns time and devices into ticks and inputs (games/game_runner),
// and draws.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/se3.h"
#include "games/playing_field.h"
#include "render/draw_list.h"
#include "render/model_set.h"

namespace parallax {

inline constexpr int kGameTicksPerSecond = 120;
inline constexpr double kGameTick_s = 1.0 / kGameTicksPerSecond;

enum class GameDifficulty { easy, normal, hard };

struct GameOptions {
  std::uint64_t seed = 1;
  GameDifficulty difficulty = GameDifficulty::normal;
  bool seated = false;            // played with little camera motion
  bool colour_blind_safe = true;  // the palette of Okabe and Ito; else a richer one
  // Values of a game's own settings by name, within what GameInfo::settings says; what is not named has its default.
  std::vector<std::pair<std::string, double>> settings;
};

// What the player does during one tick.
struct GameInput {
  // Keys or stick, -1..1 each: x to the right, y away from the viewer, as they see the table.
  Eigen::Vector2d move = Eigen::Vector2d::Zero();
  bool fire = false;  // held down
  bool act = false;   // the second button, held down
  double dial = 0;    // wheel or shoulder buttons, -1..1
  // Where the camera is (camera z forward), predicted for when the picture will be seen; nothing while tracking is
  // lost. The cross-hairs are where its optical axis meets the plane.
  std::optional<RigidTransform> camera_from_plane;
};

struct GameSetting {
  std::string name, label;  // "focal_length", "Focal length"
  std::string unit;         // "m", "deg", ""
  double least = 0, most = 1, initial = 0.5;
  std::vector<std::string> choices;  // a choice instead of a number: value is its index
};

struct GameInfo {
  std::string name;                                       // "swarm": command line, saved games, settings
  std::string title;                                      // as the menu shows it
  std::vector<std::string> explanation;                   // lines of at most 48 characters, at most ten: one screen
  std::string fire_does, act_does, move_does, dial_does;  // a few words each, empty: not used
  std::vector<GameSetting> settings;
};

struct GameGauge {
  std::string label;
  double value = 0;  // 0..1
  DrawColour colour;
};

// What is written over the picture.
struct GameHud {
  std::int64_t score = 0;
  std::vector<std::string> lines;  // short facts: "wave 3", "combo x4"
  std::vector<GameGauge> gauges;
  std::string message;      // in the middle, while there is something to say
  bool cross_hairs = true;  // shown at the optical axis
};

struct GameSound {
  std::string name;  // of assets/sounds, without extension
  float volume = 1;  // 0..1
  float pitch = 1;
  std::optional<Eigen::Vector3d> position_m;  // plane frame; nothing: everywhere
};

// A thing of the game that lies still on the table, by which to see whether the game stays where it is.
struct GameLandmark {
  std::uint64_t number = 0;                              // another number: another thing, or moved by the game
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  // plane frame
};

class Game {
 public:
  virtual ~Game() = default;

  virtual const GameInfo& info() const = 0;

  // From the beginning. Also the first thing that is called.
  virtual void start(const PlayingField& field, const GameOptions& options) = 0;
  // The map has grown, or was scaled: the game goes on where it can.
  virtual void change_field(const PlayingField& field) = 0;
  // A setting, while it is played; what lies outside its range is clamped, an unknown name is ignored.
  virtual void set(const std::string& setting, double value) = 0;

  // One tick of kGameTick_s.
  virtual void step(const GameInput& input) = 0;

  // What a patient player would do now: for demonstrations and tests.
  virtual GameInput scripted_input(const std::optional<RigidTransform>& camera_from_plane) const = 0;

  virtual bool is_over() const = 0;
  virtual GameHud hud() const = 0;
  // What was to be heard since the last call; at most a few dozen.
  virtual std::vector<GameSound> take_sounds() = 0;
  // Appends to the list; world frame (world_from_plane of the field).
  virtual void draw(const ModelSet& models, DrawList* out) const = 0;

  // What the player has made, to keep: RGBA (red first), sRGB, straight alpha. Empty: this game leaves no picture, or
  // there is nothing on it yet.
  virtual cv::Mat4b picture() const { return {}; }

  // Nothing while there is none.
  virtual std::optional<GameLandmark> landmark() const { return std::nullopt; }

  // The whole state as JSON text, and back. restore() throws InputError when the text is not a state of this game, and
  // leaves the game as it was.
  virtual std::string save() const = 0;
  virtual void restore(const std::string& text, const PlayingField& field) = 0;
  // Of everything that has an effect on what comes: equal states, equal numbers.
  virtual std::uint64_t state_hash() const = 0;
};

std::unique_ptr<Game> make_swarm();
std::unique_ptr<Game> make_burning_glass();
std::unique_ptr<Game> make_marbles();

}  // namespace parallax
