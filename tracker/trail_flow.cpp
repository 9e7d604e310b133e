#include "tracker/trail_flow.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/patch.h"

namespace parallax {
namespace {

constexpr std::size_t kSamples = 64;        // trails searched exhaustively
constexpr int kMaxRadius = 12;              // of the search, pixels of the coarse level
constexpr double kMinContrast = 25;         // of a patch worth searching, grey levels squared
constexpr double kMaxDifferencePart = 0.4;  // zero-mean SSD of the best place, part of the patch's own
constexpr std::size_t kMinForShift = 5, kMinForAffine = 16;
constexpr double kMinScale_px = 2.0;        // of the robust weights
constexpr double kNeighbourRadius_px = 60;  // for the local motion
constexpr std::size_t kMinNeighbours = 6;

struct Match {
  Eigen::Vector2d from, to;
  double weight = 1;
};

// Weighted least squares of to = linear * (from - centre) + at, with a ridge that pulls `linear` to `prior`.
struct AffineFit {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero(), at = Eigen::Vector2d::Zero();
  Eigen::Matrix2d linear = Eigen::Matrix2d::Identity();
  Eigen::Vector2d operator()(const Eigen::Vector2d& p) const { return linear * (p - centre) + at; }
};

AffineFit fit_affine(const std::vector<Match>& matches, const Eigen::Matrix2d& prior, double ridge) {
  AffineFit fit;
  double total = 0;
  for (const Match& m : matches) {
    total += m.weight;
    fit.centre += m.weight * m.from;
    fit.at += m.weight * m.to;
  }
  if (total <= 0) return fit;
  fit.centre /= total;
  fit.at /= total;
  Eigen::Matrix2d moment = Eigen::Matrix2d::Identity() * ridge, cross = prior * ridge;
  for (const Match& m : matches) {
    const Eigen::Vector2d d = m.from - fit.centre;
    moment += m.weight * d * d.transpose();
    cross += m.weight * (m.to - fit.at) * d.transpose();
  }
  fit.linear = moment.ldlt().solve(cross.transpose()).transpose();
  return fit;
}

double median(std::vector<double> v) {
  const auto middle = v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2);
  std::nth_element(v.begin(), middle, v.end());
  return *middle;
}

// Tukey weights about the fit; returns the scale.
template <typename Predict>
void reweight(const Predict& predict, std::vector<Match>* matches) {
  std::vector<double> errors;
  errors.reserve(matches->size());
  for (const Match& m : *matches) errors.push_back((m.to - predict(m.from)).norm());
  const double scale = 4.0 * std::max(kMinScale_px, median(errors));
  for (std::size_t i = 0; i < errors.size(); ++i) {
    const double r = errors[i] / scale;
    (*matches)[i].weight = r < 1 ? (1 - r * r) * (1 - r * r) : 0;
  }
}

// The best place of the block around `from` within `radius` of `start`, all in pixels of one level.
bool search_block(const GreyImage& last, const GreyImage& next, const Eigen::Vector2d& from,
                  const Eigen::Vector2d& start, int radius, Eigen::Vector2d* moved) {
  const int fx = static_cast<int>(std::lround(from.x())), fy = static_cast<int>(std::lround(from.y()));
  PatchTemplate patch;
  if (!copy_patch(last, fx, fy, &patch)) return false;
  const double own = patch.sum_squares - static_cast<double>(patch.sum) * patch.sum / kPatchPixels;
  if (own < kMinContrast * kPatchPixels) return false;
  const int sx = static_cast<int>(std::lround(start.x())), sy = static_cast<int>(std::lround(start.y()));
  int best = static_cast<int>(kMaxDifferencePart * own), bx = 0, by = 0;
  bool any = false;
  for (int y = std::max(4, sy - radius); y <= std::min(next.rows - 4, sy + radius); ++y) {
    for (int x = std::max(4, sx - radius); x <= std::min(next.cols - 4, sx + radius); ++x) {
      const int d = zmssd(patch, next, x, y);
      if (d >= best) continue;
      best = d;
      bx = x;
      by = y;
      any = true;
    }
  }
  *moved = Eigen::Vector2d(bx - fx, by - fy);
  return any;
}

}  // namespace

