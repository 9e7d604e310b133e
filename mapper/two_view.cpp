#include "mapper/two_view.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/check.h"
#include "mapper/five_point.h"
#include "mapper/homography.h"
#include "mapper/relative_pose.h"
#include "mapper/triangulation.h"
#include "solver/robust_kernel.h"

namespace parallax {

namespace {

constexpr double kDegree = M_PI / 180.0;
// Truncation of every score and the reprojection bound of an inlier, in standard deviations.
constexpr double kTruncationSigmas = 3.0;
// 99 % points of the chi-squared distribution with one and two degrees of freedom.
constexpr double kChi2One = 6.635, kChi2Two = 9.210;
// Local optimisation of a promising hypothesis looks at this many matches (they are shuffled).
constexpr std::size_t kLocalMatches = 300;
constexpr std::size_t kMaxCandidates = 6;
constexpr int kMaxLocalOptimisations = 40;
// Two poses are one when both their rotations and their translation directions agree to this.
constexpr double kSameRotation = 1.0 * kDegree, kSameDirection = 5.0 * kDegree;
// Chance of stopping before a sample of inliers only was seen.
constexpr double kMissProbability = 1e-5;
// A rotation alone explains the matches when it keeps this part of the essential matrix's inliers.
constexpr double kRotationExplains = 0.85;
// A plane explains them as well when it keeps this part.
constexpr double kPlaneExplains = 0.95;
// The best pose must beat any other by this many standard deviations of the summed cost difference (Vuong 1989).
constexpr double kDecisive = 3.0;
// Poses nearer than this are local minima of one valley (outliers near epipolar lines make many): the lowest is taken.
// Twins of a plane may be as near as kSameRotation and kSameDirection.
constexpr double kSameValleyRotation = 3.0 * kDegree, kSameValleyDirection = 20.0 * kDegree;
// A decomposition of the homography is possible when this part of its inliers is in front of the camera.
constexpr double kInFront = 0.9;
// A camera that turned less than this has not moved at all, as far as the words to the user go.
constexpr double kTurned = 1.0 * kDegree;
// An inlier's own parallax, as a part of the required median.
constexpr double kTinyParallax = 0.2;

struct Candidate {
  RigidTransform pose;
  double cost = 0;
  std::vector<float> costs;  // per match, truncated; a match that is behind a camera pays the full price
};

bool within(const RigidTransform& a, const RigidTransform& b, double rotation, double direction) {
  return (a.R * b.R.transpose()).trace() > 1.0 + 2.0 * std::cos(rotation) && a.t.dot(b.t) > std::cos(direction);
}

bool same_pose(const RigidTransform& a, const RigidTransform& b) { return within(a, b, kSameRotation, kSameDirection); }

bool same_valley(const RigidTransform& a, const RigidTransform& b) {
  return within(a, b, kSameValleyRotation, kSameValleyDirection);
}

int count_below(const std::vector<float>& errors, double bound) {
  return static_cast<int>(std::count_if(errors.begin(), errors.end(), [&](float e) { return e < bound; }));
}

class TwoViewSearch {
 public:
  TwoViewSearch(const RayMatches& matches, const TwoViewOptions& options, double focal_px, std::mt19937_64* rng)
      : matches_(matches),
        options_(options),
        rng_(rng),
        threshold_(kTruncationSigmas * options.sigma_px),
        truncation_(threshold_ * threshold_),
        measurable_parallax_(threshold_ / focal_px) {}

  void run() {
    search_rotation();
    search_homography();
    search_essential();
    finish();
  }

  const Eigen::Matrix3d& rotation() const { return rotation_; }
  bool planar() const { return planar_; }  // the homography explains the matches as well
  const std::vector<Candidate>& candidates() const { return candidates_; }  // best first
  // The homography has two decompositions that the depths cannot tell apart.
  bool plane_has_twins() const { return plane_has_twins_; }
  double sigma_px() const { return sigma_; }  // of the best candidate's inliers

 private:
  template <std::size_t N>
  void sample(std::array<std::size_t, N>* picks) {
    for (std::size_t i = 0; i < N; ++i) {
      std::size_t pick = 0;
      do {
        pick = static_cast<std::size_t>((*rng_)() % matches_.size());
      } while (std::find(picks->begin(), picks->begin() + static_cast<std::ptrdiff_t>(i), pick) !=
               picks->begin() + static_cast<std::ptrdiff_t>(i));
      (*picks)[i] = pick;
    }
  }

