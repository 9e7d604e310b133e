// Swarm as a Game: repeatable, saved and restored, hostile files, long random play, difficulty, and its picture.
#include <gtest/gtest.h>

#include <cctype>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "core/error.h"
#include "games/swarm_archive.h"
#include "tests/games/swarm_fixture.h"

namespace parallax::swarm {
namespace {

using Eigen::Vector2d;
using Json = nlohmann::json;

std::unique_ptr<Game> started(std::uint64_t seed, const PlayingField& field = empty_field(kRadius_m)) {
  GameOptions options;
  options.seed = seed;
  auto game = make_swarm();
  game->start(field, options);
  return game;
}

// A game in which there is something of everything: the state after a while of patient play, and things added.
std::string rich_save() {
  Simulation game = quiet_game();
  for (int k = 0; k < kKinds; ++k)
    add(&game, static_cast<CritterKind>(k), 0.6 * Vector2d(std::cos(1.5 * k), std::sin(1.5 * k)));
  for (int k = 0; k < 4; ++k) game.edit_state().pickups.push_back({static_cast<PickupKind>(k), {0.5, 0.2 * k}, 900});
  game.edit_state().wave.number = 5;
  game.edit_state().wave.to_release = {9, 3, 2, 2};
  for (int t = 0; t < ticks(6) && (t < ticks(1) || game.state().spits.empty() || game.state().bolts.empty()); ++t)
    game.step(aiming_at(0.6, 0.1, true));
  return save_state(game.state());
}

TEST(SwarmGame, SameSeedAndInputsGiveTheSameStates) {
  const auto play = [](std::uint64_t seed, std::uint64_t player_seed) {
    auto game = started(seed);
    RandomPlayer player(player_seed);
    std::vector<std::uint64_t> hashes;
    for (int t = 0; t < ticks(30); ++t) {
      game->step(player.next());
      if (t % 100 == 0) hashes.push_back(game->state_hash());
    }
    return hashes;
  };
  const auto once = play(5, 1);
  EXPECT_EQ(play(5, 1), once);
  EXPECT_NE(play(6, 1).back(), once.back());
  EXPECT_NE(play(5, 2).back(), once.back());
  EXPECT_EQ(std::set<std::uint64_t>(once.begin(), once.end()).size(), once.size()) << "every state is another one";
}

TEST(SwarmGame, ARestoredGameGoesOnToTheLastBit) {
  PlayingField field = table_with({{0.3, 0.4, -0.5, 0.5}});
  for (const double at_s : {0.5, 12.0, 30.0}) {
    auto game = started(11, field);
    for (int t = 0; t < ticks(at_s); ++t) game->step(game->scripted_input(looking_at(0.5 * std::sin(0.01 * t), 0.2)));
    const std::string saved = game->save();
    auto other = started(99);
    other->restore(saved, field);
    EXPECT_EQ(other->state_hash(), game->state_hash());
    EXPECT_EQ(other->save(), saved);
    for (int t = 0; t < ticks(10); ++t) {
      const RigidTransform camera = looking_at(0.5, 0.5 * std::sin(0.02 * t));
      game->step(game->scripted_input(camera));
      other->step(other->scripted_input(camera));
    }
    EXPECT_EQ(other->state_hash(), game->state_hash()) << "saved at " << at_s << " s";
    EXPECT_EQ(other->save(), game->save());
  }
}

TEST(SwarmGame, HostileSavesAreRefusedInOneLine) {
  const std::string good = rich_save();
  auto game = started(3);
  const std::uint64_t before = game->state_hash();
  const auto refused = [&](const std::string& text, const std::string& what) {
    try {
      game->restore(text, empty_field(kRadius_m));
      ADD_FAILURE() << "taken: " << what;
    } catch (const InputError& error) {
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << what;
      EXPECT_NE(std::string(error.what()).find("saved swarm game"), std::string::npos) << what;
    }
    EXPECT_EQ(game->state_hash(), before) << what;
  };
  ASSERT_FALSE(Json::parse(good)["game"]["bolts"].empty());
  ASSERT_FALSE(Json::parse(good)["game"]["spits"].empty());
  for (std::size_t length = 0; length < good.size(); length += 61) refused(good.substr(0, length), "cut short");
  refused(std::string(5'000'000, '['), "deep");
  refused(std::string(500'000, '['), "less deep");
  refused("{\"format\":\"other\",\"version\":1,\"game\":{}}", "another format");
  refused("[]", "a list");
  refused("\xff\xfe\n", "no text");

  // Every value in turn: gone, of another type, out of bounds.
  const std::vector<Json> poison{nullptr,
                                 "text",
                                 Json::array(),
                                 Json::object(),
                                 1e300,
                                 -1e300,
                                 -5,
                                 1'000'000'000'000'000'000,
                                 0.3,
                                 Json::array({1, nullptr}),
                                 Json::array({1e9, 0}),
                                 Json::array({0, 0, 0})};
  const Json document = Json::parse(good);
  std::vector<std::string> paths;
  const Json flat = document.flatten();
  for (const auto& [path, value] : flat.items()) paths.push_back(path);
  for (const std::string list : {"critters", "bolts", "spits", "pickups"}) paths.push_back("/game/" + list);
  int tried = 0;
  for (const std::string& path : paths) {
    // One of each list is enough.
    if (path.find("/critters/") != std::string::npos && path.find("/critters/0/") == std::string::npos) continue;
    const Json::json_pointer at(path);
    for (const Json& value : poison) {
      // What is a value of that place is none of the hostile ones.
      const bool number = document[at].is_number_float() && value.is_number() && std::abs(value.get<double>()) < 10;
      const bool empty_list = document[at].is_array() && value.is_array() && value.empty();
      const bool word = path == "/game/random" && value.is_number_integer() && value > 0;
      if (number || empty_list || word) continue;
      Json changed = document;
      changed[at] = value;
      refused(changed.dump(), path + " = " + value.dump());
      ++tried;
    }
  }
  EXPECT_GT(tried, 700);
  Json changed = document;
  changed["game"].erase("horde");
  refused(changed.dump(), "a value less");
  changed = document;
  changed["game"]["extra"] = 1;
  refused(changed.dump(), "a value more");
  changed = document;
  while (changed["game"]["critters"].size() <= static_cast<std::size_t>(kMostCritters))
    changed["game"]["critters"].push_back(changed["game"]["critters"][0]);
  refused(changed.dump(), "too many critters");
  changed = document;
  changed["game"]["robot"]["aim"] = {0, 0};
  refused(changed.dump(), "an aim without direction");
  changed = document;
  changed["game"]["over"] = true;
  refused(changed.dump(), "over with health");

  game->restore(good, empty_field(kRadius_m));
  EXPECT_EQ(game->save(), good);
}

TEST(SwarmGame, WhatIsTakenOfADamagedSaveCanBePlayed) {
  const std::string good = rich_save();
  std::uint64_t random = 17;
  int taken = 0;
  for (int attempt = 0; attempt < 200; ++attempt) {
    std::string text = good;
    for (int k = 0; k < 3; ++k) {
      std::size_t at = 0;
      while (std::isdigit(static_cast<unsigned char>(text[at])) == 0)
        at = static_cast<std::size_t>(random_index(&random, static_cast<int>(text.size())));
      text[at] = "0123456789.-"[random_index(&random, 12)];
    }
    auto game = make_swarm();
    try {
      game->restore(text, empty_field(kRadius_m));
    } catch (const InputError&) {
      continue;
    }
    ++taken;
    RandomPlayer player(static_cast<std::uint64_t>(attempt));
    for (int t = 0; t < 100; ++t) game->step(player.next());
    auto copy = make_swarm();
    EXPECT_NO_THROW(copy->restore(game->save(), empty_field(kRadius_m)));
  }
  EXPECT_GT(taken, 20);
}

void expect_bounded(const State& state) {
  ASSERT_LE(state.critters.size(), static_cast<std::size_t>(kMostCritters));
  ASSERT_LE(state.bolts.size(), static_cast<std::size_t>(kMostBolts));
  ASSERT_LE(state.spits.size(), static_cast<std::size_t>(kMostSpits));
  ASSERT_LE(state.pickups.size(), static_cast<std::size_t>(kMostPickups));
  ASSERT_TRUE(state.robot.position.allFinite() && state.robot.position.norm() < 2);
  ASSERT_TRUE(state.robot.aim.allFinite() && state.robot.reticle.allFinite());
  for (const Critter& critter : state.critters)
    ASSERT_TRUE(critter.position.allFinite() && critter.position.norm() < 2 && std::isfinite(critter.heading) &&
                critter.velocity.norm() < 5 && std::abs(critter.height) < 0.3);
}

// Long trials: bench/game_endurance.
TEST(SwarmGame, FiveMinutesOfAnything) {
  const std::vector<PlayingField> fields{empty_field(kRadius_m),
                                         table_with({{0.3, 0.4, -0.5, 0.5}, {-0.6, 0, 0.4, 0.5}})};
  Simulation game;
  RandomPlayer player(2);
  int games = 0, waves = 0;
  std::int64_t wave_began = 0;
  for (std::int64_t t = 0; t < ticks(5 * 60); ++t) {
    if (t == 0 || game.state().over) {
      GameOptions options;
      options.seed = static_cast<std::uint64_t>(++games);
      options.difficulty = static_cast<GameDifficulty>(games % 3);
      options.seated = games % 2 == 0;
      options.settings = {{"horde", games % 5 == 0 ? 2.0 : 1.0}};
      game.start(fields[static_cast<std::size_t>(games % 2)], options);
      wave_began = t;
    }
    const int wave = game.state().wave.number;
    game.step(player.next());
    if (game.state().wave.number != wave) {
      ++waves;
      wave_began = t;
    }
    ASSERT_LT(t - wave_began, ticks(300)) << "a wave that does not end";
    if (t % 16 == 0) expect_bounded(game.state());
    game.take_sounds();
  }
  EXPECT_GT(games, 1);
  EXPECT_GT(waves, 3);
}

TEST(SwarmGame, AFullHordeIsBoundedAndEndsTheGame) {
  GameOptions options;
  options.difficulty = GameDifficulty::hard;
  options.settings = {{"horde", 2.0}};
  Simulation game;
  game.start(empty_field(kRadius_m), options);
  game.edit_state().wave.to_release = {kMostInWave, 0, 0, 0};
  std::size_t most = 0;
  for (int t = 0; t < ticks(200) && !game.state().over; ++t) {
    if (game.state().critters.size() < static_cast<std::size_t>(kMostCritters) && t < ticks(150))
      game.edit_state().robot.health = kFullHealth;
    game.step(aiming_at(0.3, 0));
    most = std::max(most, game.state().critters.size());
    if (t % 16 == 0) expect_bounded(game.state());
  }
  EXPECT_EQ(most, static_cast<std::size_t>(kMostCritters));
  EXPECT_TRUE(game.state().over);
}

TEST(SwarmGame, APatientPlayerSurvivesWavesAndLessWhenItIsHarder) {
  std::array<double, 3> waves{}, points{};
  for (int d = 0; d < 3; ++d)
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      GameOptions options;
      options.seed = seed;
      options.difficulty = static_cast<GameDifficulty>(d);
      options.settings = {{"horde", 2.0}};
      auto game = make_swarm();
      game->start(empty_field(kRadius_m), options);
      for (int t = 0; t < ticks(240) && !game->is_over(); ++t) {
        const double s = t * kGameTick_s;
        game->step(game->scripted_input(looking_at(0.6 * std::sin(0.9 * s), 0.6 * std::sin(1.3 * s + 1))));
      }
      const Json state = Json::parse(game->save())["game"];
      waves[static_cast<std::size_t>(d)] += state["wave"]["number"].get<double>() / 4;
      points[static_cast<std::size_t>(d)] += static_cast<double>(game->hud().score) / 4;
    }
  EXPECT_GT(waves[0], waves[1] + 1);
  EXPECT_GT(waves[1], waves[2] + 1);
  EXPECT_GT(waves[2], 2.5);
  EXPECT_GT(points[1], 500);
}

TEST(SwarmGame, GameOverAndAgain) {
  auto game = started(4);
  const std::uint64_t fresh = game->state_hash();
  std::set<std::string> heard;
  int t = 0;
  for (; t < ticks(300) && !game->is_over(); ++t) {
    game->step(aiming_at(0.9, 0.9));
    const auto sounds = game->take_sounds();
    EXPECT_LE(sounds.size(), 32u);
    for (const GameSound& sound : sounds) heard.insert(sound.name);
  }
  ASSERT_TRUE(game->is_over());
  EXPECT_TRUE(heard.contains("game_over") && heard.contains("player_hurt") && heard.contains("wave_begins"));
  EXPECT_NE(game->hud().message.find("Tock is down"), std::string::npos);
  EXPECT_EQ(game->hud().gauges.at(0).value, 0);
  const std::uint64_t over = game->state_hash();
  for (int k = 0; k < 100; ++k) game->step(aiming_at(0.5, 0, true));
  EXPECT_EQ(game->state_hash(), over) << "nothing happens any more";
  GameOptions options;
  options.seed = 4;
  game->start(empty_field(kRadius_m), options);
  EXPECT_FALSE(game->is_over());
  EXPECT_EQ(game->state_hash(), fresh);
}

TEST(SwarmGame, AScaledMapScalesTheGameAndASmallerOneTakesAllIn) {
  auto game = make_swarm();
  game->restore(rich_save(), empty_field(kRadius_m));
  const std::string before = game->save();
  PlayingField scaled = empty_field(3 * kRadius_m);
  scaled.scale = 3;
  game->change_field(scaled);
  EXPECT_EQ(game->save(), before) << "in proportion";
  RigidTransform far = looking_at(0.6, 0.1);
  far.t *= 3;  // the same view of the scaled table
  GameInput input;
  input.camera_from_plane = far;
  game->step(input);
  auto other = make_swarm();
  other->restore(before, empty_field(kRadius_m));
  other->step(aiming_at(0.6, 0.1));
  const Json a = Json::parse(game->save())["game"]["robot"]["sight"],
             b = Json::parse(other->save())["game"]["robot"]["sight"];
  EXPECT_NEAR(a[0].get<double>(), b[0].get<double>(), 1e-9);
  EXPECT_NEAR(a[1].get<double>(), b[1].get<double>(), 1e-9);

  PlayingField small = empty_field(3 * kRadius_m);
  small.scale = 3;
  for (Vector2d& corner : small.outline_m) corner *= 0.5;
  game->change_field(small);
  const Json state = Json::parse(game->save())["game"];
  int seen = 0;
  for (const char* list : {"critters", "pickups"})
    for (const Json& thing : state[list]) {
      if (thing.contains("phase") && thing["phase"] == 0) continue;
      ++seen;
      EXPECT_TRUE(inside_outline(small, 0.95 * 3 * kRadius_m * Vector2d(thing["position"][0], thing["position"][1])));
    }
  EXPECT_GT(seen, 3);
}

TEST(SwarmGame, AMapThatGrowsMovesNothingUntilTheNextWave) {
  Simulation game = quiet_game();
  add(&game, CritterKind::swarmer, {0.6, 0});
  game.edit_state().robot.position = {0.4, -0.3};
  const Vector2d robot_m = game.state().robot.position * game.unit_m();
  const Vector2d critter_m = game.state().critters[0].position * game.unit_m();
  const Vector2d home_m = game.state().home * game.unit_m();
  game.change_field(empty_field(1.5 * kRadius_m));
  EXPECT_NEAR(game.unit_m(), kRadius_m, 1e-12);
  EXPECT_NEAR((game.state().robot.position * game.unit_m() - robot_m).norm(), 0, 1e-12);
  EXPECT_NEAR((game.state().critters[0].position * game.unit_m() - critter_m).norm(), 0, 1e-12);
  EXPECT_NEAR((game.state().home * game.unit_m() - home_m).norm(), 0, 1e-12);
  EXPECT_TRUE(game.ground().walkable({1.3, 0})) << "but the new part is there";
  // A saved game keeps the unit.
  Simulation later;
  later.restore(restore_state(save_state(game.state())), empty_field(1.5 * kRadius_m));
  EXPECT_NEAR(later.unit_m(), kRadius_m, 1e-12);
  // The next wave: the field's measure, everything where it was.
  game.edit_state().critters.clear();
  game.edit_state().wave.to_release = {};
  const int wave = game.state().wave.number;
  for (int t = 0; t < ticks(5) && game.unit_m() < 1.2 * kRadius_m; ++t) game.step(aiming_at(0.9, 0));
  EXPECT_EQ(game.state().wave.number, wave + 1);
  EXPECT_NEAR(game.unit_m(), 1.5 * kRadius_m, 1e-12);
  EXPECT_LT((game.state().robot.position * game.unit_m() - robot_m).norm(), 1e-3);
  EXPECT_NEAR((game.state().home * game.unit_m() - home_m).norm(), 0, 1e-12);
  // Another table: all in proportion.
  PlayingField other = empty_field(4 * kRadius_m);
  other.number = 7;
  const Vector2d before = game.state().robot.position;
  game.change_field(other);
  EXPECT_NEAR(game.unit_m(), 4 * kRadius_m, 1e-12);
  EXPECT_EQ(game.state().robot.position, before);
}

TEST(SwarmGame, TheExplanationFitsOneScreen) {
  const auto game = make_swarm();
  EXPECT_EQ(game->info().name, "swarm");
  EXPECT_LE(game->info().explanation.size(), 10u);
  for (const std::string& line : game->info().explanation) EXPECT_LE(line.size(), 48u) << line;
}

TEST(SwarmGame, ThePictureHasWhatIsThereAndItsLegsMove) {
  const ModelSet models = ModelSet::load(std::string(PARALLAX_SOURCE_DIR) + "/assets/models");
  PlayingField field = empty_field(kRadius_m);
  field.world_from_plane = looking({0.3, -0.2, 0.9}, {0, 0.1, 0}).inverse();
  Simulation plain = quiet_game(field);
  add(&plain, CritterKind::swarmer, {0.6, 0});
  auto game = make_swarm();
  game->restore(save_state(plain.state()), field);
  const auto picture = [&] {
    DrawList list;
    game->draw(models, &list);
    return list;
  };
  const DrawList first = picture();
  EXPECT_EQ(first.meshes.size(), models.model("robot").parts.size() + 2) << "a critter's trunk and its limbs";
  EXPECT_FALSE(first.world_lines.empty()) << "the reticle";
  EXPECT_TRUE(first.shadow_plane.has_value());
  // The critter stands where it is, in the world, about as long as it should be.
  const MeshInstance& body = first.meshes[0];
  const Eigen::Vector3f expected = (field.world_from_plane * Eigen::Vector3d(0.6 * kRadius_m, 0, 0)).cast<float>();
  EXPECT_LT((body.world_from_model.translation() - expected).norm(), kCritterLength * kRadius_m);
  EXPECT_NEAR(body.world_from_model.linear().col(0).norm(), kCritterLength * kRadius_m, 1e-3);

  // A leg turns against the body while it walks.
  const auto leg_against_body = [&](const DrawList& list) {
    const Model& model = models.model("swarmer");
    for (std::size_t i = 0; i < model.parts.size(); ++i)
      if (model.parts[i].name.rfind("leg", 0) == 0)
        return Eigen::Matrix3f(list.meshes[0].world_from_model.linear().inverse() *
                               list.meshes[i].world_from_model.linear());
    return Eigen::Matrix3f(Eigen::Matrix3f::Zero());
  };
  ASSERT_GT(leg_against_body(first).norm(), 0.1f);
  float most = 0;
  for (int t = 0; t < 60; ++t) {
    game->step(aiming_at(0, 0.6));
    most = std::max(most, (leg_against_body(picture()) - leg_against_body(first)).norm());
  }
  EXPECT_GT(most, 0.3f);

  // With everything there is: all finite, bars over the hurt, sparks when something is hit; nothing through walls.
  game->restore(rich_save(), field);
  const std::size_t lines_before = picture().world_lines.size();
  std::size_t sprites = 0;
  for (int t = 0; t < ticks(2); ++t) {
    game->step(aiming_at(0.6, 0.1, true));
    const DrawList list = picture();
    sprites = std::max(sprites, list.sprites.size());
    for (const MeshInstance& mesh : list.meshes) ASSERT_TRUE(mesh.world_from_model.matrix().allFinite());
    for (const Sprite& sprite : list.sprites) ASSERT_TRUE(sprite.position.allFinite() && sprite.radius_m > 0);
  }
  EXPECT_GT(sprites, 5u);
  EXPECT_GT(lines_before, 40u);
}

}  // namespace
}  // namespace parallax::swarm
