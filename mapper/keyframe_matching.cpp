#include "mapper/keyframe_matching.h"

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <utility>

#include "core/descriptor_search.h"
#include "core/error.h"
#include "mapper/place_view.h"
#include "mapper/similarity_refinement.h"

namespace parallax {
namespace {

// Points so near each other, in parts of the depth they are seen at, are one place.
constexpr double kOnePlace = 0.02;
// What a match may be off in RANSAC, in standard deviations: the corner was found anew, and young points lie off.
constexpr double kHypothesisSigmas = 3.0;
// Matches that must agree before anything is searched for with the transform, and rounds of that search.
constexpr int kLeastMatches = 12;
constexpr int kGuidedRounds = 2;
// Of the three points: sides at least this part of their depth, and alike but for the scale within this factor.
constexpr double kLeastSide = 0.03;
constexpr double kSideRatio = 1.35;
// A patch is not seen larger or smaller than this in the other view, after the pyramid's levels are accounted for.
constexpr double kMaxSizeRatio = 2.3;
// RANSAC stops when another better hypothesis is less likely than this.
constexpr double kMissed = 0.005;
// Rivals of a transform: other places of each point, transforms tried, and how far (standard deviations) another place
// must be.
constexpr int kRivalPlaces = 4;
constexpr int kRivalTrials = 150;
constexpr double kElsewhere_sigmas = 8.0;
// Inliers are spread: the smaller standard deviation of their pixels, in parts of the image's width.
constexpr double kLeastSpread = 0.03;
// Depths of a pair differ like those of the others: within so many robust standard deviations, and this part.
constexpr double kDepthSigmas = 2.5;
constexpr double kDepthPart = 0.01;
constexpr double kSigmaOfMedian = 1.4826;  // standard deviation of a normal variable of median deviation one
// Errors of a pair in the image beyond which it is none, whatever the scale of the errors.
constexpr double kLargestSigma = 2.5;

std::vector<PointId> points_around(const Map& map, KeyframeId keyframe, int neighbours) {
  std::vector<PointId> out;
  for (KeyframeId id : keyframes_around(map, keyframe, neighbours))
    for (const Measurement& m : map.keyframes.at(id).measurements) out.push_back(m.point);
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

std::vector<BinaryDescriptor> descriptors_of_points(const PlaceView& view) {
  std::vector<BinaryDescriptor> out;
  out.reserve(view.points.size());
  for (const PlacePoint& p : view.points) out.push_back(p.descriptor);
  return out;
}

bool same_place(const PlacePoint& p, const PlacePoint& q) {
  const double reach = kOnePlace * std::min(p.depth, q.depth);
  return (p.position - q.position).squaredNorm() < reach * reach;
}

// Everything that is asked of two sets of descriptors, in one pass over the distances.
struct Matches {
  std::vector<RowPair> clear;   // one to one: nearest, and clearly nearer than any other place
  std::vector<RowPair> rivals;  // all near enough, few a point and one a place
};

Matches match(const PlaceView& a, const PlaceView& b, const PlaceAlignmentOptions& options) {
  Matches out;
  const std::vector<BinaryDescriptor> of_a = descriptors_of_points(a);
  const DescriptorSet set(of_a);
  struct Best {
    int distance = 257, row = -1;
  };
  std::vector<Best> best_of_a(a.points.size());
  std::vector<std::uint16_t> distances;
  std::vector<std::pair<int, int>> near;
  for (std::size_t j = 0; j < b.points.size(); ++j) {
    const int first = set.distances(b.points[j].descriptor, &distances);
    if (first > options.max_distance) continue;
    near.clear();
    const int too_near = std::max(options.max_distance, 100 * first / options.ratio_percent);
    for (std::size_t i = 0; i < a.points.size(); ++i)
      if (distances[i] <= too_near) near.emplace_back(distances[i], static_cast<int>(i));
    std::sort(near.begin(), near.end());
    std::vector<int> places;
    bool clear_winner = true;
    for (const auto& [distance, row] : near) {
      const PlacePoint& p = a.points[static_cast<std::size_t>(row)];
      const bool known = std::any_of(places.begin(), places.end(), [&, &a = a](int other) {
        return same_place(a.points[static_cast<std::size_t>(other)], p);
      });
      if (known) continue;
      if (!places.empty() && options.ratio_percent * distance < 100 * first) clear_winner = false;
      if (distance > options.max_distance || static_cast<int>(places.size()) >= kRivalPlaces) break;
      places.push_back(row);
      out.rivals.emplace_back(row, static_cast<int>(j));
    }
    if (!clear_winner) continue;
    Best& best = best_of_a[static_cast<std::size_t>(near.front().second)];
    if (first < best.distance) best = {first, static_cast<int>(j)};
  }
  for (std::size_t i = 0; i < best_of_a.size(); ++i)
    if (best_of_a[i].row >= 0) out.clear.emplace_back(static_cast<int>(i), best_of_a[i].row);
  return out;
}

bool agrees(const PairError& error, double sigmas) { return error.in_a < sigmas && error.in_b < sigmas; }

std::vector<RowPair> agreeing(const PlaceView& a, const PlaceView& b, const std::vector<RowPair>& pairs,
                              const SimilarityTransform& a_from_b, double sigmas) {
  const SimilarityTransform b_from_a = a_from_b.inverse();
  std::vector<RowPair> out;
  for (const RowPair& pair : pairs)
    if (agrees(pair_error(a, b, pair, a_from_b, b_from_a), sigmas)) out.push_back(pair);
  return out;
}

// Three pairs that can be one transform: triangles of the same shape, not slivers.
bool similarity_of_three(const PlaceView& a, const PlaceView& b, const std::array<RowPair, 3>& pairs,
                         const std::optional<double>& fixed_scale, SimilarityTransform* a_from_b) {
  Eigen::Matrix3Xd in_a(3, 3), in_b(3, 3);
  double depth_a = 0, depth_b = 0;
  for (int k = 0; k < 3; ++k) {
    const PlacePoint& pa = a.points[static_cast<std::size_t>(pairs[static_cast<std::size_t>(k)].first)];
    const PlacePoint& pb = b.points[static_cast<std::size_t>(pairs[static_cast<std::size_t>(k)].second)];
    in_a.col(k) = pa.position;
    in_b.col(k) = pb.position;
    depth_a = std::max(depth_a, pa.depth);
    depth_b = std::max(depth_b, pb.depth);
  }
  double least = INFINITY, most = 0;
  for (int k = 0; k < 3; ++k) {
    const double side_a = (in_a.col(k) - in_a.col((k + 1) % 3)).norm();
    const double side_b = (in_b.col(k) - in_b.col((k + 1) % 3)).norm();
    if (side_a < kLeastSide * depth_a || side_b < kLeastSide * depth_b) return false;
    least = std::min(least, side_a / side_b);
    most = std::max(most, side_a / side_b);
  }
  if (most > kSideRatio * least) return false;
  if (!fixed_scale) return align_points(in_b, in_a, true, a_from_b);
  if (most > kSideRatio * *fixed_scale || least < *fixed_scale / kSideRatio) return false;
  in_b *= *fixed_scale;
  if (!align_points(in_b, in_a, false, a_from_b)) return false;
  a_from_b->s = *fixed_scale;
  return true;
}

// Logarithm of the probability that k of n matches or more agree by chance.
double log_chance(int n, int k, double p) {
  if (k <= 0) return 0;
  return std::lgamma(n + 1.0) - std::lgamma(k + 1.0) - std::lgamma(n - k + 1.0) + k * std::log(p);
}

std::optional<SimilarityTransform> first_alignment(const PlaceView& a, const PlaceView& b,
                                                   const std::vector<RowPair>& matches, const CameraModel& camera,
                                                   const PlaceAlignmentOptions& options, std::mt19937_64* rng) {
  const int n = static_cast<int>(matches.size());
  if (n < kLeastMatches) return std::nullopt;
  std::uniform_int_distribution<int> draw(0, n - 1);
  SimilarityTransform best;
  int best_count = 0, hypotheses = options.max_hypotheses, tried = 0;
  // Most triples of a poor set fail the test of their shape: cheap, but not for ever.
  for (int draws = 0; tried < hypotheses && draws < 10 * options.max_hypotheses; ++draws) {
    const std::array<int, 3> rows = {draw(*rng), draw(*rng), draw(*rng)};
    if (rows[0] == rows[1] || rows[1] == rows[2] || rows[0] == rows[2]) continue;
    SimilarityTransform candidate;
    const auto pair = [&](int k) { return matches[static_cast<std::size_t>(rows[static_cast<std::size_t>(k)])]; };
    if (!similarity_of_three(a, b, {pair(0), pair(1), pair(2)}, options.fixed_scale, &candidate)) continue;
    ++tried;
    const int count = static_cast<int>(agreeing(a, b, matches, candidate, kHypothesisSigmas).size());
    if (count <= best_count) continue;
    // The least-squares transform of those that agree is better than that of three.
    SimilarityTransform refined = candidate;
    const std::vector<RowPair> support = agreeing(a, b, matches, candidate, kHypothesisSigmas);
    int refined_count = 0;
    if (refine_similarity(a, b, support, options.fixed_scale.has_value(), &refined) > 0)
      refined_count = static_cast<int>(agreeing(a, b, matches, refined, kHypothesisSigmas).size());
    best = refined_count >= count ? refined : candidate;
    best_count = std::max(count, refined_count);
    const double good = static_cast<double>(best_count) / n;
    const double all_three = good * good * good;
    if (all_three > 1 - 1e-9) break;
    const double needed = std::log(kMissed) / std::log(1 - all_three);
    hypotheses = static_cast<int>(std::min<double>(options.max_hypotheses, std::ceil(needed)));
  }
  if (best_count < kLeastMatches) return std::nullopt;
  // By chance a match lies in the disc around its prediction, whose size is the largest of those seen.
  double sigma_px = 1;
  for (const RowPair& m : matches) sigma_px += a.points[static_cast<std::size_t>(m.first)].sigma_px / n;
  const double radius = kHypothesisSigmas * sigma_px;
  const double chance =
      std::min(0.5, 3.14159 * radius * radius / (static_cast<double>(camera.width()) * camera.height()));
  if (std::log(static_cast<double>(std::max(1, tried))) + log_chance(n - 3, best_count - 3, chance) >
      std::log(options.max_false_alarm))
    return std::nullopt;
  return best;
}

// Patches of one surface are drawn at levels that make them about equally large in both views.
bool alike_in_size(const PlacePoint& pa, const PlacePoint& pb, double scale) {
  const double size = level_scale(pa.level) * pa.depth / (level_scale(pb.level) * pb.depth * scale);
  return size < kMaxSizeRatio && size > 1 / kMaxSizeRatio;
}

// Pairs that the transform predicts: the nearest descriptor of those that are where they should be, one to one.
std::vector<RowPair> guided_pairs(const PlaceView& a, const PlaceView& b, const SimilarityTransform& a_from_b,
                                  const PlaceAlignmentOptions& options, double sigmas) {
  const SimilarityTransform b_from_a = a_from_b.inverse();
  struct Best {
    int distance = 257, row = -1;
  };
  std::vector<Best> best_of_a(a.points.size()), best_of_b(b.points.size());
  const double focal = a.points.empty() ? 1 : a.points.front().pixels_per_radian;
  for (std::size_t view = 0; view < a.cameras.size(); ++view) {
    std::vector<int> rows;
    double widest = 0;
    for (std::size_t i = 0; i < a.points.size(); ++i) {
      if (a.points[i].view != static_cast<int>(view)) continue;
      rows.push_back(static_cast<int>(i));
      widest = std::max(widest, a.points[i].sigma_px / a.points[i].pixels_per_radian);
    }
    if (rows.empty()) continue;
    // Sorted by the x of their rays, so that a prediction meets few.
    std::sort(rows.begin(), rows.end(), [&](int i, int k) {
      return a.points[static_cast<std::size_t>(i)].ray.x() < a.points[static_cast<std::size_t>(k)].ray.x();
    });
    std::vector<double> x;
    for (int i : rows) x.push_back(a.points[static_cast<std::size_t>(i)].ray.x());
    const double reach = sigmas * std::max(widest, 1 / focal);
    for (std::size_t j = 0; j < b.points.size(); ++j) {
      const Eigen::Vector3d q = a.cameras[view] * (a_from_b * b.points[j].position);
      if (!(q.z() > 0)) continue;
      const Eigen::Vector3d u = q.normalized();
      for (auto k = static_cast<std::size_t>(std::lower_bound(x.begin(), x.end(), u.x() - reach) - x.begin());
           k < x.size() && x[k] <= u.x() + reach; ++k) {
        const auto i = static_cast<std::size_t>(rows[k]);
        if (std::abs(a.points[i].ray.y() - u.y()) > reach) continue;
        const int distance = hamming(a.points[i].descriptor, b.points[j].descriptor);
        if (distance > options.guided_distance) continue;
        if (distance >= best_of_a[i].distance && distance >= best_of_b[j].distance) continue;
        if (!alike_in_size(a.points[i], b.points[j], a_from_b.s)) continue;
        const RowPair pair(static_cast<int>(i), static_cast<int>(j));
        if (!agrees(pair_error(a, b, pair, a_from_b, b_from_a), sigmas)) continue;
        if (distance < best_of_a[i].distance) best_of_a[i] = {distance, static_cast<int>(j)};
        if (distance < best_of_b[j].distance) best_of_b[j] = {distance, static_cast<int>(i)};
      }
    }
  }
  std::vector<RowPair> out;
  for (std::size_t i = 0; i < best_of_a.size(); ++i) {
    const int j = best_of_a[i].row;
    if (j >= 0 && best_of_b[static_cast<std::size_t>(j)].row == static_cast<int>(i))
      out.emplace_back(static_cast<int>(i), j);
  }
  return out;
}

double median_of(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Without those whose depths differ: seen from one direction, the edge of a thing and what lies behind it agree.
std::vector<RowPair> alike_in_depth(const PlaceView& a, const PlaceView& b, const std::vector<RowPair>& pairs,
                                    const SimilarityTransform& a_from_b) {
  if (pairs.empty()) return {};
  std::vector<double> off;
  for (const auto& [i, j] : pairs) {
    const PlacePoint& pa = a.points[static_cast<std::size_t>(i)];
    const Eigen::Vector3d q =
        a.cameras[static_cast<std::size_t>(pa.view)] * (a_from_b * b.points[static_cast<std::size_t>(j)].position);
    off.push_back(std::log(q.norm() / pa.depth));
  }
  const double middle = median_of(off);
  std::vector<double> apart;
  for (double d : off) apart.push_back(std::abs(d - middle));
  const double limit = kDepthPart + kDepthSigmas * kSigmaOfMedian * median_of(apart);
  std::vector<RowPair> out;
  for (std::size_t k = 0; k < pairs.size(); ++k)
    if (apart[k] <= limit) out.push_back(pairs[k]);
  return out;
}

// Points of b that have a possible partner where the transform puts them.
int supported(const PlaceView& a, const PlaceView& b, const std::vector<RowPair>& rivals,
              const SimilarityTransform& a_from_b) {
  const SimilarityTransform b_from_a = a_from_b.inverse();
  int out = 0, last = -1;
  for (const RowPair& pair : rivals) {
    if (pair.second == last || !agrees(pair_error(a, b, pair, a_from_b, b_from_a), kHypothesisSigmas)) continue;
    last = pair.second;
    ++out;
  }
  return out;
}

// Whether the same transform moved sideways explains about as many of the matches.
bool has_rival(const PlaceView& a, const PlaceView& b, const std::vector<RowPair>& rivals,
               const SimilarityTransform& a_from_b, const PlaceAlignmentOptions& options, std::mt19937_64* rng) {
  const SimilarityTransform b_from_a = a_from_b.inverse();
  std::vector<RowPair> elsewhere;
  for (const RowPair& pair : rivals)
    if (pair_error(a, b, pair, a_from_b, b_from_a).worse() > kElsewhere_sigmas) elsewhere.push_back(pair);
  const double enough = options.max_rival * supported(a, b, rivals, a_from_b);
  if (static_cast<double>(elsewhere.size()) < enough) return false;
  std::uniform_int_distribution<std::size_t> draw(0, elsewhere.size() - 1);
  for (int trial = 0; trial < kRivalTrials; ++trial) {
    const RowPair pair = elsewhere[draw(*rng)];
    SimilarityTransform moved = a_from_b;
    moved.t += a.points[static_cast<std::size_t>(pair.first)].position -
               a_from_b * b.points[static_cast<std::size_t>(pair.second)].position;
    if (supported(a, b, rivals, moved) > enough) return true;
  }
  return false;
}

// Standard deviation across the narrower direction of the pixels that the pairs have in a view's images.
double spread_px(const PlaceView& view, const std::vector<int>& rows) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (int i : rows) mean += view.points[static_cast<std::size_t>(i)].pixel / static_cast<double>(rows.size());
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  for (int i : rows) {
    const Eigen::Vector2d d = view.points[static_cast<std::size_t>(i)].pixel - mean;
    covariance += d * d.transpose() / static_cast<double>(rows.size());
  }
  return std::sqrt(Eigen::JacobiSVD<Eigen::Matrix2d>(covariance).singularValues()[1]);
}

bool well_spread(const PlaceView& a, const PlaceView& b, const std::vector<RowPair>& pairs, const CameraModel& camera) {
  std::vector<int> in_a, in_b;
  for (const RowPair& pair : pairs) {
    in_a.push_back(pair.first);
    in_b.push_back(pair.second);
  }
  const double least = kLeastSpread * camera.width();
  return spread_px(a, in_a) > least && spread_px(b, in_b) > least;
}

double median_sigma_px(const PlaceView& a, const std::vector<RowPair>& pairs) {
  std::vector<double> sigmas;
  for (const RowPair& pair : pairs) sigmas.push_back(a.points[static_cast<std::size_t>(pair.first)].sigma_px);
  return median_of(std::move(sigmas));
}

void check_alignment_option(bool ok, const char* what) {
  if (!ok) throw InputError(std::string("place alignment: ") + what);
}

}  // namespace

void PlaceAlignmentOptions::validate() const {
  check_alignment_option(window_keyframes >= 0, "window_keyframes must not be negative");
  check_alignment_option(max_points >= kLeastMatches, "max_points must be 12 or more");
  check_alignment_option(max_distance >= 0 && max_distance <= 256, "max_distance must lie between 0 and 256");
  check_alignment_option(guided_distance >= 0 && guided_distance <= 256, "guided_distance must lie between 0 and 256");
  check_alignment_option(ratio_percent > 0 && ratio_percent <= 100, "ratio_percent must lie between 1 and 100");
  check_alignment_option(max_hypotheses > 0, "max_hypotheses must be positive");
  check_alignment_option(inlier_sigmas > 0, "inlier_sigmas must be positive");
  check_alignment_option(min_inliers >= kLeastMatches, "min_inliers must be 12 or more");
  check_alignment_option(max_false_alarm > 0 && max_false_alarm <= 1, "max_false_alarm must lie between 0 and 1");
  check_alignment_option(max_rival > 0, "max_rival must be positive");
  check_alignment_option(!fixed_scale || *fixed_scale > 0, "fixed_scale must be positive");
}

std::optional<PlaceAlignment> align_places(const Map& a, KeyframeId in_a, const Map& b, KeyframeId in_b,
                                           const CameraModel& camera, const PlaceAlignmentOptions& options,
                                           std::mt19937_64* rng) {
  options.validate();
  if (!a.keyframes.contains(in_a) || !b.keyframes.contains(in_b)) return std::nullopt;
  std::vector<PointId> shared;
  if (&a == &b) {
    const std::vector<PointId> around_a = points_around(a, in_a, options.window_keyframes);
    const std::vector<PointId> around_b = points_around(b, in_b, options.window_keyframes);
    std::set_intersection(around_a.begin(), around_a.end(), around_b.begin(), around_b.end(),
                          std::back_inserter(shared));
  }
  const PlaceView view_a = view_of_place(a, in_a, camera, options.window_keyframes, options.max_points, shared);
  const PlaceView view_b = view_of_place(b, in_b, camera, options.window_keyframes, options.max_points, shared);
  const Matches matches = match(view_a, view_b, options);
  const auto first = first_alignment(view_a, view_b, matches.clear, camera, options, rng);
  if (!first) return std::nullopt;

  SimilarityTransform a_from_b = *first;
  std::vector<RowPair> pairs;
  double sigma = 1;
  for (int round = 0; round < kGuidedRounds; ++round) {
    pairs = guided_pairs(view_a, view_b, a_from_b, options, options.inlier_sigmas * std::min(sigma, kLargestSigma));
    pairs = alike_in_depth(view_a, view_b, pairs, a_from_b);
    if (static_cast<int>(pairs.size()) < kLeastMatches) return std::nullopt;
    sigma = refine_similarity(view_a, view_b, pairs, options.fixed_scale.has_value(), &a_from_b);
    if (!(sigma > 0)) return std::nullopt;
  }
  pairs = agreeing(view_a, view_b, pairs, a_from_b, options.inlier_sigmas * std::min(sigma, kLargestSigma));
  if (static_cast<int>(pairs.size()) < options.min_inliers || !well_spread(view_a, view_b, pairs, camera) ||
      has_rival(view_a, view_b, matches.rivals, a_from_b, options, rng))
    return std::nullopt;

  PlaceAlignment out;
  out.a_from_b = a_from_b;
  for (const auto& [i, j] : pairs)
    out.pairs.push_back({view_a.points[static_cast<std::size_t>(i)].id, view_b.points[static_cast<std::size_t>(j)].id});
  std::sort(out.pairs.begin(), out.pairs.end(), [](const PointPair& p, const PointPair& q) { return p.a < q.a; });
  out.inliers = static_cast<int>(out.pairs.size());
  out.sigma_px = sigma * median_sigma_px(view_a, pairs);
  return out;
}

}  // namespace parallax
