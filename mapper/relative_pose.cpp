#include "mapper/relative_pose.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "mapper/five_point.h"
#include "solver/robust_kernel.h"

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_THREAD__)
#define PARALLAX_SIMD_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define PARALLAX_SIMD_CLONES
#endif

namespace parallax {

namespace {

constexpr int kBlock = 64;  // matches scored between two looks at the limit
enum Lane { kX1, kY1, kX2, kY2, kA1, kB1, kC1, kD1, kA2, kB2, kC2, kD2, kJa, kJb, kJc, kJd, kLanes };

PARALLAX_SIMD_CLONES
void sampson_block(const float* block, const float* E, float* errors) {
  for (int i = 0; i < kBlock; ++i) {
    const float x1 = block[kX1 * kBlock + i], y1 = block[kY1 * kBlock + i];
    const float x2 = block[kX2 * kBlock + i], y2 = block[kY2 * kBlock + i];
    const float l0 = E[0] * x1 + E[1] * y1 + E[2];
    const float l1 = E[3] * x1 + E[4] * y1 + E[5];
    const float l2 = E[6] * x1 + E[7] * y1 + E[8];
    const float m0 = E[0] * x2 + E[3] * y2 + E[6];
    const float m1 = E[1] * x2 + E[4] * y2 + E[7];
    const float e = x2 * l0 + y2 * l1 + l2;
    const float g0 = block[kA1 * kBlock + i] * m0 + block[kC1 * kBlock + i] * m1;
    const float g1 = block[kB1 * kBlock + i] * m0 + block[kD1 * kBlock + i] * m1;
    const float h0 = block[kA2 * kBlock + i] * l0 + block[kC2 * kBlock + i] * l1;
    const float h1 = block[kB2 * kBlock + i] * l0 + block[kD2 * kBlock + i] * l1;
    errors[i] = e * e / (g0 * g0 + g1 * g1 + h0 * h0 + h1 * h1 + 1e-24f);
  }
}

PARALLAX_SIMD_CLONES
void transfer_block(const float* block, const float* H, float* errors) {
  for (int i = 0; i < kBlock; ++i) {
    const float x1 = block[kX1 * kBlock + i], y1 = block[kY1 * kBlock + i];
    const float u = H[0] * x1 + H[1] * y1 + H[2];
    const float v = H[3] * x1 + H[4] * y1 + H[5];
    const float w = H[6] * x1 + H[7] * y1 + H[8];
    const float inverse = 1.0f / (w > 1e-6f ? w : 1e-6f);
    const float dx = u * inverse - block[kX2 * kBlock + i], dy = v * inverse - block[kY2 * kBlock + i];
    const float px = block[kJa * kBlock + i] * dx + block[kJb * kBlock + i] * dy;
    const float py = block[kJc * kBlock + i] * dx + block[kJd * kBlock + i] * dy;
    errors[i] = 0.5f * (px * px + py * py);
  }
}

PARALLAX_SIMD_CLONES
float truncated_sum(const float* errors, float truncation) {
  float lanes[8] = {};
  for (int i = 0; i < kBlock; i += 8)
    for (int k = 0; k < 8; ++k) lanes[k] += errors[i + k] < truncation ? errors[i + k] : truncation;
  return ((lanes[0] + lanes[4]) + (lanes[1] + lanes[5])) + ((lanes[2] + lanes[6]) + (lanes[3] + lanes[7]));
}

using BlockErrors = void (*)(const float*, const float*, float*);

void to_floats(const Eigen::Matrix3d& m, float out[9]) {
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) out[3 * r + c] = static_cast<float>(m(r, c));
}

double truncated_cost(BlockErrors block_errors, const std::vector<float>& lanes, std::size_t n,
                      const Eigen::Matrix3d& model, double truncation, double limit) {
  float m[9], errors[kBlock];
  to_floats(model, m);
  double cost = 0;
  for (std::size_t done = 0; done < n && cost <= limit; done += kBlock) {
    block_errors(lanes.data() + done * kLanes, m, errors);
    if (n - done < kBlock) std::fill(errors + (n - done), errors + kBlock, 0.0f);  // empty slots of the last block
    cost += static_cast<double>(truncated_sum(errors, static_cast<float>(truncation)));
  }
  return cost;
}

void all_errors(BlockErrors block_errors, const std::vector<float>& lanes, const Eigen::Matrix3d& model, std::size_t n,
                std::vector<float>* out) {
  float m[9];
  to_floats(model, m);
  const std::size_t blocks = lanes.size() / (std::size_t{kLanes} * kBlock);
  out->resize(blocks * kBlock);
  for (std::size_t b = 0; b < blocks; ++b)
    block_errors(lanes.data() + b * kLanes * kBlock, m, out->data() + b * kBlock);
  out->resize(n);
}

}  // namespace

void RayMatches::reserve(std::size_t n) {
  matches_.reserve(n);
  lanes_.reserve((n / kBlock + 1) * kLanes * kBlock);
}

