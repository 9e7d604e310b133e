// Games on a tracked camera: the field that follows the map, what is kept of games, what keys and sticks mean, and
// `run --game`.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "app/display_latency.h"
#include "app/game_controls.h"
#include "app/game_drift.h"
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
  for (int k = 0; k < 6; ++k) map.keyframes.insert(kf);  // no young map
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
  for (PointId& id : larger.id) id.index += 1000;  // other points
  larger.keyframes.push_back(larger.keyframes.front());
  EXPECT_TRUE(field.update(larger));
  EXPECT_NEAR(area_of(*field.field()), 1.0, 1e-6);
  EXPECT_EQ(field.field()->world_from_plane.t, before.t) << "it grows about the same middle";
  TrackingSnapshot smaller = table_map(0.2);
  smaller.version = 3;
  for (PointId& id : smaller.id) id.index += 2000;
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
  EXPECT_NEAR(field.field()->scale, 2.5, 1e-12);
  // Grown in the same moment: told apart.
  change.s = 5;
  TrackingSnapshot both = table_map(0.4, change);
  both.version = 3;
  for (PointId& id : both.id) id.index += 1000;
  both.keyframes.push_back(both.keyframes.front());
  const PlayingField before = *field.field();
  EXPECT_TRUE(field.update(both));
  EXPECT_NEAR(length_factor(before, *field.field()), 2, 1e-12);
  EXPECT_GT(field.field()->radius_m, 2.2 * before.radius_m);
}

// The plane of the first views is still about to change: nothing is put on it, unless nothing more is to come.
TEST(GameField, WaitsForTheTableToSettle) {
  TrackingSnapshot young = table_map(0.3);
  young.keyframes.resize(2);
  GameField field;
  EXPECT_FALSE(field.update(young));
  EXPECT_FALSE(field.field());
  EXPECT_TRUE(field.settling());
  young.version = 2;  // the plane, fitted anew
  young.plane->world_from_plane.t.z() = 0.004;
  EXPECT_FALSE(field.update(young));
  EXPECT_TRUE(GameField(field).update(young, true)) << "as it is";
  TrackingSnapshot known = table_map(0.3);
  known.version = 3;
  EXPECT_TRUE(field.update(known));
  ASSERT_TRUE(field.field());
  EXPECT_FALSE(field.settling());
  EXPECT_EQ(field.field()->number, 1);
}

