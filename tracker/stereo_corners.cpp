#include "tracker/stereo_corners.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace parallax {
namespace {

constexpr int kBlock = 7;    // pixels, of the gradient matrix
constexpr int kMargin = 5;   // round a cell, that its rim is scored as its middle
constexpr int kPerCell = 4;  // corners at most, of one cell in one call

struct Cell {
  cv::Rect area;
  int taken = 0;
};

struct Candidate {
  float score;
  int x, y;
};

// Positions in buckets as wide as the distance: who is near is in one of nine.
class Neighbourhood {
 public:
  Neighbourhood(cv::Size size, double distance)
      : distance_(distance),
        columns_(static_cast<int>(size.width / distance) + 1),
        rows_(static_cast<int>(size.height / distance) + 1),
        buckets_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_)) {}
  void add(const Eigen::Vector2d& p) {
    if (p.x() >= 0 && p.y() >= 0) buckets_[bucket(column(p.x()), row(p.y()))].push_back(p);
  }
  bool is_free(const Eigen::Vector2d& p) const {
    for (int r = std::max(0, row(p.y()) - 1); r <= std::min(rows_ - 1, row(p.y()) + 1); ++r)
      for (int c = std::max(0, column(p.x()) - 1); c <= std::min(columns_ - 1, column(p.x()) + 1); ++c)
        for (const Eigen::Vector2d& other : buckets_[bucket(c, r)])
          if ((other - p).squaredNorm() < distance_ * distance_) return false;
    return true;
  }

 private:
  int column(double x) const { return std::min(columns_ - 1, static_cast<int>(x / distance_)); }
  int row(double y) const { return std::min(rows_ - 1, static_cast<int>(y / distance_)); }
  std::size_t bucket(int c, int r) const {
    return static_cast<std::size_t>(r) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(c);
  }

  double distance_;
  int columns_, rows_;
  std::vector<std::vector<Eigen::Vector2d>> buckets_;
};

// Maxima of the score within a cell, best first.
void corners_of(const GreyImage& image, const Cell& cell, double min_score, std::vector<Candidate>* out) {
  out->clear();
  const cv::Rect wide = cv::Rect(cell.area.x - kMargin, cell.area.y - kMargin, cell.area.width + 2 * kMargin,
                                 cell.area.height + 2 * kMargin) &
                        cv::Rect(0, 0, image.cols, image.rows);
  cv::Mat1f score;
  cv::cornerMinEigenVal(image(wide), score, kBlock, 3);
  // OpenCV's is the mean over the block of (twice the gradient / 255) squared.
  const float least = static_cast<float>(min_score * 4 / (255.0 * 255.0));
  for (int y = cell.area.y - wide.y; y < cell.area.y - wide.y + cell.area.height; ++y) {
    const float* row = score[y];
    for (int x = cell.area.x - wide.x; x < cell.area.x - wide.x + cell.area.width; ++x) {
      const float s = row[x];
      if (s < least || x < 1 || y < 1 || x + 1 >= score.cols || y + 1 >= score.rows) continue;
      const float *above = score[y - 1], *below = score[y + 1];
      if (s < row[x - 1] || s <= row[x + 1] || s < above[x - 1] || s < above[x] || s < above[x + 1] ||
          s <= below[x - 1] || s <= below[x] || s <= below[x + 1])
        continue;
      out->push_back({s, x + wide.x, y + wide.y});
    }
  }
  std::sort(out->begin(), out->end(), [](const Candidate& a, const Candidate& b) { return a.score > b.score; });
}

}  // namespace

std::vector<Eigen::Vector2d> find_stereo_corners(const GreyImage& image, const std::vector<Eigen::Vector2d>& taken,
                                                 const CornerSearch& search) {
  std::vector<Eigen::Vector2d> found;
  const int missing = search.wanted - static_cast<int>(taken.size());
  const int width = image.cols - 2 * search.border_px, height = image.rows - 2 * search.border_px;
  if (missing <= 0 || width < 8 || height < 8) return found;
  // Cells of about the area that a tenth of the tracks would have if they were spread evenly.
  const double side = std::clamp(std::sqrt(4.0 * width * height / search.wanted), 24.0, 96.0);
  const int columns = std::max(1, static_cast<int>(std::lround(width / side)));
  const int rows = std::max(1, static_cast<int>(std::lround(height / side)));
  std::vector<Cell> cells;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      const int x0 = search.border_px + width * c / columns, x1 = search.border_px + width * (c + 1) / columns;
      const int y0 = search.border_px + height * r / rows, y1 = search.border_px + height * (r + 1) / rows;
      cells.push_back({cv::Rect(x0, y0, x1 - x0, y1 - y0), 0});
    }
  Neighbourhood near(image.size(), search.min_distance_px);
  for (const Eigen::Vector2d& p : taken) {
    near.add(p);
    const int c = static_cast<int>((p.x() - search.border_px) * columns / width);
    const int r = static_cast<int>((p.y() - search.border_px) * rows / height);
    if (c >= 0 && r >= 0 && c < columns && r < rows)
      ++cells[static_cast<std::size_t>(r) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(c)].taken;
  }
  const int even = (search.wanted + columns * rows - 1) / (columns * rows);
  std::erase_if(cells, [&](const Cell& cell) { return cell.taken >= even + 1; });
  std::stable_sort(cells.begin(), cells.end(), [](const Cell& a, const Cell& b) { return a.taken < b.taken; });
  std::vector<Candidate> candidates;
  for (const Cell& cell : cells) {
    corners_of(image, cell, search.min_score, &candidates);
    const int room = std::min(kPerCell, even + 1 - cell.taken);
    int added = 0;
    for (const Candidate& candidate : candidates) {
      if (added >= room || static_cast<int>(found.size()) >= missing) break;
      const Eigen::Vector2d p(candidate.x, candidate.y);
      if (!near.is_free(p) || (!search.mask.empty() && search.mask(candidate.y, candidate.x) == 0)) continue;
      near.add(p);
      found.push_back(p);
      ++added;
    }
    if (static_cast<int>(found.size()) >= missing) break;
  }
  return found;
}

}  // namespace parallax
