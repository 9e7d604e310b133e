#include "mapper/five_point.h"

#include <Eigen/Geometry>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>

namespace parallax {

namespace {

// Cubic monomials in x, y, z in Nister's order: the first ten are eliminated, the last ten are (a polynomial in z)
// times x, y and 1.
enum Cubic { xxx, yyy, xxy, xyy, xxz, xx, yyz, yy, xyz, xy, xzz, xz, x1, yzz, yz, y1, zzz, zz, z1, one, n_cubic };

// Products of the four homogeneous unknowns x, y, z, 1: ten quadratic monomials, and where a quadratic times an unknown
// goes.
constexpr int kQuadratic[4][4] = {{0, 1, 2, 3}, {1, 4, 5, 6}, {2, 5, 7, 8}, {3, 6, 8, 9}};
constexpr int kCubic[10][4] = {
    {xxx, xxy, xxz, xx},  // xx
    {xxy, xyy, xyz, xy},  // xy
    {xxz, xyz, xzz, xz},  // xz
    {xx, xy, xz, x1},     // x
    {xyy, yyy, yyz, yy},  // yy
    {xyz, yyz, yzz, yz},  // yz
    {xy, yy, yz, y1},     // y
    {xzz, yzz, zzz, zz},  // zz
    {xz, yz, zz, z1},     // z
    {x1, y1, z1, one},    // 1
};

using Basis = Eigen::Matrix<double, 9, 4>;  // null vectors as columns, E row by row

using Linear = double[4];
using Quadratic = double[10];

inline void add_product(const Linear a, const Linear b, double s, Quadratic out) {
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) out[kQuadratic[i][j]] += s * a[i] * b[j];
}

inline void add_product(const Quadratic a, const Linear b, double* out) {
  for (int i = 0; i < 10; ++i)
    for (int j = 0; j < 4; ++j) out[kCubic[i][j]] += a[i] * b[j];
}

// Rows: det E = 0, and E E^T E - 1/2 trace(E E^T) E = 0.
void cubic_constraints(const Basis& basis, double rows[10][n_cubic]) {
  Linear e[3][3];
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < 4; ++k) e[r][c][k] = basis(3 * r + c, k);
  Quadratic gram[3][3] = {};  // E E^T
  for (int r = 0; r < 3; ++r)
    for (int c = r; c < 3; ++c) {
      for (int k = 0; k < 3; ++k) add_product(e[r][k], e[c][k], 1.0, gram[r][c]);
      if (c != r) std::copy(gram[r][c], gram[r][c] + 10, gram[c][r]);
    }
  for (int k = 0; k < 10; ++k) {
    const double half_trace = 0.5 * (gram[0][0][k] + gram[1][1][k] + gram[2][2][k]);
    for (int r = 0; r < 3; ++r) gram[r][r][k] -= half_trace;
  }
  std::fill(&rows[0][0], &rows[0][0] + 10 * n_cubic, 0.0);
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < 3; ++k) add_product(gram[r][k], e[k][c], rows[3 * r + c]);
  for (int c = 0; c < 3; ++c) {
    const int c1 = (c + 1) % 3, c2 = (c + 2) % 3;
    Quadratic minor = {};
    add_product(e[1][c1], e[2][c2], 1.0, minor);
    add_product(e[1][c2], e[2][c1], -1.0, minor);
    add_product(minor, e[0][c], rows[9]);
  }
}

// Gauss-Jordan with row pivoting over the first ten columns; rows 4 to 9 end up fully reduced, which is all we need.
bool eliminate(double rows[10][n_cubic]) {
  for (int p = 0; p < 10; ++p) {
    int best = p;
    for (int r = p + 1; r < 10; ++r)
      if (std::abs(rows[r][p]) > std::abs(rows[best][p])) best = r;
    if (!(std::abs(rows[best][p]) > 1e-14)) return false;
    if (best != p) std::swap_ranges(rows[p], rows[p] + n_cubic, rows[best]);
    const double inverse = 1.0 / rows[p][p];
    for (int c = p; c < n_cubic; ++c) rows[p][c] *= inverse;
    for (int r = p + 1; r < 10; ++r) {
      const double f = rows[r][p];
      for (int c = p; c < n_cubic; ++c) rows[r][c] -= f * rows[p][c];
    }
  }
  for (int p = 9; p > 4; --p)
    for (int r = 4; r < p; ++r) {
      const double f = rows[r][p];
      for (int c = p; c < n_cubic; ++c) rows[r][c] -= f * rows[p][c];
    }
  return true;
}

