#include <yaml-cpp/yaml.h>

#include <cmath>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "app/map_picture.h"
#include "core/error.h"
#include "core/file_io.h"
#include "core/parse_text.h"

namespace parallax {
namespace {

constexpr double kMostMetresPerPixel = 100, kFarthestCorner = 1e6;
constexpr int kMostSide = 20000;  // pixels

[[noreturn]] void refuse_plan(const std::string& path, const char* key, const char* expected) {
  throw InputError(path + ": key " + key + ": expected " + expected);
}

double plan_number(const YAML::Node& node, double largest, const std::string& path, const char* key,
                   const char* expected) {
  double value = 0;
  if (!node || !node.IsScalar() || !parse_number(trimmed(node.Scalar()), &value) || !(std::abs(value) <= largest))
    refuse_plan(path, key, expected);
  return value;
}

}  // namespace

FloorPlan read_floor_plan(const std::string& path) {
  YAML::Node root;
  try {
    root = YAML::Load(read_text_file(path));
  } catch (const YAML::Exception& error) {
    throw InputError(path + ": found unreadable YAML in line " + std::to_string(error.mark.line + 1) +
                     ", expected a floor plan's image, resolution and origin");
  }
  if (!root.IsMap()) throw InputError(path + ": found no keys, expected a floor plan's image, resolution and origin");
  FloorPlan plan;
  plan.metres_per_px = plan_number(root["resolution"], kMostMetresPerPixel, path, "resolution",
                                   "metres a pixel, more than 0, at most 100");
  if (!(plan.metres_per_px > 0)) refuse_plan(path, "resolution", "metres a pixel, more than 0, at most 100");
  const YAML::Node origin = root["origin"];
  const char* expected = "[x, y, yaw] of the lower left corner (metres, radians)";
  if (!origin || !origin.IsSequence() || origin.size() != 3) refuse_plan(path, "origin", expected);
  plan.corner_m = {plan_number(origin[0], kFarthestCorner, path, "origin", expected),
                   plan_number(origin[1], kFarthestCorner, path, "origin", expected)};
  plan.turn_rad = plan_number(origin[2], 100, path, "origin", expected);
  const YAML::Node name = root["image"];
  if (!name || !name.IsScalar() || name.Scalar().empty()) refuse_plan(path, "image", "the name of a PNG or JPEG file");
  const std::string image = (std::filesystem::path(path).parent_path() / name.Scalar()).string();
  try {
    const std::string bytes = read_text_file(image);
    if (!bytes.empty())
      plan.image = cv::imdecode(std::vector<unsigned char>(bytes.begin(), bytes.end()), cv::IMREAD_COLOR);
  } catch (const cv::Exception&) {
    plan.image.release();
  }
  if (plan.image.empty() || plan.image.cols > kMostSide || plan.image.rows > kMostSide)
    throw InputError(image + ": found no image that can be read, expected the floor plan of " + path +
                     " (PNG or JPEG)");
  return plan;
}

}  // namespace parallax
