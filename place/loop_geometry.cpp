#include "place/loop_geometry.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/descriptor_search.h"
#include "core/error.h"
#include "place/image_consistency.h"
#include "solver/stereo_pose.h"

namespace parallax {
namespace {

constexpr int kGuidedRounds = 2;
constexpr int kRivalHypotheses = 400;
constexpr double kRivalApart = 3;  // times guided_px: further from where the pose has it is another place
constexpr double kLeastScale = 0.6, kMostScale = 6;  // at which a feature is found again, pixels of level 0
constexpr double kMostOctavesApart = 1.3;            // between the size predicted and the one found

// Parts of an image that are looked at for things that should be there: how many, the fewest features that say
// something, and the share of them below which the part is silent.
struct SilentGrid {
  int columns = 1, rows = 1, least = 1;
  double most_seen = 0;
};
constexpr std::array<SilentGrid, 2> kSilentGrids = {{{8, 6, 6, 0.1}, {6, 4, 8, 0.15}}};

struct Side {
  const StereoCamera& camera;
  const StereoScene& scene;

  const PlaceFeature& feature(int row) const { return scene.features[static_cast<std::size_t>(row)]; }
  Eigen::Vector3d pixel(int row) const {
    const PlaceFeature& f = feature(row);
    return {static_cast<double>(f.pixel.x()), static_cast<double>(scene.right_px[static_cast<std::size_t>(row)]),
            static_cast<double>(f.pixel.y())};
  }
  bool has_depth(int row) const { return std::isfinite(scene.right_px[static_cast<std::size_t>(row)]); }
  double scale(int row) const { return level_scale(feature(row).level); }
};

using Pairs = std::vector<std::pair<int, int>>;

// A point of `from` as `to` measures it.
StereoPoseObservation observation_of(const Side& from, const Side& to, int i, int j, double sigma_px,
                                     double disparity_sigma_px) {
  StereoPoseObservation out;
  const Eigen::Vector3d seen = from.pixel(i);
  out.point = from.camera.triangulate(seen);
  const double focal_baseline = from.camera.focal_px.x() * from.camera.baseline_m;
  // The point is (ray, w) / |(ray, w)|.
  const Eigen::Vector3d ray = from.camera.ray({seen.x(), seen.z()});
  out.sigma_w = disparity_sigma_px * from.scale(i) / focal_baseline * out.point.head<3>().norm() / ray.norm();
  out.pixel = to.pixel(j);
  out.sigma_px = sigma_px * std::hypot(from.scale(i), to.scale(j));
  return out;
}

std::vector<StereoPoseObservation> observations_of(const Side& from, const Side& to, const Pairs& pairs,
                                                   const LoopGeometryOptions& options, bool turned) {
  std::vector<StereoPoseObservation> out;
  for (const auto& [a, b] : pairs) {
    const int i = turned ? b : a, j = turned ? a : b;
    if (from.has_depth(i)) out.push_back(observation_of(from, to, i, j, options.sigma_px, options.disparity_sigma_px));
  }
  return out;
}

// Where a feature of the query is in the found scene's left image, and how large.
struct Prediction {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double scale = 1;  // pixels of level 0 to one of the feature's own
};

// False when the found scene should not show it: outside, too small, too large.
bool predict(const Side& query, const Side& found, int row, const RigidTransform& found_from_query, Prediction* out) {
  const Eigen::Vector3d p = query.scene.points[static_cast<std::size_t>(row)].cast<double>();
  Eigen::Vector3d pixel;
  const Eigen::Vector3d there = found_from_query * p;
  if (!found.camera.project(there, &pixel)) return false;
  out->px = {pixel.x(), pixel.z()};
  out->scale = query.scale(row) * p.z() / there.z() * found.camera.focal_px.x() / query.camera.focal_px.x();
  if (out->scale < kLeastScale || out->scale > kMostScale) return false;
  return found.camera.in_image(out->px, (kDescriptorBorder + 1) * std::max(1.0, out->scale));
}

double octaves(double ratio) { return std::abs(std::log2(ratio)); }

// What is found where the pose has it, each feature once; `should` gets how many should be.
Pairs match_where_predicted(const Side& query, const Side& found, const RigidTransform& found_from_query,
                            const LoopGeometryOptions& options, int* should) {
  struct Best {
    int row = -1, bits = 257;
  };
  std::vector<Best> of_query(query.scene.features.size()), of_found(found.scene.features.size());
  *should = 0;
  for (const std::int32_t i : query.scene.near_tree.feature) {
    Prediction at;
    if (!predict(query, found, i, found_from_query, &at)) continue;
    ++*should;
    Best& best = of_query[static_cast<std::size_t>(i)];
    for (int j = 0; j < static_cast<int>(found.scene.features.size()); ++j) {
      const PlaceFeature& feature = found.feature(j);
      const double reach = options.guided_px * std::max(found.scale(j), at.scale);
      if ((feature.pixel.cast<double>() - at.px).squaredNorm() > reach * reach ||
          octaves(found.scale(j) / at.scale) > kMostOctavesApart)
        continue;
      const int bits = hamming(feature.descriptor, query.feature(i).descriptor);
      if (bits <= options.guided_distance && bits < best.bits) best = {j, bits};
    }
    if (best.row < 0) continue;
    Best& other = of_found[static_cast<std::size_t>(best.row)];
    if (best.bits < other.bits) other = {i, best.bits};
  }
  Pairs out;
  for (const std::int32_t i : query.scene.near_tree.feature) {
    const int j = of_query[static_cast<std::size_t>(i)].row;
    if (j >= 0 && of_found[static_cast<std::size_t>(j)].row == i) out.emplace_back(i, j);
  }
  return out;
}

// Parts of a 4x4 grid over the image that have pixels of the pairs; of the poorer of the two.
int cells_of(const Side& query, const Side& found, const Pairs& pairs) {
  const auto count = [&](const Side& side, bool second) {
    std::vector<bool> has(16);
    for (const auto& pair : pairs) {
      const Eigen::Vector2f px = side.feature(second ? pair.second : pair.first).pixel;
      const auto part = [](float at, int size) {
        return std::clamp(static_cast<int>(4 * at / static_cast<float>(size)), 0, 3);
      };
      has[static_cast<std::size_t>(4 * part(px.y(), side.camera.height) + part(px.x(), side.camera.width))] = true;
    }
    return static_cast<int>(std::count(has.begin(), has.end(), true));
  };
  return std::min(count(query, false), count(found, true));
}

// Parts of the image of `from` in which `from` has near features that `to` should show. Added up: of those with enough
// of them how many there are, and in how many next to none was found. `seen`: rows of features that were.
struct SilentParts {
  int all = 0, silent = 0;
  // As if one more of each kind had been seen: few parts say little.
  double share() const { return (silent + 1.0) / (all + 2.0); }
};
SilentParts silent_parts(const Side& from, const Side& to, const RigidTransform& to_from_from,
                         const std::vector<bool>& seen, const SilentGrid& grid) {
  std::vector<int> should(static_cast<std::size_t>(grid.columns * grid.rows)), does(should.size());
  const auto part = [](float at, int size, int parts) {
    return std::clamp(static_cast<int>(static_cast<float>(parts) * at / static_cast<float>(size)), 0, parts - 1);
  };
  for (const std::int32_t i : from.scene.near_tree.feature) {
    Prediction at;
    if (!predict(from, to, i, to_from_from, &at)) continue;
    const Eigen::Vector2f px = from.feature(i).pixel;
    const auto cell = static_cast<std::size_t>(part(px.y(), from.camera.height, grid.rows) * grid.columns +
                                               part(px.x(), from.camera.width, grid.columns));
    ++should[cell];
    does[cell] += seen[static_cast<std::size_t>(i)] ? 1 : 0;
  }
  SilentParts out;
  for (std::size_t k = 0; k < should.size(); ++k) {
    if (should[k] < grid.least) continue;
    ++out.all;
    out.silent += does[k] <= grid.most_seen * should[k] ? 1 : 0;
  }
  return out;
}

// The mean over both images and a fine and a coarse grid.
double silent_share_of(const Side& query, const Side& found, const LoopGeometry& geometry) {
  std::vector<bool> in_query(query.scene.features.size()), in_found(found.scene.features.size());
  for (const auto& [i, j] : geometry.pairs)
    in_query[static_cast<std::size_t>(i)] = in_found[static_cast<std::size_t>(j)] = true;
  const RigidTransform query_from_found = geometry.found_from_query.inverse();
  double sum = 0;
  for (const SilentGrid& grid : kSilentGrids)
    sum += silent_parts(query, found, geometry.found_from_query, in_query, grid).share() +
           silent_parts(found, query, query_from_found, in_found, grid).share();
  return sum / (2 * kSilentGrids.size());
}

// How many matches another pose explains: each near feature of the query with what is most alike elsewhere.
int find_rival(const Side& query, const Side& found, const RigidTransform& found_from_query,
               const LoopGeometryOptions& options, std::mt19937_64* rng) {
  const DescriptorSet set(descriptors_of(found.scene.features));
  std::vector<std::uint16_t> bits;
  std::vector<StereoPoseObservation> observations;
  for (const std::int32_t i : query.scene.near_tree.feature) {
    if (set.distances(query.feature(i).descriptor, &bits) > options.max_distance) continue;
    Eigen::Vector3d pixel(-1e6, 0, -1e6);
    found.camera.project(found_from_query * query.scene.points[static_cast<std::size_t>(i)].cast<double>(), &pixel);
    int best = -1, least = options.max_distance + 1;
    for (int j = 0; j < set.size(); ++j) {
      if (bits[static_cast<std::size_t>(j)] >= least) continue;
      const double apart = (found.feature(j).pixel.cast<double>() - Eigen::Vector2d(pixel.x(), pixel.z())).norm();
      if (apart < kRivalApart * options.guided_px * std::max(found.scale(j), query.scale(i))) continue;
      least = bits[static_cast<std::size_t>(j)];
      best = j;
    }
    if (best >= 0)
      observations.push_back(observation_of(query, found, i, best, options.sigma_px, options.disparity_sigma_px));
  }
  StereoPoseOptions pose_options;
  pose_options.max_hypotheses = kRivalHypotheses;
  pose_options.inlier_sigmas = options.inlier_sigmas;
  RigidTransform pose;
  std::vector<std::uint8_t> inlier;
  return find_stereo_pose(found.camera, observations, {}, pose_options, rng, &pose, &inlier).inliers;
}

std::string few(int n, int expected, const std::string& of) {
  return std::to_string(n) + " " + of + ", expected " + std::to_string(expected);
}

std::string percent(double share) { return std::to_string(static_cast<int>(std::lround(100 * share))) + " %"; }

// The points of the found scene in the query's images agree with the pose.
bool agrees_backwards(const Side& query, const Side& found, const LoopGeometry& forward,
                      const LoopGeometryOptions& options, const StereoPoseOptions& pose_options) {
  const auto observations = observations_of(found, query, forward.pairs, options, true);
  if (static_cast<int>(observations.size()) < options.min_inliers / 2) return false;
  RigidTransform query_from_found = forward.found_from_query.inverse();
  const StereoPoseSummary back =
      refine_stereo_pose(query.camera, observations, pose_options, &query_from_found, nullptr);
  if (!back.ok || 2 * back.inliers < static_cast<int>(observations.size())) return false;
  // A left increment of the inverse is one of the pose, turned by the adjoint.
  const Matrix6d turn = forward.found_from_query.adjoint();
  Matrix6d covariance = forward.covariance + turn * back.covariance * turn.transpose();
  covariance.topLeftCorner<3, 3>().diagonal().array() += options.floor_m * options.floor_m;
  covariance.bottomRightCorner<3, 3>().diagonal().array() += options.floor_rad * options.floor_rad;
  const Vector6d difference = (forward.found_from_query * query_from_found).log();
  return difference.dot(covariance.ldlt().solve(difference)) <= 6 * options.max_disagreement * options.max_disagreement;
}

}  // namespace

void LoopGeometryOptions::validate() const {
  const auto in = [](double value, double low, double high, const char* name) {
    if (!(value >= low && value <= high))
      throw InputError(std::string("loop geometry: ") + name + ": found " + std::to_string(value) + ", expected " +
                       std::to_string(low) + " to " + std::to_string(high));
  };
  in(max_distance, 1, 256, "max_distance");
  in(ratio, 0, 1, "ratio");
  in(guided_distance, 1, 256, "guided_distance");
  in(guided_px, 0.1, 100, "guided_px");
  in(sigma_px, 0.01, 100, "sigma_px");
  in(disparity_sigma_px, 0.01, 100, "disparity_sigma_px");
  in(max_hypotheses, 1, 100000, "max_hypotheses");
  in(inlier_sigmas, 0.1, 100, "inlier_sigmas");
  in(min_first_inliers, 6, 10000, "min_first_inliers");
  in(min_first_share, 0, 1, "min_first_share");
  in(min_inliers, 6, 10000, "min_inliers");
  in(min_seen_share, 0, 1, "min_seen_share");
  in(min_cells, 0, 16, "min_cells");
  in(max_silent_share, 0, 1, "max_silent_share");
  in(max_rival, 0, 100, "max_rival");
  in(max_disagreement, 0, 1e6, "max_disagreement");
  in(floor_m, 0, 10, "floor_m");
  in(floor_rad, 0, 1, "floor_rad");
  in(max_sigma_m, 0, 1e6, "max_sigma_m");
  in(max_sigma_rad, 0, 10, "max_sigma_rad");
}

LoopGeometry check_loop_geometry(const StereoCamera& query_camera, const StereoScene& query_scene,
                                 const StereoCamera& found_camera, const StereoScene& found_scene,
                                 std::span<const std::pair<int, int>> associations, const LoopGeometryOptions& options,
                                 std::mt19937_64* rng) {
  const Side query{query_camera, query_scene}, found{found_camera, found_scene};
  LoopGeometry out;
  ImageConsistencyOptions matching;
  matching.max_distance = options.max_distance;
  matching.ratio = options.ratio;
  Pairs matches = match_place_features(query_scene.features, found_scene.features, matching);
  matches.insert(matches.end(), associations.begin(), associations.end());
  std::sort(matches.begin(), matches.end());
  matches.erase(std::unique(matches.begin(), matches.end()), matches.end());
  std::erase_if(matches, [&](const auto& pair) { return !query.has_depth(pair.first); });
  out.matches = static_cast<int>(matches.size());
  if (out.matches < options.min_first_inliers) {
    out.refused = few(out.matches, options.min_first_inliers, "matches with depth");
    return out;
  }

  StereoPoseOptions pose_options;
  pose_options.max_hypotheses = options.max_hypotheses;
  pose_options.inlier_sigmas = options.inlier_sigmas;
  auto observations = observations_of(query, found, matches, options, false);
  RigidTransform pose;
  std::vector<std::uint8_t> inlier;
  StereoPoseSummary summary = find_stereo_pose(found_camera, observations, {}, pose_options, rng, &pose, &inlier);
  out.first_inliers = summary.inliers;
  if (!summary.ok || summary.inliers < options.min_first_inliers) {
    out.refused = few(summary.inliers, options.min_first_inliers, "matches that agree");
    return out;
  }
  if (summary.inliers < options.min_first_share * out.matches) {
    out.refused = few(summary.inliers, static_cast<int>(std::ceil(options.min_first_share * out.matches)),
                      "of " + std::to_string(out.matches) + " matches agree");
    return out;
  }
  summary = refine_stereo_pose(found_camera, observations, pose_options, &pose, &inlier);
  int should = 0;
  for (int round = 0; round < kGuidedRounds && summary.ok; ++round) {
    matches = match_where_predicted(query, found, pose, options, &should);
    observations = observations_of(query, found, matches, options, false);
    summary = refine_stereo_pose(found_camera, observations, pose_options, &pose, &inlier);
  }
  if (!summary.ok) {
    out.refused = "no pose that what should be seen agrees with";
    return out;
  }
  for (std::size_t i = 0; i < matches.size(); ++i)
    if (inlier[i] != 0) out.pairs.push_back(matches[i]);
  out.inliers = static_cast<int>(out.pairs.size());
  out.found_from_query = pose;
  out.covariance = summary.covariance;
  out.seen_share = should > 0 ? out.inliers / static_cast<double>(should) : 0;
  out.cells = cells_of(query, found, out.pairs);
  out.silent_share = silent_share_of(query, found, out);
  if (out.inliers < options.min_inliers) {
    out.refused = few(out.inliers, options.min_inliers, "features where the pose has them");
  } else if (out.seen_share < options.min_seen_share) {
    out.refused = percent(out.seen_share) + " of what should be seen, expected " + percent(options.min_seen_share);
  } else if (out.cells < options.min_cells) {
    out.refused = few(out.cells, options.min_cells, "of 16 parts of the image");
  } else if (out.silent_share > options.max_silent_share) {
    out.refused = percent(out.silent_share) + " of the parts of the images do not show what they should, expected " +
                  percent(options.max_silent_share);
  } else if (!agrees_backwards(query, found, out, options, pose_options)) {
    out.refused = "the two directions disagree";
  }
  if (!out.accepted()) return out;
  out.rival = find_rival(query, found, pose, options, rng);
  if (out.rival > options.max_rival * out.inliers) {
    out.refused =
        "another pose explains " + std::to_string(out.rival) + " matches, this one " + std::to_string(out.inliers);
    return out;
  }
  out.covariance.topLeftCorner<3, 3>().diagonal().array() += options.floor_m * options.floor_m;
  out.covariance.bottomRightCorner<3, 3>().diagonal().array() += options.floor_rad * options.floor_rad;
  const Vector6d sigma = out.covariance.diagonal().cwiseSqrt();
  if (!(sigma.head<3>().maxCoeff() <= options.max_sigma_m && sigma.tail<3>().maxCoeff() <= options.max_sigma_rad))
    out.refused = "a pose that is hardly determined";
  return out;
}

}  // namespace parallax
