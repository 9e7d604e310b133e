// Games on a tracked camera: the field that follows the map, what is kept of games, what keys and sticks mean, and
// `run --game`.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "app/game_controls.h"
#include "app/game_field.h"
#include "app/game_session.h"
#include "app/game_store.h"
#include "core/error.h"
#include "tests/app/run_fixture.h"
#include "tests/app/view_scene.h"

namespace parallax {
namespace {

using testing::expect_one_line;
using testing::parallax_run;
using testing::ScratchFolder;
using testing::ViewScene;

double area_of(const PlayingField& field) {
  double twice = 0;
  for (std::size_t i = 0; i < field.outline_m.size(); ++i) {
    const Eigen::Vector2d &a = field.outline_m[i], &b = field.outline_m[(i + 1) % field.outline_m.size()];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return 0.5 * twice;
}

// Points on a grid over [-half, half]^2 of z = 0, seen from 1 m above.
TrackingSnapshot table_map(double half, const SimilarityTransform& world_from_first = {}) {
  Map map;
  Keyframe kf;
  kf.camera_from_world = RigidTransform(Eigen::Vector3d(1, -1, -1).asDiagonal(), {0, 0, 1});
  kf.camera_from_world = world_from_first.rebase(kf.camera_from_world);
  kf.mean_depth = world_from_first.s;
  const KeyframeId id = map.keyframes.insert(kf);
  for (double x = -half; x <= half + 1e-9; x += half / 6) {
    for (double y = -half; y <= half + 1e-9; y += half / 6) {
      MapPoint p;
      p.position = world_from_first * Eigen::Vector3d(x, y, 0);
      p.normal = Eigen::Vector3d::UnitZ();
      p.source = id;
      map.points.insert(p);
    }
  }
  RigidTransform plane;
  plane.t = world_from_first * Eigen::Vector3d(0.02, 0.01, 0);
  plane.R = world_from_first.R;
  map.plane = Plane{plane, half};
  TrackingSnapshot out = *make_snapshot(map);
  out.version = 1;
  out.map_version = 1;
  out.world_from_first = world_from_first;
  return out;
}

TEST(GameField, IsTheMappedPartOfThePlane) {
  GameField field;
  ASSERT_TRUE(field.update(table_map(0.3)));
  ASSERT_TRUE(field.field());
  EXPECT_NEAR(area_of(*field.field()), 0.36, 1e-6);
  EXPECT_NEAR(field.field()->radius_m, std::sqrt(0.36 / M_PI), 1e-6);
  EXPECT_TRUE(inside_outline(*field.field(), {0.29, -0.29}));
  EXPECT_NEAR(field.field()->world_from_plane.t.norm(), 0, 1e-6) << "centred on what is mapped";
  EXPECT_FALSE(field.update(table_map(0.3))) << "the same map";
}

TEST(GameField, GrowsAndNeverShrinks) {
  GameField field;
  ASSERT_TRUE(field.update(table_map(0.3)));
  const RigidTransform before = field.field()->world_from_plane;
  TrackingSnapshot larger = table_map(0.5);
  larger.version = 2;
  larger.keyframes.push_back(larger.keyframes.front());
  EXPECT_TRUE(field.update(larger));
  EXPECT_NEAR(area_of(*field.field()), 1.0, 1e-6);
  EXPECT_EQ(field.field()->world_from_plane.t, before.t) << "it grows about the same middle";
  TrackingSnapshot smaller = table_map(0.2);
  smaller.version = 3;
  EXPECT_FALSE(field.update(smaller));
  EXPECT_NEAR(area_of(*field.field()), 1.0, 1e-6);
}

TEST(GameField, IsScaledWithTheWorld) {
  GameField field;
  ASSERT_TRUE(field.update(table_map(0.3)));
  SimilarityTransform change;
  change.s = 2.5;
  TrackingSnapshot scaled = table_map(0.3, change);
  scaled.version = 2;
  EXPECT_TRUE(field.update(scaled));
  EXPECT_NEAR(area_of(*field.field()), 0.36 * 6.25, 1e-5);
  EXPECT_NEAR(field.field()->radius_m, 2.5 * std::sqrt(0.36 / M_PI), 1e-6);
}

TEST(GameField, AnotherMapIsAnotherField) {
  GameField field;
  ASSERT_TRUE(field.update(table_map(0.3)));
  TrackingSnapshot other = table_map(0.1);
  other.map_version = 2;
  EXPECT_TRUE(field.update(other));
  EXPECT_NEAR(area_of(*field.field()), 0.04, 1e-6);
  TrackingSnapshot none = table_map(0.1);
  none.map_version = 3;
  none.plane.reset();
  EXPECT_TRUE(field.update(none));
  EXPECT_FALSE(field.field());
}

TEST(GameField, TakesTheSurfaceIntoItsOwnFrame) {
  GameField field;
  ASSERT_TRUE(field.update(table_map(0.3)));
  auto surface = std::make_shared<SceneSurface>();
  surface->world_from_plane.t = {0.02, 0.01, 0};  // the plane's own origin
  surface->columns = surface->rows = 10;
  surface->cell_m = 0.01;
  surface->height_m.assign(100, 0);
  surface->known.assign(100, 1);
  surface->height_m[surface->index(4, 7)] = 0.05f;
  field.set_surface(surface);
  ASSERT_TRUE(field.field()->surface);
  const Eigen::Vector2d world = surface->centre_of(4, 7) + Eigen::Vector2d(0.02, 0.01);
  EXPECT_FLOAT_EQ(field.field()->surface->height_at(world), 0.05f) << "the field lies in the world's own axes here";
  // Of another plane: of no use.
  auto tilted = std::make_shared<SceneSurface>(*surface);
  tilted->world_from_plane.R = Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()).toRotationMatrix();
  field.set_surface(tilted);
  EXPECT_FALSE(field.field()->surface);
}

TEST(GamePose, IsPredictedAsItMoved) {
  Vector6d step;
  step << 0.01, -0.02, 0.005, 0.02, 0.01, -0.03;
  const RigidTransform first(Eigen::Matrix3d::Identity(), {0.1, 0.2, 0.5});
  const RigidTransform second = RigidTransform::exp(step) * first;
  const RigidTransform expected = RigidTransform::exp(0.5 * step) * second;
  const RigidTransform predicted = predict_pose(second, first, 0.04, 0.02);
  EXPECT_NEAR((predicted.t - expected.t).norm(), 0, 1e-12);
  EXPECT_NEAR((predicted.R - expected.R).norm(), 0, 1e-12);
  EXPECT_EQ(predict_pose(second, std::nullopt, 0.04, 0.02).t, second.t);
  EXPECT_EQ(predict_pose(second, first, 0, 0.02).t, second.t);
  EXPECT_EQ(predict_pose(second, first, 5, 0.02).t, second.t) << "too long ago";
}

TEST(GameRequestText, SaysWhatIsWrong) {
  const GameRequest request = parse_game_request("swarm?seed=7&difficulty=hard&seated=1");
  EXPECT_EQ(request.name, "swarm");
  EXPECT_EQ(request.options.seed, 7u);
  EXPECT_EQ(request.options.difficulty, GameDifficulty::hard);
  EXPECT_TRUE(request.options.seated);
  for (const char* bad :
       {"", "chess", "swarm?seed", "swarm?seed=-1", "swarm?seed=1.5", "swarm?difficulty=odd", "swarm?nothing=1",
        "swarm?seated=yes", "burning_glass?focal_length=nan", "burning_glass?material=iron"}) {
    try {
      parse_game_request(bad);
      ADD_FAILURE() << bad;
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()).rfind("--game: found '", 0), 0u) << e.what();
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
    }
  }
}

