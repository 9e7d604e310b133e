// Options and calibrations of `parallax run` that make no sense: one line, exit code 2, before anything is written.
#include "tests/app/recording_maker.h"
#include "tests/app/run_fixture.h"

namespace parallax::testing {
namespace {

TEST(RunOptions, InitForms) {
  for (const std::string init :
       {"5", "5,", ",5", "x", "1,2,3", "-3,7", "7,7", "9,3", "99999999999,3", "1;5", "AUTO", "1.5,20", "0x1,20"}) {
    SCOPED_TRACE(init);
    expect_one_line(parallax_run({"synthetic:desk", "--init=" + init}), 2, "--init");
  }
}

TEST(RunOptions, InitOutsideTheRecording) {
  expect_one_line(parallax_run({"synthetic:desk?frames=20", "--init", "5,20"}), 2, "19");
  expect_one_line(parallax_run({"synthetic:desk?frames=20", "--init", "500,600"}), 2, "--init");
  expect_one_line(parallax_run({"synthetic:desk", "--frames-limit", "3", "--init", "0,3"}), 2, "--init");
  expect_one_line(parallax_run({"synthetic:desk", "--start", "40", "--init", "30,75"}), 2, "--start");
}

TEST(RunOptions, FrameRange) {
  expect_one_line(parallax_run({"synthetic:desk", "--start", "400"}), 2, "--start");
  expect_one_line(parallax_run({"synthetic:desk", "--start", "-1"}), 2, "--start");
  expect_one_line(parallax_run({"synthetic:desk", "--frames-limit", "0"}), 2, "--frames-limit");
  expect_one_line(parallax_run({"synthetic:desk", "--frames-limit", "-5"}), 2, "--frames-limit");
  expect_one_line(parallax_run({"synthetic:desk", "--frames-limit", "many"}), 2, "--frames-limit");
  expect_one_line(parallax_run({"synthetic:desk", "--threads", "0"}), 2, "--threads");
  expect_one_line(parallax_run({"synthetic:desk", "--pace", "brisk"}), 2, "brisk");
}

TEST(RunOptions, Settings) {
  for (const std::string setting :
       {"tracker.fine_points", "tracker.fine_points=", "tracker.fine_points=nan", "tracker.fine_points=1e99",
        "tracker.fine_points=3x", "tracker.fine_points=-7", "nothing=3", "=", "mapper.min_sigma=inf"}) {
    SCOPED_TRACE(setting);
    const auto result = parallax_run({"synthetic:desk", "--frames-limit", "2", "--set", setting});
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_EQ(count_lines(result.err), 1) << result.err;
  }
}

class RunCalibration : public ::testing::Test {
 protected:
  static const std::string& good() {
    static const std::string text = format_calibration(*recording_source("size=320x240", 1)->calibration());
    return text;
  }
  // The calibration with the value of one key replaced.
  static std::string with(const std::string& key, const std::string& value) {
    std::string text = good();
    const auto at = text.find(key + ":");
    EXPECT_NE(at, std::string::npos) << text;
    const auto from = at + key.size() + 1;
    return text.replace(from, text.find('\n', from) - from, " " + value);
  }
  void expect_refused(const std::string& text, const std::string& part) {
    SCOPED_TRACE(text);
    const ScratchFolder folder;
    const auto result = parallax_run({"synthetic:desk?size=320x240", "--frames-limit", "2", "--calibration",
                                      folder.write("calibration.yaml", text), "--trajectory", folder.file("t.txt")});
    expect_one_line(result, 2, part);
    EXPECT_EQ(names_in(folder.path()).size(), 1u);
  }
};

TEST_F(RunCalibration, NumbersThatAreNone) {
  for (const std::string key : {"Camera.fx", "Camera.fy", "Camera.cx", "Camera.cy", "Camera.omega"}) {
    expect_refused(with(key, ".nan"), key.substr(7));
  }
  for (const std::string value : {"nan", ".inf", "", "ten", "[1, 2]"}) expect_refused(with("Camera.fx", value), "fx");
  expect_refused(with("Camera.fx", "0"), "fx");
  expect_refused(with("Camera.fx", "-300"), "fx");
  expect_refused(with("Camera.width", "0"), "width");
  expect_refused(with("Camera.width", "-320"), "width");
  expect_refused(with("Camera.model", "thin_lens"), "thin_lens");
}

TEST_F(RunCalibration, ForAnotherSize) {
  expect_refused(with("Camera.width", "640"), "320x240");
  expect_refused(with("Camera.height", "200"), "320x240");
}

// Inside a folder as well as on the command line.
TEST_F(RunCalibration, InTheFolder) {
  const ScratchFolder folder;
  make_image_folder(folder.path(), 3);
  folder.write("calibration.yaml", with("Camera.width", "640"));
  expect_one_line(parallax_run({folder.path().string()}), 2, "640x240");
  folder.write("calibration.yaml", with("Camera.cx", ".nan"));
  expect_one_line(parallax_run({folder.path().string()}), 2, "cx");
  std::filesystem::remove(folder.path() / "calibration.yaml");
  expect_one_line(parallax_run({folder.path().string()}), 2, "--calibration");
}

TEST_F(RunCalibration, FilesThatAreNone) {
  expect_refused("", "calibration.yaml");
  expect_refused(std::string("\0\1\2\xff\xfe", 5), "calibration.yaml");
  expect_refused("{{{{", "calibration.yaml");
  const ScratchFolder folder;
  const std::string source = "synthetic:desk";
  expect_one_line(parallax_run({source, "--calibration", folder.path().string()}), 2, "folder");
  expect_one_line(parallax_run({source, "--calibration", folder.file("absent.yaml")}), 2, "absent.yaml");
  expect_one_line(parallax_run({source, "--calibration", "/proc/self/mem"}), 2, "/proc/self/mem");
  expect_one_line(parallax_run({source, "--calibration", "/dev/zero"}), 2, "/dev/zero");
}

}  // namespace
}  // namespace parallax::testing
