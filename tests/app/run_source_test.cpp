// Sources that are damaged, empty, unreadable or odd: one clear line and exit code 2, or a warning and the rest is
// tracked.
#include "tests/app/recording_maker.h"
#include "tests/app/run_fixture.h"

namespace parallax::testing {
namespace {

namespace fs = std::filesystem;

void cut_file(const fs::path& path, double part) {
  fs::resize_file(path, static_cast<std::uintmax_t>(static_cast<double>(fs::file_size(path)) * part));
}

void damage_file(const fs::path& path) {
  std::string bytes = read_all(path);
  ASSERT_GT(bytes.size(), 2000u);
  for (std::size_t i = bytes.size() / 2; i < bytes.size() / 2 + 64; ++i) bytes[i] = static_cast<char>(~bytes[i]);
  std::ofstream(path, std::ios::binary) << bytes;
}

TEST(RunSource, EmptyAndForeignFiles) {
  const ScratchFolder folder;
  expect_one_line(parallax_run({folder.write("empty.mp4", "")}), 2, "empty file");
  expect_one_line(parallax_run({folder.write("noise.mp4", std::string(3000, 'x'))}), 2, "video");
  expect_one_line(parallax_run({folder.write("notes.txt", "hello")}), 2, "text file");
  fs::create_directory(folder.path() / "nothing");
  expect_one_line(parallax_run({folder.file("nothing")}), 2, "empty folder");
}

TEST(RunSource, UnreadablePaths) {
  const ScratchFolder folder;
  fs::create_symlink("nowhere", folder.path() / "broken");
  expect_one_line(parallax_run({folder.file("broken")}), 2, "cannot be read");
  expect_one_line(parallax_run({"/proc/self/mem"}), 2, "cannot be read");
  expect_one_line(parallax_run({"/dev/null"}), 2, "device");
  expect_one_line(parallax_run({folder.file("loop") + "/x/y"}), 2, "cannot be read");
  expect_one_line(parallax_run({""}), 2, "empty name");
  expect_one_line(parallax_run({"synthetic:nowhere"}), 2, "expected one of");
  expect_one_line(parallax_run({"v4l2:/dev/nowhere"}), 2, "/dev/nowhere");
}

TEST(RunSource, VideoIsTrackedCutOrWhole) {
  const ScratchFolder folder;
  make_video(folder.path() / "whole.avi");
  const std::string calibration = folder.file("calibration.yaml");
  const auto whole = parallax_run({folder.file("whole.avi"), "--calibration", calibration});
  EXPECT_EQ(whole.exit_code, 0) << whole.err;
  EXPECT_TRUE(whole.err.empty()) << whole.err;
  EXPECT_GT(tracked_in(whole), kRecordingFrames / 2);

  expect_one_line(parallax_run({folder.file("whole.avi")}), 2, "--calibration");

  // A quarter is missing: what is there is tracked, and the user is told once.
  fs::copy_file(folder.path() / "whole.avi", folder.path() / "cut.avi");
  cut_file(folder.path() / "cut.avi", 0.75);
  const auto cut = parallax_run({folder.file("cut.avi"), "--calibration", calibration});
  EXPECT_EQ(cut.exit_code, 0) << cut.err;
  EXPECT_EQ(count_lines(cut.err), 1) << cut.err;
  EXPECT_EQ(cut.err.rfind("parallax: warning: ", 0), 0u) << cut.err;
  EXPECT_NE(cut.err.find("cut short"), std::string::npos) << cut.err;
  EXPECT_GT(tracked_in(cut), kRecordingFrames / 4);
  EXPECT_LT(tracked_in(cut), tracked_in(whole));

  // Only the header is left.
  fs::copy_file(folder.path() / "whole.avi", folder.path() / "stump.avi");
  fs::resize_file(folder.path() / "stump.avi", 600);
  expect_one_line(parallax_run({folder.file("stump.avi"), "--calibration", calibration}), 2, "stump.avi");
}

TEST(RunSource, VideoWithoutItsIndex) {
  const ScratchFolder folder;
  make_video(folder.path() / "cut.mp4", 10);
  cut_file(folder.path() / "cut.mp4", 0.6);
  expect_one_line(parallax_run({folder.file("cut.mp4"), "--calibration", folder.file("calibration.yaml")}), 2,
                  "cut.mp4");
}

// Every kind of damage at once, each in another image: each is named once and skipped, and tracking goes on.
TEST(RunSource, DamagedImagesInTheMiddleAreSkipped) {
  const ScratchFolder folder;
  const fs::path images = folder.path() / "images";
  make_image_folder(images);
  cut_file(images / image_name(30), 0.5);
  damage_file(images / image_name(40));
  std::ofstream(images / image_name(50), std::ios::trunc).close();
  fs::remove(images / image_name(55));
  fs::create_symlink("nowhere", images / image_name(55));
  write_png((images / image_name(60)).string(), cv::Mat1b(120, 160, static_cast<uchar>(90)));
  write_png((images / image_name(61)).string(), cv::Mat1b(1, 1, static_cast<uchar>(90)));
  const ScratchFolder out;
  const auto result = parallax_run({images.string(), "--trajectory", out.file("trajectory.txt")});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(count_lines(result.err), 6) << result.err;
  EXPECT_EQ(count_of(result.err, "parallax: warning: "), 6) << result.err;
  for (const int i : {30, 40, 50, 55, 60, 61}) EXPECT_EQ(count_of(result.err, image_name(i)), 1) << result.err;
  EXPECT_NE(result.out.find("frames 74,"), std::string::npos) << result.out;
  EXPECT_GT(tracked_in(result), 40);
  EXPECT_NE(result.out.find("lost 0,"), std::string::npos) << result.out;
  EXPECT_EQ(count_lines(read_all(out.file("trajectory.txt"))), tracked_in(result));
}

// In TUM layout the list of images may also name some that are not there.
TEST(RunSource, MissingImagesOfATumFolder) {
  const ScratchFolder folder;
  make_image_folder(folder.path() / "rgb");
  fs::rename(folder.path() / "rgb/calibration.yaml", folder.path() / "calibration.yaml");
  std::string list = "# timestamp filename\n";
  for (int i = 0; i < kRecordingFrames; ++i) list += std::to_string(i / 30.0) + " rgb/" + image_name(i) + "\n";
  folder.write("rgb.txt", list);
  fs::remove(folder.path() / "rgb" / image_name(35));
  fs::remove(folder.path() / "rgb" / image_name(36));
  const auto result = parallax_run({folder.path().string()});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(count_lines(result.err), 2) << result.err;
  EXPECT_EQ(count_of(result.err, image_name(35)), 1) << result.err;
  EXPECT_EQ(count_of(result.err, image_name(36)), 1) << result.err;
  EXPECT_GT(tracked_in(result), 40);
}

// A key press that falls on an unreadable image goes with the next one.
TEST(RunSource, KeyPressOnADamagedImage) {
  const ScratchFolder folder;
  make_image_folder(folder.path());
  std::ofstream(folder.path() / image_name(2), std::ios::trunc).close();
  std::ofstream(folder.path() / image_name(47), std::ios::trunc).close();
  const auto result = parallax_run({folder.path().string(), "--init", "2,47"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(count_lines(result.err), 2) << result.err;
  EXPECT_GT(tracked_in(result), 20);
}

TEST(RunSource, NoReadableImageAtAll) {
  const ScratchFolder folder;
  make_image_folder(folder.path(), 4);
  for (int i = 0; i < 4; ++i) cut_file(folder.path() / image_name(i), 0.3);
  const auto result = parallax_run({folder.path().string()});
  EXPECT_TRUE(result.exit_code == 1 || result.exit_code == 2) << result.exit_code;
  EXPECT_EQ(count_of(result.err, "parallax: ") - count_of(result.err, "parallax: warning: "), 1) << result.err;
}

TEST(RunSource, OneFrame) {
  const ScratchFolder folder;
  make_image_folder(folder.path(), 1);
  expect_one_line(parallax_run({folder.path().string()}), 1, "tracking never started");
  make_video(folder.path() / "one.avi", 1);
  expect_one_line(
      parallax_run({folder.file("one.avi"), "--calibration", folder.file("calibration.yaml"), "--pace", "realtime"}), 1,
      "tracking never started");
}

TEST(RunSource, VideoWithoutTexture) {
  const ScratchFolder folder;
  VideoWriter writer(folder.file("grey.avi"), 30, {320, 240});
  for (int i = 0; i < 60; ++i) writer.write(cv::Mat3b(240, 320, cv::Vec3b(120, 120, 120)));
  writer.close();
  write_calibration(*recording_source("size=320x240", 1)->calibration(), folder.file("calibration.yaml"));
  expect_one_line(parallax_run({folder.file("grey.avi"), "--calibration", folder.file("calibration.yaml")}), 1,
                  "tracking never started");
  expect_one_line(
      parallax_run({folder.file("grey.avi"), "--calibration", folder.file("calibration.yaml"), "--init", "5,50"}), 1,
      "tracking never started");
}

TEST(RunSource, SixteenBitImages) {
  const ScratchFolder folder;
  make_image_folder(folder.path(), kRecordingFrames, "size=320x240", [](const cv::Mat& image) {
    cv::Mat deep;
    image.convertTo(deep, CV_16U, 257);
    return deep;
  });
  const auto result = parallax_run({folder.path().string()});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(result.err.empty()) << result.err;
  EXPECT_GT(tracked_in(result), kRecordingFrames / 2);
}

TEST(RunSource, SmallestAndLargestImages) {
  const auto small = parallax_run({"synthetic:desk?size=160x120", "--start", "28", "--frames-limit", "80"});
  EXPECT_TRUE(small.exit_code == 0 || small.exit_code == 1) << small.exit_code << small.err;
  EXPECT_EQ(count_lines(small.err), small.exit_code) << small.err;
  const auto large = parallax_run(
      {"synthetic:desk?size=1920x1080&threads=2&blur=0", "--start", "30", "--frames-limit", "50", "--init", "30,75"});
  EXPECT_EQ(large.exit_code, 0) << large.err;
  EXPECT_TRUE(large.err.empty()) << large.err;
  EXPECT_GE(tracked_in(large), 3);
}

// Stereo recordings run as mono, with the left camera.
TEST(RunSource, StereoFoldersRunAsMono) {
  for (const char* name : {"building_a", "kitti00"}) {
    const std::string folder = std::string(PARALLAX_DATA_DIR) + "/" + name;
    if (!fs::exists(folder)) GTEST_SKIP() << folder << " is absent";
    const auto result = parallax_run({folder, "--frames-limit", "60"});
    EXPECT_TRUE(result.exit_code == 0 || result.exit_code == 1) << name << ": " << result.exit_code << result.err;
    EXPECT_EQ(count_lines(result.err), result.exit_code) << result.err;
    EXPECT_NE(result.out.find(std::string(name) == "kitti00" ? "frames 40," : "frames 60,"), std::string::npos)
        << result.out;
  }
}

}  // namespace
}  // namespace parallax::testing
