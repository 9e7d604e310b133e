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

// What stood on a map that was merged into this one joins what stands here.
void LiveMap::put_in(const LiveFrame& frame, const MapNews& news, LiveState* state, LiveGames* games) {
  if (news.document->scale_is_known) scale_is_known_ = true;
  std::vector<ContentItem> items = news.document->content;
  const WorldStamp then{news.world.world_from_first, news.world.warps.size()};
  for (ContentItem& item : items)
    item.world_from_item = frame.map->world().now_from(then, item.position(), item.seen_from) * item.world_from_item;
  state->content.restore(items);
  const std::map<std::string, std::string> there = games->states();
  std::map<std::string, std::string> more = news.document->games;
  std::erase_if(more, [&](const auto& game) { return there.contains(game.first); });
  games->bring(more);
}

std::vector<std::string> LiveMap::frame(const LiveFrame& frame, const LiveEngine& engine, LiveState* state,
                                        LiveGames* games) {
  std::vector<std::string> trashed;
  if (!frame.map) return trashed;
  if (engine.maps()) {
    engine.maps()->frame(frame.frame, frame.tracked);
    for (MapNews& news : engine.maps()->take_news()) {
      state->toasts.add(news.text + (news.merged ? " (F7 to undo)" : ""), news.problem);
      if (!news.trashed.empty()) trashed.push_back(news.trashed);
      if (news.document) to_put_back_.push_back(std::move(news));
    }
  }
  if (frame.map->map_version != map_version_) {
    map_version_ = frame.map->map_version;
    scale_is_known_ = false;  // another map
    games->change_map();
  }
  const auto& initial = engine.initial_map();
  if (initial && !restored_ && map_version_ == kInitialMapVersion) {
    restored_ = true;
    put_back(frame, *initial, state, games);
  }
  // The frames that are shown may still be from before.
  while (!to_put_back_.empty() && to_put_back_.front().map_version <= map_version_) {
    const MapNews& news = to_put_back_.front();
    if (news.map_version == map_version_) {
      if (news.merged && frame.map->world_version < news.world_version) break;
      if (news.merged)
        put_in(frame, news, state, games);
      else
        put_back(frame, *news.document, state, games);
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
