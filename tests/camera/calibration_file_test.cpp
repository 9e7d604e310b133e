#include "camera/calibration_file.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/file_io.h"
#include "tests/camera/source_fixture.h"

namespace parallax {
namespace {

namespace fs = std::filesystem;
using enum CameraModelKind;

std::string data_path(const std::string& name) {
  return std::string(PARALLAX_SOURCE_DIR) + "/tests/data/calibration/" + name;
}

// The one-line message that a text is refused with; empty when it is not.
std::string refusal(const std::string& text, int camera_index = 0, int width = 0, int height = 0) {
  try {
    parse_calibration(text, "FILE", camera_index, width, height);
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
    return error.what();
  }
  return "";
}

const std::string kFov =
    "%YAML:1.0\nCamera.model: fov\nCamera.width: 640\nCamera.height: 480\nCamera.fx: 375.0\nCamera.fy: 376.0\n"
    "Camera.cx: 322.3\nCamera.cy: 237.1\nCamera.omega: 0.9\n";

void expect_same_pixels(const CameraModel& a, const CameraModel& b, const std::string& what) {
  ASSERT_EQ(a.width(), b.width()) << what;
  ASSERT_EQ(a.height(), b.height()) << what;
  for (double x = -0.5; x <= 0.5; x += 0.1) {
    for (double y = -0.4; y <= 0.4; y += 0.1) {
      Eigen::Vector2d p, q;
      ASSERT_TRUE(a.project({x, y, 1}, &p) && b.project({x, y, 1}, &q)) << what;
      ASSERT_LT((p - q).norm(), 1e-9) << what;
    }
  }
}

TEST(CalibrationFile, OneCameraIsTheSameInEveryFormat) {
  struct Case {
    const char* file;
    int index, width, height;
    const char* same_as;
  };
  const Case cases[] = {
      {"radtan_kalibr.yaml", 1, 0, 0, "radtan_parallax.yaml"},
      {"radtan_opencv.yml", 0, 0, 0, "radtan_parallax.yaml"},
      {"radtan_ros.yaml", 0, 0, 0, "radtan_parallax.yaml"},
      {"radtan_ros_message.yaml", 0, 0, 0, "radtan_parallax.yaml"},
      {"radtan_euroc.yaml", 0, 0, 0, "radtan_parallax.yaml"},
      {"radtan_orb_slam2.yaml", 0, 752, 480, "radtan_parallax.yaml"},
      {"radtan_orb_slam3.yaml", 0, 0, 0, "radtan_parallax.yaml"},
      {"fisheye_kalibr.yaml", 0, 0, 0, "fisheye_parallax.yaml"},
      {"fisheye_opencv.yml", 0, 0, 0, "fisheye_parallax.yaml"},
      {"fisheye_ros.yaml", 0, 0, 0, "fisheye_parallax.yaml"},
      {"fisheye_orb_slam3.yaml", 0, 0, 0, "fisheye_parallax.yaml"},
      {"fov_ptam.cfg", 0, 640, 480, "fov_parallax.yaml"},
      {"fov_kalibr.yaml", 0, 0, 0, "fov_parallax.yaml"},
      {"pinhole_kitti.txt", 0, 1241, 376, "pinhole_parallax.yaml"},
      {"pinhole_kitti.txt", 1, 1241, 376, "pinhole_parallax.yaml"},
      {"pinhole_kalibr.yaml", 0, 0, 0, "pinhole_parallax.yaml"},
      {"pinhole_euroc.yaml", 0, 0, 0, "pinhole_parallax.yaml"},
      {"pinhole_orb_slam3.yaml", 0, 0, 0, "pinhole_parallax.yaml"},
      {"pinhole_ros.yaml", 0, 0, 0, "pinhole_parallax.yaml"},
  };
  for (const Case& c : cases) {
    const CameraModel camera = read_calibration(data_path(c.file), c.index, c.width, c.height);
    const CameraModel reference = read_calibration(data_path(c.same_as));
    EXPECT_EQ(camera.kind(), reference.kind()) << c.file;
    expect_same_pixels(camera, reference, c.file);
  }
}

TEST(CalibrationFile, ReadsOurOwnValues) {
  const CameraModel camera = parse_calibration(kFov, "FILE");
  EXPECT_EQ(camera, CameraModel(fov, 640, 480, {375, 376}, {322.3, 237.1}, {0.9}, 1));
  EXPECT_EQ(read_calibration(data_path("radtan_parallax.yaml")),
            CameraModel(radtan, 752, 480, {420.506712, 420.610940}, {355.208298, 250.336787},
                        {-0.296609, 0.080818, 0.00019359, -0.00025}, 4));
  // Other line ends, a byte order mark, and no directive.
  std::string dos;
  for (const char c : kFov.substr(10)) dos += c == '\n' ? std::string("\r\n") : std::string(1, c);
  EXPECT_EQ(parse_calibration("\xef\xbb\xbf" + dos, "FILE"), camera);
  EXPECT_EQ(parse_calibration("# first a word\n\n" + kFov, "FILE"), camera);
}

TEST(CalibrationFile, PtamPixelsAreShiftedByHalf) {
  // Half the image size, in PTAM's relative units, is the corner between the four middle pixels.
  const CameraModel camera = parse_calibration("Camera.Parameters=[ 0.5 0.6 0.5 0.5 0 ]\n", "FILE", 0, 640, 480);
  EXPECT_EQ(camera.centre_px(), Eigen::Vector2d(319.5, 239.5));
  EXPECT_EQ(camera.focal_px(), Eigen::Vector2d(320, 288));
}

TEST(CalibrationFile, PicksTheCameraAskedFor) {
  const std::string kalibr = read_text_file(data_path("radtan_kalibr.yaml"));
  EXPECT_EQ(parse_calibration(kalibr, "FILE", 0).focal_px().x(), 400);
  EXPECT_EQ(parse_calibration(kalibr, "FILE", 1).focal_px().x(), 420.506712);
  EXPECT_EQ(refusal(kalibr, 2), "FILE: key cam2: found nothing, expected a section");
  EXPECT_EQ(read_calibration(data_path("fisheye_orb_slam3.yaml"), 1).focal_px().x(), 190.442369);
  EXPECT_EQ(refusal(kFov, 1), "FILE: camera 1: found one camera only, expected more");
  EXPECT_NE(refusal(kFov, -1), "");
  EXPECT_NE(refusal(read_text_file(data_path("pinhole_kitti.txt")), 2, 1241, 376), "");
}

TEST(CalibrationFile, WhatIsWrongIsSaidInOneLine) {
  const std::string where = "FILE: key Camera.fx: ";
  EXPECT_EQ(refusal(replaced(kFov, "375.0", "abc")), where + "found 'abc', expected a positive number");
  EXPECT_EQ(refusal(replaced(kFov, "375.0", "-3")), where + "found '-3', expected a positive number");
  EXPECT_EQ(refusal(replaced(kFov, "375.0", ".nan")), where + "found '.nan', expected a positive number");
  EXPECT_EQ(refusal(replaced(kFov, "375.0", "nan")), where + "found 'nan', expected a positive number");
  EXPECT_EQ(refusal(replaced(kFov, "375.0", "inf")), where + "found 'inf', expected a positive number");
  EXPECT_EQ(refusal(replaced(kFov, "375.0", "1e999")), where + "found '1e999', expected a positive number");
  EXPECT_EQ(refusal(replaced(kFov, "375.0", "375.0px")), where + "found '375.0px', expected a positive number");
  EXPECT_EQ(refusal(replaced(kFov, "375.0", "[1, 2]")), where + "found a list of 2 values, expected a positive number");
  EXPECT_EQ(refusal(replaced(kFov, "375.0", "{a: 2}")), where + "found a section, expected a positive number");
  EXPECT_EQ(refusal(replaced(kFov, "375.0", "")), where + "found an empty value, expected a positive number");
  EXPECT_EQ(refusal(replaced(kFov, "Camera.fx: 375.0\n", "")), where + "found nothing, expected a positive number");
  EXPECT_EQ(refusal(replaced(kFov, "237.1", ".inf")), "FILE: key Camera.cy: found '.inf', expected a finite number");
  EXPECT_EQ(refusal(replaced(kFov, "0.9", "4")),
            "FILE: camera model: omega: found 4, expected radians from 0 to below pi");
  EXPECT_EQ(refusal(replaced(kFov, "640", "640.5")),
            "FILE: key Camera.width: found '640.5', expected a whole number of pixels from 1 to 65536");
  EXPECT_EQ(refusal(replaced(kFov, "480", "0")),
            "FILE: key Camera.height: found '0', expected a whole number of pixels from 1 to 65536");
  EXPECT_EQ(refusal(replaced(kFov, "fov", "omni")),
            "FILE: key Camera.model: found 'omni', expected pinhole, radtan, kannala_brandt or fov");
  EXPECT_EQ(refusal(kFov + "Camera.k1: 0.1\n"),
            "FILE: key Camera.k1: found '0.1', expected no such parameter of the model fov");
  EXPECT_EQ(refusal(kFov + "Camera.fx: 370\n"), "FILE: key 'Camera.fx': found twice, expected once");
}

TEST(CalibrationFile, RefusesWhatIsNoCalibration) {
  EXPECT_EQ(refusal(""), "FILE: found an empty file, expected a calibration");
  EXPECT_EQ(refusal(" \n\t\r\n"), "FILE: found an empty file, expected a calibration");
  EXPECT_EQ(refusal(std::string("a\0b", 3)), "FILE: found binary data, expected a calibration in text");
  EXPECT_EQ(refusal("\x7f"
                    "ELF\x02"),
            "FILE: found binary data, expected a calibration in text");
  EXPECT_EQ(refusal(std::string((1 << 20) + 1, 'x')), "FILE: found more than 1 MB, expected a calibration file");
  EXPECT_EQ(refusal("a line of prose"), "FILE: found 'a line of prose', expected a calibration (keys and values)");
  EXPECT_EQ(refusal("- 1\n- 2\n"), "FILE: found a list of 2 values, expected a calibration (keys and values)");
  EXPECT_NE(refusal("Camera.fps: 3\n").find("expected a calibration of a known format"), std::string::npos);
  EXPECT_NE(refusal("a: [1, 2\nb: }").find("FILE: line 2: found unreadable YAML"), std::string::npos);
  EXPECT_NE(refusal("%YAML:1.0\n"), "");
  EXPECT_NE(refusal("# nothing\n"), "");
}

TEST(CalibrationFile, SurvivesBombs) {
  EXPECT_NE(refusal("Camera.model: " + std::string(100000, '[')).find("nested"), std::string::npos);
  EXPECT_NE(refusal("Camera.model: " + std::string(100000, '{')).find("nested"), std::string::npos);
  std::string entries, questions, steps, aliases = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
  for (int i = 0; i < 100000; ++i) entries += "- ", questions += "? ";
  EXPECT_NE(refusal(entries).find("nested"), std::string::npos);
  EXPECT_NE(refusal(questions).find("nested"), std::string::npos);
  for (int i = 0; i < 1300; ++i) steps += std::string(static_cast<std::size_t>(i), ' ') + "k:\n";
  EXPECT_NE(refusal(steps), "");
  for (int i = 1; i < 60; ++i) {
    const std::string before = "*a" + std::to_string(i - 1);
    aliases += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [" + before;
    for (int k = 0; k < 9; ++k) aliases += ", " + before;
    aliases += "]\n";
  }
  EXPECT_EQ(refusal(aliases + "Camera.model: *a59\n"),
            "FILE: key Camera.model: found a list of 10 values, expected a word");
  EXPECT_NE(refusal("cam0: &x {camera_model: *x}\n"), "");
}

TEST(CalibrationFile, RefusesUnsupportedLensesByName) {
  const std::string kalibr = read_text_file(data_path("fov_kalibr.yaml"));
  EXPECT_EQ(
      refusal(replaced(kalibr, "pinhole", "omni")),
      "FILE: key cam0.camera_model: found 'omni', expected pinhole (other projections, such as omni, eucm and ds, "
      "are not supported)");
  EXPECT_EQ(
      refusal(replaced(kalibr, "model: fov", "model: ftheta")),
      "FILE: key cam0.distortion_model: found 'ftheta', expected radtan, radial-tangential, equidistant, fov or none");
  EXPECT_EQ(refusal(replaced(kalibr, "[0.9]", "[0.9, 0.1]")),
            "FILE: key cam0.distortion_coeffs: found 2 numbers, expected 1 (w)");
  EXPECT_EQ(refusal(replaced(kalibr, "376.0", "wide")),
            "FILE: key cam0.intrinsics: found 'wide' at place 2, expected a finite number");
  EXPECT_NE(refusal(replaced(kalibr, "[640, 480]", "[640, 480.5]")), "");
  EXPECT_NE(refusal(replaced(kalibr, "[640, 480]", "[640, -480]")), "");

  const std::string ros = read_text_file(data_path("radtan_ros.yaml"));
  EXPECT_EQ(refusal(replaced(ros, "plumb_bob", "thin_prism")),
            "FILE: key distortion_model: found 'thin_prism', expected plumb_bob, rational_polynomial, equidistant or "
            "fisheye");
  EXPECT_NE(refusal(replaced(ros, "420.506712, 0.000000", "420.506712, 0.5")).find("no skew"), std::string::npos);
  EXPECT_EQ(refusal(replaced(ros, "-0.00025, 0.000000]", "-0.00025, 0, 0]")),
            "FILE: key distortion_coefficients: found 6 numbers, expected 0, 4, 5 or 8 (k1 k2 p1 p2 k3 k4 k5 k6)");
  EXPECT_NE(refusal(replaced(ros, "-0.296609", "-2.5")).find("folds onto itself inside the image"), std::string::npos);
  EXPECT_EQ(refusal(replaced(ros, "image_width", "image_breadth")),
            "FILE: key image_width: found nothing, expected a whole number of pixels from 1 to 65536");

  const std::string orb = read_text_file(data_path("radtan_orb_slam3.yaml"));
  EXPECT_EQ(refusal(replaced(orb, "PinHole", "Spherical")),
            "FILE: key Camera.type: found 'Spherical', expected PinHole, KannalaBrandt8 or Rectified");
  EXPECT_EQ(refusal(replaced(orb, "Camera1.p2", "Camera1.q2")),
            "FILE: key Camera1.p2: found nothing, expected a finite number");
}

TEST(CalibrationFile, FormatsWithoutSizeAskForIt) {
  const std::string ptam = "Camera.Parameters=[ 0.5 0.6 0.5 0.5 0.9 ]\n";
  EXPECT_EQ(refusal(ptam),
            "FILE: key Camera.Parameters: found no image size in this format, expected the width and height of the "
            "images to be known beforehand");
  EXPECT_EQ(refusal(ptam, 0, 640, 480), "");
  EXPECT_NE(refusal("Camera.Parameters=[ 0.5 0.6 0.5 0.5 ]\n", 0, 640, 480).find("found 4 numbers"), std::string::npos);
  EXPECT_NE(refusal("Camera.Parameters=[ 0.5 x 0.5 0.5 1 ]\n", 0, 640, 480).find("found 'x'"), std::string::npos);
  EXPECT_NE(refusal("Camera.Parameters=0.5 0.6\n", 0, 640, 480).find("[ fx fy cx cy w ]"), std::string::npos);
  EXPECT_NE(refusal(read_text_file(data_path("pinhole_kitti.txt"))), "");
  EXPECT_NE(refusal(read_text_file(data_path("radtan_orb_slam2.yaml"))).find("Camera.width"), std::string::npos);
  EXPECT_EQ(refusal("P0: 1 2 3\n", 0, 640, 480),
            "FILE: key P0: found 3 numbers, expected 12 (a 3x4 projection matrix)");
}

TEST(CalibrationFile, WritingAndReadingBackKeepsEveryBit) {
  const CameraModel cameras[] = {
      CameraModel(pinhole, 640, 480, {1000.0 / 3, 1e3 / 7}, {319.123456789012345, 240.1}),
      CameraModel(radtan, 640, 480, {535.9, 535.8}, {342.3, 235.6}, {-0.1 / 3, 1e-17, 1e-4 / 3, -1e-5 / 7}, 4),
      CameraModel(radtan, 640, 480, {535.9, 535.8}, {342.3, 235.6}, {-0.1 / 3, 0.01, 1e-4, 0, 0.2 / 3}, 5),
      CameraModel(radtan, 640, 480, {535.9, 535.8}, {342.3, 235.6}, {0.1, 0.01, 0, 0, 0.02, 0.3, 0.01, 1e-3}, 8),
      CameraModel(radtan, 640, 480, {535.9, 535.8}, {342.3, 235.6}, {}, 4),
      CameraModel(kannala_brandt, 640, 480, {330, 331}, {322, 238}, {-0.0132, 0.0207, -0.0127, 0.00257}, 4),
      CameraModel(fov, 640, 480, {375, 376}, {322.3, 237.1}, {0.9 / 7}, 1),
  };
  const fs::path folder = fs::path(::testing::TempDir()) / "parallax_calibration_file_test";
  fs::create_directories(folder);
  for (const CameraModel& camera : cameras) {
    const std::string path = (folder / "camera.yaml").string();
    write_calibration(camera, path);
    EXPECT_EQ(read_calibration(path), camera) << format_calibration(camera);
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 1) << "something was left behind";
  EXPECT_THROW(write_calibration(cameras[0], (folder / "missing" / "camera.yaml").string()), RunError);
  fs::remove_all(folder);
}

TEST(CalibrationFile, UnreadablePaths) {
  const auto message = [](const std::string& path) -> std::string {
    try {
      read_calibration(path);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  const std::string folder = fs::temp_directory_path().string();
  EXPECT_EQ(message(folder), folder + ": found a folder, expected a calibration file");
  EXPECT_NE(message("/no/such/file.yaml").find("/no/such/file.yaml: "), std::string::npos);
  EXPECT_NE(message("/dev/null").find("empty"), std::string::npos);
  EXPECT_NE(message("/dev/zero").find("1 MB"), std::string::npos);
}

TEST(CalibrationFile, FuzzCorpusGivesCamerasOrInputErrors) {
  const fs::path corpus = fs::path(PARALLAX_SOURCE_DIR) / "tests/fuzz/corpus/calibration";
  int read = 0, refused = 0;
  for (const auto& entry : fs::directory_iterator(corpus)) {
    std::ifstream stream(entry.path(), std::ios::binary);
    const std::string text((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
    for (const bool whole : {true, false}) {
      for (const int index : {0, 1}) {
        // The whole text, and for the short ones every beginning of it.
        for (std::size_t n = whole ? text.size() : 0; n <= text.size(); n += 7) {
          try {
            parse_calibration(text.substr(0, n), "FILE", index, 640, 480);
            ++read;
          } catch (const InputError&) {
            ++refused;
          }
          if (!whole && text.size() > 2000) break;
        }
      }
    }
  }
  EXPECT_GT(read, 20);
  EXPECT_GT(refused, 100);
}

TEST(CalibrationFile, RealRecordings) {
  const fs::path data = PARALLAX_DATA_DIR;
  if (!fs::exists(data / "desk")) GTEST_SKIP() << "no recordings at " << data;
  EXPECT_EQ(read_calibration((data / "desk/calibration.yaml").string()).kind(), fov);
  EXPECT_EQ(read_calibration((data / "kitchen/calibration.yaml").string()).kind(), pinhole);
  EXPECT_EQ(read_calibration((data / "wide_desk/calibration.yaml").string()).kind(), radtan);
  const CameraModel kitti = read_calibration((data / "kitti00/calib.txt").string(), 0, 1241, 376);
  EXPECT_EQ(kitti.focal_px().x(), 718.856);
  const CameraModel building = read_calibration((data / "building_a/mav0/cam1/sensor.yaml").string());
  EXPECT_EQ(building.width(), 512);
  const CameraModel chess = read_calibration((data / "calibration/opencv_stereo/left_intrinsics.yml").string());
  EXPECT_EQ(chess.n_distortion(), 5);
  EXPECT_EQ(chess.distortion()[4], 2.3839153080878486e-01);
}

}  // namespace
}  // namespace parallax
