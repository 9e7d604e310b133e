#include "solver/absolute_pose.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/check.h"

namespace parallax {
namespace {

// Triangles whose height is below this part of their sides are taken as lines.
constexpr double kMinRelativeHeight = 1e-7;
// Of the squared side lengths: what a solution may leave unexplained.
constexpr double kMaxResidual = 1e-9;
// Points nearer to the camera than this part of the longest side are none: their direction is lost in rounding.
constexpr double kMinDistance = 1e-4;
// Chance of stopping before three inliers were drawn together.
constexpr double kMissProbability = 1e-4;

// A real root of c[3] x^3 + ... + c[0], c[3] not 0: one that is far from the other two.
double cubic_root(const std::array<double, 4>& c) {
  const double a = c[2] / c[3], b = c[1] / c[3], d = c[0] / c[3];
  const double shift = -a / 3, p = b - a * a / 3, q = a * (2 * a * a / 27 - b / 3) + d;  // y^3 + p y + q
  double x;
  const double discriminant = q * q / 4 + p * p * p / 27;
  if (discriminant > 0) {
    const double u = std::cbrt(-q / 2 - std::copysign(std::sqrt(discriminant), q));
    x = shift + (u != 0 ? u - p / (3 * u) : 0);
  } else {
    // Of three, an outer one, on the side of the larger gap.
    const double r = std::sqrt(std::max(0.0, -p / 3));
    const double phi = r > 0 ? std::acos(std::clamp(-q / (2 * r * r * r), -1.0, 1.0)) / 3 : 0;
    x = shift + (q <= 0 ? 2 * r * std::cos(phi) : 2 * r * std::cos(phi + 2 * M_PI / 3));
  }
  for (int k = 0; k < 3; ++k) {
    const double slope = (3 * x + 2 * a) * x + b;
    if (slope == 0) break;
    const double step = (((x + a) * x + b) * x + d) / slope;
    if (!(std::abs(step) < 0.1 * (1 + std::abs(x)))) break;
    x -= step;
  }
  return x;
}

// Its transpose is the inverse times the determinant.
Eigen::Matrix3d cofactors(const Eigen::Matrix3d& m) {
  Eigen::Matrix3d out;
  out.col(0) = m.col(1).cross(m.col(2));
  out.col(1) = m.col(2).cross(m.col(0));
  out.col(2) = m.col(0).cross(m.col(1));
  return out;
}

// Orthonormal frame of a triangle.
bool triad(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c, Eigen::Matrix3d* frame) {
  const Eigen::Vector3d ab = b - a, ac = c - a, normal = ab.cross(ac);
  const double longest2 = std::max({ab.squaredNorm(), ac.squaredNorm(), (c - b).squaredNorm()});
  if (!(normal.norm() > kMinRelativeHeight * longest2) || !(ab.squaredNorm() > 0)) return false;
  frame->col(0) = ab.normalized();
  frame->col(2) = normal.normalized();
  frame->col(1) = frame->col(2).cross(frame->col(0));
  return true;
}

// The law of cosines on the three sides: |l_i r_i - l_j r_j|^2 = side2, sides (0,1), (0,2), (1,2).
struct Sides {
  Eigen::Vector3d cosine, side2;

