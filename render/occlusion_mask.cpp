#include "render/occlusion_mask.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>

#include "core/error.h"
#include "render/occlusion_edges.h"

namespace parallax {
namespace {

constexpr int kBlock = 8;  // cells along a side

struct Span {
  double from, to;
};

// Where along a ray the coordinate lies between two values.
Span within(double origin, double direction, double low, double high) {
  if (std::abs(direction) < 1e-12) {
    const bool inside = origin >= low && origin < high;
    return inside ? Span{-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()}
                  : Span{1, 0};
  }
  const double a = (low - origin) / direction, b = (high - origin) / direction;
  return {std::min(a, b), std::max(a, b)};
}

// Walks over the squares of a grid that a ray crosses, from one distance to another.
class GridWalk {
 public:
  GridWalk(const Eigen::Vector2d& corner, double side, const Eigen::Vector3d& from, const Eigen::Vector3d& along,
           double start)
      : at_(start) {
    for (int k = 0; k < 2; ++k) {
      const double place = (from[k] + start * along[k] - corner[k]) / side;
      square_[k] = static_cast<int>(std::floor(place));
      const bool rising = along[k] > 0;
      move_[k] = rising ? 1 : -1;
      if (std::abs(along[k]) < 1e-12) {
        next_[k] = pace_[k] = std::numeric_limits<double>::infinity();
      } else {
        pace_[k] = side / std::abs(along[k]);
        next_[k] = (corner[k] + side * (square_[k] + (rising ? 1 : 0)) - from[k]) / along[k];
      }
    }
  }
  double enters() const { return at_; }
  double leaves() const { return std::min(next_[0], next_[1]); }
  int column() const { return square_[0]; }
  int row() const { return square_[1]; }
  void go_on() {
    const int k = next_[0] < next_[1] ? 0 : 1;
    at_ = std::max(at_, next_[k]);
    next_[k] += pace_[k];
    square_[k] += move_[k];
  }

