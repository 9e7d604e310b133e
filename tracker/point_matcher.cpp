#include "tracker/point_matcher.h"

#include <algorithm>
#include <cmath>

namespace parallax {
namespace {

// Corners of the frame described per level: coarse ones survive blur, fine ones are exact.
constexpr std::array<int, kPyramidLevels> kCorners = {350, 350, 200, 80};
constexpr int kMaxDistance = 64;        // bits of 256
constexpr double kRatio = 0.85;         // nearest to second nearest
constexpr int kCell = 20;               // corners are spread over cells of this size, pixels of the level

struct FrameCorner {
  BinaryDescriptor descriptor;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // level 0
  int level = 0;
};

std::vector<FrameCorner> describe_frame(const FrameImages& frame) {
  std::vector<FrameCorner> out;
  for (int level = 0; level < kPyramidLevels; ++level) {
    const GreyImage& image = frame.pyramid.level[level];
    struct Scored {
      Corner corner;
      double score;
      int rank;
    };
    std::vector<Scored> scored;
    for (const Corner& c : maximal_corners(image, frame.corners[level])) scored.push_back({c, shi_tomasi_score(image, c.x, c.y), 0});
    std::sort(scored.begin(), scored.end(), [](const Scored& a, const Scored& b) {
      if (a.score != b.score) return a.score > b.score;
      return a.corner.y != b.corner.y ? a.corner.y < b.corner.y : a.corner.x < b.corner.x;
    });
    const int columns = image.cols / kCell + 1;
    std::vector<int> in_cell(static_cast<std::size_t>(columns) * (image.rows / kCell + 1), 0);
    for (Scored& s : scored) s.rank = in_cell[static_cast<std::size_t>(s.corner.y / kCell) * columns + s.corner.x / kCell]++;
    std::stable_sort(scored.begin(), scored.end(), [](const Scored& a, const Scored& b) { return a.rank < b.rank; });
    const GreyImage smooth = smooth_for_descriptors(image);
    int taken = 0;
    for (const Scored& s : scored) {
      if (taken >= kCorners[level]) break;
      FrameCorner corner;
      if (!describe_corner(image, smooth, s.corner.x, s.corner.y, &corner.descriptor)) continue;
      corner.pixel = level_to_level0(Eigen::Vector2d(s.corner.x, s.corner.y), level);
      corner.level = level;
      out.push_back(corner);
      ++taken;
    }
  }
  return out;
}

}  // namespace

bool PointMatcher::prepare(const TrackingSnapshot& map, int max_keyframes) {
  std::vector<std::vector<int>> missing(map.keyframes.size());
  for (int row = 0; row < map.size(); ++row) {
    const auto it = described_.find(map.id[row].index);
    const bool known = it != described_.end() && it->second.source == map.keyframes[map.source[row]].id &&
                       it->second.source_pixel == map.source_pixel[row];
    if (!known) missing[map.source[row]].push_back(row);
  }
  int done = 0;
  for (std::size_t k = 0; k < missing.size() && done < max_keyframes; ++k) {
    if (missing[k].empty()) continue;
    ++done;
    const SnapshotKeyframe& source = map.keyframes[k];
    std::array<GreyImage, kPyramidLevels> smooth;
    for (int row : missing[k]) {
      const int level = map.source_level[row];
      const GreyImage& image = source.images->pyramid.level[level];
      if (smooth[level].empty()) smooth[level] = smooth_for_descriptors(image);
      Described entry;
      entry.source = source.id;
      entry.source_pixel = map.source_pixel[row];
      entry.ok = describe_corner(image, smooth[level], static_cast<int>(std::lround(entry.source_pixel.x())),
                                 static_cast<int>(std::lround(entry.source_pixel.y())), &entry.descriptor);
      described_[map.id[row].index] = entry;
    }
  }
  return done > 0;
}

std::vector<PoseObservation> PointMatcher::match(const TrackingSnapshot& map, const FrameImages& frame) const {
  const std::vector<FrameCorner> corners = describe_frame(frame);
  struct Point {
    BinaryDescriptor descriptor;
    int row;
  };
  std::vector<Point> points;
  for (int row = 0; row < map.size(); ++row) {
    const auto it = described_.find(map.id[row].index);
    if (it != described_.end() && it->second.ok) points.push_back({it->second.descriptor, row});
  }
  // For each corner its nearest point; a point keeps its nearest corner.
  struct Best {
    int distance = kMaxDistance + 1;
    int corner = -1;
  };
  std::vector<Best> best_of_point(points.size());
  for (std::size_t c = 0; c < corners.size(); ++c) {
    int first = 257, second = 257;
    std::size_t nearest = 0;
    for (std::size_t p = 0; p < points.size(); ++p) {
      const int distance = hamming(corners[c].descriptor, points[p].descriptor);
      if (distance < first) {
        // The same spot mapped twice (two levels, two keyframes) is no rival.
        second = points.empty() || first > 256 ||
                         (map.position[points[p].row] - map.position[points[nearest].row]).norm() >
                             0.02 * map.keyframes.front().mean_depth
                     ? first
                     : second;
        first = distance;
        nearest = p;
      } else if (distance < second && (map.position[points[p].row] - map.position[points[nearest].row]).norm() >
                                          0.02 * map.keyframes.front().mean_depth) {
        second = distance;
      }
    }
    if (first > kMaxDistance || first > kRatio * second) continue;
    if (first < best_of_point[nearest].distance) best_of_point[nearest] = {first, static_cast<int>(c)};
  }
  std::vector<PoseObservation> out;
  for (std::size_t p = 0; p < points.size(); ++p) {
    if (best_of_point[p].corner < 0) continue;
    const FrameCorner& corner = corners[static_cast<std::size_t>(best_of_point[p].corner)];
    out.push_back({map.position[points[p].row], corner.pixel, level_scale(corner.level)});
  }
  return out;
}

}  // namespace parallax
