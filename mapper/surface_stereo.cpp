#include "mapper/surface_stereo.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "core/check.h"
#include "core/image.h"

namespace parallax {
namespace {

// Neighbours of a pixel that the census asks about, and by how many grey levels they must differ to be different.
constexpr std::array<std::pair<int, int>, 16> kCensus = {{{-2, -2},
                                                          {0, -2},
                                                          {2, -2},
                                                          {-1, -1},
                                                          {0, -1},
                                                          {1, -1},
                                                          {-2, 0},
                                                          {-1, 0},
                                                          {1, 0},
                                                          {2, 0},
                                                          {-1, 1},
                                                          {0, 1},
                                                          {1, 1},
                                                          {-2, 2},
                                                          {0, 2},
                                                          {2, 2}}};
constexpr int kReach = 2;
constexpr double kDifferent = 3;
constexpr std::uint8_t kNoView = 48;  // cost where the neighbours do not see: neither good nor bad, of 64
// Semi-global matching: what a step of one label costs, and of more; the latter less across an edge of the image.
constexpr int kStepPenalty = 6, kJumpPenalty = 70, kLeastJumpPenalty = 18;
constexpr int kMinLabels = 24, kMaxLabels = 64;
constexpr double kLeastFocal = 0.65;  // of the lens's own, for the pinhole that keyframes are seen through
constexpr int kWorstCost = 40;        // of 64: what is no better is not believed
// A pixel is sure of its depth when in a window about it any other than its own and its neighbours' costs so much more.
constexpr int kWindow = 5;      // pixels, no more than twice kReach and one
constexpr int kSureMargin = 1;  // of 64 a pixel
constexpr std::size_t kSameLabels = 2;

// One byte a neighbour of the census: bit 0 brighter, bit 1 darker.
void code_row(const cv::Mat1b& image, const cv::Mat1b& above, const cv::Mat1b& below, int y, std::size_t k,
              unsigned char* __restrict out) {
  const auto [dx, dy] = kCensus[k];
  const unsigned char* __restrict near = image[y + dy] + dx;
  const unsigned char* __restrict high = above[y];
  const unsigned char* __restrict low = below[y];
  const int end = image.cols - kReach;
  for (int x = kReach; x < end; ++x) {
    const auto brighter = static_cast<unsigned char>(near[x] > high[x]);
    const auto darker = static_cast<unsigned char>(near[x] < low[x]);
    out[x] = static_cast<unsigned char>(brighter + 2 * darker);
  }
}

// Adds the bits by which two rows of codes differ.
void add_differences(const unsigned char* __restrict one, const unsigned char* __restrict other, int begin, int end,
                     unsigned char* __restrict sum) {
  for (int x = begin; x < end; ++x) {
    const auto differs = static_cast<unsigned char>(one[x] ^ other[x]);
    sum[x] = static_cast<unsigned char>(sum[x] + (differs & 1) + (differs >> 1));
  }
}

void thresholds(const cv::Mat1b& image, cv::Mat1b* above, cv::Mat1b* below) {
  cv::add(image, cv::Scalar(kDifferent), *above);
  cv::subtract(image, cv::Scalar(kDifferent), *below);
}

// How the warped image differs from the reference's census: 0..32, 255 where it does not see.
void census_cost(const std::vector<cv::Mat1b>& codes, const cv::Mat1b& warped, cv::Mat1b* cost) {
  cv::Mat1b above, below;
  thresholds(warped, &above, &below);
  cost->create(warped.size());
  cost->setTo(255);
  std::vector<unsigned char> code(static_cast<std::size_t>(warped.cols));
  for (int y = kReach; y < warped.rows - kReach; ++y) {
    unsigned char* out = (*cost)[y];
    std::fill(out + kReach, out + warped.cols - kReach, static_cast<unsigned char>(0));
    for (std::size_t k = 0; k < kCensus.size(); ++k) {
      code_row(warped, above, below, y, k, code.data());
      add_differences(code.data(), codes[k][y], kReach, warped.cols - kReach, out);
    }
    const unsigned char* seen = warped[y];
    for (int x = kReach; x < warped.cols - kReach; ++x)
      if (seen[x] == 0) out[x] = 255;
  }
}

}  // namespace

SurfaceCamera::SurfaceCamera(const CameraModel& camera, int largest_width) {
  while (level_ + 1 < kPyramidLevels && (camera.width() >> level_) > largest_width) ++level_;
  const double scale = level_scale(level_);
  const int width = camera.width() >> level_, height = camera.height() >> level_;
  // As wide as the image, as far as that leaves it its sharpness: the widest lenses lose their rim.
  double widest = 1;  // of what the image's edges want, over what the lens's middle has
  const double w = camera.width() - 1.0, h = camera.height() - 1.0;
  for (const Eigen::Vector2d& edge :
       {Eigen::Vector2d(0, h / 2), Eigen::Vector2d(w, h / 2), Eigen::Vector2d(w / 2, 0), Eigen::Vector2d(w / 2, h)}) {
    Eigen::Vector3d along;
    const double reach = (edge - camera.centre_px()).norm() / camera.mean_focal_px();
    widest = std::max(widest, camera.unproject(edge, &along) ? along.head<2>().norm() / reach : 1 / kLeastFocal);
  }
  focal_ = std::max(1 / widest, kLeastFocal) * camera.mean_focal_px() / scale;
  centre_ = level0_to_level(camera.centre_px(), level_);
  map_x_.create(height, width);
  map_y_.create(height, width);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      Eigen::Vector2d px(-10, -10);
      if (!camera.project(ray(x, y), &px) || !camera.in_image(px, 1)) px.setConstant(-1e4);
      const Eigen::Vector2d at = level0_to_level(px, level_);
      map_x_(y, x) = static_cast<float>(at.x());
      map_y_(y, x) = static_cast<float>(at.y());
    }
  }
}

