#include "solver/robust_kernel.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

namespace parallax {
namespace {

// The median of `values`, of which all that are left out rank below (`below` of them) or above.
template <class T>
double median_of(std::span<T> values, std::size_t below, std::size_t n) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(n / 2 - below);
  std::nth_element(values.begin(), middle, values.end());
  const double median = static_cast<double>(*middle);
  // An even number of values: the mean of the two in the middle, which matters when there are four of them.
  if (n % 2 == 1) return median;
  return 0.5 * (median + static_cast<double>(*std::max_element(values.begin(), middle)));
}

// Moves the values around the median to the front, by a histogram over their leading bits (values are not negative, so
// their bits sort as they do), and returns how many; `below` gets the number of smaller ones. Two linear passes: a
// fraction of what nth_element takes for many values.
std::size_t gather_middle(std::span<float> values, std::size_t* below) {
  constexpr int kBins = 2048, kShift = 20;  // exponent and three bits of mantissa
  const std::size_t n = values.size(), upper_rank = n / 2, lower_rank = n % 2 == 0 ? n / 2 - 1 : n / 2;
  const auto bin_of = [](float x) { return (std::bit_cast<std::uint32_t>(x) & 0x7fffffffu) >> kShift; };
  std::array<std::uint32_t, kBins> count{};
  for (const float x : values) ++count[bin_of(x)];
  std::size_t sum = 0;
  std::uint32_t first = 0, last = 0;
  *below = 0;
  bool found = false;
  for (std::uint32_t bin = 0; bin < kBins; ++bin) {
    if (!found && sum + count[bin] > lower_rank) {
      first = bin;
      *below = sum;
      found = true;
    }
    sum += count[bin];
    last = bin;
    if (sum > upper_rank) break;
  }
  std::size_t kept = 0;
  for (float& x : values) {
    const std::uint32_t bin = bin_of(x);
    if (bin >= first && bin <= last) std::swap(values[kept++], x);
  }
  return kept;
}

}  // namespace

double small_sample_factor(int n, int dof) { return 1.0 + 5.0 / std::max(1, n - dof); }

double median_squared(std::span<float> middle, std::size_t below, std::size_t n) {
  return n == 0 ? 0.0 : median_of(middle, below, n);
}

double sigma_from_median(double median_squared, int n, int dof) {
  return std::sqrt(median_squared / (2.0 * std::numbers::ln2)) * small_sample_factor(n, dof);
}

double robust_sigma_2d(std::span<double> squared, int dof) {
  if (squared.empty()) return 0.0;
  return sigma_from_median(median_of(squared, 0, squared.size()), static_cast<int>(squared.size()), dof);
}

double robust_sigma_2d(std::span<float> squared, int dof) {
  if (squared.empty()) return 0.0;
  constexpr std::size_t kMany = 4096;
  const std::size_t n = squared.size();
  std::size_t below = 0;
  const std::size_t kept = n < kMany ? n : gather_middle(squared, &below);
  return sigma_from_median(median_of(squared.first(kept), below, n), static_cast<int>(n), dof);
}

}  // namespace parallax
