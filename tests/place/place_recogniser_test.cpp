#include "place/place_recogniser.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/place/made_scenes.h"

namespace parallax {
namespace {

using namespace testing;

// A corridor that is walked along z, a keyframe every half metre and every second.
struct MadeSession {
  std::vector<RigidTransform> world_from;
  std::vector<StereoScene> scenes;
};

struct MadeBuilding {
  MadeWorld world;
  std::shared_ptr<const Vocabulary> vocabulary;
  CrfModel model = CrfModel::load(PARALLAX_SOURCE_DIR "/assets/vocabulary/matching.crf");
  std::mt19937_64 rng{7};

  MadeBuilding() {
    add_made_points({-2, -1.5, 0}, {2, 1.5, 45}, 1600, &rng, &world);
    std::vector<std::vector<BinaryDescriptor>> images(1);
    for (const auto& point : world.points) {
      if (images.back().size() == 100) images.emplace_back();
      images.back().push_back(point.descriptor);
    }
    VocabularyOptions options;
    options.levels = 3;
    vocabulary = std::make_shared<const Vocabulary>(Vocabulary::train(images, options));
  }

  MadeSession walk(int steps, double aside) {
    MadeSession out;
    for (int i = 0; i < steps; ++i) {
      out.world_from.emplace_back(exp_so3({0, 0.05 * aside, 0}), Eigen::Vector3d(aside, 0, 0.5 * i));
      out.scenes.push_back(made_scene(world, out.world_from.back().inverse(), {}, &rng));
    }
    return out;
  }
};

using Answers = std::vector<std::vector<PlaceEncounter>>;

Answers ask(PlaceRecogniser* recogniser, int session, const MadeSession& walk) {
  Answers out;
  recogniser->begin_session(session, made_camera());
  for (std::size_t i = 0; i < walk.scenes.size(); ++i)
    out.push_back(
        recogniser->add({session, static_cast<int>(i)}, from_seconds(static_cast<double>(i)), walk.scenes[i]));
  return out;
}

TEST(PlaceRecogniser, FindsAnotherSessionWithTheRightPose) {
  MadeBuilding building;
  const MadeSession first = building.walk(40, 0), second = building.walk(20, 0.3);
  PlaceRecogniser recogniser(building.vocabulary, building.model);
  for (const auto& answers : ask(&recogniser, 0, first))
    for (const PlaceEncounter& e : answers) EXPECT_FALSE(e.refused.empty()) << e.query.keyframe;
  const Answers answers = ask(&recogniser, 4, second);
  int found = 0;
  for (std::size_t i = 0; i < answers.size(); ++i) {
    bool any = false;
    for (const PlaceEncounter& e : answers[i]) {
      if (!e.refused.empty()) continue;
      any = true;
      EXPECT_EQ(e.query, (SceneKey{4, static_cast<int>(i)}));
      EXPECT_EQ(e.found.session, 0);
      const RigidTransform truth =
          first.world_from[static_cast<std::size_t>(e.found.keyframe)].inverse() * second.world_from[i];
      EXPECT_LT((e.found_from_query * truth.inverse()).log().norm(), 0.1);
      EXPECT_GT(e.covariance.diagonal().minCoeff(), 0);
    }
    found += any ? 1 : 0;
  }
  EXPECT_GE(found, 17);
  EXPECT_EQ(recogniser.size(), 60);
}

TEST(PlaceRecogniser, TheSameCallsGiveTheSameAnswersRestoredOrNot) {
  MadeBuilding building;
  const MadeSession first = building.walk(20, 0), second = building.walk(6, 0.2);
  PlaceRecogniser asked(building.vocabulary, building.model), restored(building.vocabulary, building.model);
  ask(&asked, 0, first);
  restored.begin_session(0, made_camera());
  for (std::size_t i = 0; i < first.scenes.size(); ++i)
    restored.restore({0, static_cast<int>(i)}, from_seconds(static_cast<double>(i)), first.scenes[i]);
  const Answers a = ask(&asked, 1, second), b = ask(&restored, 1, second);
  int encounters = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].size(), b[i].size());
    for (std::size_t k = 0; k < a[i].size(); ++k, ++encounters) {
      EXPECT_EQ(a[i][k].found, b[i][k].found);
      EXPECT_EQ(a[i][k].refused, b[i][k].refused);
      EXPECT_EQ(a[i][k].found_from_query.t, b[i][k].found_from_query.t);
      EXPECT_EQ(a[i][k].covariance, b[i][k].covariance);
    }
  }
  EXPECT_GE(encounters, 6);
}

TEST(PlaceRecogniser, OwnSessionOnlyAfterTheGapAndForgottenSessionsNever) {
  MadeBuilding building;
  MadeSession walk = building.walk(35, 0);
  const MadeSession back = building.walk(10, 0.1);  // to where it began
  walk.scenes.insert(walk.scenes.end(), back.scenes.begin(), back.scenes.end());
  PlaceRecogniserOptions options;
  PlaceRecogniser recogniser(building.vocabulary, building.model, options);
  int accepted = 0;
  const Answers answers = ask(&recogniser, 2, walk);
  for (std::size_t i = 0; i < answers.size(); ++i) {
    for (const PlaceEncounter& e : answers[i]) {
      EXPECT_LE(e.found.keyframe, static_cast<int>(i) - options.min_gap_keyframes);
      accepted += e.refused.empty() ? 1 : 0;
    }
  }
  EXPECT_GE(accepted, 6);
  recogniser.forget_session(2);
  EXPECT_EQ(recogniser.size(), 0);
  for (const auto& of_query : ask(&recogniser, 3, back)) EXPECT_TRUE(of_query.empty());
  options.accepted = 0;
  EXPECT_THROW(PlaceRecogniser(building.vocabulary, building.model, options), InputError);
}

}  // namespace
}  // namespace parallax