cv::Mat1b SurfaceCamera::see(const cv::Mat1b& image_of_level) const {
  cv::Mat1b out;
  cv::remap(cv::max(image_of_level, 1), out, map_x_, map_y_, cv::INTER_LINEAR, cv::BORDER_CONSTANT, cv::Scalar(0));
  return out;
}

// Labels are even steps of the inverse of the distance below the camera, as disparities are.
double SurfaceStereo::height(double label) const { return camera_height_ - 1 / (first_ + spacing_ * label); }

void SurfaceStereo::begin(SurfaceView reference, std::vector<SurfaceView> neighbours, double lowest_m,
                          double highest_m) {
  PARALLAX_CHECK(!neighbours.empty() && neighbours.size() <= said_.size(), "stereo wants one to four neighbours");
  reference_ = std::move(reference);
  neighbours_ = std::move(neighbours);
  camera_height_ = reference_.camera_from_plane.inverse().t.z();
  first_ = 1 / (camera_height_ - lowest_m);
  const double last = 1 / (camera_height_ - highest_m);
  double baseline = 0;
  for (const SurfaceView& view : neighbours_)
    baseline =
        std::max(baseline, (view.camera_from_plane.inverse().t - reference_.camera_from_plane.inverse().t).norm());
  labels_ =
      std::clamp(static_cast<int>(std::ceil(camera_.focal_px() * baseline * (last - first_))), kMinLabels, kMaxLabels);
  spacing_ = (last - first_) / (labels_ - 1);
  const cv::Size size = camera_.size();
  cv::Mat1b above, below;
  thresholds(reference_.image, &above, &below);
  codes_.resize(kCensus.size());
  for (std::size_t k = 0; k < kCensus.size(); ++k) {
    codes_[k].create(size);
    for (int y = kReach; y < size.height - kReach; ++y) code_row(reference_.image, above, below, y, k, codes_[k][y]);
  }
  const std::size_t all = static_cast<std::size_t>(size.area()) * static_cast<std::size_t>(labels_);
  cost_.assign(all, kNoView);
  smoothed_.assign(all, 0);
  depth_ = cv::Mat1f::zeros(size);
  sure_ = cv::Mat1b::zeros(size);
  stage_ = Stage::compare;
  next_ = 0;
}

