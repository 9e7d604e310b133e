#include "render/synthetic_source.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>

#include "core/error.h"

namespace parallax {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

bool same(const cv::Mat& a, const cv::Mat& b) {
  if (a.size() != b.size() || a.type() != b.type()) return false;
  for (int y = 0; y < a.rows; ++y)
    if (std::memcmp(a.ptr(y), b.ptr(y), static_cast<std::size_t>(a.cols) * a.elemSize()) != 0) return false;
  return true;
}

std::string message_of(const std::string& name) {
  try {
    open_synthetic_source(name);
  } catch (const InputError& e) {
    return e.what();
  }
  return "no error";
}

TEST(SyntheticSource, BadNamesAreOneClearLine) {
  for (const char* bad :
       {"synthetic:dekc", "synthetic:", "synthetic:desk?", "synthetic:desk?seed",
        "synthetic:desk?seed=", "synthetic:desk?seed=x", "synthetic:desk?seed=-1", "synthetic:desk?seed=1&seed=2",
        "synthetic:desk?frames=0", "synthetic:desk?frames=12.5", "synthetic:desk?colour=red",
        "synthetic:desk?lens=fish", "synthetic:desk?size=640", "synthetic:desk?size=10x10", "synthetic:desk?noise=nan",
        "synthetic:desk?blur=50", "synthetic:desk?frames=10&", "synthetic:desk ?seed=1", "synthetic:desk?=3"}) {
    const std::string message = message_of(bad);
    EXPECT_NE(message, "no error") << bad;
    EXPECT_NE(message.find("expected"), std::string::npos) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }
  EXPECT_NE(message_of("synthetic:nothing").find("desk, walls, shakes"), std::string::npos);
  EXPECT_NE(message_of("synthetic:desk?hue=1").find("seed, walk, light, frames"), std::string::npos);
}

TEST(SyntheticSource, KeysAreObeyed) {
  const auto source =
      open_synthetic_source("synthetic:blank?frames=7&size=320x240&lens=radtan&seed=3&noise=0&threads=2");
  EXPECT_EQ(source->frame_count(), 7);
  EXPECT_EQ(source->ground_truth().size(), 7u);
  EXPECT_EQ(source->calibration()->kind(), CameraModelKind::radtan);
  const Frame frame = source->frame(0);
  EXPECT_EQ(frame.grey.size(), cv::Size(320, 240));
  EXPECT_TRUE(frame.colour.empty());
  // Zero texture, no noise: one value.
  double low = 0, high = 0;
  cv::minMaxLoc(frame.grey, &low, &high);
  EXPECT_EQ(low, high);
}

TEST(SyntheticSource, SequentialEqualsRandomAccessAndHonoursTheRange) {
  SourceOptions options;
  options.start_frame = 5;
  options.max_frames = 3;
  const auto sequential = open_synthetic_source("synthetic:desk?size=160x120", options);
  const auto random = open_synthetic_source("synthetic:desk?size=160x120");
  EXPECT_EQ(sequential->frame_count(), 3);
  std::vector<cv::Mat1b> expected(8);
  for (const int i : {7, 5, 6}) expected[static_cast<std::size_t>(i)] = random->frame(i).grey;
  for (int i = 5; i < 8; ++i) {
    const auto frame = sequential->next();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->index, i);
    EXPECT_EQ(frame->time, random->time(i));
    EXPECT_TRUE(same(frame->grey, expected[static_cast<std::size_t>(i)]));
  }
  EXPECT_FALSE(sequential->next());
  EXPECT_THROW(random->frame(400), InputError);
  EXPECT_THROW(random->frame(-1), InputError);
}