  // Samples needed until one of `size` inliers was seen, given the best truncated cost so far.
  double samples_needed(double cost, int size, int at_least) const {
    const double inliers = std::clamp(1.0 - cost / (truncation_ * static_cast<double>(matches_.size())), 0.01, 0.999);
    return std::max<double>(at_least, std::log(kMissProbability) / std::log1p(-std::pow(inliers, size)));
  }

  void search_rotation() {
    double best = INFINITY;
    for (int k = 0; k < std::min(100, options_.max_hypotheses); ++k) {
      if (k >= samples_needed(best, 2, 20)) break;
      std::array<std::size_t, 2> picks;
      sample(&picks);
      const auto triad = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
        Eigen::Matrix3d frame;
        frame.col(0) = (a.normalized() + b.normalized()).normalized();
        frame.col(1) = a.cross(b).normalized();
        frame.col(2) = frame.col(0).cross(frame.col(1));
        return frame;
      };
      const RayMatch &m0 = matches_[picks[0]], &m1 = matches_[picks[1]];
      const Eigen::Matrix3d R = triad(m0.ray2, m1.ray2) * triad(m0.ray1, m1.ray1).transpose();
      if (!R.allFinite()) continue;
      const double cost = matches_.homography_cost(R, truncation_, best);
      if (!(cost < best)) continue;
      best = cost;
      rotation_ = R;
    }
    for (const double widths : {2.0, 1.5})
      refine_rotation(matches_, matches_.size(), widths * threshold_, 4, &rotation_);
  }

  void search_homography() {
    double best = INFINITY;
    for (int k = 0; k < std::min(300, options_.max_hypotheses); ++k) {
      if (k >= samples_needed(best, 4, 30)) break;
      std::array<std::size_t, 4> picks;
      sample(&picks);
      std::array<Eigen::Vector3d, 4> a, b;
      for (std::size_t i = 0; i < 4; ++i) {
        a[i] = matches_[picks[i]].ray1;
        b[i] = matches_[picks[i]].ray2;
      }
      Eigen::Matrix3d H;
      if (!fit_homography(a, b, &H)) continue;
      bool in_front = true;
      for (std::size_t i = 0; i < 4; ++i) in_front = in_front && b[i].dot(H * a[i]) > 0;
      if (!in_front) continue;
      const double cost = matches_.homography_cost(H, truncation_, 1.1 * best);
      if (!(cost < 1.1 * best)) continue;
      refine_homography(matches_, std::min(kLocalMatches, matches_.size()), 2.0 * threshold_, 3, &H);
      const double refined = matches_.homography_cost(H, truncation_, best);
      if (!(refined < best)) continue;
      best = refined;
      homography_ = H;
    }
    if (!std::isfinite(best)) return;
    refine_homography(matches_, matches_.size(), 1.5 * threshold_, 6, &homography_);
    std::array<PlanarPose, 4> poses;
    const int n = decompose_homography(homography_, &poses);
    std::vector<RigidTransform> possible;
    std::vector<float> errors;
    matches_.homography_errors(homography_, &errors);
    for (int k = 0; k < n; ++k) {
      const PlanarPose& pose = poses[static_cast<std::size_t>(k)];
      int in_front = 0, inliers = 0;
      for (std::size_t i = 0; i < errors.size(); ++i)
        if (errors[i] < truncation_) {
          ++inliers;
          in_front += plane_in_front(pose, matches_[i].ray1) ? 1 : 0;
        }
      if (2 * in_front < inliers || !(pose.second_from_first.t.norm() > 0)) continue;
      const RigidTransform unit(pose.second_from_first.R, pose.second_from_first.t.normalized());
      if (in_front > kInFront * inliers) possible.push_back(unit);
      add_candidate(unit);
    }
    plane_has_twins_ = possible.size() > 1 && !same_pose(possible[0], possible[1]);
  }

