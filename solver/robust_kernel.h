// Robust kernels and the median-based scale they use (PTAM §5.4; Huber, Robust Statistics, 1981).
#pragma once

#include <cmath>
#include <cstddef>
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

// Robust standard deviation of a 2D residual's length from the squared lengths: median-based, consistent for Gaussian
// noise (the median of a chi-squared variable with two degrees of freedom is 2 ln 2), with the small-sample factor 1 +
// 5 / (n - dof) so that few points do not give a scale that is too small. Reorders `squared`. 0 for an empty span. An
// even number of values counts with the mean of the middle two. Values must not be NaN.
double robust_sigma_2d(std::span<double> squared, int dof = 6);
double robust_sigma_2d(std::span<float> squared, int dof = 6);

// Its parts. The factor for few points (n - dof counts as one when it is less); the median of n values of which only
// the middle ones are at hand, `below` smaller ones having been left out (reorders; 0 when n is 0); and sigma from it.
double small_sample_factor(int n, int dof);
double median_squared(std::span<float> middle, std::size_t below, std::size_t n);
double sigma_from_median(double median_squared, int n, int dof = 6);

// Huber's kernel in the same form; its width for 95 % efficiency.
inline double huber_weight(double squared_over_c2) {
  return squared_over_c2 <= 1.0 ? 1.0 : 1.0 / std::sqrt(squared_over_c2);
}
inline double huber_cost(double squared_over_c2) {  // times c^2
  return squared_over_c2 <= 1.0 ? squared_over_c2 : 2.0 * std::sqrt(squared_over_c2) - 1.0;
}
inline constexpr double kHuberWidth = 1.345;

// The kernel's width in standard deviations (1 for RobustKernel::none, where it has no meaning).
inline double kernel_width(RobustKernel kernel) {
  return kernel == RobustKernel::tukey ? kTukeyWidth : kernel == RobustKernel::huber ? kHuberWidth : 1.0;
}
inline double kernel_weight(RobustKernel kernel, double squared_over_c2) {
  return kernel == RobustKernel::tukey   ? tukey_weight(squared_over_c2)
         : kernel == RobustKernel::huber ? huber_weight(squared_over_c2)
                                         : 1.0;
}
inline double kernel_cost(RobustKernel kernel, double squared_over_c2) {  // times c^2
  return kernel == RobustKernel::tukey   ? tukey_cost(squared_over_c2)
         : kernel == RobustKernel::huber ? huber_cost(squared_over_c2)
                                         : squared_over_c2;
}

}  // namespace parallax
