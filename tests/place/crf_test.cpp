#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "core/error.h"
#include "place/crf_matching.h"
#include "place/crf_training.h"
#include "place/crf_tree.h"
#include "place/feature_tree.h"
#include "tests/place/made_scenes.h"

namespace parallax {
namespace {

using namespace testing;

TreeField random_field(int n, int most_states, double spread, std::mt19937_64* rng) {
  std::vector<std::int32_t> parent(1, -1);
  for (int i = 1; i < n; ++i)
    parent.push_back((*rng)() % 8 == 0 ? -1 : static_cast<std::int32_t>((*rng)() % static_cast<std::uint64_t>(i)));
  TreeField field(parent, most_states);
  for (auto& states : field.states)
    states = 1 + static_cast<std::int32_t>((*rng)() % static_cast<std::uint64_t>(most_states));
  for (auto* values : {&field.local, &field.pair})
    for (double& value : *values) value = spread * made_gaussian(rng);
  return field;
}

// Every assignment, one after the other; false after the last.
bool advance(const TreeField& field, std::vector<std::int32_t>* assignment) {
  for (std::size_t i = 0; i < assignment->size(); ++i) {
    if (++(*assignment)[i] < field.states[i]) return true;
    (*assignment)[i] = 0;
  }
  return false;
}

TEST(CrfTree, EqualsBruteForceOnSmallTrees) {
  std::mt19937_64 rng(1);
  for (int round = 0; round < 40; ++round) {
    const TreeField field = random_field(1 + round % 7, 4, round % 3 == 0 ? 300 : 1.5, &rng);
    const int n = field.size();
    std::vector<std::int32_t> at(static_cast<std::size_t>(n), 0);
    double most = -HUGE_VAL;
    do most = std::max(most, field_score(field, at));
    while (advance(field, &at));
    double sum = 0;
    std::vector<double> states(field.local.size(), 0), pairs(field.pair.size(), 0);
    do {
      const double p = std::exp(field_score(field, at) - most);
      sum += p;
      for (int i = 0; i < n; ++i) {
        const auto row = static_cast<std::size_t>(i);
        states[field.index(i, at[row])] += p;
        if (field.parent[row] >= 0)
          pairs[field.index(i, at[static_cast<std::size_t>(field.parent[row])], at[row])] += p;
      }
    } while (advance(field, &at));
    std::vector<std::int32_t> best;
    EXPECT_NEAR(best_assignment(field, &best), most, 1e-9 * (1 + std::abs(most)));
    EXPECT_NEAR(field_score(field, best), most, 1e-9 * (1 + std::abs(most)));
    EXPECT_NEAR(log_partition(field), most + std::log(sum), 1e-9 * (1 + std::abs(most)));
    std::vector<double> state_marginals, pair_marginals;
    EXPECT_DOUBLE_EQ(field_marginals(field, &state_marginals, &pair_marginals), log_partition(field));
    for (std::size_t k = 0; k < states.size(); ++k) EXPECT_NEAR(state_marginals[k], states[k] / sum, 1e-9);
    for (std::size_t k = 0; k < pairs.size(); ++k) EXPECT_NEAR(pair_marginals[k], pairs[k] / sum, 1e-9);
  }
}

TEST(FeatureTree, IsAsShortAsKruskals) {
  std::mt19937_64 rng(2);
  for (const int n : {1, 2, 17, 60}) {
    std::vector<Eigen::Vector3f> at;
    std::vector<std::int32_t> rows;
    for (int i = 0; i < n; ++i) {
      at.push_back(Eigen::Vector3d(made_gaussian(&rng), made_gaussian(&rng), made_gaussian(&rng)).cast<float>());
      rows.push_back(100 + i);
    }
    const FeatureTree tree = minimum_spanning_tree(rows, at);
    ASSERT_EQ(tree.size(), n);
    double length = 0;
    std::vector<std::int32_t> seen = tree.feature;
    for (int v = 1; v < n; ++v) {
      const auto row = static_cast<std::size_t>(v);
      ASSERT_LT(tree.parent[row], v);
      ASSERT_GE(tree.parent[row], 0);
      const auto a = static_cast<std::size_t>(tree.feature[row] - 100);
      const auto b = static_cast<std::size_t>(tree.feature[static_cast<std::size_t>(tree.parent[row])] - 100);
      length += static_cast<double>((at[a] - at[b]).norm());
    }
    EXPECT_EQ(tree.parent[0], -1);
    std::sort(seen.begin(), seen.end());
    EXPECT_EQ(seen, rows);
    // Kruskal: edges by length, joined where they join two parts.
    struct Edge {
      double length;
      int a, b;
    };
    std::vector<Edge> edges;
    for (int a = 0; a < n; ++a)
      for (int b = 0; b < a; ++b)
        edges.push_back(
            {static_cast<double>((at[static_cast<std::size_t>(a)] - at[static_cast<std::size_t>(b)]).norm()), a, b});
    std::sort(edges.begin(), edges.end(), [](const Edge& x, const Edge& y) { return x.length < y.length; });
    std::vector<int> part(static_cast<std::size_t>(n));
    std::iota(part.begin(), part.end(), 0);
    double shortest = 0;
    for (const Edge& e : edges) {
      const int from = part[static_cast<std::size_t>(e.a)], to = part[static_cast<std::size_t>(e.b)];
      if (from == to) continue;
      shortest += e.length;
      std::replace(part.begin(), part.end(), from, to);
    }
    EXPECT_NEAR(length, shortest, 1e-5 * (1 + shortest));
  }
}

// A stretch of a corridor and walks along it.
struct MadePlaces {
  MadeWorld world;
  std::mt19937_64 rng;
  explicit MadePlaces(std::uint64_t seed) : rng(seed) {
    add_made_points({-2, -1.5, 2}, {2, 1.5, 12}, 500, &rng, &world);
  }
  struct View {
    StereoScene scene;
    std::vector<Eigen::Vector3d> points;
    RigidTransform camera_from_world;
  };
  View view(double sideways, double forwards, double turn) {
    View out;
    out.camera_from_world = RigidTransform(exp_so3({0, turn, 0}), Eigen::Vector3d(sideways, 0, forwards)).inverse();
    std::vector<int> rows;
    MadeView noise;
    noise.missed = 0.4;
    out.scene = made_scene(world, out.camera_from_world, noise, &rng, &rows);
    build_scene_trees(made_camera(), {}, &out.scene);
    for (const int row : rows)
      out.points.push_back(row < 0 ? Eigen::Vector3d::Constant(NAN)
                                   : out.camera_from_world * world.points[static_cast<std::size_t>(row)].at);
    return out;
  }
};

LabelledProblem label(const MadePlaces::View& from, const MadePlaces::View& to) {
  return label_problem(from.scene, to.scene, SceneGraph::near, from.points, to.points, made_camera(),
                       to.camera_from_world * from.camera_from_world.inverse());
}

TEST(CrfTraining, GradientIsThatOfTheObjective) {
  MadePlaces places(3);
  std::vector<LabelledProblem> data{label(places.view(0, 0, 0), places.view(0.2, 0.1, 0.03))};
  // As alike as different features of one wall are: candidates that are wrong.
  data.push_back(data.front());
  std::fill(data.back().state.begin(), data.back().state.end(), 0);
  CrfWeights at{0.7, -2, 0.4, -0.3, 0.5, -1, 0.2, -0.6, -0.1}, gradient{}, unused{};
  crf_objective(data, at, 2, &gradient);
  for (std::size_t k = 0; k < at.size(); ++k) {
    CrfWeights more = at, less = at;
    more[k] += 1e-5;
    less[k] -= 1e-5;
    const double slope = (crf_objective(data, more, 2, &unused) - crf_objective(data, less, 2, &unused)) / 2e-5;
    EXPECT_NEAR(gradient[k], slope, 1e-6 * (1 + std::abs(slope))) << kCrfWeightNames[k];
  }
}

TEST(CrfTraining, LearnedWeightsTellPlacesApartThatWereNotInTraining) {
  std::vector<LabelledProblem> data;
  for (std::uint64_t seed = 10; seed < 16; ++seed) {
    MadePlaces one(seed), other(seed + 100);
    const auto here = one.view(0, 0, 0);
    data.push_back(label(here, one.view(0.3, 0.4, 0.05)));
    data.push_back(label(here, other.view(0, 0, 0)));
    std::fill(data.back().state.begin(), data.back().state.end(), 0);
  }
  CrfTrainingOptions options;
  CrfGraphModel model;
  model.explained = 0.64;
  model.weight = train_crf_weights(data, options);
  CrfWeights gradient{};
  crf_objective(data, model.weight, options.prior_sigma, &gradient);
  double vertices = 0;
  for (const auto& one : data) vertices += one.problem.size();
  for (const double g : gradient) EXPECT_LT(std::abs(g), 1e-4 * vertices);

  int right = 0, all = 0;
  for (std::uint64_t seed = 20; seed < 25; ++seed) {
    MadePlaces one(seed), other(seed + 100);
    const auto here = one.view(0, 0, 0), again = one.view(-0.4, 0.3, -0.04);
    const CrfMatch before = match_by_crf(here.scene, one.view(0, -0.5, 0).scene, SceneGraph::near, model);
    const CrfMatch match = match_by_crf(here.scene, again.scene, SceneGraph::near, model);
    EXPECT_LE(crf_eta(match, before, model), 2);
    EXPECT_GT(crf_eta(match_by_crf(here.scene, other.view(0, 0, 0).scene, SceneGraph::near, model), before, model), 2);
    EXPECT_DOUBLE_EQ(crf_eta(before, before, model), 1);
    const RigidTransform again_from_here = again.camera_from_world * here.camera_from_world.inverse();
    for (const auto& [i, j] : match.pairs) {
      const Eigen::Vector3d there = again_from_here * here.points[static_cast<std::size_t>(i)];
      right += (there - again.points[static_cast<std::size_t>(j)]).norm() < 1e-6 ? 1 : 0;
      ++all;
    }
  }
  MadePlaces one(30);
  const auto here = one.view(0, 0, 0), again = one.view(-0.4, 0.3, -0.04);
  const CrfMatch match = match_by_crf(here.scene, again.scene, SceneGraph::near, model, true);
  EXPECT_GT(match.negative_log, 0);
  EXPECT_LT(match.negative_log, match.vertices * std::log(kCrfStates));
  EXPECT_GT(all, 200);
  EXPECT_GT(right, 0.97 * all);
}

TEST(CrfTraining, ProbabilityOfExplainedSeparatesAtBeta) {
  std::vector<CrfEvidence> evidence;
  for (int i = 0; i < 50; ++i) {
    evidence.push_back({true, 40, 10 + i % 10});
    evidence.push_back({false, 40, 32 + i % 8});
  }
  const double p = choose_explained(evidence, 2, 1), found = -std::log(p), missing = -std::log1p(-p);
  for (const CrfEvidence& one : evidence)
    EXPECT_EQ((one.explained_before - one.missing) * found + one.missing * missing <= 2 * one.explained_before * found,
              one.same_place);
}

TEST(CrfMatching, TooFewFeaturesSayNothing) {
  const CrfGraphModel model;
  CrfMatch before;
  for (int i = 0; i < kLeastExplained - 1; ++i) before.pairs.emplace_back(i, i);
  EXPECT_TRUE(std::isnan(crf_eta(before, before, model)));
  before.pairs.emplace_back(100, 100);
  EXPECT_DOUBLE_EQ(crf_eta(before, before, model), 1);
  EXPECT_EQ(match_by_crf({}, {}, SceneGraph::far, model).vertices, 0);
}

TEST(CrfModel, ReadsBackToTheLastBitAndSaysWhatIsWrong) {
  CrfModel model = CrfModel::load(PARALLAX_SOURCE_DIR "/assets/vocabulary/matching.crf");
  EXPECT_LT(model.near.weight[1], 0);  // fewer differing bits are better
  model.near.weight[3] = 1.0 / 3.0;
  model.far.explained = 0.7000000000000001;
  EXPECT_EQ(CrfModel::parse(model.text(), "x").text(), model.text());
  EXPECT_EQ(CrfModel::parse(model.text(), "x").near.weight[3], 1.0 / 3.0);
  const auto message = [&](const std::string& text) -> std::string {
    try {
      CrfModel::parse(text, "weights.crf");
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  const std::string good = model.text();
  EXPECT_EQ(message(""), "weights.crf: line 1: found '', expected 'parallax matching weights 1'");
  EXPECT_NE(message(good + "near colour 1\n").find("line 22"), std::string::npos);
  EXPECT_NE(message(good.substr(0, good.rfind("far"))).find("found 19 weights, expected 20"), std::string::npos);
  EXPECT_NE(message(good + "near match 1\n").find("each weight once"), std::string::npos);
  std::string nan = good;
  nan.replace(nan.find("near match ") + 11, 3, "nan");
  EXPECT_NE(message(nan).find("line 2"), std::string::npos);
}

}  // namespace
}  // namespace parallax
