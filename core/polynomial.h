// Real roots of polynomials in one variable, found by bisection between the roots of the derivative: slow and certain,
// for set-up code only. Pure functions.
#pragma once

#include <vector>

namespace parallax {

// All sign changes of c[0] + c[1] x + c[2] x^2 + ... inside (low, high), in order, to the last bit or so. Roots of even
// multiplicity (where the sign does not change) may be left out.
std::vector<double> polynomial_roots(const std::vector<double>& coefficients, double low, double high);

// The first of them, or `high` when there is none.
double smallest_root(const std::vector<double>& coefficients, double low, double high);

}  // namespace parallax
