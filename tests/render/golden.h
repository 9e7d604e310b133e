// Pictures compared with those kept in tests/data/golden, with room for another driver's rounding.
//
// PARALLAX_UPDATE_GOLDEN=1 in the environment writes the pictures anew; look at each before it is kept. A picture that
// does not match is left beside the test as NAME.actual.png in the temporary folder.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "camera/image_file.h"
#include "camera/image_writer.h"

namespace parallax::testing {

struct GoldenTolerance {
  double mean = 1.0;               // of the absolute difference, levels of 255
  int different = 24;              // a pixel that differs by more in any channel is different...
  double share_different = 0.004;  // ...and this share of them may be: edges fall a little otherwise
};

// Whether the picture differs from tests/data/golden/NAME.png by no more than that.
inline ::testing::AssertionResult matches_golden(const std::string& name, const cv::Mat3b& image,
                                                 const GoldenTolerance& tolerance = {}) {
  const std::string path = std::string(PARALLAX_SOURCE_DIR) + "/tests/data/golden/" + name + ".png";
  if (const char* update = std::getenv("PARALLAX_UPDATE_GOLDEN"); update != nullptr && *update == '1') {
    std::filesystem::create_directories(std::filesystem::path(path).parent_path());
    write_png(path, image);
    return ::testing::AssertionSuccess();
  }
  DecodedImage golden;
  ImageDecoding decoding;
  decoding.colour = true;
  const std::string problem = load_image(path, decoding, &golden);
  if (!problem.empty()) return ::testing::AssertionFailure() << path << ": " << problem;
  if (golden.colour.empty()) cv::cvtColor(golden.grey, golden.colour, cv::COLOR_GRAY2BGR);
  if (golden.colour.size() != image.size())
    return ::testing::AssertionFailure() << name << ": of another size, " << image.size();
  cv::Mat3b difference;
  cv::absdiff(golden.colour, image, difference);
  const cv::Scalar mean = cv::mean(difference);
  int different = 0;
  for (const cv::Vec3b& d : difference) different += std::max({d[0], d[1], d[2]}) > tolerance.different;
  const double share = static_cast<double>(different) / static_cast<double>(image.total());
  const double mean_difference = (mean[0] + mean[1] + mean[2]) / 3;
  if (mean_difference <= tolerance.mean && share <= tolerance.share_different) return ::testing::AssertionSuccess();
  const std::string actual = (std::filesystem::temp_directory_path() / (name + ".actual.png")).string();
  write_png(actual, image);
  return ::testing::AssertionFailure() << name << ": mean difference " << mean_difference << " (at most "
                                       << tolerance.mean << "), " << 100 * share << "% of the pixels differ (at most "
                                       << 100 * tolerance.share_different << "%), see " << actual;
}

}  // namespace parallax::testing
