// Robust kernels and the median-based scale they use (PTAM §5.4; Huber, Robust Statistics, 1981).
#pragma once

#include <span>
#include <vector>

namespace parallax {

enum class RobustKernel { none, huber, tukey };

// Tukey's biweight, as a function of the squared residual in units of the kernel width squared: cost with
// rho(0) = 0, rho'(0) = 1 (so it agrees with least squares near zero), and IRLS weight rho'.
inline double tukey_weight(double squared_over_c2) {
  if (squared_over_c2 >= 1.0) return 0.0;
  const double k = 1.0 - squared_over_c2;
  return k * k;
}
inline double tukey_cost(double squared_over_c2) {  // times c^2
  if (squared_over_c2 >= 1.0) return 1.0 / 3.0;
  const double k = 1.0 - squared_over_c2;
  return (1.0 - k * k * k) / 3.0;
}

// The kernel width for which Tukey's biweight is 95 % efficient, in standard deviations.
inline constexpr double kTukeyWidth = 4.6851;

// Robust standard deviation of a 2D residual's length from the squared lengths: median-based, consistent for Gaussian noise
// (the median of a chi-squared variable with two degrees of freedom is 2 ln 2), with the small-sample factor
// 1 + 5 / (n - dof) so that few points do not give a scale that is too small. Reorders `squared`. 0 for an empty span.
double robust_sigma_2d(std::span<double> squared, int dof = 6);
double robust_sigma_2d(std::span<float> squared, int dof = 6);

}  // namespace parallax