// An adjustment moves, turns and scales the points on the table, and the world and the plane's frame say nothing of it:
// the field stays on the points, but for the few that go elsewhere.
TEST(GameField, StaysOnThePointsThatAnAdjustmentMoves) {
  GameField field;
  ASSERT_TRUE(field.update(table_map(0.3)));
  const PlayingField before = *field.field();
  const Eigen::Vector3d spot(0.05, -0.11, 0);  // of the field
  const Eigen::Vector3d place = before.world_from_plane * spot;
  SimilarityTransform moved;
  moved.s = 1.02;
  moved.R = Eigen::AngleAxisd(0.03, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  moved.t = {0.011, -0.006, 0};
  TrackingSnapshot adjusted = table_map(0.3);
  adjusted.version = 2;
  for (std::size_t i = 0; i < adjusted.position.size(); ++i) {
    adjusted.position[i] = moved * adjusted.position[i];
    if (i % 10 == 0) adjusted.position[i].x() += 0.05;
  }
  EXPECT_TRUE(field.update(adjusted));
  const double factor = length_factor(before, *field.field());
  EXPECT_NEAR(factor, 1.02, 2e-4);
  const Eigen::Vector3d now = field.field()->world_from_plane * Eigen::Vector3d(factor * spot);
  EXPECT_NEAR((now - moved * place).norm(), 0, 2e-4);
  EXPECT_GT((now - place).norm(), 0.01);
}

// A worktop at the height of the table is another place, and a wall goes through its plane.
TEST(GameField, IsTheTableAlone) {
  TrackingSnapshot map = table_map(0.3);
  const auto add = [&](double x, double y, double z) {
    map.position.emplace_back(x, y, z);
    map.id.push_back(PointId{0, 1000 + static_cast<int>(map.id.size())});
    map.source.push_back(0);
  };
  for (double x = 0; x < 0.5; x += 0.05)
    for (double y = 0; y < 0.2; y += 0.05) add(x - 0.2, 0.62 + y, 0);  // the worktop
  for (double x = -0.3; x < 0.3; x += 0.02)
    for (int k = -8; k <= 0; ++k) add(x, 0.38, 0.01 * k);  // a front, joined to the table by nearness
  map.x.resize(map.position.size());
  GameField field;
  // The columns that the field does not read are left as they were.
  ASSERT_TRUE(field.update(map));
  EXPECT_NEAR(area_of(*field.field()), 0.36, 0.02);
}

TEST(GameField, AnotherMapIsAnotherField) {
  GameField field;
  ASSERT_TRUE(field.update(table_map(0.3)));
  TrackingSnapshot other = table_map(0.1);
  other.map_version = 2;
  EXPECT_TRUE(field.update(other));
  EXPECT_NEAR(area_of(*field.field()), 0.04, 1e-6);
  EXPECT_EQ(field.field()->number, 2);
  EXPECT_EQ(field.field()->scale, 1);
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
  store.effects = 0.4;
  store.palette = "tol_vibrant";
  store.seated = true;
  store.occlusion = false;
  store.explained = {"swarm"};
  store.difficulty = GameDifficulty::hard;
  store.settings["burning_glass"]["focal_length"] = 2;
  for (int i = 1; i <= 15; ++i) store.add_score("swarm", GameDifficulty::hard, 10 * i, "2020-01-02");
  EXPECT_EQ(store.add_score("swarm", GameDifficulty::hard, 145, ""), 2);
  EXPECT_EQ(store.add_score("swarm", GameDifficulty::hard, 5, ""), 0);
  EXPECT_EQ(store.add_score("swarm", GameDifficulty::easy, 0, ""), 0);
  write_game_store(store, path);
  const GameStore back = read_game_store(path);
  EXPECT_EQ(back.volume, 0.3);
  EXPECT_EQ(back.effects, 0.4);
  EXPECT_EQ(back.palette, "tol_vibrant");
  EXPECT_TRUE(back.seated);
  EXPECT_FALSE(back.occlusion);
  EXPECT_EQ(back.explained, std::set<std::string>{"swarm"});
  EXPECT_EQ(back.difficulty, GameDifficulty::hard);
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
        "{\"volume\": 7, \"palette\": \"mud\", \"explained\": [3, {}], \"effects\": -1, \"difficulty\": \"odd\", "
        "\"scores\": {\"swarm/easy\": [{\"score\": \"x\"}, 3]}}"}) {
    std::ofstream(path) << text;
    const GameStore store = read_game_store(path);
    EXPECT_GE(store.volume, 0);
    EXPECT_LE(store.volume, 1);
    EXPECT_EQ(store.difficulty, GameDifficulty::normal);
    EXPECT_EQ(store.palette, "okabe_ito");
    EXPECT_TRUE(store.explained.empty());
    EXPECT_TRUE(store.best("swarm", GameDifficulty::easy).empty());
  }
  std::ofstream(path) << "{\"colour_blind_safe\": false}";
  EXPECT_EQ(read_game_store(path).palette, "vivid") << "as it was kept before palettes had names";
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
  for (int k = 0; k < 3; ++k) scene.map().keyframes.push_back(scene.map().keyframes.back());  // no young map
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