 private:
  double at_, next_[2], pace_[2];
  int square_[2], move_[2];
};

// The three pixels to the right of one, below it and across, from the four corners, when these lie on one plane or on
// nothing: inverse depth is linear over the image of a plane.
bool fill_between(int x, int y, cv::Mat1f* depth) {
  constexpr float kSameSurface = 1.02f, kFlat = 0.006f;
  if (x + 2 >= depth->cols || y + 2 >= depth->rows) return false;
  const float corners[] = {(*depth)(y, x), (*depth)(y, x + 2), (*depth)(y + 2, x), (*depth)(y + 2, x + 2)};
  const auto [least, most] = std::minmax_element(std::begin(corners), std::end(corners));
  if (*most == 0) return true;
  if (!(*least > 0) || *most > kSameSurface * *least) return false;
  const float a = 1 / corners[0], b = 1 / corners[1], c = 1 / corners[2], d = 1 / corners[3];
  if (std::abs(a + d - b - c) > kFlat * a) return false;
  (*depth)(y, x + 1) = 2 / (a + b);
  (*depth)(y + 1, x) = 2 / (a + c);
  (*depth)(y + 1, x + 1) = 4 / (a + b + c + d);
  return true;
}

}  // namespace

void OcclusionMaskOptions::validate() const {
  const auto want = [](bool good, const char* field, double found, const char* expected) {
    if (!good)
      throw InputError(std::string("occlusion.") + field + ": found " + std::to_string(found) + ", expected " +
                       expected);
  };
  want(width >= 16, "width", width, "at least 16");
  edges.validate();
}

OcclusionMask::OcclusionMask(const CameraModel& camera, const OcclusionMaskOptions& options)
    : options_((options.validate(), options)) {
  const double scale = static_cast<double>(camera.width()) / options_.width;
  rows_ = std::max(1, static_cast<int>(std::lround(camera.height() / scale)));
  const double scale_y = static_cast<double>(camera.height()) / rows_;
  for (int y = 0; y < rows_; ++y) {
    for (int x = 0; x < options_.width; ++x) {
      Eigen::Vector3d ray;
      if (!camera.unproject({(x + 0.5) * scale - 0.5, (y + 0.5) * scale_y - 0.5}, &ray)) ray.setZero();
      rays_.push_back(ray);
    }
  }
}

void OcclusionMask::note(const SceneSurface& surface) {
  if (noted_ == surface.height_m.data() && noted_version_ == surface.version) return;
  noted_ = surface.height_m.data();
  noted_version_ = surface.version;
  block_columns_ = (surface.columns + kBlock - 1) / kBlock;
  block_rows_ = (surface.rows + kBlock - 1) / kBlock;
  block_height_.assign(static_cast<std::size_t>(block_columns_) * static_cast<std::size_t>(block_rows_), 0);
  highest_ = 0;
  for (int row = 0; row < surface.rows; ++row) {
    for (int column = 0; column < surface.columns; ++column) {
      const float height = surface.height_m[surface.index(column, row)];
      float& block = block_height_[static_cast<std::size_t>(row / kBlock) * static_cast<std::size_t>(block_columns_) +
                                   static_cast<std::size_t>(column / kBlock)];
      block = std::max(block, height);
      highest_ = std::max(highest_, static_cast<double>(height));
    }
  }
}

// How far along a ray, in lengths of `along`, it meets something that stands on the plane; 0: nothing.
double OcclusionMask::meet(const SceneSurface& surface, const Eigen::Vector3d& from,
                           const Eigen::Vector3d& along) const {
  const Span up = within(from.z(), along.z(), 0, highest_);
  const Span x =
      within(from.x(), along.x(), surface.corner_m.x(), surface.corner_m.x() + surface.columns * surface.cell_m);
  const Span y =
      within(from.y(), along.y(), surface.corner_m.y(), surface.corner_m.y() + surface.rows * surface.cell_m);
  const double start = std::max({0.0, up.from, x.from, y.from}), end = std::min({up.to, x.to, y.to});
  if (!(start < end)) return 0;
  const auto lowest = [&](double a, double b) { return from.z() + along.z() * (along.z() < 0 ? b : a); };
  GridWalk blocks(surface.corner_m, kBlock * surface.cell_m, from, along, start);
  for (; blocks.enters() < end; blocks.go_on()) {
    if (blocks.column() < 0 || blocks.row() < 0 || blocks.column() >= block_columns_ || blocks.row() >= block_rows_)
      continue;  // by rounding, at the rim
    const float height =
        block_height_[static_cast<std::size_t>(blocks.row()) * static_cast<std::size_t>(block_columns_) +
                      static_cast<std::size_t>(blocks.column())];
    const double leave = std::min(blocks.leaves(), end);
    if (!(height > 0) || height <= lowest(blocks.enters(), leave)) continue;
    GridWalk cells(surface.corner_m, surface.cell_m, from, along, blocks.enters());
    for (; cells.enters() < leave; cells.go_on()) {
      if (!surface.contains(cells.column(), cells.row())) continue;
      const double h = surface.height_m[surface.index(cells.column(), cells.row())];
      const double out = std::min(cells.leaves(), leave);
      if (!(h > 0) || h <= lowest(cells.enters(), out)) continue;
      const double at = from.z() + along.z() * cells.enters(), leaves = from.z() + along.z() * out;
      if (at > h) return (h - from.z()) / along.z();  // through its top
      if (surface.filled.empty()) return cells.enters();
      const std::uint64_t filled = surface.filled[surface.index(cells.column(), cells.row())];
      // The highest box ends at the height, which may be a little over or under its own top.
      const int level = std::clamp(static_cast<int>(at / surface.cell_m), 0,
                                   std::max(0, static_cast<int>(std::bit_width(filled)) - 1));
      if (filled >> level & 1) return cells.enters();  // through a side
      // Down onto what is under a gap, or up against what is over it.
      const std::uint64_t under = filled & ((std::uint64_t{1} << level) - 1), over = filled >> level;
      if (along.z() < 0 && under) {
        const double top = surface.cell_m * std::bit_width(under);
        if (leaves < top) return (top - from.z()) / along.z();
      } else if (along.z() > 0 && over) {
        const double bottom = surface.cell_m * (level + std::countr_zero(over));
        if (leaves > bottom) return (bottom - from.z()) / along.z();
      }
    }
  }
  return 0;
}

cv::Mat1f OcclusionMask::update(const SceneSurface& surface, const RigidTransform& camera_from_world,
                                const GreyImage& image) {
  cv::Mat1f depth(rows_, options_.width, 0.0f);
  if (surface.empty()) return depth;
  note(surface);
  if (!(highest_ > 0)) return depth;
  const RigidTransform plane_from_camera = (camera_from_world * surface.world_from_plane).inverse();
  if (!(plane_from_camera.t.z() > 0)) return depth;
  const auto ask = [&](int x, int y) {
    const Eigen::Vector3d& ray =
        rays_[static_cast<std::size_t>(y) * static_cast<std::size_t>(options_.width) + static_cast<std::size_t>(x)];
    if (ray.z() > 0) depth(y, x) = static_cast<float>(meet(surface, plane_from_camera.t, plane_from_camera.R * ray));
  };
  // Every second pixel of every second row, and between them where these do not lie on one plane.
  for (int y = 0; y < rows_; y += 2)
    for (int x = 0; x < options_.width; x += 2) ask(x, y);
  for (int y = 0; y < rows_; y += 2)
    for (int x = 0; x < options_.width; x += 2)
      if (!fill_between(x, y, &depth))
        for (const auto& [right, down] : {std::pair(1, 0), std::pair(0, 1), std::pair(1, 1)})
          if (x + right < options_.width && y + down < rows_) ask(x + right, y + down);
  if (!image.empty() && options_.edges.reach > 0) align(plane_from_camera, image, &depth);
  return depth;
}

void OcclusionMask::align(const RigidTransform& plane_from_camera, const GreyImage& image, cv::Mat1f* depth) const {
  cv::Mat1f ground(depth->size()), grey;
  const Eigen::Vector3d closer = -plane_from_camera.R.row(2).transpose() / plane_from_camera.t.z();
  for (std::size_t i = 0; i < rays_.size(); ++i)
    ground(static_cast<int>(i)) = static_cast<float>(std::max(0.0, closer.dot(rays_[i])));
  cv::Mat small;
  cv::resize(image, small, depth->size(), 0, 0, cv::INTER_AREA);
  small.convertTo(grey, CV_32F);
  align_to_edges(grey, ground, options_.edges, depth);
}

}  // namespace parallax
