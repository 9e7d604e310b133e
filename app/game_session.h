// A game on a tracked camera: its field follows the map, its time the frames, and it is drawn over them. The same for
// the window and for `run --game`.
//
// One thread at a time; holds no OpenGL.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/game_drift.h"
#include "app/game_field.h"
#include "core/frame.h"
#include "games/game_runner.h"
#include "map/tracking_snapshot.h"
#include "tracker/tracking_types.h"

namespace parallax {

// What `--game` says: "swarm", "burning_glass?seed=3&difficulty=hard&focal_length=0.2".
struct GameRequest {
  std::string name;
  GameOptions options;
};
// Throws InputError, naming --game, what was found and what is expected.
GameRequest parse_game_request(const std::string& text);

// "swarm", "burning_glass", "marbles": in the order in which `g` shows them.
const std::vector<std::string>& game_names();
// Null for another name.
std::unique_ptr<Game> make_game(const std::string& name);

// A pose is predicted no farther ahead than this: beyond it a hand has changed its mind.
inline constexpr double kFarthestPrediction_s = 0.1;
// Where the camera will be, extrapolated from two poses. Nothing when the older is missing or the two are too far apart
// in time to say.
RigidTransform predict_pose(const RigidTransform& camera_from_field, const std::optional<RigidTransform>& before,
                            double between_s, double ahead_s);

class GameSession {
 public:
  // `models` is shared, never null.
  GameSession(const GameRequest& request, std::shared_ptr<const ModelSet> models);

  GameRunner& runner() { return runner_; }
  const GameRunner& runner() const { return runner_; }
  const std::string& name() const { return name_; }
  // The player is a script (demonstrations, `run --game`).
  void set_scripted(bool scripted) { runner_.set_scripted(scripted); }
  // From the beginning, on the field as it is; waits for one where there is none.
  void restart(const GameOptions& options);
  // A state to go on with once there is a field; empty: none. Throws InputError when it is not one of this game and
  // there is a field already.
  void restore_when_possible(std::string saved);

  // A frame was tracked, `map` is what it was tracked with (may be null). `controls`: keys and sticks; the pose is
  // added here, predicted `ahead_s` seconds beyond the frame, which is when the picture will be seen.
  void frame(const Frame& frame, const TrackingResult& tracked, const TrackingSnapshot* map, GameInput controls,
             double ahead_s = 0);
  // What stands on the plane; used by the game from the next frame on.
  void set_surface(std::shared_ptr<const SceneSurface> surface);
  const std::shared_ptr<const SceneSurface>& surface() const { return surface_; }

  // Appends the game to the picture of the newest frame. Nothing before it has begun, or while tracking is lost.
  void draw(DrawList* out) const;

  // The game's landmark in the newest frame; nothing while nothing is drawn.
  std::optional<GameSight> sight() const;

  const std::optional<PlayingField>& field() const { return field_.field(); }
  // Why nothing is played: "map the table first", "tracking is lost"...; empty while it is played.
  std::string status() const;
  // What the player can do about it, where that is not clear.
  std::string advice() const;

 private:
  void begin();

  std::string name_;
  GameOptions options_;
  GameRunner runner_;
  std::shared_ptr<const ModelSet> models_;
  GameField field_;
  std::shared_ptr<const SceneSurface> surface_;
  bool surface_is_new_ = false;
  std::string saved_;
  double settling_s_ = 0;  // for so long the table has been about to settle
  std::optional<Timestamp> last_time_;
  std::optional<RigidTransform> last_pose_;  // camera_from_field, of the frame before
  double last_scale_ = 1;                    // of the field, then
  std::uint64_t last_map_version_ = 0;
  RigidTransform camera_from_world_;  // of the newest frame that was tracked
  bool tracked_ = false;
};

}  // namespace parallax