  void search_essential() {
    int optimisations = 0;
    double best = INFINITY;  // of hypotheses as they were sampled
    for (int k = 0; k < options_.max_hypotheses; ++k) {
      const double reached = candidates_.empty() ? best : std::min(best, candidates_.front().cost);
      if (k >= samples_needed(reached, 5, 50)) break;
      std::array<std::size_t, 5> picks;
      sample(&picks);
      std::array<Eigen::Vector3d, 5> a, b;
      for (std::size_t i = 0; i < 5; ++i) {
        a[i] = matches_[picks[i]].ray1;
        b[i] = matches_[picks[i]].ray2;
      }
      FivePointSolutions solutions;
      solve_five_point(a, b, &solutions);
      for (int s = 0; s < solutions.count; ++s) {
        const Eigen::Matrix3d& E = solutions.essential[static_cast<std::size_t>(s)];
        RigidTransform pose;
        if (!pose_in_front(E, a, b, &pose)) continue;
        const double limit = 1.1 * best;
        const double cost = matches_.essential_cost(E, truncation_, limit);
        if (!(cost < limit)) continue;
        best = std::min(best, cost);
        if (++optimisations <= kMaxLocalOptimisations) add_candidate(pose);
      }
    }
  }

  // The pose of E that has all sampled points in front of both cameras, if there is one.
  static bool pose_in_front(const Eigen::Matrix3d& E, const std::array<Eigen::Vector3d, 5>& rays1,
                            const std::array<Eigen::Vector3d, 5>& rays2, RigidTransform* pose) {
    const auto poses = poses_of_essential(E);
    for (const RigidTransform& candidate : poses) {
      bool in_front = true;
      for (std::size_t i = 0; i < 5 && in_front; ++i) {
        double z1 = 0, z2 = 0;
        in_front = ray_depths(candidate, rays1[i], rays2[i], &z1, &z2) && z1 > 0 && z2 > 0;
      }
      if (!in_front) continue;
      *pose = candidate;
      return true;
    }
    return false;
  }

  void evaluate(Candidate* candidate) const {
    matches_.essential_errors(essential_of_pose(candidate->pose), &candidate->costs);
    candidate->cost = 0;
    for (std::size_t i = 0; i < candidate->costs.size(); ++i) {
      float& cost = candidate->costs[i];
      const RayMatch& m = matches_[i];
      double z1 = 0, z2 = 0;
      if (!(cost < truncation_)) {
        cost = static_cast<float>(truncation_);
      } else if (ray_depths(candidate->pose, m.ray1, m.ray2, &z1, &z2) && (z1 <= 0 || z2 <= 0) &&
                 parallax_angle(candidate->pose, m.ray1, m.ray2) > measurable_parallax_) {
        cost = static_cast<float>(truncation_);
      }
      candidate->cost += static_cast<double>(cost);
    }
  }

  void insert(Candidate candidate) {
    for (Candidate& known : candidates_)
      if (same_pose(known.pose, candidate.pose)) {
        if (candidate.cost < known.cost) known = std::move(candidate);
        sort_candidates();
        return;
      }
    candidates_.push_back(std::move(candidate));
    sort_candidates();
    if (candidates_.size() > kMaxCandidates) candidates_.pop_back();
  }

  void sort_candidates() {
    std::stable_sort(candidates_.begin(), candidates_.end(),
                     [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; });
  }

  void add_candidate(const RigidTransform& pose) {
    Candidate candidate;
    candidate.pose = pose;
    const std::size_t n = std::min(kLocalMatches, matches_.size());
    refine_relative_pose(matches_, n, 2.5 * threshold_, 3, &candidate.pose);
    refine_relative_pose(matches_, n, 1.5 * threshold_, 3, &candidate.pose);
    evaluate(&candidate);
    insert(std::move(candidate));
  }

