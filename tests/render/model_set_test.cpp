// The models of the games: what is in their files, and that they are what scripts/make-models makes.
#include "render/model_set.h"

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <opencv2/imgproc.hpp>
#include <set>
#include <tuple>

#include "core/error.h"
#include "tests/render/offscreen_scene.h"
#include "tests/support/process.h"

namespace parallax {
namespace {

using Eigen::Vector3f;

const std::string kFolder = std::string(PARALLAX_SOURCE_DIR) + "/assets/models";

const ModelSet& models() {
  static const ModelSet set = ModelSet::load(kFolder);
  return set;
}

// Every model the games ask for, with the parts they move.
const std::map<std::string, std::set<std::string>>& promised() {
  static const std::set<std::string> sign{"base", "icon"}, body{"body"},
      four_legs{"body", "jaw", "leg_front_left", "leg_front_right", "leg_back_left", "leg_back_right"};
  static const std::map<std::string, std::set<std::string>> all{
      {"robot", {"body", "turret", "wheel_front_left", "wheel_front_right", "wheel_back_left", "wheel_back_right"}},
      {"swarmer",
       {"body", "jaw", "leg_front_left", "leg_front_right", "leg_middle_left", "leg_middle_right", "leg_back_left",
        "leg_back_right"}},
      {"flanker", four_legs},
      {"jumper", four_legs},
      {"spitter", four_legs},
      {"bolt", body},
      {"spit", body},
      {"pickup_heal", sign},
      {"pickup_rapid", sign},
      {"pickup_shield", sign},
      {"pickup_bomb", sign},
      {"sun", {"body", "rays"}},
      {"lens", {"rim", "glass"}},
      {"marble", body},
      {"coin", body},
      {"goal", body},
      {"ramp", body},
      {"flag", {"pole", "cloth"}}};
  return all;
}

TEST(Models, HaveTheirParts) {
  for (const auto& [name, parts] : promised()) {
    ASSERT_TRUE(models().contains(name)) << name;
    std::set<std::string> found;
    for (const ModelPart& part : models().model(name).parts) {
      EXPECT_TRUE(found.insert(part.name).second) << name << " has two parts " << part.name;
    }
    EXPECT_EQ(found, parts) << name;
  }
  EXPECT_EQ(models().names().size(), promised().size());
}

TEST(Models, StandOnTheTableAndAreAMetreLong) {
  for (const std::string& name : models().names()) {
    Eigen::AlignedBox3f box;
    std::size_t triangles = 0;
    for (const ModelPart& part : models().model(name).parts) {
      for (const MeshVertex& v : part.mesh->vertices) box.extend(part.model_from_part * v.position);
      triangles += part.mesh->indices.size() / 3;
    }
    EXPECT_GE(box.min().z(), -0.001f) << name;
    if (name != "spit" && name != "bolt") {  // they fly
      EXPECT_LE(box.min().z(), 0.3f) << name;
    }
    EXPECT_GT(box.sizes().maxCoeff(), 0.85f) << name;
    EXPECT_LT(box.sizes().maxCoeff(), 1.15f) << name;
    if (name != "flag") {  // its pole is on the axis
      EXPECT_LT(std::abs(box.center().x()), 0.1f) << name;
      EXPECT_LT(std::abs(box.center().y()), 0.02f + (name == "pickup_bomb" ? 0.05f : 0.0f)) << name;
    }
    EXPECT_GE(triangles, 200u) << name;
    EXPECT_LE(triangles, 1600u) << name;
  }
}

TEST(Models, AreClosedAndFaceOutwards) {
  for (const std::string& name : models().names()) {
    for (const ModelPart& part : models().model(name).parts) {
      const Mesh& mesh = *part.mesh;
      const std::string what = name + "/" + part.name;
      using Place = std::tuple<long, long, long>;
      const auto place = [](const Vector3f& p) {
        return Place(std::lround(2e4f * p.x()), std::lround(2e4f * p.y()), std::lround(2e4f * p.z()));
      };
      std::map<std::pair<Place, Place>, int> edges;
      double volume = 0;
      int turned_away = 0;
      for (std::size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
        std::array<MeshVertex, 3> v;
        for (std::size_t k = 0; k < 3; ++k) v[k] = mesh.vertices.at(mesh.indices[i + k]);
        const Vector3f a = v[0].position, b = v[1].position, c = v[2].position;
        volume += a.cast<double>().dot(b.cast<double>().cross(c.cast<double>())) / 6;
        for (const MeshVertex& vertex : v) {
          EXPECT_NEAR(vertex.normal.norm(), 1, 1e-3) << what;
          turned_away += vertex.normal.dot(Vector3f((b - a).cross(Vector3f(c - a)))) <= 0;
        }
        for (std::size_t k = 0; k < 3; ++k) {
          const Place from = place(v[k].position), to = place(v[(k + 1) % 3].position);
          if (from == to) continue;
          ++edges[{from, to}];
          --edges[{to, from}];
        }
      }
      int open = 0;
      for (const auto& [edge, count] : edges) open += count != 0;
      EXPECT_EQ(open, 0) << what << ": edges without a neighbour";
      EXPECT_GT(volume, 1e-5) << what;
      EXPECT_EQ(turned_away, 0) << what << ": normals that point inwards";
    }
  }
}

TEST(Models, AreWhatTheScriptMakes) {
  const testing::ScratchFolder scratch;
  const auto made =
      testing::run_process(std::string(PARALLAX_SOURCE_DIR) + "/scripts/make-models", {scratch.path().string()});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  for (const std::string& name : models().names()) {
    EXPECT_TRUE(testing::read_all(scratch.file(name + ".glb")) == testing::read_all(kFolder + "/" + name + ".glb"))
        << name << ".glb: run scripts/make-models again";
  }
}

TEST(Models, ThirtyPixelsAreEnoughToTellCrittersApart) {
  constexpr int kSize = 36;  // the model itself is some thirty pixels long
  std::optional<testing::OffscreenScene> scene;
  try {
    scene.emplace(kSize, kSize);
  } catch (const RunError& error) {
    GTEST_SKIP() << error.what();
  }
  const std::vector<std::string> critters{"swarmer", "flanker", "jumper", "spitter"};
  std::vector<cv::Mat1b> outlines;
  std::vector<cv::Scalar> colours;
  for (const std::string& name : critters) {
    DrawList list = testing::empty_list(CameraModel(CameraModelKind::pinhole, kSize, kSize, {kSize * 2.4, kSize * 2.4},
                                                    {(kSize - 1) / 2.0, (kSize - 1) / 2.0}));
    list.background_colour = {1, 0, 1, 1};
    list.camera_from_world = testing::look_at({2, 1.6, 1.7}, {0, 0, 0.35});
    draw_model(models().model(name), Eigen::Affine3f::Identity(), {}, 0, {}, &list);
    const cv::Mat3b image = scene->draw(list);
    cv::Mat1b background, outline;
    cv::inRange(image, cv::Scalar(250, 0, 250), cv::Scalar(255, 5, 255), background);
    outline = ~background;
    EXPECT_GT(cv::countNonZero(outline), 120) << name;
    cv::Mat3f lab, real;
    image.convertTo(real, CV_32FC3, 1.0 / 255);
    cv::cvtColor(real, lab, cv::COLOR_BGR2Lab);
    outlines.push_back(outline);
    colours.push_back(cv::mean(lab, outline));
  }
  for (std::size_t i = 0; i < critters.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const double together = cv::countNonZero(outlines[i] & outlines[j]);
      const double overlap = together / cv::countNonZero(outlines[i] | outlines[j]);
      EXPECT_LT(overlap, 0.7) << critters[i] << " and " << critters[j] << " have one outline";
      const cv::Scalar d = colours[i] - colours[j];
      EXPECT_GT(std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]), 15)
          << critters[i] << " and " << critters[j] << " have one colour";
    }
  }
}

