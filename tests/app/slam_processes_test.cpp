// `parallax slam --lcm` and `parallax backend` as processes.
#include <gtest/gtest.h>
#include <unistd.h>

#include <future>
#include <string>

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
