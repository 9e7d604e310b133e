#include "mapper/salient_points.h"

#include <algorithm>
#include <cmath>

namespace parallax {
namespace {

// Half a search patch and a pixel for its gradients.
constexpr int kBorder = 6;
// In a view that measures and gives few points, this part of the threshold will do.
constexpr double kWeakScore = 0.25;
// A cell of the spreading grid, in pixels of the level.
constexpr int kCell = 16;

// Marks discs of a level's image as taken.
class Occupancy {
 public:
  Occupancy(int width, int height, double radius)
      : width_(width), height_(height), radius_(radius), taken_(static_cast<std::size_t>(width) * height, 0) {}

  bool taken(int x, int y) const { return taken_[static_cast<std::size_t>(y) * width_ + x] != 0; }
  void mark(const Eigen::Vector2d& p) {
    const int r = static_cast<int>(std::ceil(radius_));
    const int px = static_cast<int>(std::lround(p.x())), py = static_cast<int>(std::lround(p.y()));
    for (int y = std::max(0, py - r); y <= std::min(height_ - 1, py + r); ++y)
      for (int x = std::max(0, px - r); x <= std::min(width_ - 1, px + r); ++x)
        if ((Eigen::Vector2d(x, y) - p).squaredNorm() < radius_ * radius_)
          taken_[static_cast<std::size_t>(y) * width_ + x] = 1;
  }

 private:
  int width_, height_;
  double radius_;
  std::vector<std::uint8_t> taken_;
};

}  // namespace

std::vector<SalientPoint> find_salient_points(const FrameImages& images, const std::vector<Measurement>& measured,
                                              const MapperOptions& options) {
  std::vector<SalientPoint> out;
  int strong = static_cast<int>(measured.size());
  const double area = static_cast<double>(images.pyramid.width()) * images.pyramid.height() / (640.0 * 480.0);
  for (int level = 0; level < kPyramidLevels; ++level) {
    const GreyImage& image = images.pyramid.level[level];
    Occupancy occupied(image.cols, image.rows, options.min_spacing_px);
    for (const Measurement& m : measured) {
      // A point measured at a much coarser level does not stand in the way of a fine one.
      if (std::abs(m.level - level) <= 1) occupied.mark(level0_to_level(m.pixel, level));
    }
    std::vector<SalientPoint> found;
    for (const Corner& c : maximal_corners(image, images.corners[level])) {
      if (c.x < kBorder || c.y < kBorder || c.x >= image.cols - kBorder || c.y >= image.rows - kBorder) continue;
      if (occupied.taken(c.x, c.y)) continue;
      const double score = shi_tomasi_score(image, c.x, c.y);
      if (score < kWeakScore * options.min_shi_tomasi[level]) continue;
      found.push_back({level, Eigen::Vector2d(c.x, c.y), score});
    }
    std::sort(found.begin(), found.end(), [](const SalientPoint& a, const SalientPoint& b) {
      if (a.score != b.score) return a.score > b.score;
      return a.pixel.y() != b.pixel.y() ? a.pixel.y() < b.pixel.y() : a.pixel.x() < b.pixel.x();
    });
    // Spread: every cell gives its best before any gives its second best.
    const int columns = image.cols / kCell + 1, rows = image.rows / kCell + 1;
    std::vector<int> in_cell(static_cast<std::size_t>(columns) * rows, 0);
    const int limit = std::max(5, static_cast<int>(options.max_new_points[level] * area));
    std::vector<std::pair<int, int>> order;  // rank in cell, index
    std::vector<int> accepted;
    for (int i = 0; i < static_cast<int>(found.size()); ++i) {
      const int x = static_cast<int>(found[i].pixel.x()), y = static_cast<int>(found[i].pixel.y());
      if (occupied.taken(x, y)) continue;
      occupied.mark(found[i].pixel);
      order.emplace_back(in_cell[static_cast<std::size_t>(y / kCell) * columns + x / kCell]++, i);
    }
    std::stable_sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    int taken = 0;
    for (const auto& [rank, index] : order) {
      if (taken >= limit) break;
      const bool weak = found[index].score < options.min_shi_tomasi[level];
      if (weak && strong >= options.wanted_points * area) continue;
      out.push_back(found[index]);
      ++taken;
      ++strong;
    }
  }
  return out;
}

}  // namespace parallax
