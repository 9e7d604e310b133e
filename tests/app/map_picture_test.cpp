// Textured maps written and drawn: files are read back, places are where the scale says.
#include "app/map_picture.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "render/point_cloud_file.h"
#include "tests/support/process.h"

namespace parallax {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using Eigen::Vector3f;

class MapPicture : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "parallax_map_XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  // A red block 4 m right of and 2 m before a green one, of a world with y down; a blue one high above both.
  static std::vector<ColouredPoint> blocks() {
    std::vector<ColouredPoint> points;
    const auto block = [&](const Vector3f& middle, std::array<std::uint8_t, 3> rgb) {
      for (int i = -10; i <= 10; ++i)
        for (int j = -10; j <= 10; ++j)
          points.push_back(
              {middle + Vector3f(0.02F * static_cast<float>(i), 0, 0.02F * static_cast<float>(j)), rgb, 0.01F});
    };
    block({0, 1, 3}, {10, 200, 20});
    block({4, 1, 5}, {200, 10, 20});
    block({2, -3, 4}, {10, 20, 200});
    return points;
  }

  // The middle of the pixels of about this colour (BGR), and how many.
  static std::pair<cv::Point2d, int> find(const cv::Mat3b& image, const cv::Vec3b& colour) {
    cv::Mat1b mask;
    cv::inRange(image, colour - cv::Vec3b(6, 6, 6), colour + cv::Vec3b(6, 6, 6), mask);
    cv::Point2d sum(0, 0);
    int count = 0;
    for (int y = 0; y < mask.rows; ++y)
      for (int x = 0; x < mask.cols; ++x)
        if (mask(y, x) != 0) {
          sum += cv::Point2d(x, y);
          ++count;
        }
    return {count > 0 ? sum / count : sum, count};
  }

  fs::path folder_;
};

TEST_F(MapPicture, PlyAndGlbReadBack) {
  const std::vector<ColouredPoint> points = blocks();
  write_cloud_ply(points, path("map.ply"));
  const std::string ply = testing::read_all(path("map.ply"));
  const std::size_t data = ply.find("end_header\n") + 11;
  EXPECT_NE(ply.find("element vertex " + std::to_string(points.size()) + "\n"), std::string::npos);
  ASSERT_EQ(ply.size() - data, points.size() * 19);
  Vector3f place;
  std::memcpy(place.data(), ply.data() + data + 19 * 500, sizeof place);
  EXPECT_EQ(place, points[500].position);
  EXPECT_EQ(static_cast<unsigned char>(ply[data + 19 * 500 + 12]), 200);

  write_cloud_glb(points, {0, -1, 0}, path("map.glb"));
  const std::string glb = testing::read_all(path("map.glb"));
  ASSERT_EQ(glb.substr(0, 4), "glTF");
  std::uint32_t json_bytes = 0;
  std::memcpy(&json_bytes, glb.data() + 12, 4);
  const auto json = nlohmann::json::parse(glb.substr(20, json_bytes));
  const auto& primitive = json["meshes"][0]["primitives"][0];
  EXPECT_EQ(primitive["mode"], 0);  // points
  const auto& accessor = json["accessors"][primitive["attributes"]["POSITION"].get<std::size_t>()];
  EXPECT_EQ(accessor["count"], points.size());
  // y up, z towards the viewer.
  EXPECT_NEAR(accessor["max"][1].get<double>(), 3, 1e-5);
  EXPECT_NEAR(accessor["min"][2].get<double>(), -5.2, 1e-5);
  std::memcpy(place.data(), glb.data() + 20 + json_bytes + 8 + 12 * 500, sizeof place);
  EXPECT_LT((place - Vector3f(points[500].position.x(), -points[500].position.y(), -points[500].position.z())).norm(),
            1e-6);
  const auto& colours = json["accessors"][primitive["attributes"]["COLOR_0"].get<std::size_t>()];
  EXPECT_EQ(colours["type"], "VEC4");
  EXPECT_TRUE(colours["normalized"].get<bool>());
  EXPECT_EQ(json["buffers"][0]["byteLength"], points.size() * 20);

  EXPECT_THROW(write_cloud_glb({}, {0, 0, 1}, path("none.glb")), RunError);
  EXPECT_FALSE(fs::exists(path("none.glb")));
}