ImageFlow estimate_flow(const ImagePyramid& last, const ImagePyramid& next, const std::vector<Trail>& trails,
                        int coarse, const Eigen::Vector2d& predicted_shift, double radius_px) {
  ImageFlow flow;
  flow.offset = predicted_shift;
  const double scale = level_scale(coarse);
  const auto level = static_cast<std::size_t>(coarse);
  const int radius = std::clamp(static_cast<int>(std::ceil(radius_px / scale)), 2, kMaxRadius);
  const std::size_t samples = std::min(kSamples, trails.size());
  std::vector<Match> matches;
  for (std::size_t i = 0; i < samples; ++i) {
    const Eigen::Vector2d& p = trails[i * trails.size() / samples].current;
    const Eigen::Vector2d from = level0_to_level(p, coarse);
    Eigen::Vector2d moved;
    if (search_block(last.level[level], next.level[level], from, from + predicted_shift / scale, radius, &moved)) {
      matches.push_back({p, p + moved * scale});
    }
  }
  if (matches.size() < kMinForShift) return flow;
  std::vector<double> x, y;
  for (const Match& m : matches) {
    x.push_back(m.to.x() - m.from.x());
    y.push_back(m.to.y() - m.from.y());
  }
  const Eigen::Vector2d shift(median(x), median(y));
  flow.offset = shift;
  if (matches.size() < kMinForAffine) return flow;
  reweight([&](const Eigen::Vector2d& p) { return Eigen::Vector2d(p + shift); }, &matches);
  AffineFit fit;
  const double ridge = 1e3 * scale * scale;
  for (int i = 0; i < 4; ++i) {
    fit = fit_affine(matches, Eigen::Matrix2d::Identity(), ridge);
    reweight(fit, &matches);
  }
  std::size_t agreeing = 0;
  for (const Match& m : matches) agreeing += m.weight > 0.3 ? 1 : 0;
  if (agreeing < kMinForAffine || (fit.linear - Eigen::Matrix2d::Identity()).norm() > 0.5) return flow;
  flow.linear = fit.linear;
  flow.offset = fit.at - fit.linear * fit.centre;
  return flow;
}

std::vector<Eigen::Matrix2d> local_linear_motion(const std::vector<Trail>& trails) {
  std::vector<Match> all;
  all.reserve(trails.size());
  for (const Trail& t : trails) all.push_back({t.first, t.current});
  AffineFit whole;
  if (all.size() >= kMinNeighbours) {
    for (int i = 0; i < 4; ++i) {
      whole = fit_affine(all, Eigen::Matrix2d::Identity(), 1e4);
      reweight(whole, &all);
    }
  }
  std::vector<Eigen::Matrix2d> out(trails.size(), whole.linear);
  std::vector<Match> near;
  for (std::size_t i = 0; i < trails.size(); ++i) {
    near.clear();
    for (const Trail& t : trails) {
      if ((t.first - trails[i].first).squaredNorm() < kNeighbourRadius_px * kNeighbourRadius_px) {
        near.push_back({t.first, t.current});
      }
    }
    if (near.size() < kMinNeighbours) continue;
    // the trail's own motion first: neighbours on another surface move differently
    const Eigen::Vector2d own = trails[i].current - trails[i].first;
    reweight([&](const Eigen::Vector2d& p) { return Eigen::Vector2d(p + own); }, &near);
    AffineFit fit;
    for (int k = 0; k < 2; ++k) {
      fit = fit_affine(near, whole.linear, 1e3);
      reweight(fit, &near);
    }
    if ((fit.linear - whole.linear).norm() < 0.5) out[i] = fit.linear;
  }
  return out;
}

}  // namespace parallax
