#include "core/polynomial.h"

#include <cstddef>

namespace parallax {
namespace {

double evaluate(const std::vector<double>& c, double x) {
  double value = 0;
  for (std::size_t i = c.size(); i-- > 0;) value = value * x + c[i];
  return value;
}

}  // namespace

std::vector<double> polynomial_roots(const std::vector<double>& coefficients, double low, double high) {
  std::vector<double> c = coefficients;
  while (!c.empty() && c.back() == 0) c.pop_back();
  if (c.size() < 2) return {};
  std::vector<double> derivative(c.size() - 1);
  for (std::size_t i = 1; i < c.size(); ++i) derivative[i - 1] = c[i] * static_cast<double>(i);
  std::vector<double> ends = polynomial_roots(derivative, low, high);
  ends.push_back(high);

  // Between two ends the polynomial is monotonic.
  std::vector<double> roots;
  double a = low;
  for (const double end : ends) {
    double b = end;
    const bool rising = evaluate(c, b) > 0;
    if ((evaluate(c, a) > 0) != rising) {
      for (double middle = 0.5 * (a + b); middle > a && middle < b; middle = 0.5 * (a + b))
        ((evaluate(c, middle) > 0) == rising ? b : a) = middle;
      roots.push_back(a);
    }
    a = end;
  }
  return roots;
}

double smallest_root(const std::vector<double>& coefficients, double low, double high) {
  const std::vector<double> roots = polynomial_roots(coefficients, low, high);
  return roots.empty() ? high : roots.front();
}

}  // namespace parallax