TEST(SyntheticSource, TheSameSeedGivesTheSameBytes) {
  SourceOptions colour;
  colour.colour = true;
  const auto a = open_synthetic_source("synthetic:desk?seed=4");
  const Frame frame = a->frame(110);
  EXPECT_TRUE(same(frame.grey, open_synthetic_source("synthetic:desk?seed=4")->frame(110).grey));
  EXPECT_TRUE(same(frame.grey, open_synthetic_source("synthetic:desk?seed=4&threads=2")->frame(110).grey));
  const Frame coloured = open_synthetic_source("synthetic:desk?seed=4", colour)->frame(110);
  EXPECT_TRUE(same(frame.grey, coloured.grey)) << "asking for colour must not change the grey picture";
  EXPECT_EQ(coloured.colour.size(), coloured.grey.size());
  cv::Mat1b converted;
  cv::cvtColor(coloured.colour, converted, cv::COLOR_BGR2GRAY);
  EXPECT_LT(cv::norm(converted, coloured.grey, cv::NORM_L1) / static_cast<double>(converted.total()), 1.5);
  EXPECT_FALSE(same(frame.grey, open_synthetic_source("synthetic:desk?seed=5")->frame(110).grey));
  EXPECT_FALSE(same(frame.grey, a->frame(111).grey));
}

TEST(SyntheticSource, AScenePaintedAnewIsTheSame) {
  cv::Mat1b first;
  {
    const auto source = open_synthetic_source("synthetic:repeat?size=320x240");
    first = source->frame(3).grey;
  }  // nobody holds the scene any more
  EXPECT_TRUE(same(first, open_synthetic_source("synthetic:repeat?size=320x240")->frame(3).grey));
}

// Carries a frame's pixels to another frame through depth and poses; the mean difference in grey levels, over pixels
// seen in both. `error` is applied to the second camera.
double transfer_error(SyntheticSource& source, int from, int to, const Vector6d& error) {
  const CameraModel camera = *source.calibration();
  const cv::Mat1b a = source.frame(from).grey, b = source.frame(to).grey;
  const cv::Mat1f depth_a = source.depth(from), depth_b = source.depth(to);
  const RigidTransform b_from_world = source.world_from_camera(to).inverse();
  const RigidTransform shifted = RigidTransform::exp(error) * b_from_world;
  double sum = 0;
  int n = 0;
  for (int y = 20; y < a.rows - 20; y += 3)
    for (int x = 20; x < a.cols - 20; x += 3) {
      Vector3d ray;
      if (!camera.unproject(Vector2d(x, y), &ray) || depth_a(y, x) == 0) continue;
      const Vector3d world = source.world_from_camera(from) * (ray * depth_a(y, x));
      const Vector3d in_b = b_from_world * world;
      Vector2d at, px;
      if (!camera.project(in_b, &at) || !camera.in_image(at, 20)) continue;
      const float seen = depth_b(static_cast<int>(std::lround(at.y())), static_cast<int>(std::lround(at.x())));
      if (std::abs(seen - in_b.z()) > 0.02 * in_b.z()) continue;
      if (!camera.project(shifted * world, &px) || !camera.in_image(px, 2)) continue;
      cv::Mat1f value;
      cv::getRectSubPix(b, {1, 1}, cv::Point2f(static_cast<float>(px.x()), static_cast<float>(px.y())), value, CV_32F);
      sum += std::abs(value(0, 0) - static_cast<float>(a(y, x)));
      ++n;
    }
  EXPECT_GT(n, 5000);
  return sum / n;
}

TEST(SyntheticSource, StampedPosesExplainTheFramesBestEvenWithBlur) {
  const auto source = open_synthetic_source("synthetic:desk?noise=0&blur=20");
  const double truth = transfer_error(*source, 150, 156, Vector6d::Zero());
  EXPECT_LT(truth, 9.0);
  for (int axis = 3; axis < 6; ++axis)
    for (const double sign : {-1.0, 1.0}) {
      Vector6d error = Vector6d::Zero();
      error[axis] = sign * 0.004;  // 1.5 px at the image centre
      EXPECT_GT(transfer_error(*source, 150, 156, error), truth + 0.3) << axis << " " << sign;
    }
}

