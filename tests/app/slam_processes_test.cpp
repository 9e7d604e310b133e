// `parallax slam --lcm` and `parallax backend` as processes.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <future>
#include <string>
#include <vector>

#include "core/time.h"
#include "core/trajectory.h"
#include "core/trajectory_error.h"
#include "tests/support/process.h"

namespace parallax {
namespace {

using testing::ProcessResult;
using testing::read_all;
using testing::run_process;
using testing::ScratchFolder;

// An address that no other test has.
std::string own_url(int k) { return "udpm://239.255.76.67:" + std::to_string(20000 + (getpid() * 4 + k) % 20000); }

TEST(SlamProcesses, AnAddressThatIsNoneIsRefusedInOneLine) {
  const ScratchFolder folder;
  for (const std::string& url :
       {std::string("tcpq://127.0.0.1:7700"), std::string("udpm://10.0.0.1:7667"), std::string("udpm://239.255.76.67"),
        std::string("udpm://239.255.76.67:0"), std::string("x")}) {
    const ProcessResult result =
        run_process(PARALLAX_BINARY, {"backend", "--lcm", url, "--database", folder.file("d.db")});
    EXPECT_EQ(result.exit_code, 2) << url;
    EXPECT_EQ(testing::count_lines(result.err), 1) << result.err;
    EXPECT_NE(result.err.find("--lcm " + url + ": found "), std::string::npos) << result.err;
  }
  const ProcessResult both = run_process(
      PARALLAX_BINARY, {"slam", "synthetic:building", "--lcm", own_url(0), "--database", folder.file("d.db")});
  EXPECT_EQ(both.exit_code, 2);
  EXPECT_NE(both.err.find("expected it with parallax backend"), std::string::npos) << both.err;
}

TEST(SlamProcesses, WithoutABackEndTheFrontEndGivesUp) {
  const ProcessResult result =
      run_process(PARALLAX_BINARY, {"slam", "synthetic:building", "--lcm", own_url(1), "--wait", "1"});
  if (result.err.find("no way to it") != std::string::npos) GTEST_SKIP() << result.err;
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(result.err, "parallax: no back end answers on " + own_url(1) + "\n");
}

// Two cameras in one building at the same time, each with a process of its own: they meet, and share a frame.
TEST(SlamProcesses, TwoFrontEndsAtOnceMeet) {
  const std::vector<std::string> names{"building_a", "building_b"};
  for (const std::string& name : names)
    if (!std::filesystem::exists(std::string(PARALLAX_DATA_DIR) + "/" + name)) GTEST_SKIP() << name << " is absent";
  const ScratchFolder folder;
  const std::string url = own_url(3), database = folder.file("building.db");
  std::future<ProcessResult> back_end = std::async(std::launch::async, [&] {
    return run_process(PARALLAX_BINARY, {"backend", "--lcm", url, "--database", database, "--once", "2"});
  });
  std::vector<std::future<ProcessResult>> running;
  for (const std::string& name : names)
    running.push_back(std::async(std::launch::async, [&, name] {
      return run_process(PARALLAX_BINARY, {"slam", std::string(PARALLAX_DATA_DIR) + "/" + name, "--lcm", url, "--pace",
                                           "lockstep", "--truth", folder.file(name + "_truth.txt")});
    }));
  std::string told;
  for (auto& one : running) {
    const ProcessResult front_end = one.get();
    if (front_end.err.find("no way to it") != std::string::npos) GTEST_SKIP() << front_end.err;
    ASSERT_EQ(front_end.exit_code, 0) << front_end.err;
    told += front_end.out;
  }
  const ProcessResult served = back_end.get();
  ASSERT_EQ(served.exit_code, 0) << served.err;
  // The one that came second where both have been says so.
  EXPECT_NE(told.find("building_a met building_b") == std::string::npos,
            told.find("building_b met building_a") == std::string::npos)
      << told;
  const ProcessResult exported =
      run_process(PARALLAX_BINARY, {"sessions", "export", database, "--global", "--tum", folder.file("poses")});
  ASSERT_EQ(exported.exit_code, 0) << exported.err;
  // Both against their truth with one alignment: a million seconds apart in one file.
  Trajectory joint, joint_truth;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto append = [&](const std::string& path, Trajectory* to) {
      for (TrajectoryPose pose : parse_trajectory(read_all(path), path)) {
        pose.time += from_seconds(1e6 * static_cast<double>(i));
        to->push_back(pose);
      }
    };
    append(folder.file("poses/" + names[i] + ".txt"), &joint);
    append(folder.file(names[i] + "_truth.txt"), &joint_truth);
  }
  EXPECT_GT(joint.size(), 190u);
  TrajectoryErrorOptions options;
  options.alignment = Alignment::se3;
  EXPECT_LT(summarise_errors(evaluate_trajectory(joint, joint_truth, options).position).rmse, 0.01);
}

TEST(SlamProcesses, GiveTheSameAsOneProcess) {
  const ScratchFolder folder;
  const std::string url = own_url(2);
  const std::vector<std::string> run{
      "slam", "synthetic:building", "--pace", "lockstep", "--frames-limit", "40", "--name", "hall"};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), run.begin(), run.end());
    return run_process(PARALLAX_BINARY, more);
  };
  std::future<ProcessResult> back_end = std::async(std::launch::async, [&] {
    return run_process(PARALLAX_BINARY, {"backend", "--lcm", url, "--database", folder.file("two.db"), "--once", "1"});
  });
  const ProcessResult front_end = with({"--lcm", url, "--trajectory", folder.file("two.txt")});
  const ProcessResult served = back_end.get();
  if (served.err.find("no way to it") != std::string::npos) GTEST_SKIP() << served.err;
  ASSERT_EQ(front_end.exit_code, 0) << front_end.err;
  EXPECT_EQ(served.exit_code, 0) << served.err;
  EXPECT_EQ(served.err, "");
  const ProcessResult one = with({"--database", folder.file("one.db"), "--trajectory", folder.file("one.txt")});
  ASSERT_EQ(one.exit_code, 0) << one.err;
  EXPECT_FALSE(read_all(folder.file("one.txt")).empty());
  EXPECT_EQ(read_all(folder.file("two.txt")), read_all(folder.file("one.txt")));
  // The pose graphs, as text, to the last digit.
  for (const std::string& name : {std::string("one"), std::string("two")}) {
    const ProcessResult exported = run_process(
        PARALLAX_BINARY, {"sessions", "export", folder.file(name + ".db"), "--g2o", folder.file(name + ".g2o")});
    ASSERT_EQ(exported.exit_code, 0) << exported.err;
  }
  EXPECT_FALSE(read_all(folder.file("one.g2o")).empty());
  EXPECT_EQ(read_all(folder.file("two.g2o")), read_all(folder.file("one.g2o")));
}

}  // namespace
}  // namespace parallax