// A camera of constant velocity: where the game aims is where the camera is when the picture is seen, not where it was
// when the frame was taken.
TEST(GameSession, AimsWhereTheCameraWillBe) {
  constexpr double kBetween_s = 1.0 / 30, kAhead_s = 0.06;
  const TrackingSnapshot map = table_map(0.3);
  // Seen from 0.6 m above; it goes to the right at 30 cm/s and turns that way by 20 degrees a second.
  Vector6d velocity;
  velocity << -0.3, 0.05, 0.02, 0.05, -0.35, 0.1;
  const RigidTransform start(Eigen::Vector3d(1, -1, -1).asDiagonal(), {-0.05, 0, 0.6});
  const auto pose_at = [&](double seconds) { return RigidTransform::exp(velocity * seconds) * start; };
  const auto sight_of = [](const GameSession& session) {
    const auto sight = nlohmann::json::parse(session.runner().game().save()).at("game").at("robot").at("sight");
    return Eigen::Vector2d(sight.at(0).get<double>(), sight.at(1).get<double>());
  };
  // Sights with poses of the frame's time plus `later_s`, predicted `ahead_s` farther.
  const auto play = [&](double later_s, double ahead_s) {
    GameSession session(GameRequest{"swarm", {}}, std::make_shared<const ModelSet>());
    std::vector<Eigen::Vector2d> sights;
    for (int i = 0; i < 12; ++i) {
      Frame frame;
      frame.index = i;
      frame.time = from_seconds(i * kBetween_s);
      TrackingResult tracked;
      tracked.camera_from_world = pose_at(i * kBetween_s + later_s);
      session.frame(frame, tracked, &map, {}, ahead_s);
      sights.push_back(sight_of(session));
    }
    return sights;
  };
  const auto predicted = play(0, kAhead_s), truth = play(kAhead_s, 0), late = play(0, 0);
  for (std::size_t i = 3; i < truth.size(); ++i) {
    EXPECT_NEAR((predicted[i] - truth[i]).norm(), 0, 1e-6) << i;
    EXPECT_GT((late[i] - truth[i]).norm(), 0.02) << "this is what the prediction is for";
  }
}

TEST(DisplayLatency, OfTheProgramsOwnClockIsCountedFromCapture) {
  DisplayLatency latency;
  const auto at = [](double seconds) { return from_seconds(5000 + seconds); };
  EXPECT_EQ(latency.capture_to_display_s(), 0);
  for (int i = 0; i < 100; ++i) {
    const double captured = i / 30.0;
    // Taken up 25 ms after its capture, on the screen 11 ms later.
    latency.take(at(captured), 0.004, at(captured + 0.025));
    latency.shown(at(captured + 0.036));
    latency.shown(at(captured + 0.06));  // drawn again without a new frame: no latency of a frame
  }
  EXPECT_TRUE(latency.exact());
  EXPECT_NEAR(latency.capture_to_display_s(), 0.036, 1e-3);
  // The next frame comes late: the horizon knows that at once.
  EXPECT_NEAR(latency.take(at(10), 0.004, at(10.05)), 0.061, 1e-3);
}

TEST(DisplayLatency, OfAnotherClockTheFastestFrameCameAtOnce) {
  DisplayLatency latency;
  const auto now = [](double seconds) { return from_seconds(5000 + seconds); };
  const auto stamp = [](double seconds) { return from_seconds(1000 + seconds); };
  for (int i = 0; i < 200; ++i) {
    const double captured = i / 30.0, waits = i % 3 == 0 ? 0.0 : 0.008;
    latency.take(stamp(captured), 0.004, now(captured + 0.3 + waits));
    latency.shown(now(captured + 0.31 + waits));
  }
  EXPECT_FALSE(latency.exact());
  EXPECT_NEAR(latency.take(stamp(7), 0.004, now(7.3)), 0.004 + 0.010, 1e-3);
  EXPECT_NEAR(latency.take(stamp(8), 0.004, now(8.33)), 0.034 + 0.010, 1e-3);
  // A clock that was set anew, or another source.
  EXPECT_NEAR(latency.take(from_seconds(3), 0.004, now(9)), 0.004 + 0.010, 1e-3);
}

nlohmann::json played(const std::string& source, const std::string& game, const ScratchFolder& scratch,
                      const std::string& frames = {}, const std::string& picture = {}) {
  const std::string report = (scratch.path() / "report.json").string();
  std::vector<std::string> arguments{source, "--game", game, "--report", report};
  if (!frames.empty()) arguments.insert(arguments.end(), {"--frames", frames});
  if (!picture.empty()) arguments.insert(arguments.end(), {"--game-picture", picture});
  const auto result = parallax_run(arguments);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("\ngame: "), std::string::npos) << result.out;
  std::ifstream in(report);
  return nlohmann::json::parse(in).at("game");
}

std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

