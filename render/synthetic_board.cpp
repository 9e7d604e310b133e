#include "render/synthetic_board.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <opencv2/core.hpp>
#include <random>
#include <vector>

#include "render/synthetic_hand.h"
#include "render/synthetic_paint.h"

namespace parallax {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

constexpr int kColumns = kSyntheticBoardColumns, kRows = kSyntheticBoardRows;
constexpr double kSquare = kSyntheticBoardSquare_m;
// The sheet: the squares around the inner corners, and one square of white paper around those.
constexpr double kSheetLeft = -2 * kSquare, kSheetTop = -2 * kSquare;
constexpr double kSheetWidth = (kColumns + 3) * kSquare, kSheetHeight = (kRows + 3) * kSquare;
// Texels a square: a multiple of kTextureAlign, so that edges lie between texels at every level of detail.
constexpr int kSquareTexels = 128;
static_assert(kSquareTexels % kTextureAlign == 0);
constexpr double kBlack = 26, kWhite = 226;

double unit_noise(std::uint64_t seed, int index) {  // -1..1
  std::mt19937_64 random(seed * 0x9e3779b97f4a7c15u + static_cast<std::uint64_t>(index) * 0xbf58476d1ce4e5b9u);
  return static_cast<double>(random() >> 11) * 0x1p-52 - 1;
}

paint::Picture sheet(SyntheticBoardKind kind) {
  const cv::Size size = texture_size((kColumns + 3) * kSquareTexels, (kRows + 3) * kSquareTexels);
  paint::Picture out = paint::plain(size, cv::Scalar::all(kWhite));
  const auto texel = [](double squares) { return static_cast<int>(squares * kSquareTexels); };
  if (kind == SyntheticBoardKind::chessboard) {
    for (int row = 0; row <= kRows; ++row)
      for (int column = row % 2; column <= kColumns; column += 2)
        out(cv::Rect(texel(column + 1), texel(row + 1), kSquareTexels, kSquareTexels)).setTo(cv::Scalar::all(kBlack));
    return out;
  }
  // Discs, each texel as dark as the share of it that is covered.
  constexpr int kParts = 4;
  const double radius = 0.25 * kSquareTexels;
  for (int row = 0; row < kRows; ++row)
    for (int column = 0; column < kColumns; ++column) {
      const int cx = texel(column + 2), cy = texel(row + 2), reach = static_cast<int>(radius) + 2;
      for (int y = -reach; y < reach; ++y)
        for (int x = -reach; x < reach; ++x) {
          int covered = 0;
          for (int part = 0; part < kParts * kParts; ++part)
            covered += std::hypot(x + (part % kParts + 0.5) / kParts, y + (part / kParts + 0.5) / kParts) <= radius;
          const double grey = kWhite + (kBlack - kWhite) * covered / (kParts * kParts);
          out(cy + y, cx + x) = cv::Vec3b::all(cv::saturate_cast<uchar>(grey));
        }
    }
  return out;
}

// Where the board is to be seen.
struct BoardView {
  double across, down;          // its middle: -1..1 over the image, as far as the whole board stays inside
  double tilt_x, tilt_y, roll;  // radians, against facing the camera
  double size;                  // of the image's width
};

constexpr std::array<BoardView, kBoardViews> kViews = {{
    {0, 0, 0, 0, 0, 0.5},
    {0, 0, 0, 0.55, 0.05, 0.5},
    {-1, -1, 0, 0, 0, 0.5},
    {0.1, 0, 0, -0.55, -0.05, 0.5},
    {1, 1, 0, 0, 0, 0.5},
    {0, 0, 0.55, 0, 0, 0.5},
    {1, -1, 0, 0, 0, 0.5},
    {0, 0.1, -0.55, 0, 0, 0.5},
    {-1, 1, 0, 0, 0, 0.5},
    {0, 0, 0.1, 0.05, 0.1, 0.8},
    {0.2, -0.1, 0, 0.1, -0.1, 0.28},
    {-1, 0, 0.2, 0.5, 0.2, 0.5},
    {1, 0, -0.2, -0.5, -0.2, 0.5},
    {0, -1, 0.5, 0.1, 0, 0.5},
    {0, 1, -0.5, -0.1, 0, 0.5},
    {-1, -1, -0.3, 0.4, 0.1, 0.42},
    {1, 1, 0.3, -0.4, 0.1, 0.42},
    {1, -1, -0.3, -0.4, -0.1, 0.42},
    {-1, 1, 0.3, 0.4, -0.1, 0.42},
    {0, 0, 0.3, 0.3, 0.3, 0.62},
}};

bool sees_all(const CameraModel& camera, const RigidTransform& camera_from_board) {
  // What is printed and a little of the paper around it.
  const double margin = 1.3 * kSquare, border_px = 0.008 * camera.width();
  constexpr int kSteps = 6;
  for (int i = 0; i <= kSteps; ++i)
    for (int j = 0; j <= kSteps; ++j) {
      const double x = -margin + i * ((kColumns - 1) * kSquare + 2 * margin) / kSteps;
      const double y = -margin + j * ((kRows - 1) * kSquare + 2 * margin) / kSteps;
      const Vector3d p = camera_from_board * Vector3d(x, y, 0);
      Vector2d px;
      if (p.z() < 0.2 * p.norm() || !camera.project(p, &px) || !camera.in_image(px, border_px)) return false;
    }
  return true;
}

RigidTransform camera_from_board(const CameraModel& camera, const BoardView& view) {
  const Vector3d middle(0.5 * (kColumns - 1) * kSquare, 0.5 * (kRows - 1) * kSquare, 0);
  const Vector2d half(0.5 * camera.width(), 0.5 * camera.height());
  RigidTransform pose;
  double size = view.size;
  for (int shrunk = 0; shrunk < 20; ++shrunk, size *= 0.95) {
    const double distance = (kColumns + 1) * kSquare * camera.mean_focal_px() / (size * camera.width());
    for (double reach = 1; reach > 0.01; reach *= 0.95) {
      const Vector2d px = half + Vector2d(0.9 * reach * view.across * half.x(), 0.9 * reach * view.down * half.y());
      Vector3d sight;
      if (!camera.unproject(px, &sight)) continue;
      sight.normalize();
      const Eigen::Matrix3d R = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), sight).toRotationMatrix() *
                                exp_so3(Vector3d(view.tilt_x, view.tilt_y, view.roll));
      pose = RigidTransform(R, sight * distance - R * middle);
      if (sees_all(camera, pose)) return pose;
      if (view.across == 0 && view.down == 0) break;
    }
  }
  return pose;
}