bool SurfaceStereo::step() {
  const int rows = camera_.size().height;
  switch (stage_) {
    case Stage::idle:
      return false;
    case Stage::compare: {
      const int n = static_cast<int>(neighbours_.size());
      compare(next_ / n, static_cast<std::size_t>(next_ % n));
      if (++next_ % n == 0) choose(next_ / n - 1);
      if (next_ == n * labels_) {
        stage_ = Stage::forwards;
        next_ = 0;
        for (auto& paths : paths_) paths.assign(4 * static_cast<std::size_t>(camera_.size().width * labels_), 0);
      }
      return true;
    }
    case Stage::forwards:
      smooth_row(next_++, 1);
      if (next_ == rows) stage_ = Stage::backwards;
      return true;
    case Stage::backwards:
      smooth_row(--next_, -1);
      decide_row(next_);
      if (next_ > 0) return true;
      stage_ = Stage::idle;
  }
  return false;
}

// What a neighbour says of a label.
void SurfaceStereo::compare(int label, std::size_t neighbour) {
  const RigidTransform& from_plane = reference_.camera_from_plane;
  const Eigen::Vector3d normal = from_plane.R.col(2);
  const double distance = normal.dot(from_plane * Eigen::Vector3d(0, 0, height(label)));
  Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
  K(0, 0) = K(1, 1) = camera_.focal_px();
  K.block<2, 1>(0, 2) = camera_.centre_px();
  const RigidTransform there_from_here = neighbours_[neighbour].camera_from_plane * from_plane.inverse();
  const Eigen::Matrix3d H = K * (there_from_here.R + there_from_here.t * normal.transpose() / distance) * K.inverse();
  cv::Matx33d matrix;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) matrix(r, c) = H(r, c);
  cv::warpPerspective(neighbours_[neighbour].image, warped_, matrix, camera_.size(),
                      cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_CONSTANT, cv::Scalar(0));
  census_cost(codes_, warped_, &said_[neighbour]);
}

// What they say of it together.
void SurfaceStereo::choose(int label) {
  const cv::Size size = camera_.size();
  const std::size_t n = neighbours_.size();
  // The better half: what hides a place hides it from one side.
  const auto stride = static_cast<std::size_t>(labels_);
  for (int y = 0; y < size.height; ++y) {
    std::uint8_t* out = &cost_[static_cast<std::size_t>(y * size.width) * stride + static_cast<std::size_t>(label)];
    const unsigned char* mine = reference_.image[y];
    for (int x = 0; x < size.width; ++x, out += stride) {
      if (mine[x] == 0) continue;
      int best = 255, second = 255, seeing = 0;
      for (std::size_t i = 0; i < n; ++i) {
        const int c = said_[i](y, x);
        seeing += c != 255;
        if (c < best) {
          second = best;
          best = c;
        } else if (c < second) {
          second = c;
        }
      }
      if (seeing == 0) continue;
      *out = static_cast<std::uint8_t>(seeing < 3 ? 2 * best : best + second);
    }
  }
}

void SurfaceStereo::smooth_row(int row, int direction) {
  const int width = camera_.size().width;
  const auto L = static_cast<std::size_t>(labels_);
  auto& now = paths_[row & 1];
  const auto& before = paths_[(row & 1) ^ 1];
  const bool first = direction > 0 ? row == 0 : row == camera_.size().height - 1;
  const auto path = [&](int kind, int x) {
    return (static_cast<std::size_t>(kind) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)) * L;
  };
  const cv::Mat1b& image = reference_.image;
  const int last_row = row - direction;
  for (int i = 0; i < width; ++i) {
    const int x = direction > 0 ? i : width - 1 - i;
    const std::size_t here =
        (static_cast<std::size_t>(row) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)) * L;
    const std::uint8_t* cost = &cost_[here];
    std::uint16_t* sum = &smoothed_[here];
    for (int kind = 0; kind < 4; ++kind) {
      // 0 along the row; the others from the row before: straight and across.
      const int from_x = kind == 0 ? x - direction : x + (kind == 1 ? 0 : kind == 2 ? -1 : 1);
      std::uint16_t* out = &now[path(kind, x)];
      if (from_x < 0 || from_x >= width || (kind > 0 && first)) {
        for (std::size_t l = 0; l < L; ++l) {
          out[l] = cost[l];
          sum[l] = static_cast<std::uint16_t>(sum[l] + out[l]);
        }
        continue;
      }
      const std::uint16_t* last = kind == 0 ? &now[path(0, from_x)] : &before[path(kind, from_x)];
      const int edge = std::abs(image(row, x) - image(kind == 0 ? row : last_row, from_x));
      const auto jump = static_cast<std::uint16_t>(std::max(kLeastJumpPenalty, kJumpPenalty * 6 / (6 + edge)));
      std::uint16_t least = last[0];
      for (std::size_t l = 1; l < L; ++l) least = std::min(least, last[l]);
      const auto far = static_cast<std::uint16_t>(least + jump);
      const auto at = [&](std::size_t l, std::uint16_t a, std::uint16_t b) {
        const std::uint16_t stay = std::min(last[l], far);
        const auto step = static_cast<std::uint16_t>(std::min(a, b) + kStepPenalty);
        out[l] = static_cast<std::uint16_t>(cost[l] + std::min(stay, step) - least);
        sum[l] = static_cast<std::uint16_t>(sum[l] + out[l]);
      };
      at(0, last[1], last[1]);
      for (std::size_t l = 1; l + 1 < L; ++l) at(l, last[l - 1], last[l + 1]);
      at(L - 1, last[L - 2], last[L - 2]);
    }
  }
}

