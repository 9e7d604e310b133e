#include "place/place_features.h"

#include <algorithm>
#include <array>
#include <tuple>

#include "core/fast.h"

namespace parallax {
namespace {

// The top level is too small to tell places apart.
constexpr int kLevels = 3;

struct Candidate {
  float score = 0;
  int level = 0, x = 0, y = 0;
};

bool is_better(const Candidate& a, const Candidate& b) {
  return std::tuple(-a.score, a.level, a.y, a.x) < std::tuple(-b.score, b.level, b.y, b.x);
}

}  // namespace

std::vector<PlaceFeature> extract_place_features(const ImagePyramid& pyramid, const PlaceFeatureOptions& options) {
  const int columns = (pyramid.width() + options.cell_px - 1) / options.cell_px;
  const int rows = (pyramid.height() + options.cell_px - 1) / options.cell_px;
  std::vector<std::vector<Candidate>> cells(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
  for (int level = 0; level < kLevels; ++level) {
    const GreyImage& image = pyramid.level[static_cast<std::size_t>(level)];
    if (image.cols <= 2 * kDescriptorBorder || image.rows <= 2 * kDescriptorBorder) break;
    CornerList corners;
    fast_corners(image, options.fast_threshold, &corners);
    for (const Corner& c : maximal_corners(image, corners)) {
      if (c.x < kDescriptorBorder || c.y < kDescriptorBorder || c.x >= image.cols - kDescriptorBorder ||
          c.y >= image.rows - kDescriptorBorder)
        continue;
      const Eigen::Vector2d at = level_to_level0({c.x, c.y}, level);
      const auto cell = static_cast<std::size_t>(static_cast<int>(at.y()) / options.cell_px * columns +
                                                 static_cast<int>(at.x()) / options.cell_px);
      cells[cell].push_back({shi_tomasi_score(image, c.x, c.y), level, c.x, c.y});
    }
  }
  for (auto& cell : cells) std::sort(cell.begin(), cell.end(), is_better);
  std::array<GreyImage, kPyramidLevels> smooth;
  std::vector<PlaceFeature> out;
  for (std::size_t rank = 0; static_cast<int>(out.size()) < options.count; ++rank) {
    std::vector<Candidate> round;
    for (const auto& cell : cells)
      if (rank < cell.size()) round.push_back(cell[rank]);
    if (round.empty()) break;
    std::sort(round.begin(), round.end(), is_better);
    for (const Candidate& c : round) {
      if (static_cast<int>(out.size()) >= options.count) break;
      const auto level = static_cast<std::size_t>(c.level);
      if (smooth[level].empty()) smooth[level] = smooth_for_descriptors(pyramid.level[level]);
      PlaceFeature feature;
      if (!describe_corner(pyramid.level[level], smooth[level], c.x, c.y, &feature.descriptor)) continue;
      feature.pixel = level_to_level0({c.x, c.y}, c.level).cast<float>();
      feature.level = c.level;
      out.push_back(feature);
    }
  }
  return out;
}

std::vector<BinaryDescriptor> descriptors_of(const std::vector<PlaceFeature>& features) {
  std::vector<BinaryDescriptor> out;
  out.reserve(features.size());
  for (const PlaceFeature& feature : features) out.push_back(feature.descriptor);
  return out;
}

}  // namespace parallax
