// `parallax eval`: the published figures to the sixth decimal, its files, and what it says about bad input.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <ostream>

#include "core/trajectory.h"
#include "tests/support/process.h"

namespace parallax::testing {
namespace {

namespace fs = std::filesystem;

const std::string kFolder = PARALLAX_DATA_DIR "/evaluation/";

ProcessResult eval(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "eval");
  return run_process(PARALLAX_BINARY, arguments);
}

struct Published {
  const char* estimate;
  const char* truth;
  std::vector<std::string> options;
  const char* figure;
  double rmse, max, median;
};

// How the case is called in lists of tests.
std::ostream& operator<<(std::ostream& out, const Published& p) {
  out << p.estimate << ' ' << p.figure;
  for (const auto& option : p.options) out << ' ' << option;
  return out;
}

class PublishedFigures : public ::testing::TestWithParam<Published> {};

TEST_P(PublishedFigures, AgreeToTheSixthDecimal) {
  const Published& p = GetParam();
  if (!fs::exists(kFolder)) GTEST_SKIP() << "no recordings in " << kFolder;
  const ScratchFolder scratch;
  std::vector<std::string> arguments{kFolder + p.estimate, kFolder + p.truth, "--json", scratch.file("figures.json")};
  arguments.insert(arguments.end(), p.options.begin(), p.options.end());
  const auto result = eval(arguments);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto json = nlohmann::json::parse(read_all(scratch.file("figures.json")));
  const auto& figures = json.at("all_frames").at(p.figure);
  // The published figures are rounded to six decimals.
  EXPECT_NEAR(figures.at("rmse").get<double>(), p.rmse, 0.51e-6);
  EXPECT_NEAR(figures.at("max").get<double>(), p.max, 0.51e-6);
  EXPECT_NEAR(figures.at("median").get<double>(), p.median, 0.51e-6);
}

constexpr const char* kDeskTruth = "fr2_desk_groundtruth.txt";
constexpr const char* kKittiTruth = "KITTI_00_gt.txt";
constexpr const char* kKittiEstimate = "KITTI_00_ORB.txt";

INSTANTIATE_TEST_SUITE_P(
    Evo, PublishedFigures,
    ::testing::Values(
        Published{"fr2_desk_ORB.txt", kDeskTruth, {"--align", "se3"}, "ate_position_m", 0.008119, 0.024300, 0.007415},
        Published{"fr2_desk_ORB_kf_mono.txt",
                  kDeskTruth,
                  {"--align", "sim3"},
                  "ate_position_m",
                  0.007729,
                  0.015689,
                  0.007100},
        Published{"fr2_desk_ORB_kf_mono.txt",
                  kDeskTruth,
                  {"--align", "sim3"},
                  "ate_rotation_deg",
                  0.899056,
                  1.372716,
                  0.856043},
        Published{kKittiEstimate, kKittiTruth, {"--align", "none"}, "ate_position_m", 7.790289, 13.458509, 6.801632},
        Published{kKittiEstimate, kKittiTruth, {"--align", "se3"}, "ate_position_m", 1.303450, 3.587949, 1.065625},
        Published{kKittiEstimate,
                  kKittiTruth,
                  {"--align", "none", "--delta", "10", "--delta-unit", "m"},
                  "rpe_position_m",
                  0.226261,
                  1.272209,
                  0.138484}));

// A helix at 10 poses a second, and the same seen from another world and scale.
struct HelixFiles {
  ScratchFolder scratch;
  std::string truth, estimate;

