#include "core/polynomial.h"

#include <gtest/gtest.h>

namespace parallax {
namespace {

TEST(Polynomial, FindsEverySimpleRootInsideTheInterval) {
  // (x - 1)(x - 2)(x - 3)(x + 1) = x^4 - 5 x^3 + 5 x^2 + 5 x - 6
  const std::vector<double> c{-6, 5, 5, -5, 1, 0, 0};
  const auto roots = polynomial_roots(c, 0, 10);
  ASSERT_EQ(roots.size(), 3u);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(roots[static_cast<std::size_t>(i)], i + 1.0, 1e-13);
  EXPECT_NEAR(smallest_root(c, 1.5, 10), 2, 1e-13);
  EXPECT_EQ(smallest_root(c, 4, 10), 10);
}

TEST(Polynomial, SeparatesCloseRootsOverAWideInterval) {
  // (x - 1e-3)(x - 1.001e-3) over [0, 1e8].
  const auto roots = polynomial_roots({1.001e-6, -2.001e-3, 1}, 0, 1e8);
  ASSERT_EQ(roots.size(), 2u);
  EXPECT_NEAR(roots[0], 1e-3, 1e-10);
  EXPECT_NEAR(roots[1], 1.001e-3, 1e-10);
}

TEST(Polynomial, NoRoots) {
  EXPECT_TRUE(polynomial_roots({}, 0, 1).empty());
  EXPECT_TRUE(polynomial_roots({3}, 0, 1).empty());
  EXPECT_TRUE(polynomial_roots({1, 0, 1}, -5, 5).empty());
}

}  // namespace
}  // namespace parallax