TEST(Models, AMovedPartTurnsAboutItsJoint) {
  const Model& robot = models().model("robot");
  const ModelPart* turret = robot.part("turret");
  ASSERT_NE(turret, nullptr);
  EXPECT_EQ(robot.part("tail"), nullptr);
  PartMotion quarter{"turret"};
  quarter.motion.rotate(Eigen::AngleAxisf(static_cast<float>(M_PI / 2), Vector3f::UnitZ()));
  Eigen::Affine3f world_from_model = Eigen::Affine3f::Identity();
  world_from_model.translate(Vector3f(3, 2, 1)).scale(2);
  DrawList list;
  draw_model(robot, world_from_model, {0.5f, 0.25f, 1, 1}, 0.125f, {quarter}, &list);
  ASSERT_EQ(list.meshes.size(), robot.parts.size());
  for (std::size_t i = 0; i < robot.parts.size(); ++i) {
    const MeshInstance& drawn = list.meshes[i];
    const ModelPart& part = robot.parts[i];
    EXPECT_EQ(drawn.mesh, part.mesh);
    EXPECT_EQ(drawn.tint.g, 0.25f);
    EXPECT_EQ(drawn.emission, 0.125f);
    Vector3f ahead = part.model_from_part * Vector3f(1, 0, 0);
    if (part.name == "turret") {
      ahead = part.model_from_part.translation() + Vector3f(0, 1, 0);
    }
    EXPECT_LT((drawn.world_from_model * Vector3f(1, 0, 0) - (2 * ahead + Vector3f(3, 2, 1))).norm(), 1e-5f);
  }
}

TEST(Models, SomethingIsSeenOfAModelThatIsNotThere) {
  EXPECT_FALSE(models().contains("unicorn"));
  EXPECT_FALSE(models().model("unicorn").parts.empty());
  EXPECT_FALSE(ModelSet().model("robot").parts.empty());
}

TEST(Models, AnAbsentFolderIsNamed) {
  try {
    ModelSet::load("no/such/folder");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("no/such/folder: found"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace parallax
