#include "calib/target.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <set>

#include "calib/target_pdf.h"
#include "core/error.h"
#include "core/file_io.h"
#include "tests/calib/rendered_board.h"

namespace parallax {
namespace {

CalibrationTarget make(TargetKind kind, int columns, int rows) {
  CalibrationTarget target = calib_test::chessboard(columns, rows, 0.02);
  target.kind = kind;
  return target;
}

const std::vector<CalibrationTarget> all_targets{make(TargetKind::chessboard, 9, 6),
                                                 make(TargetKind::chessboard, 7, 7),
                                                 make(TargetKind::chessboard, 8, 6),
                                                 make(TargetKind::chessboard, 6, 6),
                                                 make(TargetKind::charuco, 9, 6),
                                                 make(TargetKind::circles, 7, 5),
                                                 make(TargetKind::circles, 6, 6),
                                                 make(TargetKind::asymmetric_circles, 4, 11),
                                                 make(TargetKind::asymmetric_circles, 5, 8),
                                                 make(TargetKind::squares, 8, 8),
                                                 make(TargetKind::squares, 5, 4)};

TEST(Target, PointsAreWhereTheInkChanges) {
  for (const auto& target : all_targets) {
    const auto points = target_points(target);
    ASSERT_EQ(static_cast<int>(points.size()), target_point_count(target));
    const double e = 0.01 * target.square_m;
    const bool discs = target.kind == TargetKind::circles || target.kind == TargetKind::asymmetric_circles;
    for (const auto& p : points) {
      int black = 0;
      for (const double dx : {-e, e})
        for (const double dy : {-e, e}) black += target_is_black(target, p.x() + dx, p.y() + dy) ? 1 : 0;
      // Two of four quarters on a chessboard, one at a square's corner, all in a disc.
      EXPECT_EQ(black, discs ? 4 : target.kind == TargetKind::squares ? 1 : 2) << to_string(target.kind);
      if (!discs) continue;
      const double r = 0.5 * target.detail();
      EXPECT_TRUE(target_is_black(target, p.x() + 0.98 * r, p.y()));
      EXPECT_FALSE(target_is_black(target, p.x() + 1.02 * r, p.y()));
    }
  }
}

// A symmetry takes the points onto each other by a rotation of the plane that leaves the ink as it was.
TEST(Target, SymmetriesLeaveTheInkAsItIs) {
  for (const auto& target : all_targets) {
    const auto points = target_points(target);
    const auto symmetries = target_symmetries(target);
    ASSERT_GE(symmetries.size(), 1u);
    for (const auto& ids : symmetries) {
      ASSERT_EQ(ids.size(), points.size());
      EXPECT_EQ(std::set<int>(ids.begin(), ids.end()).size(), points.size());
      Eigen::Matrix3Xd from(3, points.size()), to(3, points.size());
      for (std::size_t i = 0; i < points.size(); ++i) {
        from.col(static_cast<int>(i)) = points[i];
        to.col(static_cast<int>(i)) = points[static_cast<std::size_t>(ids[i])];
      }
      SimilarityTransform turn;
      ASSERT_TRUE(align_points(from, to, false, &turn));
      for (std::size_t i = 0; i < points.size(); ++i)
        ASSERT_LT((turn * points[i] - points[static_cast<std::size_t>(ids[i])]).norm(), 1e-9) << to_string(target.kind);
      const TargetExtent extent = target_extent(target);
      std::mt19937 random(1);
      std::uniform_real_distribution<double> unit(0, 1);
      for (int k = 0; k < 500; ++k) {
        const Eigen::Vector3d p(extent.left + extent.width() * unit(random),
                                extent.top + extent.height() * unit(random), 0);
        const Eigen::Vector3d q = turn * p;
        ASSERT_EQ(target_is_black(target, p.x(), p.y()), target_is_black(target, q.x(), q.y()))
            << to_string(target.kind) << " " << target.columns << "x" << target.rows;
      }
    }
  }
  EXPECT_EQ(target_symmetries(make(TargetKind::chessboard, 9, 6)).size(), 1u);
  EXPECT_EQ(target_symmetries(make(TargetKind::chessboard, 8, 6)).size(), 2u);
  EXPECT_EQ(target_symmetries(make(TargetKind::chessboard, 6, 6)).size(), 4u);
  EXPECT_EQ(target_symmetries(make(TargetKind::circles, 6, 6)).size(), 4u);
  EXPECT_EQ(target_symmetries(make(TargetKind::asymmetric_circles, 4, 11)).size(), 1u);
}

TEST(Target, MarkersLieInWhiteSquares) {
  const CalibrationTarget target = make(TargetKind::charuco, 6, 5);
  EXPECT_EQ(charuco_marker_count(target), 21);
  std::set<std::pair<int, int>> squares;
  for (int i = 0; i < charuco_marker_count(target); ++i) {
    Eigen::Vector2i square;
    const auto corners = charuco_marker(target, i, &square);
    EXPECT_EQ((square.x() + square.y()) % 2, 1);
    EXPECT_TRUE(squares.insert({square.x(), square.y()}).second);
    // The border of a marker is black, what is around it white.
    const double cell = target.detail() / 7;
    EXPECT_TRUE(target_is_black(target, corners[0].x() + 0.5 * cell, corners[0].y() + 0.5 * cell));
    EXPECT_FALSE(target_is_black(target, corners[0].x() - 0.5 * cell, corners[0].y() + 0.5 * cell));
  }
}

TEST(Target, RefusesWhatCannotBePrinted) {
  EXPECT_THROW(make(TargetKind::chessboard, 2, 6).validate(), InputError);
  EXPECT_THROW(make(TargetKind::charuco, 40, 40).validate(), InputError);
  CalibrationTarget target = make(TargetKind::charuco, 9, 6);
  target.detail_m = 0.02;
  EXPECT_THROW(target.validate(), InputError);
  target = make(TargetKind::chessboard, 9, 6);
  target.square_m = -1;
  EXPECT_THROW(target.validate(), InputError);
  EXPECT_THROW((void)target_kind("dots"), InputError);
}

TEST(TargetPdf, FitsTheSheet) {
  const std::string path = (std::filesystem::path(::testing::TempDir()) / "parallax_target.pdf").string();
  for (const auto& original : all_targets) {
    CalibrationTarget target = original;
    for (const Paper sheet : {Paper::a4, Paper::letter}) {
      target.square_m = fitting_square_m(original, sheet);
      EXPECT_GT(target_extent(target).width(), 0.09) << to_string(target.kind);
      write_target_pdf(target, sheet, path);
      const std::string bytes = read_text_file(path);
      EXPECT_EQ(bytes.rfind("%PDF-", 0), 0u);
      EXPECT_NE(bytes.find("%%EOF"), std::string::npos);
      target.square_m += 0.012;
      EXPECT_THROW(write_target_pdf(target, sheet, path), InputError) << to_string(target.kind);
    }
  }
  std::filesystem::remove(path);
  EXPECT_THROW(write_target_pdf(make(TargetKind::chessboard, 9, 6), Paper::a4, "/nowhere/board.pdf"), RunError);
}

}  // namespace
}  // namespace parallax