  HelixFiles() {
    Trajectory true_poses, estimated;
    const SimilarityTransform estimate_from_truth(0.5, exp_so3({0.3, -0.2, 1.0}), {1, 2, 3});
    for (int i = 0; i < 50; ++i) {
      const double a = 0.1 * i;
      TrajectoryPose pose;
      pose.time = from_seconds(100 + a);
      pose.world_from_camera = {exp_so3({0.1 * a, a, 0}), {std::cos(a), std::sin(a), 0.2 * a}};
      true_poses.push_back(pose);
      if (i < 10) continue;  // tracking begins late
      pose.world_from_camera = {estimate_from_truth.R * pose.world_from_camera.R,
                                estimate_from_truth * pose.world_from_camera.t};
      estimated.push_back(pose);
    }
    write_trajectory_tum(true_poses, truth = scratch.file("truth.txt"));
    write_trajectory_tum(estimated, estimate = scratch.file("estimate.txt"));
  }
};

TEST(Eval, TableAndFilesOfAnExactEstimate) {
  const HelixFiles files;
  const auto file = [&](const char* name) { return files.scratch.file(name); };
  const auto result = eval({files.estimate, files.truth, "--keyframes", files.estimate, "--json", file("f.json"),
                            "--plot", file("p.svg"), "--output", file("aligned.txt")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(result.err.empty()) << result.err;
  EXPECT_NE(result.out.find("tracked 0.8000 of 50 frames"), std::string::npos) << result.out;
  EXPECT_NE(result.out.find("keyframes: 40 of 40"), std::string::npos) << result.out;

  const auto json = nlohmann::json::parse(read_all(file("f.json")));
  for (const char* part : {"all_frames", "keyframes"}) {
    EXPECT_LT(json.at(part).at("ate_position_m").at("max").get<double>(), 1e-7);
    EXPECT_LT(json.at(part).at("ate_rotation_deg").at("max").get<double>(), 1e-5);
    EXPECT_NEAR(json.at(part).at("scale").get<double>(), 2.0, 1e-7);
    EXPECT_NEAR(json.at(part).at("scale_error").get<double>(), -0.5, 1e-7);
  }
  EXPECT_DOUBLE_EQ(json.at("all_frames").at("tracked_fraction").get<double>(), 0.8);

  const std::string svg = read_all(file("p.svg"));
  EXPECT_EQ(svg.rfind("<svg ", 0), 0u);
  EXPECT_NE(svg.find("</svg>"), std::string::npos);
  for (const char* label : {"x (m)", "y (m)", "position error (m)", "rotation error (degrees)"}) {
    EXPECT_NE(svg.find(label), std::string::npos) << label;
  }
  // What was written aligned needs no alignment any more.
  const auto again = eval({file("aligned.txt"), files.truth, "--align", "none", "--json", file("g.json")});
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_LT(nlohmann::json::parse(read_all(file("g.json"))).at("all_frames").at("ate_position_m").at("max"), 1e-7);
}

TEST(Eval, PngPlotHasItsSignature) {
  const HelixFiles files;
  const std::string png = files.scratch.file("p.png");
  ASSERT_EQ(eval({files.estimate, files.truth, "--plot", png}).exit_code, 0);
  EXPECT_EQ(read_all(png).substr(0, 8), "\x89PNG\r\n\x1a\n");
}

TEST(Eval, FramesGivenSetTheTrackedFraction) {
  const HelixFiles files;
  EXPECT_NE(eval({files.estimate, files.truth, "--frames", "80"}).out.find("tracked 0.5000 of 80"), std::string::npos);
  expect_one_line_error(eval({files.estimate, files.truth, "--frames", "39"}), 2, "--frames");
}

TEST(Eval, BadInputIsOneLineAndTwo) {
  const HelixFiles files;
  const ScratchFolder& s = files.scratch;
  expect_one_line_error(eval({s.file("missing.txt"), files.truth}), 2, "missing.txt");
  expect_one_line_error(eval({s.write("empty.txt", ""), files.truth}), 2, "empty.txt");
  expect_one_line_error(eval({s.write("remarks.txt", "# nothing but this\n"), files.truth}), 2, "remarks.txt");
  expect_one_line_error(eval({s.write("nan.txt", "100 0 0 nan 0 0 0 1\n"), files.truth}), 2, "nan.txt");
  expect_one_line_error(eval({s.write("binary.txt", std::string("\0\1\2\xff\n", 5)), files.truth}), 2, "binary.txt");
  expect_one_line_error(eval({s.write("later.txt", "900 0 0 0 0 0 0 1\n901 1 0 0 0 0 0 1\n"), files.truth}), 2,
                        "do not overlap in time");
  const std::string line = "100 0 0 0 0 0 0 1\n100.1 1 0 0 0 0 0 1\n100.2 2 0 0 0 0 0 1\n100.3 3 0 0 0 0 0 1\n";
  expect_one_line_error(eval({s.write("line.txt", line), files.truth}), 2, "lie on one line");
  EXPECT_EQ(eval({s.file("line.txt"), files.truth, "--align", "none"}).exit_code, 0);
  const std::string kitti = s.write("kitti.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 1 0 1 0 0 0 0 1 0\n");
  expect_one_line_error(eval({kitti, files.truth}), 2, "carries no times");
  const std::string longer = s.write("kitti3.txt", read_all(kitti) + "1 0 0 2 0 1 0 0 0 0 1 0\n");
  expect_one_line_error(eval({kitti, longer}), 2, "not equally long");
  expect_one_line_error(eval({files.estimate, files.truth, "--align", "so3"}), 2, "--align");
  expect_one_line_error(eval({files.estimate, files.truth, "--delta", "-1"}), 2, "step");
  expect_one_line_error(eval({files.estimate, files.truth, "--delta", "1.5"}), 2, "whole number");
  expect_one_line_error(eval({files.estimate, files.truth, "--plot", "plot.jpg"}), 2, "plot.jpg");
}

TEST(Eval, OutputsThatCannotBeWrittenAreOneLineAndOne) {
  const HelixFiles files;
  for (const char* option : {"--json", "--output"}) {
    expect_one_line_error(eval({files.estimate, files.truth, option, "/dev/full"}), 1, "/dev/full");
    expect_one_line_error(eval({files.estimate, files.truth, option, files.scratch.file("no/such/folder")}), 1,
                          "cannot be written");
  }
  for (const char* name : {"no/such.svg", "no/such.png"}) {
    expect_one_line_error(eval({files.estimate, files.truth, "--plot", files.scratch.file(name)}), 1,
                          "cannot be written");
  }
}

}  // namespace
}  // namespace parallax::testing
