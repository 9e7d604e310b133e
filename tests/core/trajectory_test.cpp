#include "core/trajectory.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <random>

#include "core/error.h"
#include "core/file_io.h"
#include "core/parse_text.h"

namespace parallax {
namespace {
namespace fs = std::filesystem;

class TrajectoryFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "parallax_trajectory_XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  void put(const std::string& name, const std::string& text) const {
    fs::create_directories((folder_ / name).parent_path());
    std::ofstream(path(name)) << text;
  }
  fs::path folder_;
};

Trajectory random_trajectory(int n) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  Trajectory out;
  Timestamp time(1311868163869700001);
  for (int i = 0; i < n; ++i) {
    Vector6d mu;
    for (int k = 0; k < 6; ++k) mu(k) = normal(random);
    out.push_back({time, RigidTransform::exp(mu)});
    time += Timestamp(33333333 + i);
  }
  return out;
}

std::string refusal(const std::string& text) {
  try {
    parse_trajectory(text, "FILE");
  } catch (const InputError& error) {
    return error.what();
  }
  return "(accepted)";
}

TEST_F(TrajectoryFiles, RoundTripsInEveryForm) {
  const Trajectory truth = random_trajectory(50);
  for (const auto format : {TrajectoryFormat::tum, TrajectoryFormat::kitti, TrajectoryFormat::euroc}) {
    write_trajectory(truth, format, path("t"));
    TrajectoryFormat found{};
    const Trajectory read = read_trajectory(path("t"), &found);
    EXPECT_EQ(found, format);
    ASSERT_EQ(read.size(), truth.size());
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const Timestamp time = format == TrajectoryFormat::kitti ? Timestamp(std::chrono::seconds(i)) : truth[i].time;
      EXPECT_EQ(read[i].time.count(), time.count());
      EXPECT_LT((read[i].world_from_camera.t - truth[i].world_from_camera.t).norm(), 2e-9);
      EXPECT_LT((read[i].world_from_camera.R - truth[i].world_from_camera.R).norm(), 1e-8);
    }
  }
}

TEST_F(TrajectoryFiles, TumIsWrittenWithNineDecimals) {
  RigidTransform T;
  T.t = {1, -2.5, 0.123456789};
  write_trajectory_tum({{Timestamp(1500000001), T}}, path("t"));
  EXPECT_EQ(read_text_file(path("t")),
            "1.500000001 1.000000000 -2.500000000 0.123456789 0.000000000 0.000000000 0.000000000 1.000000000\n");
}

TEST(Trajectory, ConventionsOfTheThreeForms) {
  // A quarter turn about z: x goes to y.
  const char* tum = "1.25 1 2 3 0 0 0.70710678 0.70710678\n";
  const char* euroc = "1250000000,1,2,3,0.70710678,0,0,0.70710678,9,9,9\n";
  const char* kitti = "0 -1 0 1 1 0 0 2 0 0 1 3\n";
  for (const char* text : {tum, euroc, kitti}) {
    const Trajectory read = parse_trajectory(text, "FILE");
    ASSERT_EQ(read.size(), 1u);
    EXPECT_EQ(read[0].time, Timestamp(text == kitti ? 0 : 1250000000));
    EXPECT_LT((read[0].world_from_camera * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(1, 3, 3)).norm(), 1e-7) << text;
  }
}

TEST(Trajectory, CommentsBlankLinesCarriageReturnsAndByteOrderMarks) {
  const Trajectory read = parse_trajectory("\xef\xbb\xbf# t x\r\n\r\n 1\t0 0 0 0 0 0 1 \r\n#\n2 0 0 0 0 0 0 1", "FILE");
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[1].time, from_seconds(2));
}

