#include "solver/bal_problem.h"

#include <charconv>
#include <cmath>
#include <cstdio>
#include <string_view>

#include "core/error.h"
#include "core/se3.h"
#include "solver/schur_solver.h"

namespace parallax {
namespace {

// Words of a text, with the line each is on.
class Words {
 public:
  Words(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  double number(const char* expected) {
    const std::string_view word = next(expected);
    double value = 0;
    const char* first = word.data() + (word.front() == '+' ? 1 : 0);
    const auto result = std::from_chars(first, word.data() + word.size(), value);
    if (result.ec != std::errc() || result.ptr != word.data() + word.size() || !std::isfinite(value))
      refuse(word, expected);
    return value;
  }

  int index(int count, const char* expected) {
    const std::string_view word = next(expected);
    int value = 0;
    const auto result = std::from_chars(word.data(), word.data() + word.size(), value);
    if (result.ec != std::errc() || result.ptr != word.data() + word.size() || value < 0 || value >= count)
      refuse(word, expected);
    return value;
  }

  void expect_end() {
    skip_space();
    if (at_ < text_.size()) refuse(next(""), "the end of the file");
  }

  // How many more words there can be at the most: bounds what the counts may ask for.
  std::size_t most_words_left() const { return (text_.size() - at_ + 1) / 2; }

  [[noreturn]] void refuse(std::string_view found, const std::string& expected) const {
    constexpr std::size_t kLongest = 40;
    throw InputError(
        name_ + ": line " + std::to_string(line_) + ": found " +
        (found.empty() ? std::string("the end of the file") : "'" + std::string(found.substr(0, kLongest)) + "'") +
        ", expected " + expected);
  }

 private:
  static bool space(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }
  void skip_space() {
    for (; at_ < text_.size() && space(text_[at_]); ++at_) line_ += text_[at_] == '\n';
  }
  std::string_view next(const char* expected) {
    skip_space();
    const std::size_t first = at_;
    while (at_ < text_.size() && !space(text_[at_])) ++at_;
    if (first == at_) refuse({}, expected);
    return text_.substr(first, at_ - first);
  }

  std::string_view text_;
  const std::string& name_;
  std::size_t at_ = 0;
  int line_ = 1;
};

}  // namespace

BalProblem parse_bal(const std::string& text, const std::string& name) {
  constexpr int kMost = 100'000'000;
  Words words(text, name);
  const int cameras = words.index(kMost, "the number of cameras"), points = words.index(kMost, "the number of points"),
            observations = words.index(kMost, "the number of observations");
  const double needed = 9.0 * cameras + 3.0 * points + 4.0 * observations;
  if (needed > static_cast<double>(words.most_words_left()))
    words.refuse("a file too short for its counts",
                 std::to_string(static_cast<long long>(needed)) + " numbers to follow");
  BalProblem problem;
  problem.observations.resize(static_cast<std::size_t>(observations));
  for (BundleObservation& o : problem.observations) {
    o.pose = words.index(cameras, "a camera index below the number of cameras");
    o.point = words.index(points, "a point index below the number of points");
    o.pixel.x() = words.number("a pixel coordinate");
    o.pixel.y() = words.number("a pixel coordinate");
  }
  problem.cameras.resize(static_cast<std::size_t>(cameras));
  for (auto& camera : problem.cameras)
    for (double& value : camera) value = words.number("a camera parameter");
  problem.points.resize(static_cast<std::size_t>(points));
  for (Eigen::Vector3d& p : problem.points)
    for (int k = 0; k < 3; ++k) p[k] = words.number("a point coordinate");
  words.expect_end();
  return problem;
}

std::string format_bal(const BalProblem& problem) {
  std::string out = std::to_string(problem.cameras.size()) + " " + std::to_string(problem.points.size()) + " " +
                    std::to_string(problem.observations.size()) + "\n";
  char line[128];
  for (const BundleObservation& o : problem.observations) {
    std::snprintf(line, sizeof line, "%d %d %.17g %.17g\n", o.pose, o.point, o.pixel.x(), o.pixel.y());
    out += line;
  }
  const auto add = [&](double value) {
    std::snprintf(line, sizeof line, "%.17g\n", value);
    out += line;
  };
  for (const auto& camera : problem.cameras)
    for (const double value : camera) add(value);
  for (const Eigen::Vector3d& p : problem.points)
    for (int k = 0; k < 3; ++k) add(p[k]);
  return out;
}

BundleSummary adjust_bal(BalProblem* problem, const BundleOptions& options, const Interruption& stop,
                         std::vector<std::uint8_t>* outlier) {
  using solver::kCameraStride;
  using RowMatrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  solver::SchurProblem schur;
  schur.lens.lens = solver::Lens::bal;
  schur.cameras.assign(problem->cameras.size() * kCameraStride, 0.0);
  for (std::size_t i = 0; i < problem->cameras.size(); ++i) {
    const auto& from = problem->cameras[i];
    double* to = schur.cameras.data() + i * kCameraStride;
    Eigen::Map<RowMatrix>{to} = exp_so3(Eigen::Map<const Eigen::Vector3d>(from.data()));
    for (std::size_t k = 3; k < 9; ++k) to[6 + k] = from[k];
  }
  const std::vector<std::uint8_t> fixed(problem->cameras.size(), 0);
  schur.camera_fixed = fixed;
  schur.points = problem->points;
  schur.observations = problem->observations;
  const BundleSummary summary = solver::solve_schur(schur, options, stop, outlier);
  if (summary.failed) return summary;
  for (std::size_t i = 0; i < problem->cameras.size(); ++i) {
    const double* from = schur.cameras.data() + i * kCameraStride;
    auto& to = problem->cameras[i];
    Eigen::Map<Eigen::Vector3d>{to.data()} = log_so3(Eigen::Matrix3d(Eigen::Map<const RowMatrix>(from)));
    for (std::size_t k = 3; k < 9; ++k) to[k] = from[6 + k];
  }
  return summary;
}

}  // namespace parallax
