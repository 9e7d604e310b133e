#include "place/image_consistency.h"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/descriptor_search.h"
#include "core/image.h"

namespace parallax {
namespace {

constexpr int kSample = 4;             // determines the affine epipolar constraint
constexpr std::size_t kFullModel = 8;  // determines the fundamental matrix

struct PixelPair {
  Eigen::Vector2d a, b;
  double sigma = 1;  // of the larger of the two features' scales
};

struct Nearest {
  int index = -1, distance = 0;
};

// The clearly nearest of `set` to each of `features`; index -1: none.
std::vector<Nearest> nearest_in(const DescriptorSet& set, std::size_t size, std::span<const PlaceFeature> features,
                                const ImageConsistencyOptions& options) {
  std::vector<Nearest> out(features.size());
  std::vector<std::uint16_t> distances;
  for (std::size_t i = 0; i < features.size(); ++i) {
    const int first = set.distances(features[i].descriptor, &distances);
    if (first > options.max_distance) continue;
    int second = 256, at = -1;
    for (std::size_t k = 0; k < size; ++k) {
      if (distances[k] == first && at < 0) {
        at = static_cast<int>(k);
      } else {
        second = std::min<int>(second, distances[k]);
      }
    }
    if (first < options.ratio * second) out[i] = {at, first};
  }
  return out;
}

// a^T n = d in four dimensions, (x_a, y_a, x_b, y_b): the direction in which the pairs vary least.
struct AffineEpipolar {
  Eigen::Vector4d normal = Eigen::Vector4d::Zero();
  double offset = 0;
  double error(const PixelPair& p) const {
    return std::abs(normal[0] * p.a.x() + normal[1] * p.a.y() + normal[2] * p.b.x() + normal[3] * p.b.y() - offset);
  }
};

AffineEpipolar affine_of(const std::array<const PixelPair*, kSample>& sample) {
  Eigen::Matrix4d rows;
  for (int i = 0; i < kSample; ++i) rows.row(i) << sample[i]->a.transpose(), sample[i]->b.transpose();
  const Eigen::RowVector4d mean = rows.colwise().mean();
  rows.rowwise() -= mean;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> eigen(rows.transpose() * rows);
  AffineEpipolar out;
  out.normal = eigen.eigenvectors().col(0);
  out.offset = mean * out.normal;
  return out;
}

// Sampson's distance to first order, pixels.
double epipolar_error(const Eigen::Matrix3d& F, const PixelPair& p) {
  const Eigen::Vector3d a(p.a.x(), p.a.y(), 1), b(p.b.x(), p.b.y(), 1);
  const Eigen::Vector3d in_b = F * a, in_a = F.transpose() * b;
  const double slope = in_b.head<2>().squaredNorm() + in_a.head<2>().squaredNorm();
  return slope > 0 ? std::abs(b.dot(in_b)) / std::sqrt(slope) : 1e9;
}

// Centred, with a mean distance of sqrt(2).
Eigen::Matrix3d normaliser(std::span<const std::pair<Eigen::Vector2d, Eigen::Vector2d>> pairs, bool first) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const auto& p : pairs) mean += first ? p.first : p.second;
  mean /= static_cast<double>(pairs.size());
  double spread = 0;
  for (const auto& p : pairs) spread += ((first ? p.first : p.second) - mean).norm();
  const double s = spread > 0 ? std::sqrt(2.0) * static_cast<double>(pairs.size()) / spread : 1;
  Eigen::Matrix3d T;
  T << s, 0, -s * mean.x(), 0, s, -s * mean.y(), 0, 0, 1;
  return T;
}

}  // namespace

std::vector<std::pair<int, int>> match_place_features(std::span<const PlaceFeature> a, std::span<const PlaceFeature> b,
                                                      const ImageConsistencyOptions& options) {
  if (a.empty() || b.empty()) return {};
  const auto set_of = [](std::span<const PlaceFeature> features) {
    std::vector<BinaryDescriptor> descriptors;
    for (const PlaceFeature& f : features) descriptors.push_back(f.descriptor);
    return DescriptorSet(descriptors);
  };
  const std::vector<Nearest> forward = nearest_in(set_of(b), b.size(), a, options);
  const std::vector<Nearest> backward = nearest_in(set_of(a), a.size(), b, options);
  std::vector<std::pair<int, int>> out;
  for (std::size_t i = 0; i < forward.size(); ++i) {
    const int j = forward[i].index;
    if (j >= 0 && backward[static_cast<std::size_t>(j)].index == static_cast<int>(i))
      out.emplace_back(static_cast<int>(i), j);
  }
  return out;
}