TEST(GameControls, KeysAndStickBecomeOneMovement) {
  GameKeys keys;
  keys.right = keys.away = true;
  EXPECT_NEAR(game_input(keys, {}).move.norm(), 1, 1e-12);
  keys.left = true;
  EXPECT_NEAR((game_input(keys, {}).move - Eigen::Vector2d(0, 1)).norm(), 0, 1e-12) << "both ways is no way";
  GamePad pad;
  pad.present = true;
  pad.left_x = 0.1f;  // at rest
  EXPECT_EQ(game_input({}, pad).move.norm(), 0);
  pad.left_x = 0;
  pad.left_y = -1;  // pushed away
  EXPECT_NEAR((game_input({}, pad).move - Eigen::Vector2d(0, 1)).norm(), 0, 1e-6);
  pad.right_trigger = 0.8f;
  EXPECT_TRUE(game_input({}, pad).fire);
  pad.present = false;
  EXPECT_FALSE(game_input({}, pad).fire);
}

TEST(GameStore, ComesBackAndKeepsTheBest) {
  const ScratchFolder scratch;
  const std::string path = (scratch.path() / "sub" / "games.json").string();
  GameStore store;
  store.volume = 0.3;
  store.difficulty = GameDifficulty::hard;
  store.left["swarm"] = "{\"a\": 1}";
  store.settings["burning_glass"]["focal_length"] = 2;
  for (int i = 1; i <= 15; ++i) store.add_score("swarm", GameDifficulty::hard, 10 * i, "2020-01-02");
  EXPECT_EQ(store.add_score("swarm", GameDifficulty::hard, 145, ""), 2);
  EXPECT_EQ(store.add_score("swarm", GameDifficulty::hard, 5, ""), 0);
  EXPECT_EQ(store.add_score("swarm", GameDifficulty::easy, 0, ""), 0);
  write_game_store(store, path);
  const GameStore back = read_game_store(path);
  EXPECT_EQ(back.volume, 0.3);
  EXPECT_EQ(back.difficulty, GameDifficulty::hard);
  EXPECT_EQ(back.left.at("swarm"), "{\"a\": 1}");
  ASSERT_EQ(back.best("swarm", GameDifficulty::hard).size(), GameStore::kScoresKept);
  EXPECT_EQ(back.best("swarm", GameDifficulty::hard)[0].score, 150);
  EXPECT_EQ(back.best("swarm", GameDifficulty::hard)[1].score, 145);
  EXPECT_TRUE(back.best("swarm", GameDifficulty::easy).empty());
  EXPECT_EQ(back.options("burning_glass", 3).settings.front().second, 2);
}

