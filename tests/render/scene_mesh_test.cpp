// What meshes go through before they are drawn: cutting, and the shadow below them.
#include <gtest/gtest.h>

#include <map>
#include <numbers>
#include <opencv2/core.hpp>

#include "render/mesh_shadow.h"
#include "render/mesh_shapes.h"
#include "render/mesh_subdivision.h"

namespace parallax {
namespace {

using Key = std::array<float, 3>;
Key key(const Eigen::Vector3f& p) { return {p.x() + 0.0f, p.y() + 0.0f, p.z() + 0.0f}; }

double area(const Mesh& mesh) {
  double sum = 0;
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
    const Eigen::Vector3f a = mesh.vertices[mesh.indices[i]].position, b = mesh.vertices[mesh.indices[i + 1]].position,
                          c = mesh.vertices[mesh.indices[i + 2]].position;
    sum += 0.5 * (b - a).cross(c - a).norm();
  }
  return sum;
}

// How often each edge, by the places of its ends, is passed forwards minus backwards: 0 everywhere in a closed surface.
int open_edges(const Mesh& mesh) {
  std::map<std::pair<Key, Key>, int> passed;
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
    for (int k = 0; k < 3; ++k) {
      const Key a = key(mesh.vertices[mesh.indices[i + k]].position);
      const Key b = key(mesh.vertices[mesh.indices[i + (k + 1) % 3]].position);
      passed[std::minmax(a, b)] += a < b ? 1 : -1;
    }
  }
  return static_cast<int>(std::count_if(passed.begin(), passed.end(), [](const auto& e) { return e.second != 0; }));
}

TEST(MeshSubdivision, CutsEveryLongEdgeAndKeepsTheSurfaceClosed) {
  const auto box = box_mesh({0.3f, 0.2f, 0.1f});
  ASSERT_EQ(open_edges(*box), 0);
  // Finer towards one side, as it is in a view.
  const auto too_long = [](const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
    return (a - b).norm() > 0.02f + 0.3f * std::max(0.0f, 0.5f * (a + b).x());
  };
  const Mesh cut = subdivide(*box, too_long);
  EXPECT_GT(cut.indices.size() / 3, 200u);
  EXPECT_NEAR(area(cut), area(*box), 1e-5);
  EXPECT_EQ(open_edges(cut), 0) << "no gaps where finer meets coarser";
  for (std::size_t i = 0; i < cut.indices.size(); i += 3) {
    for (int k = 0; k < 3; ++k) {
      EXPECT_FALSE(
          too_long(cut.vertices[cut.indices[i + k]].position, cut.vertices[cut.indices[i + (k + 1) % 3]].position));
    }
  }
}

TEST(MeshSubdivision, CarriesTheAttributes) {
  const auto quad = quad_mesh(2, 1);
  const Mesh cut = subdivide(*quad, [](const auto& a, const auto& b) { return (a - b).norm() > 0.13f; });
  EXPECT_TRUE(cut.two_sided);
  for (const MeshVertex& v : cut.vertices) {
    EXPECT_NEAR(v.uv.x(), 0.5f + v.position.x() / 2, 1e-5f);
    EXPECT_NEAR(v.uv.y(), 0.5f - v.position.y(), 1e-5f);
    EXPECT_EQ(v.normal, Eigen::Vector3f(0, 0, 1));
  }
}

TEST(MeshSubdivision, GivesUpAtItsLimit) {
  const auto quad = quad_mesh(1, 1);
  const Mesh cut = subdivide(
      *quad, [](const auto&, const auto&) { return true; }, 1000);
  EXPECT_LE(cut.indices.size() / 3, 1010u);
  EXPECT_NEAR(area(cut), 1, 1e-4);
}

// Share of an even sky that a solid hides from a place of the plane: rays with the cosine's density, one by one.
template <typename Hit>
double hidden_from(const Eigen::Vector2d& place, const Hit& hit) {
  constexpr int rings = 60, spokes = 120;
  int hits = 0;
  for (int i = 0; i < rings; ++i) {
    for (int k = 0; k < spokes; ++k) {
      const double r = std::sqrt((i + 0.5) / rings), turn = 2 * std::numbers::pi * (k + 0.5) / spokes;
      const Eigen::Vector3d direction(r * std::cos(turn), r * std::sin(turn), std::sqrt(1 - r * r));
      hits += hit(Eigen::Vector3d(place.x(), place.y(), 0), direction);
    }
  }
  return static_cast<double>(hits) / (rings * spokes);
}

