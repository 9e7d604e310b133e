#include "app/live_map.h"

namespace parallax {
namespace {

// The saver looks at what it was given when it saves; so often it is brought up to date.
constexpr std::chrono::milliseconds kInterval{1000};

}  // namespace

void LiveMap::frame(const LiveFrame& frame, const LiveEngine& engine, LiveState* state, LiveGames* games) {
  if (!frame.map) return;
  if (frame.map->map_version != map_version_) {
    map_version_ = frame.map->map_version;
    scale_is_known_ = false;  // another map
  }
  const auto& initial = engine.initial_map();
  if (initial && !restored_ && map_version_ == kInitialMapVersion) {
    restored_ = true;
    scale_is_known_ = initial->scale_is_known;
    // What was saved is in the first world of this map.
    state->content.follow(map_version_, SimilarityTransform());
    state->content.restore(initial->content);
    state->content.follow(*frame.map);
    games->bring(initial->games);
  }
  MapSaver* saver = engine.saver();
  if (!saver) return;
  if (const std::string message = saver->take_message(); !message.empty()) state->toasts.add(message, true);
  if (SteadyClock::now() - handed_over_ >= kInterval) hand_over(frame, engine, *state, *games);
}

void LiveMap::hand_over(const LiveFrame& frame, const LiveEngine& engine, const LiveState& state,
                        const LiveGames& games) {
  if (!engine.saver() || !frame.map) return;
  handed_over_ = SteadyClock::now();
  engine.saver()->set_extras(
      {frame.map->map_version, frame.map->world_from_first, state.content.items(), games.states(), scale_is_known_});
}

}  // namespace parallax