constexpr int kDegree = 10;
using Polynomial = double[kDegree + 1];  // ascending powers

inline void add_polynomial_product(const double* a, int na, const double* b, int nb, double s, double* out) {
  for (int i = 0; i <= na; ++i)
    for (int j = 0; j <= nb; ++j) out[i + j] += s * a[i] * b[j];
}

inline double evaluate(const double* c, int degree, double x) {
  double v = c[degree];
  for (int i = degree - 1; i >= 0; --i) v = v * x + c[i];
  return v;
}

// The root of a polynomial that changes sign once in [lo, hi]: Newton kept inside the shrinking bracket.
double bracketed_root(const double* c, int degree, double lo, double hi, bool positive_at_hi, double tolerance) {
  double x = 0.5 * (lo + hi);
  for (int iteration = 0; iteration < 80; ++iteration) {
    double f = c[degree], df = 0;
    for (int i = degree - 1; i >= 0; --i) {
      df = df * x + f;
      f = f * x + c[i];
    }
    if ((f > 0) == positive_at_hi) {
      hi = x;
    } else {
      lo = x;
    }
    double next = x - f / df;
    if (!(next > lo && next < hi)) next = 0.5 * (lo + hi);
    const double step = std::abs(next - x);
    x = next;
    if (step < tolerance || hi - lo < tolerance) break;
  }
  return x;
}

struct Roots {
  std::array<double, 2 * kDegree + 2> at;
  int count = 0;
  void add(double x) {
    if (count < static_cast<int>(at.size())) at[static_cast<std::size_t>(count++)] = x;
  }
};

// Real roots in [-1, 1], found between those of the derivative, and so on up from the linear one. Where the polynomial
// nearly touches zero at an extremum the extremum is given too: noise may have split a double root into a complex pair.
void roots_in_unit_interval(const Polynomial& p, Roots* roots) {
  double derivative[kDegree + 1][kDegree + 1];  // [order][power]
  std::copy(p, p + kDegree + 1, derivative[0]);
  double magnitude = 0;
  for (double c : p) magnitude += std::abs(c);
  for (int order = 1; order < kDegree; ++order)
    for (int i = 0; i <= kDegree - order; ++i) derivative[order][i] = derivative[order - 1][i + 1] * (i + 1);
  std::array<double, kDegree + 3> breaks;
  int n_inner = 0;
  std::array<double, kDegree + 1> inner{};
  for (int order = kDegree - 1; order >= 0; --order) {
    const int degree = kDegree - order;
    const double* c = derivative[order];
    const double tolerance = order == 0 ? 1e-14 : 1e-8;
    int n = 0;
    breaks[0] = -1.0;
    for (int i = 0; i < n_inner; ++i) breaks[static_cast<std::size_t>(++n)] = inner[static_cast<std::size_t>(i)];
    breaks[static_cast<std::size_t>(++n)] = 1.0;
    n_inner = 0;
    double previous = evaluate(c, degree, -1.0);
    for (int i = 1; i <= n; ++i) {
      const double lo = breaks[static_cast<std::size_t>(i - 1)], hi = breaks[static_cast<std::size_t>(i)];
      const double value = evaluate(c, degree, hi);
      if ((previous > 0) != (value > 0)) {
        const double root = bracketed_root(c, degree, lo, hi, value > 0, tolerance);
        if (order == 0) {
          roots->add(root);
        } else if (n_inner < kDegree) {
          inner[static_cast<std::size_t>(n_inner++)] = root;
        }
      }
      if (order == 0 && i < n && std::abs(value) < 1e-9 * magnitude) roots->add(hi);
      previous = value;
    }
  }
}

// One E of the solution space and its ten constraints; the constraints' derivative along a direction D.
Eigen::Matrix3d trace_constraint(const Eigen::Matrix3d& E) {
  const Eigen::Matrix3d gram = E * E.transpose();
  return 2.0 * (gram * E) - gram.trace() * E;
}

Eigen::Matrix3d cofactors(const Eigen::Matrix3d& E) {
  Eigen::Matrix3d c;
  c.row(0) = E.row(1).cross(E.row(2));
  c.row(1) = E.row(2).cross(E.row(0));
  c.row(2) = E.row(0).cross(E.row(1));
  return c;
}