TEST(Trajectory, SortedByTimeAndOfEqualTimesTheFirstStays) {
  const Trajectory read =
      parse_trajectory("3 3 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n3 4 0 0 0 0 0 1\n2 2 0 0 0 0 0 1\n", "FILE");
  ASSERT_EQ(read.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(read[i].world_from_camera.t.x(), static_cast<double>(i + 1));
}

TEST(Trajectory, BadLinesAreNamed) {
  const std::string good = "1 0 0 0 0 0 0 1\n";
  EXPECT_EQ(refusal(""),
            "FILE: found no pose, expected 8 values (TUM: t tx ty tz qx qy qz qw), 12 (KITTI: a 3x4 matrix) "
            "or a comma-separated EuRoC line");
  EXPECT_EQ(refusal("# only\n\n").substr(0, 20), "FILE: found no pose,");
  EXPECT_EQ(refusal("1 2 3\n").substr(0, 22), "FILE:1: found 3 values");
  EXPECT_EQ(refusal(good + "\n2 0 0 0 0 0 0\n"), "FILE:3: found 7 values, expected 8 as in the lines before");
  EXPECT_EQ(refusal(good + "2 0 x 0 0 0 0 1\n"), "FILE:2: found 'x' in column 3, expected a finite number");
  EXPECT_EQ(refusal(good + "2 0 nan 0 0 0 0 1\n"), "FILE:2: found 'nan' in column 3, expected a finite number");
  EXPECT_EQ(refusal(good + "2 0 1e999 0 0 0 0 1\n"), "FILE:2: found '1e999' in column 3, expected a finite number");
  EXPECT_EQ(refusal(good + "2s 0 0 0 0 0 0 1\n"), "FILE:2: found '2s' in column 1, expected a time in seconds");
  EXPECT_EQ(refusal(good + "1e18 0 0 0 0 0 0 1\n").substr(0, 21), "FILE:2: found '1e18' ");
  EXPECT_EQ(refusal(good + "2 0 0 0 0 0 0 0\n").substr(0, 35), "FILE:2: found a quaternion of lengt");
  EXPECT_EQ(refusal(good + "2,0,0,0,1,0,0,0\n").substr(0, 14), "FILE:2: found ");
  EXPECT_EQ(refusal("1.5,0,0,0,1,0,0,0\n"), "FILE:1: found '1.5' in column 1, expected a time in whole nanoseconds");
  EXPECT_EQ(refusal("1 0 0 0 0 1 0 0 0 0 -1 0\n"),
            "FILE:1: found a matrix that is no rotation, expected a rigid transform");
  EXPECT_EQ(refusal("2 0 0 0 0 1 0 0 0 0 1 0\n"),
            "FILE:1: found a matrix that is no rotation, expected a rigid transform");
}

TEST_F(TrajectoryFiles, FoldersByTheirLayout) {
  put("tum/groundtruth.txt", "1 5 0 0 0 0 0 1\n");
  EXPECT_EQ(read_trajectory(path("tum"))[0].world_from_camera.t.x(), 5);
  put("kitti/poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 7 0 1 0 0 0 0 1 0\n");
  EXPECT_EQ(read_trajectory(path("kitti"))[1].time, from_seconds(1));
  put("kitti/times.txt", "0.0\n1.5e-01\n");
  EXPECT_EQ(read_trajectory(path("kitti"))[1].time, from_seconds(0.15));
  put("kitti/times.txt", "0.0\n");
  EXPECT_THROW(read_trajectory(path("kitti")), InputError);
  put("euroc/mav0/state_groundtruth_estimate0/data.csv", "#t\n5,1,2,3,0.70710678,0,0,0.70710678\n");
  put("euroc/mav0/cam0/sensor.yaml",
      "sensor_type: camera\nT_BS:\n  cols: 4\n  data: [1, 0, 0, 0.5,\n 0, 1, 0, 0,\n 0, 0, 1, 0,\n 0, 0, 0, 1]\n");
  for (const char* folder : {"euroc", "euroc/mav0"}) {
    const auto pose = read_trajectory(path(folder))[0].world_from_camera;
    EXPECT_LT((pose.t - Eigen::Vector3d(1, 2.5, 3)).norm(), 1e-7);  // the camera's offset turned by the body's pose
  }
  fs::create_directories(path("none"));
  EXPECT_THROW(read_trajectory(path("none")), InputError);
  EXPECT_THROW(read_trajectory(path("not there")), InputError);
}

TEST(Trajectory, EurocExtrinsicsThatAreUnusable) {
  for (const char* text : {"", "T_BS:\n", "T_BS: [1, 2]", "T_BS: [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,2]",
                           "T_BS: [2,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]", "T_BS: ]["}) {
    EXPECT_THROW(parse_euroc_body_from_sensor(text, "FILE"), InputError) << text;
  }
}

TEST(Trajectory, EvaluationFilesParse) {
  const fs::path folder = fs::path(PARALLAX_DATA_DIR) / "evaluation";
  if (!fs::exists(folder)) GTEST_SKIP() << "no recordings at " << folder;
  const auto lines = [](const fs::path& path) {
    std::ifstream in(path);
    std::size_t n = 0;
    for (std::string line; std::getline(in, line);) n += !line.empty() && line[0] != '#';
    return n;
  };
  for (const char* name : {"fr2_desk_groundtruth.txt", "fr2_desk_ORB.txt", "fr2_desk_ORB_kf_mono.txt",
                           "KITTI_00_gt.txt", "KITTI_00_ORB.txt"}) {
    TrajectoryFormat found{};
    const Trajectory read = read_trajectory((folder / name).string(), &found);
    EXPECT_EQ(found, name[0] == 'K' ? TrajectoryFormat::kitti : TrajectoryFormat::tum) << name;
    EXPECT_GT(read.size(), 100u) << name;
    EXPECT_LE(read.size(), lines(folder / name)) << name;
    EXPECT_GE(read.size() + 5, lines(folder / name)) << name;  // but for a few lines with one time
  }
}

TEST(ParseText, SecondsAreExact) {
  const auto ns = [](const char* text) {
    Timestamp time{-1};
    return parse_seconds(text, &time) ? time.count() : -999;
  };
  EXPECT_EQ(ns("1311868163.8697"), 1311868163869700000);
  EXPECT_EQ(ns("1311868163.123456789"), 1311868163123456789);
  EXPECT_EQ(ns("1311868163.1234567895"), 1311868163123456790);
  EXPECT_EQ(ns("0.9999999999"), 1000000000);
  EXPECT_EQ(ns("-1.5"), -1500000000);
  EXPECT_EQ(ns("+2"), 2000000000);
  EXPECT_EQ(ns("1.000000e-01"), 100000000);
  EXPECT_EQ(ns("3."), 3000000000);
  for (const char* bad : {"", "-", ".", "1.2.3", "1e99", "nan", "inf", "99999999999", "1 ", "0x10", "--1"}) {
    EXPECT_EQ(ns(bad), -999) << bad;
  }
  for (const char* text : {"1311868163.869700000", "-0.000000001", "0.000000000"}) {
    EXPECT_EQ(format_seconds(Timestamp(ns(text))), text);
  }
}

}  // namespace
}  // namespace parallax