double sharpness(const cv::Mat1b& image) {
  cv::Mat1f edges;
  cv::Laplacian(image, edges, CV_32F);
  return cv::norm(edges, cv::NORM_L1) / static_cast<double>(edges.total());
}

TEST(SyntheticSource, FastMotionBlursAndStillnessDoesNot) {
  const auto blurred = open_synthetic_source("synthetic:shakes?noise=0"),
             sharp = open_synthetic_source("synthetic:shakes?noise=0&blur=0");
  EXPECT_EQ(sharp->samples(262), 4);
  EXPECT_GT(blurred->samples(262), 8);
  EXPECT_LT(sharpness(blurred->frame(262).grey), 0.6 * sharpness(sharp->frame(262).grey));
  EXPECT_GT(sharpness(blurred->frame(10).grey), 0.85 * sharpness(sharp->frame(10).grey));
}

TEST(SyntheticSource, NoiseHasTheStatedStrength) {
  const auto source = open_synthetic_source("synthetic:blank?noise=3");
  cv::Scalar mean, deviation;
  const cv::Mat1b a = source->frame(0).grey, b = source->frame(1).grey;
  cv::meanStdDev(a, mean, deviation);
  EXPECT_NEAR(deviation[0], 3.0, 0.15);
  cv::Mat1f difference;
  cv::subtract(a, b, difference, cv::noArray(), CV_32F);
  cv::meanStdDev(difference, mean, deviation);
  EXPECT_NEAR(deviation[0], 3.0 * std::sqrt(2.0), 0.2) << "independent from frame to frame";
}

TEST(SyntheticSource, WallsAreThePapersScene) {
  const auto source = open_synthetic_source("synthetic:walls");
  EXPECT_EQ(source->frame_count(), 600);
  EXPECT_EQ(source->frame(0).grey.size(), cv::Size(600, 480));
  const auto truth = source->ground_truth();
  double travelled = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    EXPECT_DOUBLE_EQ(truth[i].world_from_camera.t.z(), 3.0);
    if (i > 0) travelled += (truth[i].world_from_camera.t - truth[i - 1].world_from_camera.t).norm();
  }
  EXPECT_NEAR(travelled, 18.2, 0.005);
  // Facing the first wall squarely, every depth is the distance to it; at the end, the same of the second.
  for (const int index : {0, 599}) {
    double low = 0, high = 0;
    cv::minMaxLoc(source->depth(index), &low, &high);
    EXPECT_NEAR(low, 2.5, 1e-5) << index;
    EXPECT_NEAR(high, 2.5, 1e-5) << index;
  }
  // The walls stand at right angles: the first and the last view too.
  EXPECT_NEAR((truth.front().world_from_camera.R.transpose() * truth.back().world_from_camera.R)(2, 2), 0, 1e-9);
}

TEST(SyntheticSource, WallsNeverShowAnythingButWall) {
  const auto source = open_synthetic_source("synthetic:walls");
  for (int i = 0; i < 600; i += 23) {
    double low = 0;
    cv::minMaxLoc(source->depth(i), &low, nullptr);
    EXPECT_GT(low, 1.0) << i;
  }
}

TEST(SyntheticSource, CoveredFramesAreDarkAndOnlyThose) {
  const auto source = open_synthetic_source("synthetic:shakes?size=160x120");
  EXPECT_LT(cv::mean(source->frame(365).grey)[0], 40);
  EXPECT_TRUE(source->label(365).covered);
  EXPECT_FALSE(source->label(340).covered);
  EXPECT_GT(cv::mean(source->frame(340).grey)[0], 60);
  const double before = cv::mean(source->frame(639).grey)[0], after = cv::mean(source->frame(640).grey)[0];
  EXPECT_TRUE(source->label(640).light);
  EXPECT_LT(after, 0.6 * before);
}

}  // namespace
}  // namespace parallax
