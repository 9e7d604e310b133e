// Outputs of `parallax run` that cannot be written: one line, exit code 1, nothing half-written left behind.
#include <nlohmann/json.hpp>

#include "core/trajectory.h"
#include "tests/app/run_fixture.h"
#include "tests/support/file_size_limit.h"

namespace parallax::testing {
namespace {

namespace fs = std::filesystem;

// Tracked from frame 30 on, so that every output has something to say.
const std::vector<std::string> kTrackedSource = {"synthetic:desk?size=320x240&threads=2", "--start", "28",
                                                 "--frames-limit", "60"};

std::vector<std::string> tracked_with(const std::vector<std::string>& more) {
  std::vector<std::string> words = kTrackedSource;
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

class RunOutput : public ::testing::TestWithParam<const char*> {};

TEST_P(RunOutput, FullDevice) {
  expect_one_line(parallax_run(tracked_with({GetParam(), "/dev/full"})), 1, "/dev/full: cannot be written");
}

// The disk gets full by the video: what is small enough is there all the same, and whole.
TEST(RunOutputs, TheOthersAreWrittenWhenTheVideoCannotBe) {
  const ScratchFolder folder;
  ProcessResult result;
  {
    const FileSizeLimit limit(60000);
    result = parallax_run(tracked_with({"--video", folder.file("v.avi"), "--trajectory", folder.file("t.txt"),
                                        "--keyframes", folder.file("k.txt"), "--report", folder.file("r.json")}));
  }
  expect_one_line(result, 1, folder.file("v.avi") + ": cannot be written");
  EXPECT_EQ(result.out.find("video: "), std::string::npos) << result.out;
  EXPECT_EQ(names_in(folder.path()).size(), 3u);
  EXPECT_GT(read_trajectory(folder.file("t.txt")).size(), 20u);
  EXPECT_GE(read_trajectory(folder.file("k.txt")).size(), 2u);
  EXPECT_EQ(nlohmann::json::parse(read_all(folder.file("r.json"))).at("frames").at("read"), 60);
}

TEST_P(RunOutput, DiskThatGetsFull) {
  const ScratchFolder folder;
  folder.write("out", "what was there");
  ProcessResult result;
  {
    const FileSizeLimit limit(200);
    result = parallax_run(tracked_with({GetParam(), folder.file("out")}));
  }
  expect_one_line(result, 1, folder.file("out") + ": cannot be written");
  EXPECT_EQ(names_in(folder.path()).size(), 1u);
  EXPECT_EQ(read_all(folder.file("out")), "what was there");
}

TEST_P(RunOutput, PlaceThatIsNone) {
  const ScratchFolder folder;
  const auto with = [&](const std::string& path) { return parallax_run(tracked_with({GetParam(), path})); };
  expect_one_line(with(folder.path().string()), 1, "folder");
  expect_one_line(with(folder.file("absent/out")), 1, "absent/out");
  EXPECT_TRUE(names_in(folder.path()).empty());
}

INSTANTIATE_TEST_SUITE_P(Files, RunOutput,
                         ::testing::Values("--trajectory", "--keyframes", "--points", "--timing", "--report",
                                           "--truth"),
                         [](const auto& test) { return std::string(test.param).substr(2); });

TEST(RunPictures, DiskThatGetsFullUnderTheVideo) {
  for (const std::string name : {"out.mp4", "out.avi"}) {
    const ScratchFolder folder;
    folder.write(name, "what was there");
    ProcessResult result;
    {
      const FileSizeLimit limit(40000);
      result = parallax_run(tracked_with({"--video", folder.file(name)}));
    }
    expect_one_line(result, 1, folder.file(name) + ": cannot be written");
    EXPECT_EQ(names_in(folder.path()).size(), 1u);
    EXPECT_EQ(read_all(folder.file(name)), "what was there");
  }
}

TEST(RunPictures, DiskThatGetsFullUnderTheFrames) {
  const ScratchFolder folder;
  ProcessResult result;
  {
    const FileSizeLimit limit(3000);
    result = parallax_run(tracked_with({"--frames", folder.file("frames")}));
  }
  expect_one_line(result, 1, "cannot be written");
  EXPECT_TRUE(names_in(folder.path() / "frames").empty());
}

TEST(RunPictures, PlacesThatAreNone) {
  const ScratchFolder folder;
  const auto with = [&](const std::string& option, const std::string& path) {
    return parallax_run({"synthetic:desk?size=320x240", "--frames-limit", "2", option, path});
  };
  expect_one_line(with("--video", folder.file("out.mkv")), 2, ".mp4 or .avi");
  expect_one_line(with("--video", folder.file("out")), 2, ".mp4 or .avi");
  expect_one_line(with("--video", folder.file("absent/out.mp4")), 1, "absent/out.mp4");
  fs::create_directory(folder.path() / "folder.mp4");
  expect_one_line(with("--video", folder.file("folder.mp4")), 1, "folder.mp4");
  expect_one_line(with("--frames", folder.write("file", "")), 1, "file");
  expect_one_line(with("--frames", "/dev/full"), 1, "/dev/full");
  EXPECT_EQ(names_in(folder.path()).size(), 2u);
}

TEST(RunPictures, AreWritten) {
  const ScratchFolder folder;
  const auto result =
      parallax_run(tracked_with({"--video", folder.file("out.mp4"), "--frames", folder.file("frames/deep")}));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(result.err.empty()) << result.err;
  EXPECT_EQ(names_in(folder.path() / "frames/deep").size(), 60u);
  EXPECT_EQ(names_in(folder.path()).size(), 2u);
  EXPECT_GT(fs::file_size(folder.path() / "out.mp4"), 10000u);
}

}  // namespace
}  // namespace parallax::testing