TEST(RunGame, TheSameRecordingAndSeedGiveTheSameGameAndTheSamePictures) {
  const ScratchFolder scratch;
  const std::string source = "synthetic:desk?frames=330&size=320x240";
  const auto one = scratch.path() / "one", two = scratch.path() / "two";
  const auto first = played(source, "swarm?seed=3", scratch, one.string());
  const auto again = played(source, "swarm?seed=3", scratch, two.string());
  const auto other = played(source, "swarm?seed=4", scratch);
  EXPECT_GT(first.at("seconds").get<double>(), 1);
  EXPECT_EQ(first, again);
  EXPECT_NE(first.at("state"), other.at("state"));
  const auto names = testing::names_in(one);
  ASSERT_EQ(names.size(), 330u);
  for (const std::string& name : names) ASSERT_EQ(bytes_of(one / name), bytes_of(two / name)) << name;
}

TEST(RunGame, WhatItPutsOnTheTableStaysThere) {
  const ScratchFolder scratch;
  for (const std::string& game : game_names()) {
    const std::string picture = game == "burning_glass" ? (scratch.path() / "burnt.png").string() : "";
    const auto drift = played("synthetic:desk?frames=380&size=320x240", game, scratch, {}, picture).at("drift");
    EXPECT_GT(drift.at("frames").get<int>(), 80) << game;
    EXPECT_LT(drift.at("median_px").get<double>(), 2) << game << " " << drift;
  }
  // What was burnt: a mark on nothing.
  const cv::Mat burnt = cv::imread((scratch.path() / "burnt.png").string(), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(burnt.type(), CV_8UC4);
  cv::Mat alpha;
  cv::extractChannel(burnt, alpha, 3);
  EXPECT_GT(cv::countNonZero(alpha > 128), 20);
  EXPECT_LT(cv::countNonZero(alpha > 128), alpha.rows * alpha.cols / 2);
}

// A camera that goes round a thing on z = 0, drawn with another map's scale and axes.
TEST(GameDrift, IsTheDistanceFromWhereTheThingTrulyIs) {
  const CameraModel camera(CameraModelKind::pinhole, 640, 480, {500, 500}, {319.5, 239.5});
  SimilarityTransform map_from_truth;
  map_from_truth.s = 3;
  map_from_truth.R = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  map_from_truth.t = {0.3, -0.2, 0.9};
  const Eigen::Vector3d thing(0.05, 0.02, 0);
  const auto measured = [&](double error_px, int from) {
    std::vector<GameSight> sights;
    std::vector<StampedPose> truth;
    for (int i = 0; i < 60; ++i) {
      const Timestamp time(static_cast<std::int64_t>(i) * 33'000'000);
      const Eigen::Vector3d eye(0.3 * std::cos(0.05 * i), 0.3 * std::sin(0.05 * i), 0.4);
      const Eigen::Vector3d z = -eye.normalized(), x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
      RigidTransform world_from_camera;
      world_from_camera.R << x, z.cross(x), z;
      world_from_camera.t = eye;
      truth.push_back({time, world_from_camera});
      GameSight sight;
      sight.time = time;
      sight.number = 5;
      sight.camera_from_world = map_from_truth.rebase(world_from_camera.inverse());
      sight.place = map_from_truth * thing;
      // Drawn to the right of where it is.
      const Eigen::Vector3d in_camera = sight.camera_from_world * sight.place;
      if (i >= from)
        sight.place = sight.camera_from_world.inverse() *
                      Eigen::Vector3d(in_camera + Eigen::Vector3d(error_px * in_camera.z() / 500, 0, 0));
      sights.push_back(sight);
    }
    return measure_drift(sights, truth, camera);
  };
  const auto none = measured(0, 0), some = measured(4, 1), late = measured(4, 50);
  ASSERT_TRUE(none && some && late);
  EXPECT_EQ(none->frames, 59);
  EXPECT_EQ(none->things, 1);
  EXPECT_NEAR(none->largest_px, 0, 1e-6);
  EXPECT_NEAR(some->median_px, 4, 1e-6);
  EXPECT_NEAR(late->median_px, 0, 1e-6);
  EXPECT_NEAR(late->largest_px, 4, 1e-6);
  EXPECT_FALSE(measure_drift({}, {}, camera));
}

TEST(RunGame, UnknownGameIsOneLine) {
  expect_one_line(parallax_run({"synthetic:desk?frames=10", "--game", "chess"}), 2, "--game");
}

}  // namespace
}  // namespace parallax
