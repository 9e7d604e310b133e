// The games of the window: what is left of a game belongs to the map that it was played on.
#include "app/live_games.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "tests/app/run_fixture.h"
#include "tests/app/view_scene.h"

namespace parallax {
namespace {

using testing::ScratchFolder;
using testing::ViewScene;

// What the window does with a map that it sees again and again.
class Player {
 public:
  explicit Player(const std::string& store) : games(store) {
    scene_.map().version = 1;
    scene_.map().map_version = 1;
    for (int k = 0; k < 3; ++k) scene_.map().keyframes.push_back(scene_.map().keyframes.back());  // no young map
  }

  // The card after the one that is on, or the first.
  void choose() {
    games.next();
    for (int press = 0; press < 2 && games.menu_is_open(); ++press) games.press(MenuKey::accept, scene_.camera());
    ASSERT_FALSE(games.menu_is_open());
    ASSERT_TRUE(games.playing());
  }

  void see(int frames) {
    for (int i = 0; i < frames; ++i) {
      LiveFrame frame;
      frame.frame.index = seen_++;
      frame.frame.time = Timestamp(static_cast<std::int64_t>(seen_) * 33'333'333);
      frame.tracked.camera_from_world = scene_.pose(75);
      frame.map = scene_.shared_map();
      games.frame(frame, {}, 0);
    }
  }

  LiveGames games;

 private:
  ViewScene scene_;
  int seen_ = 0;
};

TEST(LiveGames, WhatIsLeftStaysWithItsMap) {
  const ScratchFolder scratch;
  const std::string store = (scratch.path() / "games.json").string();
  std::map<std::string, std::string> kept;
  {
    Player player(store);
    EXPECT_TRUE(player.games.states().empty());
    player.choose();
    EXPECT_TRUE(player.games.states().empty()) << "it has not begun";
    player.see(40);
    kept = player.games.states();
    ASSERT_EQ(kept.size(), 1u);
    EXPECT_TRUE(kept.contains("swarm"));
    player.games.leave();
    EXPECT_EQ(player.games.states(), kept) << "left, and still of this map";
    // Another game, and in the midst of it another map.
    player.choose();
    player.games.leave();
    EXPECT_EQ(player.games.states(), kept) << "never begun, nothing lost";
    player.choose();
    player.see(3);
    EXPECT_EQ(player.games.states().size(), 1u) << "the one that was left, played on";
    player.games.change_map();
    EXPECT_FALSE(player.games.playing());
    EXPECT_TRUE(player.games.states().empty()) << "they stay with the map before";
    player.games.bring(kept);
    EXPECT_EQ(player.games.states(), kept) << "and are there when it comes again";
    player.choose();
    player.games.leave();
    EXPECT_EQ(player.games.states(), kept) << "chosen, and left before it began";
  }
  // The program begins anew, with another map first: nothing of the other one's is put there.
  Player later(store);
  EXPECT_TRUE(later.games.states().empty());
  later.choose();
  later.see(40);
  EXPECT_EQ(later.games.states().size(), 1u);
  EXPECT_NE(later.games.states(), kept) << "begun anew, not gone on with";
}

TEST(LiveGames, AGameChosenBeforeTheMapGoesOnWithWhatWasLeftOnIt) {
  Player first("");
  first.choose();
  first.see(40);
  const auto kept = first.games.states();
  Player player("");
  player.choose();
  player.games.change_map();
  EXPECT_TRUE(player.games.playing()) << "it waits for a map";
  player.games.bring(kept);
  player.see(1);
  EXPECT_EQ(player.games.states(), kept) << "counted down, as it was";
}

}  // namespace
}  // namespace parallax