TEST(GameStore, WhatCannotBeReadIsNone) {
  const ScratchFolder scratch;
  const std::string path = (scratch.path() / "games.json").string();
  for (const char* text :
       {"", "{", "[]", "null",
        "{\"volume\": \"loud\", \"scores\": [1], \"left\": {\"swarm\": 3}, \"settings\": {\"a\": 1}}",
        "{\"volume\": 7, \"difficulty\": \"odd\", \"scores\": {\"swarm/easy\": [{\"score\": \"x\"}, 3]}}"}) {
    std::ofstream(path) << text;
    const GameStore store = read_game_store(path);
    EXPECT_GE(store.volume, 0);
    EXPECT_LE(store.volume, 1);
    EXPECT_EQ(store.difficulty, GameDifficulty::normal);
    EXPECT_TRUE(store.left.empty());
    EXPECT_TRUE(store.best("swarm", GameDifficulty::easy).empty());
  }
  EXPECT_EQ(read_game_store((scratch.path() / "nothing").string()).volume, GameStore().volume);
}

TEST(GameSession, IsPlayedWhileTheCameraIsTracked) {
  ViewScene scene;
  GameSession session(GameRequest{"marbles", {}}, std::make_shared<const ModelSet>());
  session.set_scripted(true);
  const auto pass = [&](int from, int to, bool tracked) {
    for (int i = from; i < to; ++i) {
      Frame frame;
      frame.index = i;
      frame.time = Timestamp(static_cast<std::int64_t>(i) * 33'333'333);
      TrackingResult result;
      if (tracked) result.camera_from_world = scene.pose(75);
      session.frame(frame, result, scene.shared_map().get(), {});
    }
  };
  scene.map().version = 1;
  scene.map().map_version = 1;
  pass(0, 60, true);
  EXPECT_EQ(session.runner().phase(), GamePhase::playing);
  EXPECT_GT(session.runner().ticks(), 200);
  DrawList list;
  session.draw(&list);
  EXPECT_GT(list.meshes.size(), 2u);
  pass(60, 90, false);
  EXPECT_EQ(session.runner().phase(), GamePhase::lost);
  EXPECT_FALSE(session.status().empty());
  DrawList nothing;
  session.draw(&nothing);
  EXPECT_TRUE(nothing.meshes.empty());
  // A game that was left comes back as it was.
  const std::string saved = session.runner().game().save();
  const std::uint64_t state = session.runner().game().state_hash();
  GameSession later(GameRequest{"marbles", {}}, std::make_shared<const ModelSet>());
  later.restore_when_possible(saved);
  Frame frame;
  TrackingResult result;
  result.camera_from_world = scene.pose(75);
  later.frame(frame, result, scene.shared_map().get(), {});
  EXPECT_EQ(later.runner().game().state_hash(), state);
  EXPECT_EQ(later.runner().phase(), GamePhase::resuming);
}

TEST(RunGame, TheSameRecordingAndSeedGiveTheSameGame) {
  const ScratchFolder scratch;
  const auto play = [&](const std::string& game) {
    const std::string report = (scratch.path() / "report.json").string();
    const auto result = parallax_run({"synthetic:desk?frames=170&size=320x240", "--game", game, "--report", report});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_NE(result.out.find("\ngame: "), std::string::npos) << result.out;
    std::ifstream in(report);
    return nlohmann::json::parse(in).at("game");
  };
  const auto first = play("swarm?seed=3"), again = play("swarm?seed=3"), other = play("swarm?seed=4");
  EXPECT_GT(first.at("seconds").get<double>(), 2);
  EXPECT_EQ(first, again);
  EXPECT_NE(first.at("state"), other.at("state"));
}

TEST(RunGame, UnknownGameIsOneLine) {
  expect_one_line(parallax_run({"synthetic:desk?frames=10", "--game", "chess"}), 2, "--game");
}

}  // namespace
}  // namespace parallax