  // Full refinement of the few candidates that can still win, at the noise the data shows.
  void finish() {
    if (candidates_.empty()) return;
    std::vector<Candidate> rough;
    rough.swap(candidates_);
    std::vector<double> squared;
    for (const float c : rough.front().costs)
      if (c < static_cast<float>(truncation_)) squared.push_back(static_cast<double>(c));
    sigma_ = options_.sigma_px;
    if (!squared.empty()) {
      const auto middle = squared.begin() + static_cast<std::ptrdiff_t>(squared.size() / 2);
      std::nth_element(squared.begin(), middle, squared.end());
      sigma_ = std::clamp(1.4826 * std::sqrt(*middle), 0.05 * options_.sigma_px, options_.sigma_px);
    }
    std::vector<float> errors;
    matches_.homography_errors(homography_, &errors);
    planar_ = count_below(errors, kChi2Two * sigma_ * sigma_) >=
              kPlaneExplains * count_below(rough.front().costs, kChi2One * sigma_ * sigma_);
    // On a plane a match must agree in both directions, which clears away the outliers that lie along epipolar lines.
    RayMatches on_plane;
    if (planar_)
      for (std::size_t i = 0; i < errors.size(); ++i)
        if (errors[i] < truncation_) on_plane.add(matches_[i]);
    const RayMatches& used = planar_ ? on_plane : matches_;
    const double hopeless = 1.3 * rough.front().cost + 0.05 * truncation_ * static_cast<double>(matches_.size());
    for (Candidate& candidate : rough) {
      if (candidate.cost > hopeless) break;
      refine_relative_pose(used, used.size(), 1.5 * threshold_, 6, &candidate.pose);
      refine_relative_pose(used, used.size(), std::max(kTukeyWidth * sigma_, 0.5 * options_.sigma_px), 10,
                           &candidate.pose);
      evaluate(&candidate);
      insert(std::move(candidate));
    }
  }

  const RayMatches& matches_;
  const TwoViewOptions& options_;
  std::mt19937_64* rng_;
  double threshold_, truncation_;
  double measurable_parallax_;  // radians; below it the sign of a depth is noise
  Eigen::Matrix3d rotation_ = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d homography_ = Eigen::Matrix3d::Identity();
  std::vector<Candidate> candidates_;
  double sigma_ = 1.0;
  bool plane_has_twins_ = false, planar_ = false;
};

// How decisively the first candidate beats the second, in standard deviations of the summed difference of their costs.
double decisiveness(const Candidate& best, const Candidate& other, double sigma_px) {
  const double floor = 0.1 * sigma_px * 0.1 * sigma_px;  // differences that rounding alone may make
  double sum = 0, squares = 0;
  for (std::size_t i = 0; i < best.costs.size(); ++i) {
    const double d = static_cast<double>(other.costs[i]) - static_cast<double>(best.costs[i]);
    sum += d;
    squares += d * d + floor * floor;
  }
  return sum / std::sqrt(squares);
}

// Another motion, not just another local minimum of the same valley, explains the matches about as well.
bool has_rival(const TwoViewSearch& search, double sigma_px) {
  const Candidate& best = search.candidates().front();
  const bool twins = search.planar() && search.plane_has_twins();
  return std::any_of(search.candidates().begin() + 1, search.candidates().end(), [&](const Candidate& other) {
    return (twins || !same_valley(best.pose, other.pose)) && decisiveness(best, other, sigma_px) < kDecisive;
  });
}

}  // namespace

const char* describe(TwoViewStatus status) {
  switch (status) {
    case TwoViewStatus::ok:
      return "The two views give a map.";
    case TwoViewStatus::too_few_matches:
      return "Too few points could be followed: look at a surface with more texture and move more slowly.";
    case TwoViewStatus::rotation_only:
      return "The camera only turned: move it sideways by about 10 cm while looking at the same place.";
    case TwoViewStatus::too_little_parallax:
      return "The camera hardly moved: move it further sideways, about a tenth of its distance from the scene.";
    case TwoViewStatus::ambiguous:
      return "Two different motions explain the views equally well: move sideways rather than straight ahead, or let "
             "something stand out of the plane.";
    case TwoViewStatus::inconsistent:
      return "The tracked points do not agree on one motion: keep the scene still and move more slowly.";
  }
  return "Unknown status.";
}