bool hits_box(const Eigen::Vector3d& from, const Eigen::Vector3d& direction, const Eigen::AlignedBox3d& box) {
  double near = 0, far = 1e9;
  for (int i = 0; i < 3; ++i) {
    const double a = (box.min()[i] - from[i]) / direction[i], b = (box.max()[i] - from[i]) / direction[i];
    near = std::max(near, std::min(a, b));
    far = std::min(far, std::max(a, b));
  }
  return near <= far;
}

double shadow_at(const ContactShadow& shadow, const Eigen::Vector2d& place) {
  const Eigen::Vector2d share =
      (place - shadow.low.cast<double>()).cwiseQuotient((shadow.high - shadow.low).cast<double>());
  const int x = static_cast<int>(std::floor(share.x() * shadow.hidden.cols));
  const int y = static_cast<int>(std::floor(share.y() * shadow.hidden.rows));
  if (x < 0 || y < 0 || x >= shadow.hidden.cols || y >= shadow.hidden.rows) return 0;
  return shadow.hidden(y, x) / 255.0;
}

TEST(ContactShadow, HidesWhatRaysSay) {
  for (const double lift : {0.0, 0.02, 0.06}) {
    const Eigen::Vector3f size(0.08f, 0.05f, 0.04f);
    Eigen::Affine3f above = Eigen::Affine3f::Identity();
    above.translation().z() = static_cast<float>(lift) + 0.5f * size.z();
    const ContactShadow shadow = contact_shadow(*box_mesh(size), above);
    ASSERT_FALSE(shadow.hidden.empty());
    const Eigen::Vector3d half = 0.5 * size.cast<double>();
    const Eigen::AlignedBox3d box(Eigen::Vector3d(-half.x(), -half.y(), lift),
                                  Eigen::Vector3d(half.x(), half.y(), lift + size.z()));
    double worst = 0, most = 0;
    for (double x = -0.12; x <= 0.12; x += 0.011) {
      for (double y = -0.1; y <= 0.1; y += 0.011) {
        // Below what stands on the plane nobody looks; at its very foot a texel is too coarse.
        if (lift == 0 && std::abs(x) < half.x() + 0.006 && std::abs(y) < half.y() + 0.006) continue;
        const double truth =
            hidden_from({x, y}, [&](const auto& from, const auto& to) { return hits_box(from, to, box); });
        worst = std::max(worst, std::abs(truth - shadow_at(shadow, {x, y})));
        most = std::max(most, truth);
      }
    }
    EXPECT_GT(most, 0.2) << lift;
    EXPECT_LT(worst, 0.15) << lift;
  }
}

TEST(ContactShadow, IsNoneForWhatIsBelowOrFarAbove) {
  Eigen::Affine3f above = Eigen::Affine3f::Identity();
  above.translation().z() = -0.2f;
  EXPECT_TRUE(contact_shadow(*sphere_mesh(0.05f), above).hidden.empty());
  above.translation().z() = 2;
  EXPECT_TRUE(contact_shadow(*sphere_mesh(0.05f), above).hidden.empty());
}

TEST(ContactShadow, ItsFrameFollowsTheThingOnThePlane) {
  const Eigen::Affine3f tilted = Eigen::Translation3f(0, 0, 0.05f) * Eigen::AngleAxisf(0.4f, Eigen::Vector3f(0, 1, 0)) *
                                 Eigen::Affine3f::Identity();
  const Eigen::Affine3f moved =
      Eigen::Translation3f(0.3f, -0.2f, 0) * Eigen::AngleAxisf(1.1f, Eigen::Vector3f::UnitZ()) * tilted;
  const auto inside = [](const Eigen::Affine3f& plane_from_model) {
    return Eigen::Matrix4f((frame_below(plane_from_model).inverse() * plane_from_model).matrix());
  };
  EXPECT_LT((inside(tilted) - inside(moved)).cwiseAbs().maxCoeff(), 1e-5f);
}

}  // namespace
}  // namespace parallax
