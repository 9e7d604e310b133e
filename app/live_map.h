// The map file of the window's session: what was on the map comes back with it, and what the user places is handed to
// the saver.
//
// The window's thread.
#pragma once

#include <deque>
#include <string>
#include <vector>

#include "app/live_engine.h"
#include "app/live_games.h"
#include "app/live_state.h"

namespace parallax {

class LiveMap {
 public:
  // A session has begun.
  void begun() { *this = LiveMap(); }

  // After the content has followed this frame's map. Content and games of the map that the session began with are put
  // back at its first frame, and those of a stored map that the session has gone over to or merged. Returns where the
  // maps lie that went to the trash meanwhile.
  std::vector<std::string> frame(const LiveFrame& frame, const LiveEngine& engine, LiveState* state, LiveGames* games);
  // Hands over what stands on the map now; before the session ends.
  void hand_over(const LiveFrame& frame, const LiveEngine& engine, const LiveState& state, const LiveGames& games);
  // The user has set the scale of this map.
  void scale_was_set() { scale_is_known_ = true; }

 private:
  void put_back(const LiveFrame& frame, const MapDocument& document, LiveState* state, LiveGames* games);
  void put_in(const LiveFrame& frame, const MapNews& news, LiveState* state, LiveGames* games);

  std::deque<MapNews> to_put_back_;
  bool restored_ = false, scale_is_known_ = false;
  std::uint64_t map_version_ = 0;
  SteadyClock::time_point handed_over_{};
};

}  // namespace parallax
