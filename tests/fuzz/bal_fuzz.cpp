// libFuzzer target: bundle adjustment problems in the BAL text form; what is read is written and read again, and
// adjusted, however ill-posed.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "core/error.h"
#include "solver/bal_problem.h"

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    parallax::BalProblem problem = parallax::parse_bal(text, "problem.txt");
    const parallax::BalProblem again = parallax::parse_bal(parallax::format_bal(problem), "written.txt");
    require(again.cameras == problem.cameras && again.points == problem.points);
    require(again.observations.size() == problem.observations.size());
    if (problem.cameras.size() > 8 || problem.points.size() > 200) return 0;
    parallax::BundleOptions options;
    options.max_iterations = 3;
    (void)parallax::adjust_bal(&problem, options);
    for (const auto& point : problem.points) require(point.allFinite());
    for (const auto& camera : problem.cameras)
      for (const double value : camera) require(std::isfinite(value));
  } catch (const parallax::InputError& error) {
    require(std::string(error.what()).find('\n') == std::string::npos);
  }
  return 0;
}