TEST_F(MapPicture, ShowsPlacesToScaleFromAboveAndFromTheSide) {
  const std::vector<MapPath> ways{{{{0, 0, 0}, {0, 0, 6}}, {20, 90, 200}, "way"}};
  MapPictureOptions options;
  draw_map_picture(blocks(), ways, options, path("above.png"));
  const cv::Mat3b above = cv::imread(path("above.png"));
  const auto [green, greens] = find(above, {20, 200, 10});
  const auto [red, reds] = find(above, {20, 10, 200});
  ASSERT_GT(greens, 100);
  ASSERT_GT(reds, 100);
  EXPECT_EQ(find(above, {200, 20, 10}).second, 0);  // the ceiling is left out
  const double px_per_m = (red.x - green.x) / 4;
  EXPECT_GT(px_per_m, 100);
  EXPECT_NEAR((green.y - red.y) / px_per_m, 2, 0.02);  // what is farther is higher on the page

  options.most_above_path_m = 100;
  draw_map_picture(blocks(), ways, options, path("all.png"));
  EXPECT_GT(find(cv::imread(path("all.png")), {200, 20, 10}).second, 100);

  options.view = MapPictureView::from_the_side;
  draw_map_picture(blocks(), {}, options, path("side.png"));
  const cv::Mat3b side = cv::imread(path("side.png"));
  const auto [low, lows] = find(side, {20, 200, 10});
  const auto [high, highs] = find(side, {200, 20, 10});
  ASSERT_GT(lows, 20);
  ASSERT_GT(highs, 20);
  EXPECT_NEAR((low.y - high.y) / (high.x - low.x), 4.0 / 2.0, 0.02);

  options.title = "a < b";
  draw_map_picture(blocks(), ways, options, path("map.svg"));
  const std::string svg = testing::read_all(path("map.svg"));
  EXPECT_NE(svg.find("href=\"data:image/png;base64,iVBOR"), std::string::npos);
  EXPECT_NE(svg.find("grid 1 m"), std::string::npos);
  EXPECT_THROW(draw_map_picture(blocks(), ways, options, path("map.txt")), InputError);
  EXPECT_THROW(draw_map_picture({}, {}, options, path("empty.png")), RunError);
}

TEST_F(MapPicture, GridStepsAreOneTwoFiveTen) {
  EXPECT_EQ(map_grid_step(0.5), 1);
  EXPECT_EQ(map_grid_step(14), 1);
  EXPECT_EQ(map_grid_step(15), 2);
  EXPECT_EQ(map_grid_step(35), 5);
  EXPECT_EQ(map_grid_step(110), 10);
  EXPECT_EQ(map_grid_step(1000), 100);
}

TEST_F(MapPicture, AFloorPlanLiesUnderItAtItsScale) {
  // 10 cm a pixel, turned by a quarter: a dark square of 1 m about (5, 5) m of the plan's own axes.
  cv::Mat3b plan(100, 100, cv::Vec3b(255, 255, 255));
  plan(cv::Rect(45, 45, 10, 10)) = cv::Vec3b(0, 0, 0);
  ASSERT_TRUE(cv::imwrite(path("plan.png"), plan));
  const auto put = [&](const std::string& text) { std::ofstream(path("plan.yaml")) << text; };
  put("image: plan.png\nresolution: 0.1\norigin: [7.0, 0.5, 1.5707963267948966]\nnegate: 0\n");
  MapPictureOptions options;
  options.floor_plan = read_floor_plan(path("plan.yaml"));
  EXPECT_EQ(options.floor_plan->metres_per_px, 0.1);
  draw_map_picture(blocks(), {{{{0, 0, 0}, {0, 0, 6}}, {20, 90, 200}, ""}}, options, path("above.png"));
  const cv::Mat3b image = cv::imread(path("above.png"));
  const auto green = find(image, {20, 200, 10}).first, red = find(image, {20, 10, 200}).first;
  const auto [square, pixels] = find(image, {140, 140, 140});
  const double px_per_m = (red.x - green.x) / 4;
  EXPECT_NEAR(pixels / (px_per_m * px_per_m), 1, 0.25);
  // The plan's (5, 5) turned left about its corner: (7 - 5, 0.5 + 5).
  EXPECT_NEAR((square.x - green.x) / px_per_m, 2, 0.05);
  EXPECT_NEAR((green.y - square.y) / px_per_m, 5.5 - 3, 0.05);

  const auto refusal = [&](const std::string& text) -> std::string {
    put(text);
    try {
      (void)read_floor_plan(path("plan.yaml"));
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(refusal("image: plan.png\nresolution: 0\norigin: [0, 0, 0]\n").find("key resolution"), std::string::npos);
  EXPECT_NE(refusal("image: plan.png\nresolution: 1\norigin: [0, 0]\n").find("key origin"), std::string::npos);
  EXPECT_NE(refusal("resolution: 1\norigin: [0, 0, 0]\n").find("key image"), std::string::npos);
  EXPECT_NE(refusal("image: gone.png\nresolution: 1\norigin: [0, 0, 0]\n").find("gone.png"), std::string::npos);
  EXPECT_NE(refusal("image: plan.yaml\nresolution: 1\norigin: [0, 0, 0]\n").find("no image"), std::string::npos);
  EXPECT_NE(refusal("[1, 2\n"), "");
  EXPECT_THROW(read_floor_plan(path("none.yaml")), InputError);
}

}  // namespace
}  // namespace parallax