void RayMatches::clear() {
  matches_.clear();
  lanes_.clear();
}

void RayMatches::add(const Eigen::Vector3d& ray1, const Eigen::Vector3d& ray2, const Eigen::Matrix2d& px_from_ray1,
                     const Eigen::Matrix2d& px_from_ray2) {
  RayMatch m;
  m.ray1 = ray1;
  m.ray2 = ray2;
  m.ray_from_px1 = px_from_ray1.inverse();
  m.ray_from_px2 = px_from_ray2.inverse();
  m.px_from_ray2 = px_from_ray2;
  add(m);
}

void RayMatches::add(const RayMatch& m) {
  const std::size_t slot = matches_.size() % kBlock;
  if (slot == 0) lanes_.resize(lanes_.size() + std::size_t{kLanes} * kBlock, 0.0f);
  matches_.push_back(m);
  float* block = lanes_.data() + lanes_.size() - std::size_t{kLanes} * kBlock;
  const double values[kLanes] = {
      m.ray1.x(),           m.ray1.y(),           m.ray2.x(),           m.ray2.y(),
      m.ray_from_px1(0, 0), m.ray_from_px1(0, 1), m.ray_from_px1(1, 0), m.ray_from_px1(1, 1),
      m.ray_from_px2(0, 0), m.ray_from_px2(0, 1), m.ray_from_px2(1, 0), m.ray_from_px2(1, 1),
      m.px_from_ray2(0, 0), m.px_from_ray2(0, 1), m.px_from_ray2(1, 0), m.px_from_ray2(1, 1)};
  for (int k = 0; k < kLanes; ++k) block[k * kBlock + static_cast<int>(slot)] = static_cast<float>(values[k]);
}

double RayMatches::essential_cost(const Eigen::Matrix3d& E, double truncation_px2, double limit) const {
  return truncated_cost(sampson_block, lanes_, size(), E / E.norm(), truncation_px2, limit);
}

double RayMatches::homography_cost(const Eigen::Matrix3d& H, double truncation_px2, double limit) const {
  return truncated_cost(transfer_block, lanes_, size(), H / H.norm(), truncation_px2, limit);
}

void RayMatches::essential_errors(const Eigen::Matrix3d& E, std::vector<float>* errors_px2) const {
  all_errors(sampson_block, lanes_, E / E.norm(), size(), errors_px2);
}

void RayMatches::homography_errors(const Eigen::Matrix3d& H, std::vector<float>* errors_px2) const {
  all_errors(transfer_block, lanes_, H / H.norm(), size(), errors_px2);
}

void refine_relative_pose(const RayMatches& matches, std::size_t n, double width_px, int iterations,
                          RigidTransform* second_from_first) {
  const double inverse_width2 = 1.0 / (width_px * width_px);
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const Eigen::Vector3d t = second_from_first->t.normalized();
    const Eigen::Vector3d tangent1 = t.unitOrthogonal(), tangent2 = t.cross(tangent1);
    const Eigen::Matrix3d& R = second_from_first->R;
    const Eigen::Matrix3d E = hat(t) * R;
    // dE: three left rotations, two turns of the translation.
    Eigen::Matrix<double, 9, 5> dE;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Matrix3d d = hat(t) * hat(Eigen::Vector3d::Unit(k)) * R;
      dE.col(k) = Eigen::Map<const Eigen::Matrix<double, 9, 1>>(d.data());
    }
    const Eigen::Matrix3d d1 = hat(tangent1) * R, d2 = hat(tangent2) * R;
    dE.col(3) = Eigen::Map<const Eigen::Matrix<double, 9, 1>>(d1.data());
    dE.col(4) = Eigen::Map<const Eigen::Matrix<double, 9, 1>>(d2.data());

    Eigen::Matrix<double, 5, 5> normal = Eigen::Matrix<double, 5, 5>::Zero();
    Eigen::Matrix<double, 5, 1> gradient = Eigen::Matrix<double, 5, 1>::Zero();
    for (std::size_t i = 0; i < n; ++i) {
      const RayMatch& m = matches[i];
      const Eigen::Vector3d l = E * m.ray1;
      const Eigen::Vector2d mm = E.leftCols<2>().transpose() * m.ray2;
      const double e = m.ray2.dot(l);
      const Eigen::Vector2d g = m.ray_from_px1.transpose() * mm, h = m.ray_from_px2.transpose() * l.head<2>();
      const double d = g.squaredNorm() + h.squaredNorm();
      const double r2 = e * e / d;
      const double weight = tukey_weight(r2 * inverse_width2);
      if (!(weight > 0)) continue;
      const double s = 1.0 / std::sqrt(d);
      const double residual = e * s, k = e / d;
      // d residual / dE = (ray2 ray1^T - k (ray2 (K1 g, 0)^T + (K2 h, 0) ray1^T)) s
      Eigen::Vector3d a = m.ray1, b = m.ray2;
      a.head<2>() -= k * (m.ray_from_px1 * g);
      const Eigen::Vector2d c = -k * (m.ray_from_px2 * h);
      Eigen::Matrix3d J = b * a.transpose();
      J.topRows<2>() += c * m.ray1.transpose();
      const Eigen::Matrix<double, 5, 1> j =
          dE.transpose() * Eigen::Map<const Eigen::Matrix<double, 9, 1>>(J.data()) * s;
      normal += (weight * j) * j.transpose();
      gradient += (weight * residual) * j;
    }
    const double damping = 1e-9 * normal.trace() + 1e-12;
    normal.diagonal().array() += damping;
    Eigen::Matrix<double, 5, 1> step = -normal.ldlt().solve(gradient);
    const double length = step.norm();
    if (!std::isfinite(length)) return;
    if (length > 0.3) step *= 0.3 / length;
    second_from_first->R = exp_so3(step.head<3>()) * R;
    second_from_first->t = (t + step(3) * tangent1 + step(4) * tangent2).normalized();
    if (length < 1e-7) break;
  }
  second_from_first->orthonormalise();
}

