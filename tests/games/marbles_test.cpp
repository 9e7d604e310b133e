// Marbles: the table made of real things, the levels made of the table, the rules, and the game as the program sees it.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>

#include "core/error.h"
#include "games/marbles_game.h"

namespace parallax {
namespace {

constexpr double kTableRadius_m = 0.2;
constexpr double kUnit_m = kTableRadius_m / kMarblesFieldRadius;

double share(std::mt19937_64* random) { return static_cast<double>((*random)() >> 11) * 0x1p-53; }

// A desk with boxes turned every way, heights with noise, and speckles.
PlayingField cluttered_field(std::uint64_t seed, int things, double cell_m = 0.005) {
  PlayingField field = empty_field(kTableRadius_m);
  field.outline_m.clear();
  for (int i = 0; i < 10; ++i) {
    const double angle = 2 * M_PI * i / 10;
    field.outline_m.push_back(kTableRadius_m * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
  }
  auto surface = std::make_shared<SceneSurface>();
  surface->cell_m = cell_m;
  surface->columns = surface->rows = static_cast<int>(0.5 / cell_m);
  surface->corner_m = {-0.25, -0.25};
  const std::size_t cells = surface->index(surface->columns - 1, surface->rows - 1) + 1;
  surface->height_m.assign(cells, 0);
  surface->known.assign(cells, 1);
  std::mt19937_64 random(seed);
  for (int thing = 0; thing < things; ++thing) {
    const double turn = 3 * share(&random), width = 0.01 + 0.05 * share(&random), depth = 0.01 + 0.05 * share(&random);
    const Eigen::Vector2d at(0.36 * share(&random) - 0.18, 0.36 * share(&random) - 0.18);
    const double height = thing % 2 == 0 ? 0.006 + 0.012 * share(&random) : 0.02 + 0.06 * share(&random);
    for (std::size_t i = 0; i < cells; ++i) {
      const int column = static_cast<int>(i) % surface->columns, row = static_cast<int>(i) / surface->columns;
      const Eigen::Vector2d from = surface->centre_of(column, row) - at;
      if (std::abs(from.x() * std::cos(turn) + from.y() * std::sin(turn)) < width &&
          std::abs(from.y() * std::cos(turn) - from.x() * std::sin(turn)) < depth)
        surface->height_m[i] = static_cast<float>(height + 0.001 * share(&random));
    }
  }
  for (int k = 0; k < 30; ++k) surface->height_m[random() % cells] = static_cast<float>(0.05 * share(&random));
  field.surface = surface;
  return field;
}

RigidTransform camera_over_table(double roll = 0, double pitch = 0.9) {
  // From the viewer's side, looking down by `pitch`.
  const Eigen::Vector3d forward(0, std::cos(pitch), -std::sin(pitch)), right(1, 0, 0);
  Eigen::Matrix3d R;
  R.row(0) = right;
  R.row(1) = forward.cross(right);
  R.row(2) = forward;
  R = Eigen::AngleAxisd(-roll, Eigen::Vector3d::UnitZ()).toRotationMatrix() * R;
  return {R, -(R * (-0.4 * forward))};
}

GameOptions options_of(std::uint64_t seed, GameDifficulty difficulty = GameDifficulty::normal) {
  GameOptions options;
  options.seed = seed;
  options.difficulty = difficulty;
  return options;
}

void wait_until_playing(MarblesGame* game) {
  for (int tick = 0; tick < 1000 && game->state().phase != MarblesPhase::playing; ++tick) game->step({});
}

TEST(MarblesGround, NoiseIsRemovedAndThingsAreKept) {
  PlayingField field = empty_field(kTableRadius_m);
  auto surface = std::make_shared<SceneSurface>();
  surface->cell_m = 0.25 * kUnit_m;
  surface->columns = surface->rows = 140;
  surface->corner_m = Eigen::Vector2d::Constant(-70 * surface->cell_m);
  surface->height_m.assign(140 * 140, 0);
  surface->known.assign(140 * 140, 1);
  const auto set = [&](int c0, int c1, int r0, int r1, double units) {
    for (int r = r0; r < r1; ++r)
      for (int c = c0; c < c1; ++c) surface->height_m[surface->index(c, r)] = static_cast<float>(units * kUnit_m);
  };
  set(20, 40, 20, 40, 1.0);    // a thing
  set(28, 30, 28, 30, 0.0);    // with a hole
  set(22, 24, 22, 24, 1.15);   // and an uneven top
  set(60, 61, 20, 60, 2.0);    // a wall of one cell
  set(80, 82, 80, 82, 3.0);    // a speckle
  set(90, 120, 90, 120, 0.2);  // noise of the plane
  field.surface = surface;
  const TableGround ground = read_ground(field, kUnit_m);
  const auto at = [&](int c, int r) {
    const Eigen::Vector2i cell = ground.grid.cell_of((surface->centre_of(c, r) / kUnit_m).cast<float>());
    return ground.height[ground.grid.index(cell.x(), cell.y())];
  };
  EXPECT_NEAR(at(25, 25), 1, 1e-3);
  EXPECT_EQ(at(29, 29), at(25, 25));
  EXPECT_EQ(at(23, 23), at(25, 25));
  EXPECT_NEAR(at(60, 40), 2, 1e-3);
  EXPECT_EQ(at(81, 81), 0);
  EXPECT_EQ(at(100, 100), 0);

  // The blocks cover the cells that are not 0, once, at their heights.
  const std::vector<TableBox> boxes = merge_boxes(ground);
  EXPECT_LT(boxes.size(), 12u);
  for (std::size_t i = 0; i < ground.grid.size(); ++i) {
    const Eigen::Vector2f centre = ground.grid.centre(i);
    int covered = 0;
    for (const TableBox& box : boxes) {
      const bool within = (centre.array() > box.least.array()).all() && (centre.array() < box.most.array()).all();
      covered += within;
      if (within) {
        EXPECT_EQ(box.height, ground.height[i]);
      }
    }
    ASSERT_EQ(covered, ground.height[i] > 0 ? 1 : 0);
  }
}

TEST(MarblesLevel, EverythingCanBeReachedAndNothingIsInsideAnything) {
  int ramps = 0, on_top = 0;
  for (std::uint64_t seed = 1; seed <= 24; ++seed) {
    const PlayingField field = cluttered_field(seed, static_cast<int>(seed % 9), seed % 2 ? 0.005 : 0.01);
    const TableGround ground = read_ground(field, kUnit_m);
    MarblesLevelWishes wishes;
    wishes.seed = seed;
    MarblesLevel level, again;
    ASSERT_TRUE(make_marbles_level(ground, wishes, &level)) << seed;
    ASSERT_TRUE(make_marbles_level(ground, wishes, &again));
    EXPECT_EQ(level.start, again.start);
    EXPECT_EQ(level.goal, again.goal);
    EXPECT_GE(level.coins.size(), 2u) << seed;
    ramps += static_cast<int>(level.ramps.size());

    const WalkMap walk = make_walk_map(ground, level.ramps);
    const auto start = walk.cell_at(level.start);
    ASSERT_TRUE(start);
    const std::vector<float> ways = ways_to(walk, *start);
    const auto check = [&](const Eigen::Vector2f& place, float height, const std::string& what) {
      const auto cell = walk.cell_at(place);
      ASSERT_TRUE(cell);
      EXPECT_TRUE(std::isfinite(ways[*cell])) << what << " of " << seed << " cannot be reached";
      EXPECT_NEAR(walk.height[*cell], height, 1e-6);
      EXPECT_GT(distance_inside(ground.outline, place), kMarbleRadius);
      for (const TableBox& box : merge_boxes(ground)) {
        const Eigen::Vector2f nearest = place.cwiseMax(box.least).cwiseMin(box.most);
        if (box.height > height + 0.05f) {
          EXPECT_GE((nearest - place).norm(), kMarbleRadius) << what << " of " << seed << " stands in something";
        }
      }
    };
    check(level.start, level.start_height, "start");
    check(level.goal, level.goal_height, "goal");
    for (const MarblesCoin& coin : level.coins) {
      check(coin.place, coin.height, "coin");
      on_top += coin.height > 0;
    }
    for (const Eigen::Vector2f& place : level.loose) check(place, 0, "loose marble");

    // A level that fits is left as it is.
    MarblesLevel mended = level;
    ASSERT_TRUE(mend_marbles_level(ground, &mended));
    EXPECT_EQ(mended.start, level.start);
    EXPECT_EQ(mended.goal, level.goal);
    EXPECT_EQ(mended.ramps.size(), level.ramps.size());
  }
  EXPECT_GT(ramps, 2);
  EXPECT_GT(on_top, 2);
}

TEST(MarblesWalk, WaysAreNoShorterThanStraightAndNeverThroughThings) {
  const TableGround ground = read_ground(cluttered_field(5, 6), kUnit_m);
  const WalkMap walk = make_walk_map(ground, {});
  const int area = walk.greatest_area();
  const auto target = walk.nearest_drivable({0, 0}, 20, area);
  ASSERT_TRUE(target);
  const std::vector<float> ways = ways_to(walk, *target);
  for (std::size_t i = 0; i < walk.grid.size(); ++i) {
    EXPECT_EQ(std::isfinite(ways[i]), walk.area[i] == area);
    if (walk.area[i] != area) continue;
    EXPECT_GE(ways[i], 0.999f * (walk.grid.centre(i) - walk.grid.centre(*target)).norm() - 1e-3f);
    EXPECT_EQ(ground.height[i], ground.height[*target]);  // without ramps one height is all
  }
}

TEST(Marbles, TheScriptedPlayerFinishesLevels) {
  int finished = 0, over_ramps = 0;
  constexpr int kDesks = 12;
  for (std::uint64_t seed = 1; seed <= kDesks; ++seed) {
    MarblesGame game;
    game.start(cluttered_field(100 + seed, 3 + static_cast<int>(seed % 4)), options_of(seed));
    int high = 0;
    for (const MarblesCoin& coin : game.state().level.coins) high += coin.height > 0;
    int tick = 0;
    while (tick < 110 * kGameTicksPerSecond && game.state().level_number == 1 && !game.is_over()) {
      game.step(game.scripted_input(std::nullopt));
      ++tick;
    }
    EXPECT_EQ(game.state().level_number, 2) << "seed " << seed;
    EXPECT_GE(game.state().score, 500);
    finished += game.state().level_number == 2;
    over_ramps += game.state().level_number == 2 && high > 0;
  }
  EXPECT_EQ(finished, kDesks);
  EXPECT_GT(over_ramps, 0);
}

TEST(Marbles, SameInputsSameStatesAndASavedGameGoesOnAlike) {
  const PlayingField field = cluttered_field(3, 5);
  MarblesGame a, b, c;
  a.start(field, options_of(9));
  b.start(field, options_of(9));
  EXPECT_EQ(a.state_hash(), b.state_hash());
  std::mt19937_64 random(4);
  GameInput input;
  for (int tick = 0; tick < 20 * kGameTicksPerSecond; ++tick) {
    if (tick % 40 == 0) {
      input.move = {2 * share(&random) - 1, 2 * share(&random) - 1};
      input.fire = random() % 2 == 0;
      input.camera_from_plane = camera_over_table(0.2 * share(&random), 0.8 + 0.3 * share(&random));
    }
    a.step(input);
    b.step(input);
    if (tick == 777) c.restore(a.save(), field);
    if (tick > 777) c.step(input);
    if (tick % 60 == 0) {
      ASSERT_EQ(a.state_hash(), b.state_hash()) << tick;
    }
    if (tick >= 777 && tick % 30 == 0) {
      ASSERT_EQ(a.save(), c.save()) << tick;
    }
  }
  MarblesGame other;
  other.start(field, options_of(10));
  EXPECT_NE(other.state().level.goal, a.state().level.goal);
}

TEST(Marbles, HostileSavesAreRefusedInOneLineAndChangeNothing) {
  const PlayingField field = cluttered_field(3, 5);
  MarblesGame game;
  game.start(field, options_of(9));
  wait_until_playing(&game);
  const std::string good = game.save();
  const auto with = [&](const std::string& from, const std::string& to) {
    const std::size_t at = good.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return at == std::string::npos ? std::string() : good.substr(0, at) + to + good.substr(at + from.size());
  };
  std::vector<std::string> bad = {"",
                                  "{",
                                  "[]",
                                  "null",
                                  "{\"game\":\"swarm\"}",
                                  good.substr(0, good.size() / 2),
                                  with("\"version\":1", "\"version\":2"),
                                  with("\"lives\":3", "\"lives\":-1"),
                                  with("\"lives\":3", "\"lives\":\"a\\nb\""),
                                  with("\"seed\":9", "\"seed\":-9"),
                                  with("\"unit_m\":", "\"unit_m\":1e300,\"x\":"),
                                  with("\"unit_m\":", "\"y\":"),
                                  with("\"unit_m\":", "\"unit_m\":1e-8,\"x\":"),
                                  with("\"rotation\":[", "\"rotation\":[1,"),
                                  with("\"position\":[", "\"position\":[1e9,"),
                                  with("\"coins\":[", "\"coins\":[7,"),
                                  with("\"phase\":1", "\"phase\":9"),
                                  with("\"marbles\":[", "\"marbles\":[],\"z\":["),
                                  with("\"tilt\":[", "\"tilt\":[null,"),
                                  std::string(3 << 20, '['),
                                  std::string(100000, '[')};
  const std::uint64_t before = game.state_hash();
  for (const std::string& text : bad) {
    try {
      game.restore(text, field);
      ADD_FAILURE() << "taken: " << text.substr(0, 80);
    } catch (const InputError& error) {
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
      EXPECT_LT(std::string(error.what()).size(), 300u);
    }
    EXPECT_EQ(game.state_hash(), before);
  }
  // Cut and bent at random: refused or playable, never worse.
  std::mt19937_64 random(1);
  for (int k = 0; k < 300; ++k) {
    std::string text = good;
    for (int n = 0; n < 3; ++n)
      text[random() % text.size()] = static_cast<char>("0123456789-.e,\"[]{}x"[random() % 20]);
    try {
      MarblesGame restored;
      restored.restore(text, field);
      for (int tick = 0; tick < 5; ++tick) restored.step({});
    } catch (const InputError&) {
    }
  }
}

TEST(Marbles, AMarbleOverTheEdgeCostsALifeAndComesBack) {
  MarblesGame game;
  game.start(empty_field(kTableRadius_m), options_of(2));
  wait_until_playing(&game);
  GameInput input;
  input.move = {1, 0};
  int tick = 0;
  for (; tick < 20 * kGameTicksPerSecond && game.state().lives == 3; ++tick) game.step(input);
  EXPECT_EQ(game.state().lives, 2);
  for (tick = 0; tick < 2 * kGameTicksPerSecond; ++tick) game.step({});
  const Eigen::Vector3f& at = game.state().marbles.front().position;
  EXPECT_LT((at.head<2>() - game.state().level.start).norm(), 3);
  EXPECT_NEAR(at.z(), kMarbleRadius, 0.05);
  for (tick = 0; tick < 100 * kGameTicksPerSecond && !game.is_over(); ++tick) game.step(input);
  EXPECT_TRUE(game.is_over());
  EXPECT_EQ(game.state().lives, 0);
}

TEST(Marbles, TheCameraTiltsTheTableAndTheKeysTakeOver) {
  MarblesGame game;
  GameOptions options = options_of(2);
  options.settings = {{"loose_marbles", 0}};
  game.start(empty_field(kTableRadius_m), options);
  wait_until_playing(&game);
  GameInput input;
  input.camera_from_plane = camera_over_table();
  const auto play = [&] {
    for (int tick = 0; tick < 60; ++tick) game.step(input);
    return game.state().tilt;
  };
  EXPECT_LT(play().norm(), 1e-4);
  input.camera_from_plane = camera_over_table(0.15);  // the right side down
  // Turned about an axis that looks down, the right side dips by less.
  EXPECT_NEAR(play().x(), std::asin(std::sin(0.15) * std::cos(0.9)) - 0.026, 0.01);
  EXPECT_NEAR(game.state().tilt.y(), 0, 0.02);
  input.camera_from_plane = camera_over_table(0, 0.9 + 0.15);  // nose down: away
  EXPECT_NEAR(play().y(), std::sin(0.15 - 0.026), 0.02);
  EXPECT_NEAR(game.state().tilt.x(), 0, 0.02);
  input.move = {-1, 0};
  EXPECT_NEAR(play().x(), -kMarblesGreatestTilt, 1e-3);
  input.move = {0, 0};
  input.act = true;  // this attitude is level now
  play();
  input.act = false;
  EXPECT_LT(play().norm(), 1e-4);
}

TEST(Marbles, AFlickSendsTheMarbleAlongTheView) {
  MarblesGame game;
  game.start(empty_field(kTableRadius_m), options_of(2));
  wait_until_playing(&game);
  const Eigen::Vector2d at_m = game.state().marbles[0].position.head<2>().cast<double>() * game.state().unit_m;
  GameInput input;
  RigidTransform camera = camera_over_table();
  camera.t -= camera.R * Eigen::Vector3d(at_m.x(), at_m.y(), 0);  // aimed at the marble
  input.camera_from_plane = camera;
  input.fire = true;
  for (int tick = 0; tick < 60; ++tick) game.step(input);
  EXPECT_LT(game.state().marbles[0].velocity.norm(), 0.1f);
  EXPECT_EQ(game.hud().gauges.back().label, "flick");
  input.fire = false;
  game.step(input);
  EXPECT_NEAR(game.state().marbles[0].velocity.y(), 15, 1.5);
  EXPECT_NEAR(game.state().marbles[0].velocity.x(), 0, 0.1);
}

TEST(Marbles, AMapThatGrowsLiftsMarblesOutAndOneThatScalesMovesNothing) {
  MarblesGame game;
  PlayingField field = cluttered_field(3, 2);
  game.start(field, options_of(4));
  wait_until_playing(&game);
  const MarblesState before = game.state();

  // Something now stands where the player's marble is.
  PlayingField grown = field;
  auto surface = std::make_shared<SceneSurface>(*field.surface);
  const Eigen::Vector2d at_m = before.marbles[0].position.head<2>().cast<double>() * before.unit_m;
  for (int row = 0; row < surface->rows; ++row)
    for (int column = 0; column < surface->columns; ++column)
      if ((surface->centre_of(column, row) - at_m).norm() < 0.04)
        surface->height_m[surface->index(column, row)] = 0.03f;
  grown.surface = surface;
  for (Eigen::Vector2d& corner : grown.outline_m) corner *= 1.3;
  grown.outline_m.push_back(0.5 * (grown.outline_m.front() + grown.outline_m.back()));
  game.change_field(grown);
  const MarbleMotion& lifted = game.state().marbles[0];
  EXPECT_EQ(lifted.position.head<2>(), before.marbles[0].position.head<2>());
  EXPECT_NEAR(lifted.position.z(), 0.03 / before.unit_m + kMarbleRadius, 0.1);
  EXPECT_EQ(game.state().unit_m, before.unit_m);
  for (int tick = 0; tick < 15 * kGameTicksPerSecond; ++tick) game.step(game.scripted_input(std::nullopt));
  EXPECT_GE(game.state().lives, 2);  // put back when it cannot come down by itself

  // The same again, twice the size.
  MarblesGame scaled;
  scaled.start(field, options_of(4));
  wait_until_playing(&scaled);
  PlayingField twice = field;
  twice.radius_m *= 2;
  twice.scale = 2;
  for (Eigen::Vector2d& corner : twice.outline_m) corner *= 2;
  auto larger = std::make_shared<SceneSurface>(*field.surface);
  larger->cell_m *= 2;
  larger->corner_m *= 2;
  for (float& height : larger->height_m) height *= 2;
  twice.surface = larger;
  scaled.change_field(twice);
  EXPECT_NEAR(scaled.state().unit_m, 2 * before.unit_m, 1e-9);
  EXPECT_EQ(scaled.state().marbles[0].position, before.marbles[0].position);
  EXPECT_EQ(scaled.state().level.goal, before.level.goal);
  EXPECT_EQ(scaled.table().boxes.size(), merge_boxes(read_ground(field, before.unit_m)).size());
}

// A new map may have any scale.
TEST(Marbles, AnotherTableIsPlayedOnInProportion) {
  MarblesGame game;
  game.start(cluttered_field(3, 2), options_of(4));
  wait_until_playing(&game);
  const double unit_m = game.state().unit_m;
  for (const double factor : {0.01, 1.0, 300.0}) {
    PlayingField other = empty_field(factor * kTableRadius_m);
    other.number = game.state().level_number + static_cast<int>(10 * factor) + 7;
    game.change_field(other);
    EXPECT_NEAR(game.state().unit_m, factor * unit_m, 1e-9 * factor);
    EXPECT_TRUE(game.walk().cell_at(game.state().level.goal));
    for (int tick = 0; tick < 120; ++tick) game.step(game.scripted_input(std::nullopt));
  }
}

TEST(Marbles, OddFieldsCanBePlayed) {
  PlayingField nothing;
  PlayingField full = cluttered_field(1, 0);
  auto surface = std::make_shared<SceneSurface>(*full.surface);
  for (float& height : surface->height_m)
    height = 0.05f * static_cast<float>(&height - surface->height_m.data()) / 9e3f;
  full.surface = surface;
  PlayingField sliver = empty_field(kTableRadius_m);
  sliver.outline_m = {{0, 0}, {1e-3, 0}, {0, 1e-3}};
  PlayingField broken = empty_field(kTableRadius_m);
  broken.outline_m[1].x() = std::nan("");
  for (const PlayingField& field : {nothing, full, sliver, broken}) {
    MarblesGame game;
    game.start(field, options_of(1));
    for (int tick = 0; tick < 600; ++tick) game.step(game.scripted_input(std::nullopt));
    EXPECT_TRUE(game.state().marbles[0].position.allFinite());
    EXPECT_FALSE(game.is_over());
  }
}

// Long trials: bench/game_endurance.
TEST(Marbles, FiveMinutesOfRandomInput) {
  MarblesGame game;
  std::mt19937_64 random(11);
  std::uint64_t games = 1;
  game.start(cluttered_field(7, 6), options_of(games));
  GameInput input;
  std::size_t longest_save = 0;
  int since_change = 0;
  for (int tick = 0; tick < 5 * 60 * kGameTicksPerSecond; ++tick) {
    if (tick % 50 == 0) {
      input.move = {3 * share(&random) - 1.5, 3 * share(&random) - 1.5};
      input.fire = random() % 3 == 0;
      input.act = random() % 9 == 0;
      input.camera_from_plane.reset();
      if (random() % 5 != 0) input.camera_from_plane = camera_over_table(share(&random) - 0.5, 1.5 * share(&random));
    }
    if (tick % 20011 == 0) game.change_field(cluttered_field(random(), static_cast<int>(random() % 8)));
    const int lives = game.state().lives, number = game.state().level_number;
    game.step(input);
    since_change = lives == game.state().lives && number == game.state().level_number ? since_change + 1 : 0;
    ASSERT_LE(since_change, marbles_level_ticks(GameDifficulty::normal, 1) + 10 * kGameTicksPerSecond) << "stuck";
    for (const MarbleMotion& marble : game.state().marbles) {
      ASSERT_TRUE(marble.position.allFinite() && marble.velocity.allFinite());
      ASSERT_LT(marble.position.norm(), 500);
    }
    if (tick % 997 == 0) longest_save = std::max(longest_save, game.save().size());
    if (tick % 120 == 0) {
      ASSERT_LE(game.take_sounds().size(), 32u);
    }
    if (game.is_over()) {
      game.start(cluttered_field(random(), static_cast<int>(random() % 8)), options_of(++games));
      since_change = 0;
    }
  }
  EXPECT_LT(longest_save, 20000u);
  EXPECT_GT(games, 1u);
}

TEST(Marbles, DrawsItsThings) {
  MarblesGame game;
  game.start(cluttered_field(3, 5), options_of(9));
  const ModelSet models;  // boxes in the place of models
  DrawList list;
  game.draw(models, &list);
  EXPECT_GE(list.meshes.size(), game.state().level.coins.size() + game.state().marbles.size() + 1);
  EXPECT_GT(list.world_lines.size(), 10u);
  for (const std::string& line : game.info().explanation) EXPECT_LE(line.size(), 48u);
  EXPECT_LE(game.info().explanation.size(), 10u);
}

}  // namespace
}  // namespace parallax
