#include "camera/stereo_source.h"

#include <gtest/gtest.h>

#include "source_fixture.h"

namespace parallax {
namespace {
namespace fs = std::filesystem;

using StereoSourceTest = SourceTest;

std::vector<StereoFrame> play_pairs(StereoSource& source) {
  std::vector<StereoFrame> pairs;
  while (auto pair = source.next()) pairs.push_back(std::move(*pair));
  return pairs;
}

TEST_F(StereoSourceTest, Euroc) {
  put_euroc("euroc");
  const auto source = open_stereo_source(path("euroc"));
  ASSERT_TRUE(source->calibration());
  EXPECT_LT((source->calibration()->right_from_left.t - Eigen::Vector3d(-0.1, 0, 0)).norm(), 1e-12);
  EXPECT_NEAR(source->calibration()->baseline_m(), 0.1, 1e-12);
  EXPECT_EQ(source->ground_truth().size(), 6u);
  const auto pairs = play_pairs(*source);
  EXPECT_TRUE(source->take_warnings().empty());
  ASSERT_EQ(pairs.size(), 6u);
  EXPECT_TRUE(same_pixels(pairs[2].left.grey, grey_picture(2)));
  EXPECT_TRUE(same_pixels(pairs[2].right.grey, grey_picture(42)));
  EXPECT_EQ(pairs[2].right.time, pairs[2].left.time);
}

TEST_F(StereoSourceTest, Kitti) {
  put_kitti("kitti");
  const auto source = open_stereo_source(path("kitti"));
  ASSERT_TRUE(source->calibration());
  EXPECT_LT((source->calibration()->right_from_left.t - Eigen::Vector3d(-0.5, 0, 0)).norm(), 1e-12);
  const auto pairs = play_pairs(*source);
  ASSERT_EQ(pairs.size(), 5u);
  EXPECT_TRUE(same_pixels(pairs[4].right.grey, grey_picture(44)));
  EXPECT_EQ(source->frame_count(), 5);
}

TEST_F(StereoSourceTest, MissingRightImagesAreSkippedWithAWarning) {
  put_euroc("euroc");
  put("euroc/mav0/cam1/data.csv",
      "1400000000000000000,1400000000000000000.png\n1400000000051000000,1400000000050000000.png\n"
      "1400000000120000000,1400000000100000000.png\n1400000000150000000,gone.png\n"
      "1400000000200000000,1400000000200000000.png\n");
  const auto source = open_stereo_source(path("euroc"));
  const auto pairs = play_pairs(*source);
  ASSERT_EQ(pairs.size(), 3u);
  EXPECT_EQ(pairs[1].left.index, 1);  // a millisecond apart is a pair still
  EXPECT_TRUE(same_pixels(pairs[1].right.grey, grey_picture(41)));
  EXPECT_EQ(pairs[2].left.index, 4);
  const auto warnings = source->take_warnings();
  ASSERT_EQ(warnings.size(), 3u);
  EXPECT_EQ(warnings[0].frame, 2);
  EXPECT_TRUE(contains(warnings[0].text, "no right image"));
  EXPECT_EQ(warnings[1].frame, 3);
  EXPECT_TRUE(contains(warnings[1].text, "gone.png: skipped: "));
  EXPECT_EQ(warnings[2].frame, 5);
}

TEST_F(StereoSourceTest, RefusesWhatIsNotStereo) {
  put_tum("tum", 2);
  EXPECT_TRUE(contains(input_error([&] { open_stereo_source(path("tum")); }), "found no stereo recording"));
  EXPECT_NE(input_error([&] { open_stereo_source(path("none")); }), "");
  put_kitti("kitti", 3);
  fs::remove_all(path("kitti/image_1"));
  EXPECT_TRUE(contains(input_error([&] { open_stereo_source(path("kitti")); }), "image_1"));
}

TEST_F(StereoSourceTest, Recordings) {
  const fs::path data = PARALLAX_DATA_DIR;
  if (!fs::exists(data / "kitti00")) GTEST_SKIP() << "no recordings at " << data;
  const auto kitti = open_stereo_source((data / "kitti00").string());
  EXPECT_NEAR(kitti->calibration()->baseline_m(), 386.1448 / 718.856, 1e-9);
  EXPECT_EQ(play_pairs(*kitti).size(), 40u);
  for (const auto& [name, count] : {std::pair{"building_a", 300}, std::pair{"building_b", 150}}) {
    const auto source = open_stereo_source((data / name).string());
    EXPECT_NEAR(source->calibration()->baseline_m(), 0.119, 1e-9);
    EXPECT_EQ(source->frame_count(), count);
    EXPECT_TRUE(source->next().has_value());
    EXPECT_TRUE(source->take_warnings().empty());
  }
}

}  // namespace
}  // namespace parallax