void refine_homography(const RayMatches& matches, std::size_t n, double width_px, int iterations, Eigen::Matrix3d* H) {
  const double inverse_width2 = 1.0 / (width_px * width_px);
  for (int iteration = 0; iteration < iterations; ++iteration) {
    *H /= H->norm();
    Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
    Eigen::Matrix<double, 9, 1> gradient = Eigen::Matrix<double, 9, 1>::Zero();
    for (std::size_t i = 0; i < n; ++i) {
      const RayMatch& m = matches[i];
      const Eigen::Vector3d p = *H * m.ray1;
      if (!(p.z() > 1e-6)) continue;
      const double w = 1.0 / p.z();
      const Eigen::Vector2d u = p.head<2>() * w;
      const Eigen::Vector2d residual = m.px_from_ray2 * (u - m.ray2.head<2>()) * M_SQRT1_2;
      const double weight = tukey_weight(residual.squaredNorm() * inverse_width2);
      if (!(weight > 0)) continue;
      Eigen::Matrix<double, 2, 3> d_u;  // with respect to p
      d_u << w, 0, -w * u.x(), 0, w, -w * u.y();
      const Eigen::Matrix<double, 2, 3> d = m.px_from_ray2 * d_u * M_SQRT1_2;
      Eigen::Matrix<double, 2, 9> j;  // H row by row
      for (int r = 0; r < 3; ++r) j.middleCols<3>(3 * r) = d.col(r) * m.ray1.transpose();
      normal += weight * j.transpose() * j;
      gradient += weight * j.transpose() * residual;
    }
    // The scale of H is free: hold it.
    const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> h = *H;
    const Eigen::Map<const Eigen::Matrix<double, 9, 1>> scale(h.data());
    normal += normal.trace() * scale * scale.transpose();
    normal.diagonal().array() += 1e-12 * normal.trace() + 1e-12;
    const Eigen::Matrix<double, 9, 1> step = -normal.ldlt().solve(gradient);
    const double length = step.norm();
    if (!std::isfinite(length)) return;
    *H += Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(step.data()) *
          (length > 0.3 ? 0.3 / length : 1.0);
    if (length < 1e-7) break;
  }
  *H /= H->norm();
}

void refine_rotation(const RayMatches& matches, std::size_t n, double width_px, int iterations, Eigen::Matrix3d* R) {
  const double inverse_width2 = 1.0 / (width_px * width_px);
  for (int iteration = 0; iteration < iterations; ++iteration) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < n; ++i) {
      const RayMatch& m = matches[i];
      const Eigen::Vector3d p = *R * m.ray1;
      if (!(p.z() > 1e-6)) continue;
      const double w = 1.0 / p.z();
      const Eigen::Vector2d u = p.head<2>() * w;
      const Eigen::Vector2d residual = m.px_from_ray2 * (u - m.ray2.head<2>()) * M_SQRT1_2;
      const double weight = tukey_weight(residual.squaredNorm() * inverse_width2);
      if (!(weight > 0)) continue;
      Eigen::Matrix<double, 2, 3> d_u;
      d_u << w, 0, -w * u.x(), 0, w, -w * u.y();
      const Eigen::Matrix<double, 2, 3> j = m.px_from_ray2 * d_u * -hat(p) * M_SQRT1_2;
      normal += weight * j.transpose() * j;
      gradient += weight * j.transpose() * residual;
    }
    normal.diagonal().array() += 1e-9 * normal.trace() + 1e-12;
    Eigen::Vector3d step = -normal.ldlt().solve(gradient);
    const double length = step.norm();
    if (!std::isfinite(length)) return;
    if (length > 0.3) step *= 0.3 / length;
    *R = exp_so3(step) * *R;
    if (length < 1e-7) break;
  }
  *R = Eigen::Quaterniond(*R).normalized().toRotationMatrix();
}

}  // namespace parallax
