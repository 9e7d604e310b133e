#include "render/synthetic_board.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <set>

#include "core/error.h"
#include "render/synthetic_hand.h"
#include "render/synthetic_source.h"

namespace parallax {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kPeriod = kBoardStillFrames + kBoardMovingFrames;

// Where the points of the board are in a frame, by the truth.
std::vector<Vector2d> true_points(const SyntheticSource& source, int frame) {
  const CameraModel camera = source.options().camera;
  const RigidTransform camera_from_board = source.world_from_camera(frame).inverse() * world_from_synthetic_board();
  std::vector<Vector2d> points;
  for (int row = 0; row < kSyntheticBoardRows; ++row)
    for (int column = 0; column < kSyntheticBoardColumns; ++column) {
      Vector2d px(NAN, NAN);
      camera.project(camera_from_board * (kSyntheticBoardSquare_m * Vector3d(column, row, 0)), &px);
      points.push_back(px);
    }
  return points;
}

TEST(SyntheticBoard, CornersOfThePictureAreWhereTheTruthSays) {
  for (const std::string lens : {"fov", "radtan", "pinhole"}) {
    const auto source = open_synthetic_source("synthetic:board?noise=0&blur=0&lens=" + lens);
    double squares = 0;
    Vector2d sum = Vector2d::Zero();
    int count = 0;
    for (const int view : {0, 1, 2, 5, 9, 10, 16}) {
      const int frame = view * kPeriod + 5;
      // Edges as sharp as these are softened first: else the spread is for the most part that of the refinement.
      cv::Mat1b picture;
      cv::GaussianBlur(source->frame(frame).grey, picture, cv::Size(), 1.0);
      for (const Vector2d& truth : true_points(*source, frame)) {
        std::vector<cv::Point2f> corner{cv::Point2f(static_cast<float>(truth.x()), static_cast<float>(truth.y()))};
        cv::cornerSubPix(picture, corner, {4, 4}, {-1, -1},
                         {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 40, 1e-4});
        const Vector2d error = Vector2d(corner[0].x, corner[0].y) - truth;
        EXPECT_LT(error.norm(), 0.15) << lens << " view " << view;
        squares += error.squaredNorm();
        sum += error;
        ++count;
      }
    }
    EXPECT_LT(std::sqrt(squares / count), 0.05) << lens;
    EXPECT_LT(sum.norm() / count, 0.008) << lens << ": they are all shifted one way";
  }
}

TEST(SyntheticBoard, EveryViewHoldsStillAndShowsTheWholeBoard) {
  for (const std::string lens : {"fov", "radtan", "kannala_brandt", "pinhole"}) {
    const auto source = open_synthetic_source("synthetic:board?size=320x240&frames=100000&lens=" + lens);
    const CameraModel camera = source->options().camera;
    std::set<int> cells;
    for (int view = 0; view < 3 * kBoardViews; ++view) {
      const int first = view * kPeriod;
      const auto begin = true_points(*source, first);
      for (int frame = first + 1; frame < first + kBoardStillFrames; ++frame) {
        const auto before = true_points(*source, frame - 1), now = true_points(*source, frame);
        for (std::size_t i = 0; i < now.size(); ++i) {
          ASSERT_TRUE(camera.in_image(now[i], 1)) << lens << " view " << view;
          EXPECT_LT((now[i] - before[i]).norm(), 0.005 * 320);
        }
      }
      if (view < kBoardViews)
        for (const Vector2d& px : begin)
          cells.insert(static_cast<int>(px.x() / 53.4) * 4 + static_cast<int>(px.y() / 60));
    }
    EXPECT_GE(cells.size(), 22u) << lens;  // of 24
  }
}

TEST(SyntheticBoard, MovesWithoutJumps) {
  const auto source = open_synthetic_source("synthetic:board?frames=2000");
  double fastest = 0;
  for (int frame = 1; frame < 3 * kBoardViews * kPeriod; ++frame) {
    const RigidTransform step = source->world_from_camera(frame - 1).inverse() * source->world_from_camera(frame);
    fastest = std::max({fastest, step.t.norm(), 0.5 * step.angle()});
  }
  EXPECT_LT(fastest, 0.15);
  EXPECT_GT(fastest, 0.01);
}

TEST(SyntheticBoard, TheHandStartsInFrontOfIt) {
  // From where the hand starts the board is upright, square on, and in the middle.
  const auto hand = HandMotion::State{}.world_from_camera();
  const RigidTransform camera_from_board = hand.inverse() * world_from_synthetic_board();
  EXPECT_LT(camera_from_board.angle(), 1e-9);
  const Vector3d middle = camera_from_board * (kSyntheticBoardSquare_m * Vector3d(4, 2.5, 0));
  EXPECT_LT(middle.head<2>().norm(), 1e-9);
  EXPECT_GT(middle.z(), 0.4);
  EXPECT_LT(middle.z(), 0.7);
}

TEST(SyntheticBoard, OnlyTheBoardHasATarget) {
  EXPECT_EQ(open_synthetic_source("synthetic:board?target=circles&frames=1")->options().scene, "circle board");
  EXPECT_THROW(open_synthetic_source("synthetic:board?target=moon"), InputError);
  EXPECT_THROW(open_synthetic_source("synthetic:desk?target=circles"), InputError);
}

}  // namespace
}  // namespace parallax
