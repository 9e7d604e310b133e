#include "tracker/point_matcher.h"

#include <algorithm>
#include <cmath>

#include "core/descriptor_search.h"

namespace parallax {
namespace {

// Corners of the frame described per level: coarse ones survive blur, fine ones are exact.
constexpr std::array<int, kPyramidLevels> kCorners = {350, 350, 200, 80};
constexpr int kMaxDistance = 64;   // bits of 256
constexpr int kRatioPercent = 85;  // nearest to the nearest of another place
constexpr double kSamePlace =
    0.02;                  // points so near each other, in parts of the depth they were seen at, are one place
constexpr int kCell = 20;  // corners are spread over cells of this size, pixels of the level

struct FrameCorner {
  BinaryDescriptor descriptor;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // level 0
  int level = 0;
  std::uint8_t orientation = 0;
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
    for (const Corner& c : maximal_corners(image, frame.corners[level]))
      scored.push_back({c, shi_tomasi_score(image, c.x, c.y), 0});
    std::sort(scored.begin(), scored.end(), [](const Scored& a, const Scored& b) {
      if (a.score != b.score) return a.score > b.score;
      return a.corner.y != b.corner.y ? a.corner.y < b.corner.y : a.corner.x < b.corner.x;
    });
    const int columns = image.cols / kCell + 1;
    std::vector<int> in_cell(static_cast<std::size_t>(columns) * (image.rows / kCell + 1), 0);
    for (Scored& s : scored)
      s.rank = in_cell[static_cast<std::size_t>(s.corner.y / kCell) * columns + s.corner.x / kCell]++;
    std::stable_sort(scored.begin(), scored.end(), [](const Scored& a, const Scored& b) { return a.rank < b.rank; });
    const GreyImage smooth = smooth_for_descriptors(image);
    int taken = 0;
    for (const Scored& s : scored) {
      if (taken >= kCorners[level]) break;
      FrameCorner corner;
      if (!describe_corner(image, smooth, s.corner.x, s.corner.y, &corner.descriptor, &corner.orientation)) continue;
      corner.pixel = level_to_level0(Eigen::Vector2d(s.corner.x, s.corner.y), level);
      corner.level = level;
      out.push_back(corner);
      ++taken;
    }
  }
  return out;
}

}  // namespace

bool PointMatcher::is_current(const Described& entry, const TrackingSnapshot& map, int row) const {
  return entry.source == map.keyframes[map.source[row]].id && entry.source_level == map.source_level[row] &&
         entry.source_pixel == map.source_pixel[row];
}

bool PointMatcher::prepare(const TrackingSnapshot& map, int max_keyframes) {
  if (map.map_version != map_version_) clear();
  map_version_ = map.map_version;
  std::vector<std::vector<int>> missing(map.keyframes.size());
  std::size_t known = 0;
  for (int row = 0; row < map.size(); ++row) {
    const auto it = described_.find(map.id[row].index);
    if (it != described_.end()) ++known;
    if (it == described_.end() || !is_current(it->second, map, row)) missing[map.source[row]].push_back(row);
  }
  if (described_.size() > 2 * known + 1000) {  // most were deleted since
    std::unordered_map<std::int32_t, Described> kept;
    for (const PointId id : map.id)
      if (const auto it = described_.find(id.index); it != described_.end()) kept.insert(*it);
    described_ = std::move(kept);
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
      entry.source_level = level;
      entry.source_pixel = map.source_pixel[row];
      entry.ok =
          describe_corner(image, smooth[level], static_cast<int>(std::lround(entry.source_pixel.x())),
                          static_cast<int>(std::lround(entry.source_pixel.y())), &entry.descriptor, &entry.orientation);
      described_[map.id[row].index] = entry;
    }
  }
  return done > 0;
}

std::vector<PoseObservation> PointMatcher::match(const TrackingSnapshot& map, const FrameImages& frame,
                                                 std::vector<double>* turns) const {
  if (turns) turns->clear();
  if (map.map_version != map_version_) return {};
  std::vector<BinaryDescriptor> descriptors;
  std::vector<int> rows;
  std::vector<std::uint8_t> orientations;
  for (int row = 0; row < map.size(); ++row) {
    const auto it = described_.find(map.id[row].index);
    if (it == described_.end() || !it->second.ok || !is_current(it->second, map, row)) continue;
    descriptors.push_back(it->second.descriptor);
    rows.push_back(row);
    orientations.push_back(it->second.orientation);
  }
  if (rows.empty()) return {};
  const DescriptorSet points(descriptors);
  const std::vector<FrameCorner> corners = describe_frame(frame);
  // For each corner its nearest point; a point keeps its nearest corner.
  struct Best {
    int distance = kMaxDistance + 1;
    int corner = -1;
  };
  std::vector<Best> best_of_point(rows.size());
  std::vector<std::uint16_t> distances;
  for (std::size_t c = 0; c < corners.size(); ++c) {
    const int first = points.distances(corners[c].descriptor, &distances);
    if (first > kMaxDistance) continue;
    const auto nearest = static_cast<std::size_t>(
        std::find(distances.begin(), distances.end(), static_cast<std::uint16_t>(first)) - distances.begin());
    if (first >= best_of_point[nearest].distance) continue;
    // No rival may come as near as this; the same place mapped twice (two levels, two keyframes) is none.
    const auto too_near = static_cast<std::uint16_t>((100 * first - 1) / kRatioPercent);
    const Eigen::Vector3d& place = map.position[rows[nearest]];
    const double reach = kSamePlace * map.keyframes[map.source[rows[nearest]]].mean_depth;
    bool clear_winner = true;
    for (std::size_t block = 0; block < distances.size() && clear_winner; block += DescriptorSet::kBlock) {
      std::uint16_t any = 0;
      for (std::size_t p = block; p < block + DescriptorSet::kBlock; ++p)
        any = static_cast<std::uint16_t>(any | (distances[p] <= too_near));
      if (!any) continue;
      for (std::size_t p = block; p < std::min(block + DescriptorSet::kBlock, rows.size()); ++p)
        if (distances[p] <= too_near && (map.position[rows[p]] - place).squaredNorm() > reach * reach)
          clear_winner = false;
    }
    if (clear_winner) best_of_point[nearest] = {first, static_cast<int>(c)};
  }
  std::vector<std::size_t> matched;
  for (std::size_t p = 0; p < rows.size(); ++p)
    if (best_of_point[p].corner >= 0) matched.push_back(p);
  std::stable_sort(matched.begin(), matched.end(),
                   [&](std::size_t a, std::size_t b) { return best_of_point[a].distance < best_of_point[b].distance; });
  std::vector<PoseObservation> out;
  for (const std::size_t p : matched) {
    const FrameCorner& corner = corners[static_cast<std::size_t>(best_of_point[p].corner)];
    out.push_back({map.position[rows[p]], corner.pixel, level_scale(corner.level)});
    if (turns) turns->push_back(2 * M_PI / kDescriptorOrientations * (corner.orientation - orientations[p]));
  }
  return out;
}

}  // namespace parallax
