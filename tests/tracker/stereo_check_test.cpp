#include "tracker/stereo_check.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/error.h"
#include "tests/support/rendered_views.h"

namespace parallax {
namespace {

using Eigen::Vector3d;

// The desk from five places, 4 cm of way between them while the rig turns, each seen by a left (even) and a right (odd)
// camera.
test::RenderedViews& pairs() {
  static test::RenderedViews views([] {
    std::vector<RigidTransform> poses;
    for (int i = 0; i < 5; ++i) {
      const RigidTransform left =
          test::above_desk(-0.05 + 0.04 * i) * RigidTransform(exp_so3({0, 0.03 * i, 0.02 * i}), Vector3d::Zero());
      poses.push_back(left);
      poses.push_back(left * RigidTransform(Eigen::Matrix3d(Eigen::Matrix3d::Identity()), Vector3d(0.06, 0, 0)));
    }
    return poses;
  }());
  return views;
}
GreyImage left(int i) { return pairs().frame(2 * i).grey; }
GreyImage right(int i) { return pairs().frame(2 * i + 1).grey; }

GreyImage rows_down(const GreyImage& image, int rows) {
  GreyImage moved = image.clone();
  image.rowRange(0, image.rows - rows).copyTo(moved.rowRange(rows, image.rows));
  return moved;
}

GreyImage covered(std::uint64_t seed) {
  GreyImage image(240, 320);
  cv::RNG random(seed);
  random.fill(image, cv::RNG::NORMAL, 9, 2.5);
  return image;
}

void expect_problem(const StereoVerdict& verdict, StereoProblem problem) {
  EXPECT_EQ(verdict.problem, problem) << to_string(verdict.problem) << ": " << verdict.text << "; corners "
                                      << verdict.corners << " matched " << verdict.matched << " backwards "
                                      << verdict.matched_backwards << " rows " << verdict.row_offset_px << " +- "
                                      << verdict.row_spread_px << " texture " << verdict.left_texture << " "
                                      << verdict.right_texture;
  EXPECT_EQ(verdict.text.empty(), problem == StereoProblem::none);
  EXPECT_EQ(verdict.text.find('\n'), std::string::npos);
}

TEST(StereoCheck, NamesWhatIsWrongWithARenderedPair) {
  using enum StereoProblem;
  for (const int i : {0, 2}) {
    const GreyImage l = left(i), r = right(i);
    const StereoVerdict good = check_stereo_pair(l, r);
    expect_problem(good, none);
    EXPECT_GT(good.matched, 40);
    EXPECT_LT(good.matched_backwards, 5);
    EXPECT_NEAR(good.row_offset_px, 0, 0.1);
    EXPECT_LT(good.row_spread_px, 0.3);
    GreyImage darker;
    r.convertTo(darker, CV_8U, 0.7, -5);  // another exposure
    expect_problem(check_stereo_pair(l, darker), none);

    expect_problem(check_stereo_pair(r, l), swapped);
    expect_problem(check_stereo_pair(l, l.clone()), one_image);
    const StereoVerdict apart = check_stereo_pair(l, rows_down(r, 2));
    expect_problem(apart, rows_apart);
    EXPECT_NEAR(apart.row_offset_px, 2, 0.15);
    expect_problem(check_stereo_pair(l, covered(1)), right_covered);
    expect_problem(check_stereo_pair(covered(1), r), left_covered);
    expect_problem(check_stereo_pair(covered(1), covered(2)), too_little_texture);
    // A moment later, while the camera turns; and something else altogether.
    expect_problem(check_stereo_pair(l, right(i + 1)), unsynchronised);
    GreyImage other;
    cv::flip(r, other, -1);
    expect_problem(check_stereo_pair(l, other), unrelated);
  }
}

TEST(StereoCheck, RecordedPairs) {
  using enum StereoProblem;
  const std::filesystem::path folder = std::filesystem::path(PARALLAX_DATA_DIR) / "building_a" / "mav0";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no recordings at " << PARALLAX_DATA_DIR;
  std::vector<std::filesystem::path> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder / "cam0" / "data"))
    names.push_back(entry.path().filename());
  std::sort(names.begin(), names.end());
  const auto image = [&](const char* camera, std::size_t i) {
    return GreyImage(cv::imread((folder / camera / "data" / names.at(i)).string(), cv::IMREAD_GRAYSCALE));
  };
  for (const std::size_t i : {0U, 75U, 150U, 225U}) {
    const GreyImage l = image("cam0", i), r = image("cam1", i);
    expect_problem(check_stereo_pair(l, r), none);
    expect_problem(check_stereo_pair(r, l), swapped);
    expect_problem(check_stereo_pair(l, rows_down(r, 2)), rows_apart);
    expect_problem(check_stereo_pair(l, GreyImage(l.size(), uchar{20})), right_covered);
  }
}

TEST(StereoWatch, TellsOnceWhatHasBegunAndWhatIsOver) {
  StereoCheckOptions options;
  options.interval = 4;
  options.interval_in_trouble = 2;
  StereoWatch watch(options);
  const GreyImage l = left(0), r = right(0), dark = covered(3);
  for (int i = 0; i < 6; ++i) EXPECT_FALSE(watch.look(l, r)) << i;
  EXPECT_EQ(watch.looks(), 3);
  EXPECT_FALSE(watch.look(l, r));  // looked at, well
  // One pair that fails is no problem yet.
  std::vector<StereoProblem> told;
  for (int i = 0; i < 20; ++i)
    if (const auto verdict = watch.look(l, dark)) told.push_back(verdict->problem);
  ASSERT_EQ(told, std::vector{StereoProblem::right_covered});
  EXPECT_EQ(watch.problem(), StereoProblem::right_covered);
  for (int i = 0; i < 20; ++i)
    if (const auto verdict = watch.look(l, r)) told.push_back(verdict->problem);
  EXPECT_EQ(told, (std::vector{StereoProblem::right_covered, StereoProblem::none}));

  StereoWatch swapped;
  EXPECT_FALSE(swapped.look(r, l));
  EXPECT_FALSE(swapped.look(r, l));
  const auto verdict = swapped.look(r, l);
  ASSERT_TRUE(verdict);
  EXPECT_EQ(verdict->problem, StereoProblem::swapped);
}

TEST(StereoCheck, RefusesOptionsThatMakeNoSense) {
  StereoCheckOptions options;
  options.rows_px = 0;
  EXPECT_THROW(options.validate(), InputError);
  EXPECT_THROW(StereoWatch{options}, InputError);
  EXPECT_NO_THROW(StereoCheckOptions{}.validate());
}

}  // namespace
}  // namespace parallax