double board_step(double x) {
  x = std::clamp(x, 0.0, 1.0);
  return x * x * x * (x * (6 * x - 15) + 10);
}

}  // namespace

RigidTransform world_from_synthetic_board() {
  const HandMotion::State hand;
  const RigidTransform world_from_hand = hand.world_from_camera();
  // On the hand's axis, turned towards it; so far along it that the sheet's lower edge touches the table.
  const Vector3d right = world_from_hand.R.col(0), down = world_from_hand.R.col(1), into = world_from_hand.R.col(2);
  const double lowest = 0.5 * kSheetHeight * -down.z() + 0.002;
  const Vector3d middle = hand.position + into * ((lowest - hand.position.z()) / into.z());
  Eigen::Matrix3d R;
  R << right, down, into;
  return {R, middle - R * Vector3d(0.5 * (kColumns - 1) * kSquare, 0.5 * (kRows - 1) * kSquare, 0)};
}

SyntheticScene build_board_scene(std::uint64_t seed, SyntheticBoardKind kind) {
  cv::RNG rng(0xb0a2d000u + seed * 7919u);
  for (int i = 0; i < 20; ++i) rng.next();
  SyntheticScene scene;
  const auto picture = [&](double width_px, double height_px, auto painter) {
    return scene.add_texture(painter(texture_size(width_px, height_px), rng));
  };
  const auto wood = [](double px_per_metre, const cv::Scalar& colour) {
    return [=](cv::Size s, cv::RNG& r) { return paint::wood(s, px_per_metre, colour, r); };
  };
  constexpr double kTablePx = 700, kHalfWidth = 0.8, kFront = -0.75, kBack = 0.5, kFloor = -0.7;
  const double depth = kBack - kFront;
  const int edge = picture(512, 32, wood(500, {60, 96, 130}));
  scene.add_box({0, 0.5 * (kBack + kFront)}, -0.03, {2 * kHalfWidth, depth, 0.03}, 0,
                picture(2 * kHalfWidth * kTablePx, depth * kTablePx, wood(kTablePx, {86, 136, 184})), edge, edge);

  // The board, and the box it leans on: its front's upper edge touches the sheet from behind.
  const RigidTransform world_from_board = world_from_synthetic_board();
  const Eigen::Matrix3d& R = world_from_board.R;
  const Vector3d corner = world_from_board * Vector3d(kSheetLeft, kSheetTop, 0);
  scene.add_rectangle(corner, kSheetWidth * R.col(0), kSheetHeight * R.col(1), scene.add_texture(sheet(kind)));
  const Vector3d behind = 0.003 * R.col(2);
  scene.add_rectangle(corner + behind, kSheetWidth * R.col(0), kSheetHeight * R.col(1),
                      picture(256, 192, paint::cardboard), true);
  const Vector3d middle = corner + behind + 0.5 * kSheetWidth * R.col(0) + 0.5 * kSheetHeight * R.col(1);
  const int box = picture(256, 160, paint::cardboard);
  const double box_depth = 0.09, box_height = middle.z() - 0.002;
  scene.add_box({middle.x(), middle.y() + 0.5 * box_depth + 0.001}, 0.0005, {0.22, box_depth, box_height}, 0, box, box,
                box);

  // A few things around it, and the room.
  const auto lay = [&](double x, double y, double z, double yaw) {
    const Vector3d ex(std::cos(yaw), std::sin(yaw), 0), ey(-std::sin(yaw), std::cos(yaw), 0);
    scene.add_rectangle(Vector3d(x, y, z) - 0.105 * ex + 0.1485 * ey, 0.21 * ex, -0.297 * ey,
                        picture(224, 320, paint::printed_page));
  };
  lay(-0.47, -0.28, 0.0010, 0.25);
  lay(-0.55, -0.22, 0.0014, -0.2);
  lay(0.40, -0.30, 0.0018, -0.3);
  const auto book = [&](double x, double y, double bottom, double yaw) {
    const int cover = picture(192, 288, paint::book_cover), pages = picture(192, 32, paint::page_edges);
    scene.add_box({x, y}, bottom, {0.16, 0.23, 0.028}, yaw, cover, pages, pages);
  };
  book(-0.52, 0.12, 0.0005, 0.3);
  book(-0.51, 0.12, 0.0290, 0.1);
  book(0.46, 0.06, 0.0005, -0.4);
  scene.add_can({0.30, -0.16}, 0.0005, 0.04, 0.1, 0.8, picture(384, 160, paint::can_label),
                picture(32, 32,
                        [](cv::Size s, cv::RNG&) {
                          return paint::plain(s, {26, 40, 62});
                        }),
                true);
  const double side = 1.7, back = 0.85, front = -1.9, top = 1.7;
  const Vector3d fall(0, 0, kFloor - top);
  const int wall = picture(512, 352, [](cv::Size s, cv::RNG& r) { return paint::plaster(s, {188, 198, 202}, r); });
  scene.add_rectangle({-side, back, top}, {2 * side, 0, 0}, fall, wall);
  scene.add_rectangle({-side, front, top}, {0, back - front, 0}, fall, wall);
  scene.add_rectangle({side, back, top}, {0, front - back, 0}, fall, wall);
  scene.add_rectangle({side, front, top}, {-2 * side, 0, 0}, fall, wall);
  scene.add_rectangle({-side, back, kFloor}, {2 * side, 0, 0}, {0, front - back, 0},
                      picture(512, 416, [](cv::Size s, cv::RNG& r) {
                        return paint::carpet(s, {92, 80, 74}, r);
                      }));
  for (const double x : {-0.75, -0.15, 0.45})
    scene.add_rectangle({x, back - 0.004, 0.95}, {0.42, 0, 0}, {0, 0, -0.56}, picture(224, 288, paint::poster));
  return scene;
}

