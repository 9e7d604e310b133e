#include "tracker/projection.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <set>
#include <vector>

#include "map/source_patch.h"

namespace parallax {
namespace {

constexpr double kMinCosine = 0.2;

CameraModel lens(int i) {
  if (i == 0) return {CameraModelKind::pinhole, 640, 480, {420, 421}, {318, 241}};
  if (i == 1) return {CameraModelKind::fov, 640, 480, {375, 376}, {321.4, 238.2}, {0.9}, 1};
  return {CameraModelKind::radtan, 640, 480, {390, 391}, {318.2, 241.3}, {-0.26, 0.07, 4e-4, -3e-4}, 4};
}

// Points all around the origin, facing every which way; patches a fraction of a millimetre to a centimetre a pixel.
TrackingSnapshot cloud(int n, unsigned seed) {
  TrackingSnapshot s;
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> place(-2, 2), unit(-1, 1), size(-8, -4);
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector3d p(place(rng), place(rng), place(rng));
    Eigen::Vector3d normal(unit(rng), unit(rng), unit(rng));
    normal.normalize();
    const Eigen::Vector3d right = normal.unitOrthogonal(), down = (-normal).cross(right);
    const double pixel_m = std::exp(size(rng));
    s.id.push_back({0, i});
    s.position.push_back(p);
    s.x.push_back(static_cast<float>(p.x()));
    s.y.push_back(static_cast<float>(p.y()));
    s.z.push_back(static_cast<float>(p.z()));
    s.nx.push_back(static_cast<float>(normal.x()));
    s.ny.push_back(static_cast<float>(normal.y()));
    s.nz.push_back(static_cast<float>(normal.z()));
    Eigen::Matrix<float, 3, 2> axes;
    axes.col(0) = (right * pixel_m).cast<float>();
    axes.col(1) = (down * pixel_m).cast<float>();
    s.axes.push_back(axes);
    s.source.push_back(0);
    s.source_level.push_back(0);
    s.source_pixel.emplace_back(0, 0);
    s.quality.push_back(static_cast<std::uint8_t>(i % 6));
  }
  return s;
}

RigidTransform pose(unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> angle(-3, 3), place(-1, 1);
  const Eigen::Vector3d w(angle(rng), angle(rng), angle(rng)), t(place(rng), place(rng), place(rng));
  return {exp_so3(w), t};
}

TEST(Projection, CandidatesAreWhatDirectComputationSays) {
  for (int l = 0; l < 3; ++l) {
    const CameraModel camera = lens(l);
    const TrackingSnapshot map = cloud(3000, 4);
    MapProjector projector(camera, kMinCosine);
    std::vector<Candidate> candidates;
    std::set<int> levels;
    int total = 0;
    for (unsigned k = 0; k < 6; ++k) {
      const RigidTransform camera_from_world = pose(k);
      projector.project(map, camera_from_world, &candidates);
      total += static_cast<int>(candidates.size());
      for (const Candidate& c : candidates) {
        const auto row = static_cast<std::size_t>(c.row);
        Eigen::Vector2d pixel;
        ASSERT_TRUE(camera.project(camera_from_world * map.position[row], &pixel));
        EXPECT_NEAR((pixel - c.pixel).norm(), 0, 1e-9);
        for (int a = 0; a < 2; ++a) {
          const Eigen::Vector3d axis = map.axes[row].col(a).cast<double>();
          const double h = 1e-4 / axis.norm();
          Eigen::Vector2d plus, minus;
          ASSERT_TRUE(camera.project(camera_from_world * (map.position[row] + h * axis), &plus));
          ASSERT_TRUE(camera.project(camera_from_world * (map.position[row] - h * axis), &minus));
          EXPECT_NEAR((c.warp.col(a) - (plus - minus) / (2 * h)).norm(), 0, 1e-4 * (1 + c.warp.norm()));
        }
        EXPECT_EQ(c.level, target_level(c.warp.determinant()));
        levels.insert(c.level);
      }
    }
    EXPECT_GT(total, 100);
    EXPECT_EQ(levels.size(), 4U) << "every level is searched by some";
  }
}

// Against the definition, point by point, in double precision; points within a hair of a border may go either way.
TEST(Projection, CullLosesNothingAndKeepsNothingWrong) {
  for (int l = 0; l < 3; ++l) {
    const CameraModel camera = lens(l);
    const TrackingSnapshot map = cloud(4001, 9);
    MapProjector projector(camera, kMinCosine);
    std::vector<Candidate> candidates;
    for (unsigned k = 10; k < 18; ++k) {
      const RigidTransform camera_from_world = pose(k);
      projector.project(map, camera_from_world, &candidates);
      EXPECT_TRUE(std::is_sorted(candidates.begin(), candidates.end(),
                                 [](const Candidate& a, const Candidate& b) { return a.row < b.row; }));
      std::set<int> found;
      for (const Candidate& c : candidates) found.insert(c.row);
      EXPECT_EQ(found.size(), candidates.size());
      const Eigen::Vector3d centre = camera_from_world.inverse().t;
      for (int row = 0; row < map.size(); ++row) {
        const auto i = static_cast<std::size_t>(row);
        const Eigen::Vector3d p = camera_from_world * map.position[i];
        const Eigen::Vector3d normal(map.nx[i], map.ny[i], map.nz[i]);
        const double cosine = normal.dot((centre - map.position[i]).normalized());
        if (std::abs(cosine - kMinCosine) < 1e-4) continue;
        Eigen::Vector2d px;
        Eigen::Matrix<double, 2, 3> jacobian;
        bool expected = cosine > kMinCosine && p.z() > 0 && camera.project(p, &px, &jacobian);
        if (expected) {
          const double det = (jacobian * camera_from_world.R * map.axes[i].cast<double>()).determinant();
          const int level = target_level(det);
          const double border = level < 0 ? 0 : 4 * level_scale(level);
          if (std::abs(std::min({px.x(), px.y(), 639 - px.x(), 479 - px.y()}) - border) < 1e-3) continue;
          expected = level >= 0 && camera.in_image(px, border);
        }
        EXPECT_EQ(found.contains(row), expected) << "lens " << l << " pose " << k << " row " << row;
      }
    }
  }
}

TEST(Projection, AnEdgeOnPatchIsNoCandidate) {
  TrackingSnapshot map = cloud(500, 3);
  for (auto& axes : map.axes) axes.setZero();
  MapProjector projector(lens(0), kMinCosine);
  std::vector<Candidate> candidates;
  projector.project(map, pose(1), &candidates);
  EXPECT_TRUE(candidates.empty());
  projector.project(TrackingSnapshot(), pose(1), &candidates);
  EXPECT_TRUE(candidates.empty());
}

// Candidates all over a 640x480 image, a crowd of them in one corner.
std::vector<Candidate> crowd(int spread, int crowded, unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> x(5, 634), y(5, 474), near(5, 45);
  std::vector<Candidate> out;
  for (int i = 0; i < spread + crowded; ++i) {
    Candidate c;
    c.row = i;
    c.pixel = i < spread ? Eigen::Vector2d(x(rng), y(rng)) : Eigen::Vector2d(near(rng), near(rng));
    out.push_back(c);
  }
  return out;
}

int cell_of(const Candidate& c) {
  return static_cast<int>(c.pixel.y() * 9 / 480) * 12 + static_cast<int>(c.pixel.x() * 12 / 640);
}

TEST(ChooseSpread, TakesAllWhenThereIsRoom) {
  const auto candidates = crowd(50, 50, 1);
  std::vector<int> chosen;
  choose_spread(candidates, cloud(100, 1), 640, 480, 100, &chosen);
  ASSERT_EQ(chosen.size(), 100U);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(chosen[static_cast<std::size_t>(i)], i);
  choose_spread({}, cloud(1, 1), 640, 480, 10, &chosen);
  EXPECT_TRUE(chosen.empty());
}

TEST(ChooseSpread, CountsExactlyAndSharesOutFairly) {
  const auto candidates = crowd(1200, 1800, 2);
  TrackingSnapshot map = cloud(3000, 2);
  for (int count : {1, 50, 333, 1000, 2999}) {
    std::vector<int> chosen;
    choose_spread(candidates, map, 640, 480, count, &chosen);
    ASSERT_EQ(static_cast<int>(chosen.size()), count);
    EXPECT_TRUE(std::is_sorted(chosen.begin(), chosen.end()));
    EXPECT_EQ(std::set<int>(chosen.begin(), chosen.end()).size(), chosen.size());
    std::map<int, int> available, taken;
    for (const Candidate& c : candidates) ++available[cell_of(c)];
    for (int i : chosen) ++taken[cell_of(candidates[static_cast<std::size_t>(i)])];
    // A cell with something left over has no fewer than any other cell, but for the last round.
    int most = 0;
    for (const auto& [cell, n] : taken) most = std::max(most, n);
    for (const auto& [cell, n] : available) {
      if (taken[cell] < n) {
        EXPECT_GE(taken[cell], most - 1) << "cell " << cell << " count " << count;
      }
    }
  }
}

TEST(ChooseSpread, WellMeasuredPointsComeFirst) {
  const auto candidates = crowd(1000, 0, 3);
  TrackingSnapshot map = cloud(1000, 3);  // half of the rows have a quality of three or more
  std::vector<int> chosen;
  choose_spread(candidates, map, 640, 480, 250, &chosen);
  int good = 0;
  for (int i : chosen) good += map.quality[static_cast<std::size_t>(i)] >= 3 ? 1 : 0;
  EXPECT_GT(good, 240);
}

TEST(ChooseSpread, TheSamePointsAreChosenFromFrameToFrame) {
  const TrackingSnapshot map = cloud(3000, 5);
  auto candidates = crowd(1200, 1800, 5);
  std::vector<int> chosen;
  choose_spread(candidates, map, 640, 480, 500, &chosen);
  std::set<int> before;
  for (int i : chosen) before.insert(candidates[static_cast<std::size_t>(i)].row);
  // Half a pixel of motion, and some candidates drop out.
  std::mt19937 rng(1);
  std::bernoulli_distribution gone(0.03);
  std::erase_if(candidates, [&](const Candidate&) { return gone(rng); });
  std::set<int> still;
  for (Candidate& c : candidates) {
    c.pixel += Eigen::Vector2d(0.5, -0.3);
    if (before.contains(c.row)) still.insert(c.row);
  }
  choose_spread(candidates, map, 640, 480, 500, &chosen);
  int same = 0;
  for (int i : chosen) same += still.contains(candidates[static_cast<std::size_t>(i)].row) ? 1 : 0;
  EXPECT_GT(same, 0.9 * static_cast<double>(still.size()));
}

}  // namespace
}  // namespace parallax