inline Eigen::Matrix3d combine(const Basis& basis, const Eigen::Vector4d& c) {
  const Eigen::Matrix<double, 9, 1> e = basis * c;
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(e.data());
}

// Gauss-Newton on the ten constraints over the unit sphere of the four coefficients. Returns the squared residual.
double polish(const Basis& basis, Eigen::Vector4d* c, Eigen::Matrix3d* E) {
  double residual2 = 0;
  constexpr int kIterations = 6;
  for (int iteration = 0; iteration <= kIterations; ++iteration) {
    *E = combine(basis, *c);
    const Eigen::Matrix3d r = trace_constraint(*E), co = cofactors(*E);
    const double det = co.row(0).dot(E->row(0));
    residual2 = r.squaredNorm() + det * det;
    if (residual2 < 1e-28 || iteration == kIterations) break;
    if (iteration == 2 && residual2 > 1e-4) break;  // not near a solution
    // Tangent basis of the sphere at c: the columns of the Householder reflection that takes c to an axis.
    Eigen::Vector4d v = *c;
    v(3) += v(3) >= 0 ? 1.0 : -1.0;
    v.normalize();
    Eigen::Matrix<double, 4, 3> tangent;
    for (int k = 0; k < 3; ++k) {
      tangent.col(k) = (-2.0 * v(k)) * v;
      tangent(k, k) += 1.0;
    }
    const Eigen::Matrix3d gram = *E * E->transpose(), right = E->transpose() * *E;
    const double trace = gram.trace();
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient;
    Eigen::Matrix3d jacobian[3];
    double jacobian_det[3];
    for (int k = 0; k < 3; ++k) {
      const Eigen::Matrix3d D = combine(basis, tangent.col(k));
      jacobian[k] =
          2.0 * (D * right + *E * (D.transpose() * *E) + gram * D) - trace * D - (2.0 * D.cwiseProduct(*E).sum()) * *E;
      jacobian_det[k] = co.cwiseProduct(D).sum();
      gradient(k) = jacobian[k].cwiseProduct(r).sum() + jacobian_det[k] * det;
      for (int l = 0; l <= k; ++l)
        normal(k, l) = normal(l, k) = jacobian[k].cwiseProduct(jacobian[l]).sum() + jacobian_det[k] * jacobian_det[l];
    }
    const Eigen::Matrix3d adjugate = cofactors(normal).transpose();
    const double determinant = normal.row(0).dot(adjugate.col(0));
    if (!(determinant > 1e-30)) break;
    Eigen::Vector3d step = adjugate * gradient / -determinant;
    const double length = step.norm();
    if (length > 0.2) step *= 0.2 / length;
    *c = (*c + tangent * step).normalized();
  }
  return residual2;
}

}  // namespace

