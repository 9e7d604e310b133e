// Where a chi-squared variable lies with 95 % probability, two-sided: the bounds of consistency tests (normalised
// estimation error squared). By Wilson and Hilferty's cube root (1931): the upper bound is within half a percent of the
// tables from three degrees of freedom on, the lower one within 0.8 percent from ten and 16 percent from three.
#pragma once

#include <cmath>

namespace parallax {

// z: the standard normal variable's quantile of the same probability.
inline double chi_square_quantile(double z, double degrees_of_freedom) {
  const double spread = 2 / (9 * degrees_of_freedom), root = 1 - spread + z * std::sqrt(spread);
  return degrees_of_freedom * root * root * root;
}

struct ChiSquareBounds {
  double low = 0, high = 0;
};
inline ChiSquareBounds chi_square_bounds_95(double degrees_of_freedom) {
  constexpr double kZ = 1.959963984540054;
  return {chi_square_quantile(-kZ, degrees_of_freedom), chi_square_quantile(kZ, degrees_of_freedom)};
}

}  // namespace parallax
