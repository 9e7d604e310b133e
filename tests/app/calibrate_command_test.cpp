// `parallax calibrate` as a whole, on rendered boards whose truth is known.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "camera/calibration_file.h"
#include "render/synthetic_source.h"
#include "tests/support/process.h"

namespace parallax::testing {
namespace {

ProcessResult calibrate(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "calibrate");
  return run_process(PARALLAX_BINARY, arguments);
}

// Quick: small pictures, the fewest views that are enough.
const std::string kBoard = "synthetic:board?size=320x240&frames=240&threads=2";

struct Parameter {
  std::string name;
  double truth;
};

// Every parameter within three standard deviations of the truth, the file as the report, and what is said.
void expect_truth(const std::string& source, const std::string& model, const std::vector<Parameter>& parameters,
                  const std::vector<std::string>& options = {}) {
  const ScratchFolder folder;
  std::vector<std::string> arguments{
      source, "--model", model, "--output", folder.file("camera.yaml"), "--report", folder.file("r.json")};
  arguments.insert(arguments.end(), options.begin(), options.end());
  const ProcessResult result = calibrate(arguments);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(result.err.empty()) << result.err;
  EXPECT_NE(result.out.find("\nheld out: 0.0"), std::string::npos) << result.out;
  EXPECT_NE(result.out.find("\nenough: this calibration is good for use\n"), std::string::npos) << result.out;
  const auto report = nlohmann::json::parse(read_all(folder.file("r.json")), nullptr, false);
  ASSERT_FALSE(report.is_discarded());
  for (const auto& [name, truth] : parameters) {
    const auto& found = report.at("parameters").at(name);
    const double value = found.at("value"), sigma = found.at("sigma");
    EXPECT_GT(sigma, 0) << name;
    EXPECT_LT(std::abs(value - truth), 3 * sigma) << name << ": " << value << " +- " << sigma << ", truth " << truth;
  }
  const CameraModel camera = read_calibration(folder.file("camera.yaml"));
  EXPECT_EQ(camera.width(), 320);
  EXPECT_EQ(camera.focal_px().x(), report.at("parameters").at("fx").at("value").get<double>());
}

std::vector<Parameter> pinhole_part(const CameraModel& truth) {
  return {{"fx", truth.focal_px().x()},
          {"fy", truth.focal_px().y()},
          {"cx", truth.centre_px().x()},
          {"cy", truth.centre_px().y()}};
}

TEST(CalibrateCommand, FindsTheFovLensOfTheSyntheticCamera) {
  auto wanted = pinhole_part(*open_synthetic_source(kBoard)->calibration());
  wanted.push_back({"omega", 0.9});
  expect_truth(kBoard, "fov", wanted);
}

TEST(CalibrateCommand, FindsARadialTangentialLens) {
  const std::string source = kBoard + "&lens=radtan";
  auto wanted = pinhole_part(*open_synthetic_source(source)->calibration());
  for (const Parameter& p :
       {Parameter{"k1", -0.26}, Parameter{"k2", 0.07}, Parameter{"p1", 0.0004}, Parameter{"p2", -0.0003}})
    wanted.push_back(p);
  expect_truth(source, "radtan4", wanted);
}

TEST(CalibrateCommand, FindsTheLensFromDiscs) {
  auto wanted = pinhole_part(*open_synthetic_source(kBoard)->calibration());
  wanted.push_back({"omega", 0.9});
  expect_truth(kBoard + "&target=circles", "fov", wanted, {"--target", "circles"});
}

TEST(CalibrateCommand, WhatGoesWrongIsOneLine) {
  expect_one_line_error(calibrate({"synthetic:blank?size=160x120&frames=5"}), 1, "in 0 of 5 images");
  expect_one_line_error(calibrate({kBoard, "--target", "moon"}), 2, "target: found 'moon'");
  expect_one_line_error(calibrate({kBoard, "--board", "9"}), 2, "--board");
  expect_one_line_error(calibrate({"synthetic:board?target=moon"}), 2, "key target: found 'moon'");
  expect_one_line_error(calibrate({"synthetic:bored"}), 2, "unknown sequence 'bored'");
  // Said before minutes of work are lost.
  const ProcessResult late = calibrate({kBoard, "--output", "/nonexistent/camera.yaml"});
  expect_one_line_error(late, 1, "/nonexistent/camera.yaml: cannot be written");
  EXPECT_TRUE(late.out.empty()) << late.out;
}

}  // namespace
}  // namespace parallax::testing
