#include "solver/bal_problem.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "core/error.h"

namespace parallax {
namespace {

const char* kSmall = "1 2 2\n0 0 1.5 -2\n0 1 3 4\n0.1 0.2 0.3 1 2 3 500 0.01 -0.001\n1 2 3\n4 5 6e0\n";

TEST(BalProblem, ReadsAndWritesTheSame) {
  const BalProblem p = parse_bal(kSmall, "small");
  ASSERT_EQ(p.cameras.size(), 1u);
  ASSERT_EQ(p.points.size(), 2u);
  ASSERT_EQ(p.observations.size(), 2u);
  EXPECT_EQ(p.observations[1].point, 1);
  EXPECT_EQ(p.observations[0].pixel, Eigen::Vector2d(1.5, -2));
  EXPECT_EQ(p.cameras[0][6], 500);
  EXPECT_EQ(p.points[1], Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(format_bal(parse_bal(format_bal(p), "again")), format_bal(p));
}

std::string message_of(const std::string& text) {
  try {
    parse_bal(text, "bad.txt");
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(BalProblem, NamesTheLineOfWhatIsWrong) {
  EXPECT_NE(message_of("").find("bad.txt: line 1: found the end of the file"), std::string::npos);
  EXPECT_NE(message_of("x").find("found 'x', expected the number of cameras"), std::string::npos);
  EXPECT_NE(message_of("99999999 2 2\n").find("too short"), std::string::npos);
  std::string text = kSmall;
  text.replace(text.find("0 1 3 4"), 7, "0 2 3 4");
  EXPECT_NE(message_of(text).find("line 3: found '2', expected a point index"), std::string::npos);
  text = kSmall;
  text.replace(text.find("500"), 3, "nan");
  EXPECT_NE(message_of(text).find("line 4: found 'nan'"), std::string::npos);
  EXPECT_NE(message_of(std::string(kSmall) + "7\n").find("expected the end of the file"), std::string::npos);
  // Every truncation is refused in one line.
  for (std::size_t n = 0; n + 4 < std::string(kSmall).size(); ++n) {
    const std::string message = message_of(std::string(kSmall).substr(0, n));
    EXPECT_FALSE(message.empty()) << n;
    EXPECT_EQ(message.find('\n'), std::string::npos);
  }
}

TEST(BalProblem, LadybugReachesThePublishedMinimum) {
  const std::string path = std::string(PARALLAX_DATA_DIR) + "/bundle/ladybug-49-1800.txt";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not there";
  std::stringstream text;
  text << std::ifstream(path).rdbuf();
  const BalProblem start = parse_bal(text.str(), path);
  EXPECT_EQ(start.cameras.size(), 49u);
  EXPECT_EQ(start.observations.size(), 10863u);
  for (const int threads : {1, 2}) {
    BalProblem p = start;
    BundleOptions options;
    options.kernel = RobustKernel::none;
    options.estimate_sigma = false;
    options.max_iterations = 100;
    options.relative_cost_tolerance = 1e-12;
    options.threads = threads;
    const BundleSummary s = adjust_bal(&p, options);
    EXPECT_TRUE(s.converged);
    EXPECT_NEAR(s.initial_cost, 2.345198e5, 0.1);
    EXPECT_NEAR(s.final_cost, 3.00135908e3, 1e-6 * 3.00135908e3);
    EXPECT_LE(s.iterations, 40);
    // What is written back is that state.
    options.max_iterations = 0;
    EXPECT_NEAR(adjust_bal(&p, options).initial_cost, s.final_cost, 1e-6);
  }
}

}  // namespace
}  // namespace parallax
