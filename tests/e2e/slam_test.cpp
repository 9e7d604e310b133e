// `parallax slam` as a user meets it: accuracy on the stereo recordings as limits that fail, repeatability, two threads
// at the pace of the time stamps, and input that is not as it should be.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>

#include "tests/e2e/program_run.h"

namespace parallax::testing {
namespace {

namespace fs = std::filesystem;

std::string recording(const char* name) { return std::string(PARALLAX_DATA_DIR) + "/" + name; }

struct SlamRun {
  ProcessResult process;
  nlohmann::json report;
  Trajectory trajectory, truth;
  std::string trajectory_text, final_text, graph_text;
};

SlamRun run_slam_on(const std::string& source, const std::vector<std::string>& arguments) {
  const ScratchFolder folder;
  std::vector<std::string> words{"slam",
                                 source,
                                 "--trajectory",
                                 folder.file("trajectory.txt"),
                                 "--final-trajectory",
                                 folder.file("final.txt"),
                                 "--graph",
                                 folder.file("graph.g2o"),
                                 "--report",
                                 folder.file("report.json")};
  words.insert(words.end(), arguments.begin(), arguments.end());
  if (std::find(arguments.begin(), arguments.end(), "--no-truth") == arguments.end()) {
    words.insert(words.end(), {"--truth", folder.file("truth.txt")});
  } else {
    std::erase(words, "--no-truth");
  }
  SlamRun run;
  run.process = run_process(PARALLAX_BINARY, words);
  run.trajectory_text = read_all(folder.file("trajectory.txt"));
  run.final_text = read_all(folder.file("final.txt"));
  run.graph_text = read_all(folder.file("graph.g2o"));
  run.report = nlohmann::json::parse(read_all(folder.file("report.json")), nullptr, false);
  if (!run.trajectory_text.empty()) run.trajectory = parse_trajectory(run.trajectory_text, "trajectory");
  const std::string truth = read_all(folder.file("truth.txt"));
  if (!truth.empty()) run.truth = parse_trajectory(truth, "truth");
  return run;
}

// Metres, after alignment by a rigid motion.
double ate_m(const SlamRun& run) {
  TrajectoryErrorOptions options;
  options.alignment = Alignment::se3;
  return summarise_errors(evaluate_trajectory(run.trajectory, run.truth, options).position).rmse;
}

void expect_chain_of_poses(const SlamRun& run) {
  const int poses = run.report.at("map").at("poses"), constraints = run.report.at("map").at("constraints");
  EXPECT_EQ(constraints, poses - 1);
  std::size_t edges = 0, vertices = 0;
  std::istringstream lines(run.graph_text);
  for (std::string line; std::getline(lines, line);) {
    edges += static_cast<std::size_t>(line.rfind("EDGE_SE3:QUAT ", 0) == 0);
    vertices += static_cast<std::size_t>(line.rfind("VERTEX_SE3:QUAT ", 0) == 0);
  }
  EXPECT_EQ(edges, static_cast<std::size_t>(constraints));
  EXPECT_EQ(vertices, static_cast<std::size_t>(poses));
}

TEST(Slam, BuildingIsTrackedAccuratelyAndTheSameTwice) {
  const std::string folder = recording("building_a");
  if (!fs::exists(folder)) GTEST_SKIP() << folder << " is absent";
  const SlamRun run = run_slam_on(folder, {"--pace", "lockstep"});
  ASSERT_EQ(run.process.exit_code, 0) << run.process.err;
  EXPECT_TRUE(run.process.err.empty()) << run.process.err;
  ASSERT_EQ(run.trajectory.size(), 300u);
  const double ate = ate_m(run);
  RecordProperty("ate_mm", std::to_string(1e3 * ate));
  EXPECT_LT(ate, 0.008);
  EXPECT_EQ(run.report.at("failures"), 0);
  expect_chain_of_poses(run);
  const SlamRun again = run_slam_on(folder, {"--pace", "lockstep", "--frames-limit", "50"});
  const SlamRun once_more = run_slam_on(folder, {"--pace", "lockstep", "--frames-limit", "50"});
  ASSERT_EQ(again.trajectory.size(), 50u);
  EXPECT_EQ(again.trajectory_text, once_more.trajectory_text);
  EXPECT_EQ(again.final_text, once_more.final_text);
  EXPECT_EQ(again.graph_text, once_more.graph_text);
  // What is known at a frame does not depend on what comes behind it.
  EXPECT_EQ(run.trajectory_text.substr(0, again.trajectory_text.size()), again.trajectory_text);
}

TEST(Slam, KittiIsTrackedAccurately) {
  const std::string folder = recording("kitti00");
  if (!fs::exists(folder)) GTEST_SKIP() << folder << " is absent";
  const SlamRun run = run_slam_on(folder, {"--pace", "lockstep"});
  ASSERT_EQ(run.process.exit_code, 0) << run.process.err;
  ASSERT_EQ(run.trajectory.size(), 40u);
  const double ate = ate_m(run);
  RecordProperty("ate_m", std::to_string(ate));
  EXPECT_LT(ate, 0.36);
  EXPECT_EQ(run.report.at("failures"), 0);
}

// What it may take depends on the machine; that nothing is lost must not.
TEST(Realtime, SlamTracksTheBuildingAsItArrives) {
  const std::string folder = recording("building_a");
  if (!fs::exists(folder)) GTEST_SKIP() << folder << " is absent";
  const SlamRun run = run_slam_on(folder, {"--pace", "realtime", "--frames-limit", "60"});
  ASSERT_EQ(run.process.exit_code, 0) << run.process.err;
  EXPECT_EQ(run.report.at("failures"), 0);
  const int read = run.report.at("frames").at("read"), dropped = run.report.at("frames").at("dropped");
  EXPECT_EQ(read, 60);
  EXPECT_EQ(static_cast<int>(run.trajectory.size()), read - dropped);
  EXPECT_LT(ate_m(run), 0.02);
}

void expect_one_line(const ProcessResult& result, const std::string& part) {
  EXPECT_EQ(result.exit_code, 2) << result.err;
  EXPECT_EQ(count_lines(result.err), 1) << result.err;
  EXPECT_EQ(result.err.rfind("parallax: ", 0), 0u) << result.err;
  EXPECT_NE(result.err.find(part), std::string::npos) << result.err;
}

ProcessResult slam(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "slam");
  return run_process(PARALLAX_BINARY, arguments);
}

const char* const kOtherSize =
    "cam0:\n"
    "  camera_model: pinhole\n"
    "  distortion_model: none\n"
    "  distortion_coeffs: []\n"
    "  intrinsics: [400.0, 400.0, 320.0, 240.0]\n"
    "  resolution: [640, 480]\n"
    "cam1:\n"
    "  camera_model: pinhole\n"
    "  distortion_model: none\n"
    "  distortion_coeffs: []\n"
    "  intrinsics: [400.0, 400.0, 320.0, 240.0]\n"
    "  resolution: [640, 480]\n"
    "  T_cn_cnm1:\n"
    "  - [1.0, 0.0, 0.0, -0.12]\n"
    "  - [0.0, 1.0, 0.0, 0.0]\n"
    "  - [0.0, 0.0, 1.0, 0.0]\n"
    "  - [0.0, 0.0, 0.0, 1.0]\n";

TEST(Slam, WhatCannotBeUsedIsOneLine) {
  expect_one_line(slam({}), "required");
  expect_one_line(slam({"/nonexistent/pairs"}), "/nonexistent/pairs");
  expect_one_line(slam({"synthetic:building", "--set", "stereo.nonsense=3"}), "stereo.nonsense");
  expect_one_line(slam({"synthetic:building", "--set", "window.poses=1"}), "poses");
  expect_one_line(slam({"synthetic:building", "--pace", "never"}), "--pace");
  expect_one_line(slam({"synthetic:cellar"}), "cellar");
  const ScratchFolder scratch;
  if (fs::exists(recording("desk"))) expect_one_line(slam({recording("desk")}), "desk");
  if (!fs::exists(recording("building_a"))) GTEST_SKIP() << recording("building_a") << " is absent";
  const std::string other = scratch.write("other.yaml", kOtherSize);
  const ProcessResult size = slam({recording("building_a"), "--calibration", other, "--frames-limit", "3"});
  expect_one_line(size, "640");
  EXPECT_NE(size.err.find("512"), std::string::npos) << size.err;
  expect_one_line(slam({recording("building_a"), "--calibration", scratch.file("none.yaml")}), "none.yaml");
}

// The recording with parts of it taken away or exchanged; images are links to the recording's own.
fs::path altered_copy(const ScratchFolder& scratch, int frames, bool swapped,
                      const std::function<bool(int)>& has_right) {
  const fs::path from = recording("building_a"), to = scratch.path() / "pairs";
  for (const std::string camera : {"cam0", "cam1"}) {
    const std::string taken = swapped ? (camera == "cam0" ? "cam1" : "cam0") : camera;
    fs::create_directories(to / "mav0" / camera / "data");
    fs::copy_file(from / "mav0" / camera / "sensor.yaml", to / "mav0" / camera / "sensor.yaml");
    std::ifstream in(from / "mav0" / camera / "data.csv");
    std::ofstream out(to / "mav0" / camera / "data.csv");
    int row = -1;
    for (std::string line; std::getline(in, line); ++row) {
      if (row >= frames) break;
      out << line << '\n';
      const std::string name = line.substr(line.find(',') + 1);
      if (row < 0 || (camera == "cam1" && !has_right(row))) continue;
      fs::create_symlink(from / "mav0" / taken / "data" / name, to / "mav0" / camera / "data" / name);
    }
  }
  return to;
}

TEST(Slam, MissingRightImagesAreSurvived) {
  if (!fs::exists(recording("building_a"))) GTEST_SKIP() << recording("building_a") << " is absent";
  const ScratchFolder scratch;
  const fs::path pairs = altered_copy(scratch, 60, false, [](int row) { return row % 2 == 0; });
  const SlamRun run = run_slam_on(pairs.string(), {"--pace", "lockstep", "--no-truth"});
  ASSERT_EQ(run.process.exit_code, 0) << run.process.err;
  EXPECT_NE(run.process.err.find("parallax: warning: "), std::string::npos) << run.process.err;
  EXPECT_GE(run.trajectory.size(), 28u);
  EXPECT_LE(run.trajectory.size(), 30u);
  EXPECT_EQ(run.report.at("failures"), 0);
  EXPECT_GT(run.report.at("warnings").size(), 0u);
}

TEST(Slam, DarknessIsToldAndSurvived) {
  if (!fs::exists(recording("building_a"))) GTEST_SKIP() << recording("building_a") << " is absent";
  const ScratchFolder scratch;
  const fs::path pairs = altered_copy(scratch, 50, false, [](int) { return true; });
  for (const char* camera : {"cam0", "cam1"}) {
    std::vector<fs::path> images;
    for (const auto& entry : fs::directory_iterator(pairs / "mav0" / camera / "data")) images.push_back(entry.path());
    std::sort(images.begin(), images.end());
    ASSERT_EQ(images.size(), 50u);
    for (std::size_t row = 20; row < 30; ++row) {  // what an image is, its content says
      fs::remove(images[row]);
      std::ofstream(images[row]) << "P5 512 384 255\n" << std::string(512 * 384, '\x06');
    }
  }
  const SlamRun run = run_slam_on(pairs.string(), {"--pace", "lockstep", "--no-truth"});
  ASSERT_EQ(run.process.exit_code, 0) << run.process.err;
  EXPECT_NE(run.process.err.find("frame 20: the motion was lost: both cameras see next to nothing"), std::string::npos)
      << run.process.err;
  EXPECT_EQ(run.trajectory.size(), 40u);
  EXPECT_EQ(run.report.at("failures"), 11);  // ten in the dark, and the one that begins anew
}

TEST(Slam, SwappedCamerasAreToldSo) {
  if (!fs::exists(recording("building_a"))) GTEST_SKIP() << recording("building_a") << " is absent";
  const ScratchFolder scratch;
  const fs::path pairs = altered_copy(scratch, 40, true, [](int) { return true; });
  expect_one_line(slam({pairs.string(), "--pace", "lockstep"}), "swapped");
}

}  // namespace
}  // namespace parallax::testing