  Eigen::Vector3d residual(const Eigen::Vector3d& l) const {
    return {l[0] * l[0] + l[1] * l[1] - 2 * cosine[0] * l[0] * l[1] - side2[0],
            l[0] * l[0] + l[2] * l[2] - 2 * cosine[1] * l[0] * l[2] - side2[1],
            l[1] * l[1] + l[2] * l[2] - 2 * cosine[2] * l[1] * l[2] - side2[2]};
  }
  Eigen::Matrix3d jacobian(const Eigen::Vector3d& l) const {
    Eigen::Matrix3d j;
    j << l[0] - cosine[0] * l[1], l[1] - cosine[0] * l[0], 0,  //
        l[0] - cosine[1] * l[2], 0, l[2] - cosine[1] * l[0],   //
        0, l[1] - cosine[2] * l[2], l[2] - cosine[2] * l[1];
    return 2 * j;
  }
  // Newton steps as long as they lead closer.
  void polish(Eigen::Vector3d* l) const {
    Eigen::Vector3d r = residual(*l);
    for (int k = 0; k < 5; ++k) {
      const Eigen::Matrix3d j = jacobian(*l);
      const double det = j.determinant();
      if (det == 0) return;
      const Eigen::Vector3d next = *l - cofactors(j).transpose() * r / det;
      const Eigen::Vector3d r_next = residual(next);
      if (!(r_next.squaredNorm() < r.squaredNorm())) return;
      *l = next;
      r = r_next;
    }
  }
};

// The quadratic form l^T Q l of one side's law of cosines.
Eigen::Matrix3d side_form(int i, int j, double cosine) {
  Eigen::Matrix3d q = Eigen::Matrix3d::Zero();
  q(i, i) = q(j, j) = 1;
  q(i, j) = q(j, i) = -cosine;
  return q;
}

// Directions of the plane with this normal on which the form vanishes: none or two (equal when they touch).
int null_directions(const Eigen::Matrix3d& form, const Eigen::Vector3d& normal, std::array<Eigen::Vector3d, 2>* out) {
  const Eigen::Vector3d p = normal.unitOrthogonal(), q = normal.cross(p).normalized();
  // a x^2 + 2 b x y + c y^2 on x p + y q.
  const double a = p.dot(form * p), b = p.dot(form * q), c = q.dot(form * q);
  const double largest = std::max({std::abs(a), std::abs(b), std::abs(c)});
  double discriminant = b * b - a * c;
  if (!(largest > 0) || !(discriminant > -1e-9 * largest * largest)) return 0;
  const double root = std::sqrt(std::max(0.0, discriminant));
  const double m = b >= 0 ? -b - root : -b + root;  // roots (x : y) = (m : a) and (c : m)
  (*out)[0] = m * p + a * q;
  (*out)[1] = c * p + m * q;
  if (m == 0 && a == 0) (*out)[0] = p;
  if (m == 0 && c == 0) (*out)[1] = q;
  return 2;
}

// Probability that `count` or more of many independent rare events happen when `expected` do on average (Chernoff's
// bound on the Poisson distribution), natural logarithm.
double log_tail(double count, double expected) {
  if (!(count > expected)) return 0;
  return expected > 0 ? count - expected - count * std::log(count / expected) : -HUGE_VAL;
}

// Length on the plane z = 1 that a pixel there covers: an inlier limit without the lens.
double ray_length_of_pixel(const CameraModel& camera, const Eigen::Vector2d& pixel, const Eigen::Vector3d& ray) {
  Eigen::Vector3d beside, below;
  const Eigen::Vector2d here = ray.hnormalized();
  const double right =
      camera.unproject(pixel + Eigen::Vector2d(1, 0), &beside) ? (beside.hnormalized() - here).norm() : 0;
  const double down = camera.unproject(pixel + Eigen::Vector2d(0, 1), &below) ? (below.hnormalized() - here).norm() : 0;
  return right > 0 && down > 0 ? 0.5 * (right + down) : 1 / camera.mean_focal_px();
}

// Counts the matches that a pose agrees with on the plane z = 1, in single precision and without branches: what
// hypotheses are compared by.
class QuickCount {
 public:
  void add(const Eigen::Vector3d& point, const Eigen::Vector3d& ray, double limit) {
    for (int i = 0; i < 3; ++i) point_[i].push_back(static_cast<float>(point[i]));
    u_.push_back(static_cast<float>(ray.x() / ray.z()));
    v_.push_back(static_cast<float>(ray.y() / ray.z()));
    limit_squared_.push_back(static_cast<float>(limit * limit));
  }
  int count(const RigidTransform& pose) const {
    const Eigen::Matrix3f R = pose.R.cast<float>();
    const Eigen::Vector3f t = pose.t.cast<float>();
    int agree = 0;
    for (std::size_t i = 0; i < u_.size(); ++i) {
      const float px = point_[0][i], py = point_[1][i], pz = point_[2][i];
      const float x = R(0, 0) * px + R(0, 1) * py + R(0, 2) * pz + t[0];
      const float y = R(1, 0) * px + R(1, 1) * py + R(1, 2) * pz + t[1];
      const float z = R(2, 0) * px + R(2, 1) * py + R(2, 2) * pz + t[2];
      const float du = x - u_[i] * z, dv = y - v_[i] * z;
      agree += static_cast<int>(z > 0) & static_cast<int>(du * du + dv * dv <= limit_squared_[i] * z * z);
    }
    return agree;
  }

 private:
  std::vector<float> point_[3], u_, v_, limit_squared_;
};

// How many of the best matches the k-th hypothesis is drawn from.
std::size_t best_matches(std::size_t n, int k, int hypotheses) {
  constexpr std::size_t kFirst = 12;
  if (n <= kFirst) return n;
  return std::min(n, kFirst + 2 * (n - kFirst) * static_cast<std::size_t>(k) / static_cast<std::size_t>(hypotheses));
}

// Draws three different ones of the first `from` matches, alike in how they turn where that is known.
class TripleSampler {
 public:
  TripleSampler(std::vector<double> turns, double max_difference)
      : turns_(std::move(turns)), max_difference_(max_difference) {
    for (double& turn : turns_) turn = std::remainder(turn, 2 * M_PI);
  }