void solve_five_point(const std::array<Eigen::Vector3d, 5>& rays1, const std::array<Eigen::Vector3d, 5>& rays2,
                      FivePointSolutions* solutions) {
  solutions->count = 0;
  Eigen::Matrix<double, 9, 5> epipolar;  // transposed: one constraint a column
  for (std::size_t i = 0; i < 5; ++i) {
    const Eigen::Vector3d a = rays1[i].normalized(), b = rays2[i].normalized();
    for (int r = 0; r < 3; ++r) epipolar.col(static_cast<int>(i)).segment<3>(3 * r) = b(r) * a;
  }
  if (!epipolar.allFinite()) return;
  const Eigen::ColPivHouseholderQR<Eigen::Matrix<double, 9, 5>> qr(epipolar);
  Basis basis = Basis::Zero();
  basis.bottomRows<4>().setIdentity();
  basis.applyOnTheLeft(qr.householderQ());

  double rows[10][n_cubic];
  cubic_constraints(basis, rows);
  if (!eliminate(rows)) return;

  // Three equations linear in x and y with coefficients in z: row(..z) - z row(..), Nister's (k), (l), (m).
  double px[3][4], py[3][4], pc[3][5];
  for (int k = 0; k < 3; ++k) {
    const double *a = rows[4 + 2 * k], *b = rows[5 + 2 * k];
    const double x_coefficients[4] = {a[x1], a[xz] - b[x1], a[xzz] - b[xz], -b[xzz]};
    const double y_coefficients[4] = {a[y1], a[yz] - b[y1], a[yzz] - b[yz], -b[yzz]};
    const double c_coefficients[5] = {a[one], a[z1] - b[one], a[zz] - b[z1], a[zzz] - b[zz], -b[zzz]};
    std::copy(x_coefficients, x_coefficients + 4, px[k]);
    std::copy(y_coefficients, y_coefficients + 4, py[k]);
    std::copy(c_coefficients, c_coefficients + 5, pc[k]);
  }
  Polynomial p = {};
  for (int k = 0; k < 3; ++k) {
    const int k1 = (k + 1) % 3, k2 = (k + 2) % 3;
    double minor[7] = {};
    add_polynomial_product(px[k1], 3, py[k2], 3, 1.0, minor);
    add_polynomial_product(px[k2], 3, py[k1], 3, -1.0, minor);
    add_polynomial_product(minor, 6, pc[k], 4, 1.0, p);
  }
  double largest = 0;
  for (double c : p) largest = std::max(largest, std::abs(c));
  if (!(largest > 0) || !std::isfinite(largest)) return;
  for (double& c : p) c /= largest;

  // |z| <= 1 from the polynomial, |z| > 1 from the reversed one, where w = 1/z.
  for (int side = 0; side < 2; ++side) {
    Polynomial q;
    for (int i = 0; i <= kDegree; ++i) q[i] = side == 0 ? p[i] : p[kDegree - i];
    Roots roots;
    roots_in_unit_interval(q, &roots);
    if (side == 1)
      for (int k = 0; k < 3; ++k) {
        std::reverse(px[k], px[k] + 4);
        std::reverse(py[k], py[k] + 4);
        std::reverse(pc[k], pc[k] + 5);
      }
    for (int i = 0; i < roots.count; ++i) {
      const double root = roots.at[static_cast<std::size_t>(i)];
      Eigen::Matrix3d B;
      for (int k = 0; k < 3; ++k) {
        B(k, 0) = evaluate(px[k], 3, root);
        B(k, 1) = evaluate(py[k], 3, root);
        B(k, 2) = evaluate(pc[k], 4, root);
      }
      for (int k = 0; k < 3; ++k) {
        const double norm = B.row(k).norm();
        if (norm > 0) B.row(k) /= norm;
      }
      const Eigen::Matrix3d crosses = cofactors(B);
      int widest = 0;
      crosses.rowwise().squaredNorm().maxCoeff(&widest);
      const Eigen::Vector3d v = crosses.row(widest);
      Eigen::Vector4d c = side == 0 ? Eigen::Vector4d(v.x(), v.y(), root * v.z(), v.z())
                                    : Eigen::Vector4d(v.x(), v.y(), v.z(), root * v.z());
      const double norm = c.norm();
      if (!(norm > 0) || !std::isfinite(norm)) continue;
      c /= norm;
      Eigen::Matrix3d E;
      if (!(polish(basis, &c, &E) < 1e-16)) continue;
      bool known = false;
      for (int j = 0; j < solutions->count && !known; ++j) {
        const double dot = solutions->essential[static_cast<std::size_t>(j)].cwiseProduct(E).sum();
        known = std::abs(dot) > 1.0 - 1e-12;
      }
      if (!known && solutions->count < 10) solutions->essential[static_cast<std::size_t>(solutions->count++)] = E;
    }
  }
}

std::array<RigidTransform, 4> poses_of_essential(const Eigen::Matrix3d& essential) {
  // t is the left null vector: the longest cross product of two columns. With |E|^2 = 2 |t|^2 and E = hat(t) R the
  // rotation is cof(E) - hat(t) E for |t| = 1 (Horn, Recovering baseline and orientation from 'essential' matrix,
  // 1990).
  const Eigen::Matrix3d E = essential * (std::sqrt(2.0) / essential.norm());
  const Eigen::Matrix3d by_columns = cofactors(E.transpose());
  int widest = 0;
  by_columns.rowwise().squaredNorm().maxCoeff(&widest);
  const Eigen::Vector3d t = by_columns.row(widest).transpose().normalized();
  const Eigen::Matrix3d cofactor = cofactors(E), tE = hat(t) * E;
  RigidTransform a(cofactor - tE, t), b(cofactor + tE, t);
  a.orthonormalise();
  b.orthonormalise();
  return {a, RigidTransform(a.R, -t), b, RigidTransform(b.R, -t)};
}

Eigen::Matrix3d essential_of_pose(const RigidTransform& second_from_first) {
  return hat(second_from_first.t) * second_from_first.R;
}

}  // namespace parallax