void SurfaceStereo::decide_row(int row) {
  const int width = camera_.size().width;
  const RigidTransform& from_plane = reference_.camera_from_plane;
  const Eigen::Vector3d normal = from_plane.R.col(2);
  const auto L = static_cast<std::size_t>(labels_);
  // Costs summed over a window about the pixel, column by column.
  constexpr int kHalf = kWindow / 2;
  const int rows = camera_.size().height;
  std::vector<std::uint16_t> columns(static_cast<std::size_t>(width) * L, 0);
  for (int y = std::max(0, row - kHalf); y <= std::min(rows - 1, row + kHalf); ++y) {
    const std::uint8_t* cost = &cost_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) * L];
    for (std::size_t i = 0; i < columns.size(); ++i) columns[i] = static_cast<std::uint16_t>(columns[i] + cost[i]);
  }
  std::vector<std::uint16_t> window(L, 0);
  for (int x = 0; x < kWindow - 1; ++x)
    for (std::size_t l = 0; l < L; ++l)
      window[l] = static_cast<std::uint16_t>(window[l] + columns[static_cast<std::size_t>(x) * L + l]);
  const auto take_columns = [&](int x) {
    const std::uint16_t* in = &columns[static_cast<std::size_t>(x + kHalf) * L];
    for (std::size_t l = 0; l < L; ++l) window[l] = static_cast<std::uint16_t>(window[l] + in[l]);
    if (x - kHalf - 1 < 0) return;
    const std::uint16_t* out = &columns[static_cast<std::size_t>(x - kHalf - 1) * L];
    for (std::size_t l = 0; l < L; ++l) window[l] = static_cast<std::uint16_t>(window[l] - out[l]);
  };
  for (int x = kReach; x < width - kReach; ++x) {
    const std::size_t here =
        (static_cast<std::size_t>(row) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)) * L;
    const std::uint16_t* sum = &smoothed_[here];
    take_columns(x);
    const auto best = static_cast<std::size_t>(std::min_element(sum, sum + L) - sum);
    if (cost_[here + best] > kWorstCost || best + 1 >= L) continue;
    double label = static_cast<double>(best);
    if (best > 0) {
      const double a = sum[best - 1], b = sum[best], c = sum[best + 1];
      if (a + c > 2 * b) label += 0.5 * (a - c) / (a + c - 2 * b);
    }
    const double along = normal.dot(camera_.ray(x, row));
    const double distance = normal.dot(from_plane * Eigen::Vector3d(0, 0, height(label)));
    if (!(along < -1e-3)) continue;  // does not come down to the plane
    depth_(row, x) = static_cast<float>(distance / along);
    int inside = 65535, outside = 65535;
    for (std::size_t l = 0; l < L; ++l) {
      int& least = l + kSameLabels >= best && l <= best + kSameLabels ? inside : outside;
      least = std::min<int>(least, window[l]);
    }
    if (outside - inside >= kSureMargin * kWindow * kWindow) sure_(row, x) = 255;
  }
}

}  // namespace parallax
