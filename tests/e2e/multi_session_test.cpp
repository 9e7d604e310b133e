// Several sessions by `parallax slam`: two recordings of one building meet and make one map, whether they are worked on
// in one run or on different days, and every place that was recognised is the right one.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "tests/e2e/program_run.h"

namespace parallax::testing {
namespace {

namespace fs = std::filesystem;

std::string session_recording(const char* name) { return std::string(PARALLAX_DATA_DIR) + "/" + name; }

Trajectory trajectory_of(const std::string& path) { return parse_trajectory(read_all(path), path); }

double rigid_ate_m(const Trajectory& estimate, const Trajectory& truth) {
  TrajectoryErrorOptions options;
  options.alignment = Alignment::se3;
  return summarise_errors(evaluate_trajectory(estimate, truth, options).position).rmse;
}

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream text(line);
  for (std::string cell; std::getline(text, cell, ',');) cells.push_back(cell);
  return cells;
}

struct Precision {
  int right = 0, wrong = 0;
  double worst_m = 0, worst_rad = 0;
};

// What is in the graph, against where the cameras were.
Precision precision_of(const std::string& encounters) {
  Precision out;
  std::istringstream lines(encounters);
  std::string line;
  std::getline(lines, line);
  const auto names = cells_of(line);
  const auto column = [&](const char* name) {
    return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
  };
  while (std::getline(lines, line)) {
    const auto cells = cells_of(line);
    if (cells.at(column("state")) != "active") continue;
    const double off_m = std::stod(cells.at(column("error_m"))), off_rad = std::stod(cells.at(column("error_rad")));
    out.worst_m = std::max(out.worst_m, off_m);
    out.worst_rad = std::max(out.worst_rad, off_rad);
    ++(off_m < 0.1 && off_rad < 0.02 ? out.right : out.wrong);
  }
  return out;
}

struct Files {
  ScratchFolder folder;
  std::vector<std::string> outputs(const std::string& prefix) const {
    return {"--pace",
            "lockstep",
            "--joint-trajectory",
            folder.file(prefix + "joint.txt"),
            "--joint-truth",
            folder.file(prefix + "joint_truth.txt"),
            "--encounters",
            folder.file(prefix + "encounters.csv"),
            "--no-images"};
  }
};

TEST(MultiSession, TwoRecordingsMeetAndMakeOneMapTodayOrTomorrow) {
  const std::string a = session_recording("building_a"), b = session_recording("building_b");
  if (!fs::exists(a) || !fs::exists(b)) GTEST_SKIP() << a << " is absent";
  const Files files;
  const auto run = [&](std::vector<std::string> words, const std::string& prefix) {
    words.insert(words.begin(), "slam");
    const auto outputs = files.outputs(prefix);
    words.insert(words.end(), outputs.begin(), outputs.end());
    return run_process(PARALLAX_BINARY, words);
  };
  const ProcessResult together = run({a, b}, "");
  ASSERT_EQ(together.exit_code, 0) << together.err;
  EXPECT_NE(together.out.find("building_b met building_a"), std::string::npos) << together.out;
  EXPECT_EQ(together.out.find("has met no other session"), std::string::npos) << together.out;
  const Trajectory joint = trajectory_of(files.folder.file("joint.txt"));
  const Trajectory joint_truth = trajectory_of(files.folder.file("joint_truth.txt"));
  EXPECT_EQ(joint.size(), 450u);
  // 50 m of path: 0.1 percent would be 50 mm, and each alone is off by 3.5 mm.
  EXPECT_LT(rigid_ate_m(joint, joint_truth), 0.008);

  const Precision precision = precision_of(read_all(files.folder.file("encounters.csv")));
  EXPECT_EQ(precision.wrong, 0) << precision.worst_m << " m, " << precision.worst_rad << " rad";
  EXPECT_GE(precision.right, 30);

  // On two days, by way of the database: the same.
  const std::string database = files.folder.file("building.db");
  ASSERT_EQ(run({a, "--database", database}, "monday_").exit_code, 0);
  const ProcessResult tuesday = run({b, "--database", database}, "tuesday_");
  ASSERT_EQ(tuesday.exit_code, 0) << tuesday.err;
  EXPECT_NE(tuesday.out.find("building_b met building_a"), std::string::npos) << tuesday.out;
  const Trajectory later = trajectory_of(files.folder.file("tuesday_joint.txt"));
  ASSERT_EQ(later.size(), 150u);
  double worst_m = 0;
  for (std::size_t i = 0; i < later.size(); ++i)
    worst_m = std::max(worst_m, (later[i].world_from_camera.t - joint[300 + i].world_from_camera.t).norm());
  EXPECT_LT(worst_m, 1e-4);
}

// The recording with both cameras covered for some frames; the other images are links to its own.
fs::path darkened(const std::string& recording, const ScratchFolder& folder, std::size_t first, std::size_t last) {
  const fs::path out = folder.path() / "darkened";
  fs::create_directories(out / "mav0");
  for (const auto& part : fs::directory_iterator(fs::path(recording) / "mav0")) {
    const fs::path there = out / "mav0" / part.path().filename();
    if (part.path().filename() != "cam0" && part.path().filename() != "cam1") {
      fs::create_symlink(part.path(), there);
      continue;
    }
    fs::create_directories(there / "data");
    for (const auto& file : fs::directory_iterator(part.path()))
      if (file.is_regular_file()) fs::create_symlink(file.path(), there / file.path().filename());
    std::vector<fs::path> images;
    for (const auto& image : fs::directory_iterator(part.path() / "data")) images.push_back(image.path());
    std::sort(images.begin(), images.end());
    for (std::size_t i = 0; i < images.size(); ++i) {
      const fs::path image = there / "data" / images[i].filename();
      if (i < first || i >= last)
        fs::create_symlink(images[i], image);
      else  // what an image is, its content says
        std::ofstream(image) << "P5 512 384 255\n" << std::string(512 * 384, '\x06');
    }
  }
  return out;
}

// Half a second of the second recording is dark, and half a metre of its way unknown: what is recognised after it puts
// the rest where it belongs, whether it stays one session or becomes two.
TEST(MultiSession, WhatWasLostIsFoundAgain) {
  const std::string a = session_recording("building_a"), b = session_recording("building_b");
  if (!fs::exists(a) || !fs::exists(b)) GTEST_SKIP() << a << " is absent";
  const Files files;
  const std::string dark = darkened(b, files.folder, 40, 50).string();
  for (const std::string& parts : {std::string("0"), std::string("1")}) {
    std::vector<std::string> words{"slam", a, dark, "--set", "sessions.new_after_failure=" + parts};
    const auto outputs = files.outputs(parts);
    words.insert(words.end(), outputs.begin(), outputs.end());
    const ProcessResult run = run_process(PARALLAX_BINARY, words);
    ASSERT_EQ(run.exit_code, 0) << run.err;
    EXPECT_NE(run.err.find("frame 40: the motion was lost"), std::string::npos) << run.err;
    EXPECT_EQ(run.out.find("darkened-2 met building_a") != std::string::npos, parts == "1") << run.out;
    const Trajectory joint = trajectory_of(files.folder.file(parts + "joint.txt"));
    EXPECT_EQ(joint.size(), 440u);
    EXPECT_LT(rigid_ate_m(joint, trajectory_of(files.folder.file(parts + "joint_truth.txt"))), 0.01);
    const Precision precision = precision_of(read_all(files.folder.file(parts + "encounters.csv")));
    EXPECT_EQ(precision.wrong, 0) << precision.worst_m << " m, " << precision.worst_rad << " rad";
    EXPECT_GE(precision.right, 50);
  }
}

TEST(MultiSession, WhatCannotBeIsOneLine) {
  const std::string a = session_recording("building_a");
  if (!fs::exists(a)) GTEST_SKIP() << a << " is absent";
  const auto told = [](std::vector<std::string> words) {
    words.insert(words.begin(), "slam");
    const ProcessResult result = run_process(PARALLAX_BINARY, words);
    EXPECT_EQ(result.exit_code, 2) << result.err;
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    return result.err;
  };
  EXPECT_NE(told({a, a, "--name", "one"}).find("expected one for each"), std::string::npos);
  EXPECT_NE(told({a, a, "--at-once", "--pace", "lockstep"}).find("--at-once"), std::string::npos);
  EXPECT_NE(told({a, "--resume"}).find("--database"), std::string::npos);
  EXPECT_NE(told({a, "--database", a + "/mav0/cam0/sensor.yaml"}).find("sensor.yaml"), std::string::npos);
  EXPECT_NE(told({a, "--set", "vote.reach_m=0"}).find("reach_m"), std::string::npos);
}

}  // namespace
}  // namespace parallax::testing
