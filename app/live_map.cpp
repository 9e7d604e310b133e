#include "app/live_map.h"

namespace parallax {
namespace {

// The saver looks at what it was given when it saves; so often it is brought up to date.
constexpr std::chrono::milliseconds kInterval{1000};

}  // namespace

// What was saved is in the first world of this map.
void LiveMap::put_back(const LiveFrame& frame, const MapDocument& document, LiveState* state, LiveGames* games) {
  scale_is_known_ = document.scale_is_known;
  state->content.follow(map_version_, SimilarityTransform());
  state->content.restore(document.content);
  state->content.follow(*frame.map);
  games->bring(document.games);
}

std::vector<std::string> LiveMap::frame(const LiveFrame& frame, const LiveEngine& engine, LiveState* state,
                                        LiveGames* games) {
  std::vector<std::string> trashed;
  if (!frame.map) return trashed;
  if (engine.maps()) {
    engine.maps()->frame(frame.frame, frame.tracked);
    for (MapNews& news : engine.maps()->take_news()) {
      state->toasts.add(news.text, news.problem);
      if (!news.trashed.empty()) trashed.push_back(news.trashed);
      if (news.document) to_put_back_.push_back(std::move(news));
    }
  }
  if (frame.map->map_version != map_version_) {
    map_version_ = frame.map->map_version;
    scale_is_known_ = false;  // another map
  }
  const auto& initial = engine.initial_map();
  if (initial && !restored_ && map_version_ == kInitialMapVersion) {
    restored_ = true;
    put_back(frame, *initial, state, games);
  }
  // The frames that are shown may still be from before.
  while (!to_put_back_.empty() && to_put_back_.front().map_version <= map_version_) {
    if (to_put_back_.front().map_version == map_version_) {
      games->change_map();
      put_back(frame, *to_put_back_.front().document, state, games);
      engine.saver()->content_is_back();
    }
    to_put_back_.pop_front();
  }
  MapSaver* saver = engine.saver();
  if (!saver) return trashed;
  if (const std::string message = saver->take_message(); !message.empty()) state->toasts.add(message, true);
  if (SteadyClock::now() - handed_over_ >= kInterval) hand_over(frame, engine, *state, *games);
  return trashed;
}

void LiveMap::hand_over(const LiveFrame& frame, const LiveEngine& engine, const LiveState& state,
                        const LiveGames& games) {
  if (!engine.saver() || !frame.map) return;
  handed_over_ = SteadyClock::now();
  engine.saver()->set_extras(
      {frame.map->map_version, frame.map->stamp(), state.content.items(), games.states(), scale_is_known_});
}

}  // namespace parallax
