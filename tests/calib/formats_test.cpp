// Writing calibrations: every format reads back what it was given.
#include <gtest/gtest.h>

#include "camera/calibration_file.h"
#include "core/error.h"
#include "tests/calib/rendered_board.h"

namespace parallax {
namespace {

constexpr CalibrationFormat formats[] = {CalibrationFormat::parallax, CalibrationFormat::kalibr,
                                         CalibrationFormat::opencv,   CalibrationFormat::ros,
                                         CalibrationFormat::orb_slam, CalibrationFormat::ptam};

TEST(Formats, ReadBackWhatTheyHold) {
  int held = 0;
  for (const auto& [model, camera] : calib_test::lenses()) {
    for (const CalibrationFormat format : formats) {
      if (!format_problem(camera, format).empty()) {
        EXPECT_THROW((void)format_calibration(camera, format), InputError);
        continue;
      }
      ++held;
      const std::string text = format_calibration(camera, format);
      const CameraModel again = parse_calibration(text, "test", 0, 640, 480);
      for (double v = 0; v < 480; v += 60) {
        for (double u = 0; u < 640; u += 60) {
          Eigen::Vector3d ray;
          Eigen::Vector2d px;
          if (!camera.unproject({u, v}, &ray)) continue;
          ASSERT_TRUE(again.project(ray, &px)) << to_string(model) << " " << to_string(format);
          ASSERT_LT((px - Eigen::Vector2d(u, v)).norm(), 1e-7) << to_string(model) << " " << to_string(format) << "\n"
                                                               << text;
        }
      }
      EXPECT_EQ(again.width(), 640);
      EXPECT_EQ(again.height(), 480);
      // A five-parameter form of four is the same lens.
      if (format == CalibrationFormat::parallax) {
        EXPECT_EQ(again, camera);
      }
    }
  }
  EXPECT_EQ(held, 6 + 4 + 5 + 5 + 4 + 1);
}

TEST(Formats, HaveNames) {
  for (const CalibrationFormat format : formats) EXPECT_EQ(calibration_format(to_string(format)), format);
  EXPECT_THROW((void)calibration_format("matlab"), InputError);
}

}  // namespace
}  // namespace parallax