TwoViewResult solve_two_view(const CameraModel& camera, std::span<const TwoViewMatch> matches,
                             const TwoViewOptions& options, std::mt19937_64* rng) {
  PARALLAX_CHECK(rng != nullptr, "a random generator is needed");
  PARALLAX_CHECK(options.sigma_px > 0, "the noise of a match must be positive");
  TwoViewResult result;
  result.inlier.assign(matches.size(), 0);
  result.points.assign(matches.size(), Eigen::Vector3d::Zero());

  // Rays once, in random order so that any prefix is a fair sample.
  std::vector<std::size_t> order(matches.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[(*rng)() % i]);
  RayMatches rays;
  rays.reserve(matches.size());
  std::vector<std::size_t> original;
  original.reserve(matches.size());
  for (const std::size_t i : order) {
    Eigen::Vector3d r1, r2;
    Eigen::Vector2d px;
    Eigen::Matrix<double, 2, 3> j1, j2;
    if (!matches[i].first.allFinite() || !matches[i].second.allFinite()) continue;
    if (!camera.unproject(matches[i].first, &r1) || !camera.unproject(matches[i].second, &r2)) continue;
    if (!camera.project(r1, &px, &j1) || !camera.project(r2, &px, &j2)) continue;
    rays.add(r1, r2, j1.leftCols<2>(), j2.leftCols<2>());
    original.push_back(i);
  }
  const int n = static_cast<int>(rays.size());
  if (n < std::max(8, options.min_inliers)) return result;

  TwoViewSearch search(rays, options, camera.mean_focal_px(), rng);
  search.run();

  std::vector<float> errors;
  const double sigma = search.sigma_px();
  rays.homography_errors(search.rotation(), &errors);
  const int rotation_inliers = count_below(errors, kChi2Two * sigma * sigma);
  const auto motionless = [&] {
    return log_so3(search.rotation()).norm() > kTurned ? TwoViewStatus::rotation_only
                                                       : TwoViewStatus::too_little_parallax;
  };
  const double fraction_needed = options.min_inlier_fraction * n;
  if (search.candidates().empty()) {
    result.status = rotation_inliers >= fraction_needed ? motionless() : TwoViewStatus::inconsistent;
    return result;
  }
  const Candidate& best = search.candidates().front();
  const double truncation = kTruncationSigmas * kTruncationSigmas * options.sigma_px * options.sigma_px;
  result.second_from_first = best.pose;
  result.score = std::clamp(1.0 - best.cost / (truncation * n), 0.0, 1.0);

  const int consistent = count_below(best.costs, truncation);
  const int essential_inliers = count_below(best.costs, std::min(kChi2One * sigma * sigma, truncation));
  result.planar = search.planar();

  // Parallax over everything that fits, points without a usable depth included: they are what a pure turn gives.
  std::vector<double> parallax;
  int inliers = 0;
  for (std::size_t k = 0; k < rays.size(); ++k) {
    if (!(best.costs[k] < truncation)) continue;
    const double angle = parallax_angle(best.pose, rays[k].ray1, rays[k].ray2);
    parallax.push_back(angle);
    const std::size_t i = original[k];
    Eigen::Vector3d point;
    Eigen::Vector2d px1, px2;
    if (angle < kTinyParallax * options.min_parallax_deg * kDegree) continue;
    if (!triangulate(best.pose, rays[k].ray1, rays[k].ray2, &point)) continue;
    if (!camera.project(point, &px1) || !camera.project(best.pose * point, &px2)) continue;
    const double bound = kTruncationSigmas * options.sigma_px;
    if ((px1 - matches[i].first).norm() > bound || (px2 - matches[i].second).norm() > bound) continue;
    result.inlier[i] = 1;
    result.points[i] = point;
    ++inliers;
  }
  if (!parallax.empty()) {
    const auto middle = parallax.begin() + static_cast<std::ptrdiff_t>(parallax.size() / 2);
    std::nth_element(parallax.begin(), middle, parallax.end());
    result.median_parallax_deg = *middle / kDegree;
  }

  if (std::max(consistent, rotation_inliers) < fraction_needed) {
    result.status = TwoViewStatus::inconsistent;
  } else if (rotation_inliers >= kRotationExplains * essential_inliers) {
    result.status = motionless();
  } else if (result.median_parallax_deg < options.min_parallax_deg) {
    result.status = TwoViewStatus::too_little_parallax;
  } else if (has_rival(search, options.sigma_px)) {
    result.status = TwoViewStatus::ambiguous;
  } else if (inliers < options.min_inliers) {
    result.status = TwoViewStatus::too_few_matches;
  } else {
    result.status = TwoViewStatus::ok;
  }
  return result;
}

}  // namespace parallax
