// A folder of its own for a test, and small recordings in every layout to put into it.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "camera/frame_source.h"
#include "core/error.h"

namespace parallax {

// The text with its first `from` made `to`.
inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  if (at != std::string::npos) text.replace(at, from.size(), to);
  return text;
}

class SourceTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "parallax_source_XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string path(const std::string& name = "") const {
    return name.empty() ? folder_.string() : (folder_ / name).string();
  }

  void put(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((folder_ / name).parent_path());
    std::ofstream(path(name), std::ios::binary) << text;
  }
  std::string get(const std::string& name) const {
    std::ifstream in(path(name), std::ios::binary);
    std::ostringstream out;
    out << in.rdbuf();
    return out.str();
  }
  void cut_in_half(const std::string& name) const {
    std::filesystem::resize_file(path(name), std::filesystem::file_size(path(name)) / 2);
  }

  // A picture whose brightness and pattern depend on `seed`.
  static cv::Mat3b picture(int seed, int width = 320, int height = 240) {
    cv::Mat3b image(height, width);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        image(y, x) = cv::Vec3b(static_cast<uchar>(x / 2 + seed), static_cast<uchar>(y / 2 + 3 * seed),
                                static_cast<uchar>((x + y) / 3 + 5 * seed));
      }
    }
    cv::circle(image, {width / 2 + seed, height / 2}, height / 5, {20, 200, 90}, -1);
    return image;
  }
  static cv::Mat1b grey_picture(int seed, int width = 320, int height = 240) {
    cv::Mat1b grey;
    cv::cvtColor(picture(seed, width, height), grey, cv::COLOR_BGR2GRAY);
    return grey;
  }
  void put_image(const std::string& name, const cv::Mat& image) const {
    std::filesystem::create_directories((folder_ / name).parent_path());
    ASSERT_TRUE(cv::imwrite(path(name), image)) << name;
  }

  static std::string calibration_text(int width, int height) {
    std::ostringstream out;
    out << "%YAML:1.0\nCamera.model: pinhole\nCamera.width: " << width << "\nCamera.height: " << height
        << "\nCamera.fx: 300.0\nCamera.fy: 301.0\nCamera.cx: " << width / 2 << ".0\nCamera.cy: " << height / 2
        << ".0\n";
    return out.str();
  }

  // Ten frames at 20 a second from 100 s, with ground truth x = the frame's number.
  void put_tum(const std::string& name, int frames = 10) const {
    std::ostringstream list, truth;
    list << "# timestamp filename\n";
    for (int i = 0; i < frames; ++i) {
      const int ms = 100000 + 50 * i;
      const std::string stamp = std::to_string(ms / 1000) + "." + std::to_string(ms % 1000 + 1000).substr(1);
      list << stamp << " rgb/" << i << ".jpg\n";
      truth << stamp << " " << i << " 0 0 0 0 0 1\n";
      put_image(name + "/rgb/" + std::to_string(i) + ".jpg", picture(i));
    }
    put(name + "/rgb.txt", list.str());
    put(name + "/groundtruth.txt", truth.str());
    put(name + "/calibration.yaml", calibration_text(320, 240));
  }

  // Cameras 0 and 1 at 20 a second, 0.1 m apart, the body 0.5 m behind camera 0.
  void put_euroc(const std::string& name, int frames = 6) const {
    std::ostringstream list, truth;
    list << "#timestamp [ns],filename\r\n";
    truth << "#timestamp\n";
    for (int i = 0; i < frames; ++i) {
      const std::string stamp = std::to_string(1400000000000000000 + 50000000LL * i);
      list << stamp << "," << stamp << ".png\r\n";
      truth << stamp << "," << i << ",0,0,1,0,0,0\n";
      put_image(name + "/mav0/cam0/data/" + stamp + ".png", grey_picture(i));
      put_image(name + "/mav0/cam1/data/" + stamp + ".png", grey_picture(i + 40));
    }
    for (const char* camera : {"cam0", "cam1"}) {
      put(name + "/mav0/" + camera + "/data.csv", list.str());
      put(name + "/mav0/" + camera + "/sensor.yaml", sensor_text(camera[3] == '0' ? 0.0 : 0.1, 320));
    }
    put(name + "/mav0/state_groundtruth_estimate0/data.csv", truth.str());
  }
  static std::string sensor_text(double x, int width) {
    std::ostringstream out;
    out << "#Default\nsensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1.0, 0.0, 0.0, " << x
        << ",\n         0.0, 1.0, 0.0, 0.0,\n         0.0, 0.0, 1.0, 0.5,\n         0.0, 0.0, 0.0, 1.0]\n"
        << "rate_hz: 20\nresolution: [" << width << ", 240]\ncamera_model: pinhole\n"
        << "intrinsics: [300.0, 301.0, 160.0, 120.0] #fu, fv, cu, cv\ndistortion_model: radial-tangential\n"
        << "distortion_coefficients: [-0.1, 0.01, 0.0, 0.0]\n";
    return out.str();
  }

  // Frames at 10 a second, 0.5 m between the cameras.
  void put_kitti(const std::string& name, int frames = 5) const {
    std::ostringstream times, poses;
    for (int i = 0; i < frames; ++i) {
      times << "0." << i << "\n";
      poses << "1 0 0 " << i << " 0 1 0 0 0 0 1 0\n";
      const std::string file = "00000" + std::to_string(i) + ".png";
      put_image(name + "/image_0/" + file, grey_picture(i));
      put_image(name + "/image_1/" + file, grey_picture(i + 40));
    }
    put(name + "/times.txt", times.str());
    put(name + "/poses.txt", poses.str());
    put(name + "/calib.txt", "P0: 300 0 160 0 0 300 120 0 0 0 1 0\nP1: 300 0 160 -150 0 300 120 0 0 0 1 0\n");
  }

  std::filesystem::path folder_;
};

struct Played {
  std::vector<Frame> frames;
  std::vector<SourceWarning> warnings;
};
inline Played play(FrameSource& source) {
  Played played;
  while (auto frame = source.next()) played.frames.push_back(std::move(*frame));
  played.warnings = source.take_warnings();
  return played;
}
inline bool same_pixels(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && (a.empty() || cv::norm(a, b, cv::NORM_INF) == 0);
}
// The line an InputError says; empty when none was thrown.
template <typename Call>
std::string input_error(Call&& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}
inline bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

}  // namespace parallax