  // False when nothing goes with the first.
  bool draw(std::size_t from, std::mt19937_64* rng, std::array<std::size_t, 3>* pick) {
    if (turns_.empty()) {
      *pick = {(*rng)() % from, (*rng)() % (from - 1), (*rng)() % (from - 2)};
      if ((*pick)[1] >= (*pick)[0]) ++(*pick)[1];
      for (std::size_t other : {std::min((*pick)[0], (*pick)[1]), std::max((*pick)[0], (*pick)[1])})
        if ((*pick)[2] >= other) ++(*pick)[2];
      return true;
    }
    const std::size_t first = (*rng)() % from;
    alike_.clear();
    for (std::size_t i = 0; i < from; ++i) {
      const double difference = std::abs(turns_[i] - turns_[first]);  // to two half turns
      if (i != first && std::min(difference, 2 * M_PI - difference) <= max_difference_) alike_.push_back(i);
    }
    if (alike_.size() < 2) return false;
    const std::size_t second = (*rng)() % alike_.size();
    std::size_t third = (*rng)() % (alike_.size() - 1);
    third += third >= second ? 1 : 0;
    *pick = {first, alike_[second], alike_[third]};
    return true;
  }

 private:
  std::vector<double> turns_;
  double max_difference_;
  std::vector<std::size_t> alike_;
};

}  // namespace

int solve_three_points(const std::array<Eigen::Vector3d, 3>& points, const std::array<Eigen::Vector3d, 3>& rays,
                       std::array<RigidTransform, 4>* poses) {
  std::array<Eigen::Vector3d, 3> r;
  for (int i = 0; i < 3; ++i) {
    const double length = rays[i].norm();
    if (!(length > 0) || !std::isfinite(length) || !points[i].allFinite()) return 0;
    r[i] = rays[i] / length;
  }
  Eigen::Matrix3d world_frame;
  if (!triad(points[0], points[1], points[2], &world_frame)) return 0;
  Sides sides;
  sides.cosine = {r[0].dot(r[1]), r[0].dot(r[2]), r[1].dot(r[2])};
  sides.side2 = {(points[0] - points[1]).squaredNorm(), (points[0] - points[2]).squaredNorm(),
                 (points[1] - points[2]).squaredNorm()};
  const double unit2 = sides.side2.maxCoeff();
  sides.side2 /= unit2;

  // Two combinations of the three equations without a constant term: conics that the distances l lie on, up to scale.
  const Eigen::Matrix3d m01 = side_form(0, 1, sides.cosine[0]), m02 = side_form(0, 2, sides.cosine[1]),
                        m12 = side_form(1, 2, sides.cosine[2]);
  Eigen::Matrix3d d1 = m01 * sides.side2[2] - m12 * sides.side2[0], d2 = m02 * sides.side2[2] - m12 * sides.side2[1];
  // The member d1 + g d2 of their pencil that is a pair of lines.
  double det1 = d1.determinant(), det2 = d2.determinant();
  if (std::abs(det1) > std::abs(det2)) {
    std::swap(d1, d2);
    std::swap(det1, det2);
  }
  double g = 0;
  if (std::abs(det2) > 0)
    g = cubic_root({det1, cofactors(d1).cwiseProduct(d2).sum(), cofactors(d2).cwiseProduct(d1).sum(), det2});
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(d1 + g * d2);
  std::array<int, 3> order = {0, 1, 2};
  std::sort(order.begin(), order.end(),
            [&](int i, int j) { return std::abs(eigen.eigenvalues()[i]) > std::abs(eigen.eigenvalues()[j]); });
  const double large = eigen.eigenvalues()[order[0]], small = eigen.eigenvalues()[order[1]];
  if (!(std::abs(large) > 0)) return 0;
  const double ratio = -small / large;
  if (!(ratio > -1e-9)) return 0;  // lines that are not real
  const double slope = std::sqrt(std::max(0.0, ratio));
  int n = 0;
  std::array<Eigen::Vector3d, 4> found;
  for (double sign : {1.0, -1.0}) {
    const Eigen::Vector3d normal =
        (eigen.eigenvectors().col(order[0]) + sign * slope * eigen.eigenvectors().col(order[1])).normalized();
    // On the line both conics are the same up to scale: the one that is further from vanishing there says more.
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - normal * normal.transpose();
    const bool first = (across * d1 * across).squaredNorm() > (across * d2 * across).squaredNorm();
    std::array<Eigen::Vector3d, 2> directions;
    const int n_directions = null_directions(first ? d1 : d2, normal, &directions);
    for (int k = 0; k < n_directions; ++k) {
      Eigen::Vector3d l = directions[k];
      if (l.sum() < 0) l = -l;
      const double size2 = l.dot((m01 + m02 + m12) * l);
      if (!(l.minCoeff() > 0) || !(size2 > 0)) continue;
      l *= std::sqrt(sides.side2.sum() / size2);
      sides.polish(&l);
      if (!(l.minCoeff() > kMinDistance) || !(sides.residual(l).cwiseAbs().maxCoeff() < kMaxResidual)) continue;
      bool known = false;
      for (int j = 0; j < n; ++j) known |= (found[j] - l).squaredNorm() < 1e-24 * l.squaredNorm();
      if (known) continue;
      const Eigen::Vector3d lengths = std::sqrt(unit2) * l;
      const Eigen::Vector3d p0 = lengths[0] * r[0];
      Eigen::Matrix3d camera_frame;
      if (!triad(p0, lengths[1] * r[1], lengths[2] * r[2], &camera_frame)) continue;
      found[n] = l;
      RigidTransform& pose = (*poses)[n++];
      pose.R = camera_frame * world_frame.transpose();
      pose.t = p0 - pose.R * points[0];
    }
  }
  return n;
}

AbsolutePoseSummary solve_absolute_pose(const CameraModel& camera, std::span<const PoseObservation> matches,
                                        const AbsolutePoseOptions& options, std::mt19937_64* rng,
                                        RigidTransform* camera_from_world) {
  PARALLAX_CHECK(options.turns.empty() || options.turns.size() == matches.size(),
                 "absolute pose: a turn for each match");
  AbsolutePoseSummary summary;
  std::vector<PoseObservation> usable;
  std::vector<Eigen::Vector3d> rays;
  std::vector<double> turns;
  QuickCount quick;
  double by_chance = 0;  // inliers of a pose that has nothing to do with the image
  const double area = static_cast<double>(camera.width()) * camera.height();
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const PoseObservation& m = matches[i];
    Eigen::Vector3d ray;
    if (!m.point.allFinite() || !m.pixel.allFinite() || !(m.sigma_px > 0) || !camera.unproject(m.pixel, &ray)) continue;
    usable.push_back(m);
    rays.push_back(ray);
    if (!options.turns.empty()) turns.push_back(options.turns[i]);
    const double limit = options.inlier_sigmas * m.sigma_px;
    by_chance += std::min(1.0, M_PI * limit * limit / area);
    quick.add(m.point, ray, limit * ray_length_of_pixel(camera, m.pixel, ray));
  }
  const std::size_t n = usable.size();
  if (n < static_cast<std::size_t>(std::max(4, options.min_inliers))) return summary;
  const auto inliers_of = [&](const RigidTransform& pose, std::vector<PoseObservation>* kept) {
    int count = 0;
    for (const PoseObservation& m : usable) {
      Eigen::Vector2d pixel;
      if (!camera.project(pose * m.point, &pixel)) continue;
      const double limit = options.inlier_sigmas * m.sigma_px;
      if (!((pixel - m.pixel).squaredNorm() <= limit * limit)) continue;
      ++count;
      if (kept) kept->push_back(m);
    }
    return count;
  };
  RigidTransform best;
  int most = 0, tried = 0;
  double needed = options.max_hypotheses;
  TripleSampler sampler(std::move(turns), options.max_turn_difference);
  for (int k = 0; k < options.max_hypotheses && k < needed; ++k) {
    const std::size_t from = options.best_first ? best_matches(n, k, options.max_hypotheses) : n;
    std::array<std::size_t, 3> pick;
    if (!sampler.draw(from, rng, &pick)) continue;
    std::array<RigidTransform, 4> poses;
    const int solutions = solve_three_points({usable[pick[0]].point, usable[pick[1]].point, usable[pick[2]].point},
                                             {rays[pick[0]], rays[pick[1]], rays[pick[2]]}, &poses);
    for (int s = 0; s < solutions; ++s) {
      ++tried;
      const int count = quick.count(poses[s]);
      if (count <= most) continue;
      most = count;
      best = poses[s];
      const double part = static_cast<double>(most) / static_cast<double>(n);
      needed = std::log(kMissProbability) / std::log1p(-std::min(0.999, part * part * part));
    }
  }
  if (most < options.min_inliers) return summary;
  for (int round = 0; round < 2; ++round) {
    std::vector<PoseObservation> kept;
    inliers_of(best, &kept);
    if (!refine_pose(camera, kept, PoseOptions{}, &best).ok) return summary;
  }
  summary.inliers = inliers_of(best, nullptr);
  // The three that made the hypothesis agree anyway.
  const double log_false_alarm = std::log(std::max(1, tried)) + log_tail(summary.inliers - 3, by_chance);
  summary.ok = summary.inliers >= options.min_inliers && log_false_alarm <= std::log(options.max_false_alarm);
  if (summary.ok) *camera_from_world = best;
  return summary;
}

}  // namespace parallax