SyntheticMotion board_motion(const CameraModel& camera, std::uint64_t seed) {
  // Two rounds are made ahead; the second is repeated for as long as anybody looks.
  constexpr int kPeriod = kBoardStillFrames + kBoardMovingFrames;
  const auto views = std::make_shared<std::vector<RigidTransform>>();
  const RigidTransform board_from_world = world_from_synthetic_board().inverse();
  for (int i = 0; i < 2 * kBoardViews; ++i) {
    BoardView view = kViews[static_cast<std::size_t>(i % kBoardViews)];
    const double away = i < kBoardViews ? 0.02 : 0.12;
    view.tilt_x += away * unit_noise(seed, 8 * i);
    view.tilt_y += away * unit_noise(seed, 8 * i + 1);
    view.roll += away * unit_noise(seed, 8 * i + 2);
    view.size *= 1 + away * unit_noise(seed, 8 * i + 3);
    views->push_back((camera_from_board(camera, view) * board_from_world).inverse());
  }
  const auto tremor = std::make_shared<const HandTremor>(seed);
  SyntheticMotion motion;
  motion.world_from_camera = [views, tremor](int frame, double offset_s) {
    const int step = frame / kPeriod;
    const auto view = [&](int i) {
      return (*views)[static_cast<std::size_t>(i < kBoardViews ? i : kBoardViews + i % kBoardViews)];
    };
    const double moved = (frame % kPeriod + offset_s * kSyntheticFps - kBoardStillFrames) / kBoardMovingFrames;
    const RigidTransform a = view(step), b = view(step + 1);
    const RigidTransform pose = a * RigidTransform::exp((a.inverse() * b).log() * board_step(moved));
    return pose * tremor->at(frame / kSyntheticFps + offset_s);
  };
  motion.label = [](int) { return FrameLabel{}; };
  motion.gain = [](int frame) { return 1 + 0.03 * std::sin(0.31 * frame / kSyntheticFps); };
  motion.cover = [](int) { return 0.0; };
  return motion;
}

}  // namespace parallax