bool solve_fundamental(std::span<const std::pair<Eigen::Vector2d, Eigen::Vector2d>> pairs, Eigen::Matrix3d* b_F_a) {
  if (pairs.size() < kFullModel) return false;
  const Eigen::Matrix3d Ta = normaliser(pairs, true), Tb = normaliser(pairs, false);
  Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
  for (const auto& p : pairs) {
    const Eigen::Vector3d a = Ta * Eigen::Vector3d(p.first.x(), p.first.y(), 1);
    const Eigen::Vector3d b = Tb * Eigen::Vector3d(p.second.x(), p.second.y(), 1);
    Eigen::Matrix<double, 9, 1> row;
    for (int i = 0; i < 3; ++i) row.segment<3>(3 * i) = b[i] * a;
    normal += row * row.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> eigen(normal);
  // Two solutions of nothing: the pairs do not determine it.
  if (!(eigen.eigenvalues()[1] > 1e-12 * eigen.eigenvalues()[8])) return false;
  Eigen::Matrix3d F;
  for (int i = 0; i < 3; ++i) F.row(i) = eigen.eigenvectors().col(0).segment<3>(3 * i).transpose();
  Eigen::JacobiSVD<Eigen::Matrix3d> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d values = svd.singularValues();
  values[2] = 0;
  *b_F_a = Tb.transpose() * (svd.matrixU() * values.asDiagonal() * svd.matrixV().transpose()) * Ta;
  return b_F_a->allFinite();
}

ImageConsistency check_image_consistency(std::span<const PlaceFeature> a, std::span<const PlaceFeature> b,
                                         const ImageConsistencyOptions& options, std::mt19937_64* rng) {
  ImageConsistency out;
  std::vector<PixelPair> pairs;
  for (const auto& [i, j] : match_place_features(a, b, options)) {
    const PlaceFeature &fa = a[static_cast<std::size_t>(i)], &fb = b[static_cast<std::size_t>(j)];
    pairs.push_back({fa.pixel.cast<double>(), fb.pixel.cast<double>(),
                     static_cast<double>(level_scale(std::max(fa.level, fb.level)))});
  }
  out.matches = static_cast<int>(pairs.size());
  if (pairs.size() < kFullModel) return out;

  AffineEpipolar best;
  int most = 0;
  for (int round = 0; round < options.rounds; ++round) {
    std::array<const PixelPair*, kSample> sample{};
    for (int k = 0; k < kSample; ++k) {
      const PixelPair* one = nullptr;
      do one = &pairs[(*rng)() % pairs.size()];
      while (std::find(sample.begin(), sample.begin() + k, one) != sample.begin() + k);
      sample[static_cast<std::size_t>(k)] = one;
    }
    const AffineEpipolar candidate = affine_of(sample);
    int agree = 0;
    for (const PixelPair& p : pairs)
      agree += candidate.error(p) < options.first_tolerance * options.tolerance_px * p.sigma ? 1 : 0;
    if (agree > most) {
      most = agree;
      best = candidate;
    }
  }
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> support;
  for (const PixelPair& p : pairs)
    if (best.error(p) < options.first_tolerance * options.tolerance_px * p.sigma) support.emplace_back(p.a, p.b);
  for (int i = 0; i < 2; ++i) {
    Eigen::Matrix3d F;
    if (!solve_fundamental(support, &F)) break;
    support.clear();
    for (const PixelPair& p : pairs)
      if (epipolar_error(F, p) < options.tolerance_px * p.sigma) support.emplace_back(p.a, p.b);
    out.inliers = static_cast<int>(support.size());
  }
  return out;
}

}  // namespace parallax
