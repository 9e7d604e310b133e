#include "render/occlusion_edges.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "core/check.h"
#include "core/error.h"

namespace parallax {
namespace {

constexpr int kStepsMost = 17;  // for a reach of 4
constexpr float kStep_px = 0.5f;

// A place of an outline: between two pixels of which one is much nearer.
struct OutlinePlace {
  Eigen::Vector2f at, normal;            // the normal points to what is farther
  float near = 0, far = 0;               // depths to either side; far is 0 where nothing stands
  std::array<float, kStepsMost> edge{};  // how strong the image's edge is at each distance
  float moves = 0;
};

float bilinear(const cv::Mat1f& image, float x, float y) {
  x = std::clamp(x, 0.0f, static_cast<float>(image.cols) - 1.001f);
  y = std::clamp(y, 0.0f, static_cast<float>(image.rows) - 1.001f);
  const int column = static_cast<int>(x), row = static_cast<int>(y);
  const float a = x - static_cast<float>(column), b = y - static_cast<float>(row);
  const float *upper = image[row] + column, *lower = image[row + 1] + column;
  return (1 - b) * ((1 - a) * upper[0] + a * upper[1]) + b * ((1 - a) * lower[0] + a * lower[1]);
}

class EdgeAlignment {
 public:
  EdgeAlignment(const cv::Mat1f& grey, const cv::Mat1f& inverse_ground, const OcclusionEdgeOptions& options,
                cv::Mat1f* depth)
      : options_(options),
        depth_(depth),
        half_(std::min(static_cast<int>(std::lround(options.reach / kStep_px)), kStepsMost / 2)) {
    find(inverse_ground);
    if (places_.empty()) return;
    look(grey);
    decide();
    move();
  }

 private:
  int steps() const { return 2 * half_ + 1; }

  void find(const cv::Mat1f& inverse_ground) {
    const int rows = depth_->rows, columns = depth_->cols;
    cv::Mat1f inverse(rows, columns);
    for (int y = 0; y < rows; ++y)
      for (int x = 0; x < columns; ++x)
        inverse(y, x) = (*depth_)(y, x) > 0 ? 1 / (*depth_)(y, x) : inverse_ground(y, x);
    cv::Mat1f smooth, dx, dy;
    cv::GaussianBlur(inverse, smooth, {7, 7}, 1.6);
    cv::Sobel(smooth, dx, CV_32F, 1, 0);
    cv::Sobel(smooth, dy, CV_32F, 0, 1);
    index_ = cv::Mat2i(rows, columns, cv::Vec2i(-1, -1));
    const float least = 1 + static_cast<float>(options_.least_jump);
    for (int y = 0; y + 1 < rows; ++y) {
      for (int x = 0; x + 1 < columns; ++x) {
        for (int below = 0; below < 2; ++below) {
          const int x2 = x + 1 - below, y2 = y + below;
          const float a = inverse(y, x), b = inverse(y2, x2);
          if (!(std::max(a, b) > least * std::min(a, b))) continue;
          OutlinePlace place;
          place.at = Eigen::Vector2f(static_cast<float>(x + x2), static_cast<float>(y + y2)) / 2;
          place.near = a > b ? (*depth_)(y, x) : (*depth_)(y2, x2);
          place.far = a > b ? (*depth_)(y2, x2) : (*depth_)(y, x);
          if (!(place.near > 0)) continue;  // the plane before something: at its foot
          place.normal = -Eigen::Vector2f(dx(y, x) + dx(y2, x2), dy(y, x) + dy(y2, x2));
          const float length = place.normal.norm();
          if (!(length > 0)) continue;
          // Of a slanting outline's two kinds of steps one is enough.
          if (std::abs(place.normal[below]) < std::abs(place.normal[1 - below])) continue;
          place.normal /= length;
          index_(y, x)[below] = static_cast<int>(places_.size());
          places_.push_back(place);
        }
      }
    }
  }

  void look(const cv::Mat1f& grey) {
    cv::Mat1f smooth, dx, dy;
    cv::GaussianBlur(grey, smooth, {3, 3}, 0.7);
    cv::Sobel(smooth, dx, CV_32F, 1, 0, 3, 1.0 / 8);
    cv::Sobel(smooth, dy, CV_32F, 0, 1, 3, 1.0 / 8);
    const float noise = static_cast<float>(options_.noise * options_.noise);
    for (OutlinePlace& place : places_) {
      for (int k = 0; k < steps(); ++k) {
        const Eigen::Vector2f at = place.at + static_cast<float>(k - half_) * kStep_px * place.normal;
        const float slope =
            place.normal.x() * bilinear(dx, at.x(), at.y()) + place.normal.y() * bilinear(dy, at.x(), at.y());
        place.edge[static_cast<std::size_t>(k)] = slope * slope / (slope * slope + noise);
      }
    }
  }

  // Places on the same outline, near by.
  template <class Each>
  void for_neighbours(const OutlinePlace& place, const Each& each) const {
    const int reach = options_.together, x0 = static_cast<int>(place.at.x()), y0 = static_cast<int>(place.at.y());
    for (int y = std::max(0, y0 - reach); y <= std::min(depth_->rows - 1, y0 + reach); ++y) {
      for (int x = std::max(0, x0 - reach); x <= std::min(depth_->cols - 1, x0 + reach); ++x) {
        for (int below = 0; below < 2; ++below) {
          if (index_(y, x)[below] < 0) continue;
          const OutlinePlace& other = places_[static_cast<std::size_t>(index_(y, x)[below])];
          if (place.normal.dot(other.normal) > 0.8f && std::abs(place.near - other.near) < 0.1f * place.near)
            each(other);
        }
      }
    }
  }

  void decide() {
    std::vector<float> moves(places_.size());
    for (std::size_t i = 0; i < places_.size(); ++i) {
      std::array<float, kStepsMost> sum{};
      float count = 0;
      for_neighbours(places_[i], [&](const OutlinePlace& other) {
        for (int k = 0; k < steps(); ++k) sum[static_cast<std::size_t>(k)] += other.edge[static_cast<std::size_t>(k)];
        ++count;
      });
      int best = half_;
      float most = -1;
      for (int k = 0; k < steps(); ++k) {
        const float off = static_cast<float>(k - half_) / static_cast<float>(std::max(1, half_));
        const float worth = sum[static_cast<std::size_t>(k)] / count - static_cast<float>(options_.stay) * off * off;
        if (worth > most) {
          most = worth;
          best = k;
        }
      }
      moves[i] = static_cast<float>(best - half_) * kStep_px;
    }
    for (std::size_t i = 0; i < places_.size(); ++i) places_[i].moves = moves[i];
  }

  // Every pixel in reach is on the side of the nearest place's new outline that it lies on.
  void move() {
    const int reach = static_cast<int>(std::ceil(options_.reach)) + 1;
    cv::Mat1f distance(depth_->size(), std::numeric_limits<float>::max());
    cv::Mat1i nearest(depth_->size(), -1);
    for (std::size_t i = 0; i < places_.size(); ++i) {
      const OutlinePlace& place = places_[i];
      const int x0 = static_cast<int>(place.at.x()), y0 = static_cast<int>(place.at.y());
      for (int y = std::max(0, y0 - reach); y <= std::min(depth_->rows - 1, y0 + reach); ++y) {
        for (int x = std::max(0, x0 - reach); x <= std::min(depth_->cols - 1, x0 + reach); ++x) {
          const float far = (Eigen::Vector2f(static_cast<float>(x), static_cast<float>(y)) - place.at).squaredNorm();
          if (far >= distance(y, x)) continue;
          distance(y, x) = far;
          nearest(y, x) = static_cast<int>(i);
        }
      }
    }
    for (int y = 0; y < depth_->rows; ++y) {
      for (int x = 0; x < depth_->cols; ++x) {
        if (nearest(y, x) < 0) continue;
        const OutlinePlace& place = places_[static_cast<std::size_t>(nearest(y, x))];
        const float side = place.normal.dot(Eigen::Vector2f(static_cast<float>(x), static_cast<float>(y)) - place.at);
        if (side > 0 && side <= place.moves) (*depth_)(y, x) = place.near;
        if (side < 0 && side >= place.moves) (*depth_)(y, x) = place.far;
      }
    }
  }

  const OcclusionEdgeOptions& options_;
  cv::Mat1f* depth_;
  const int half_;
  std::vector<OutlinePlace> places_;
  cv::Mat2i index_;  // of the place to the right of a pixel, and of that below it
};

}  // namespace

void OcclusionEdgeOptions::validate() const {
  const auto want = [](bool good, const char* field, double found, const char* expected) {
    if (!good)
      throw InputError(std::string("occlusion.edges.") + field + ": found " + std::to_string(found) + ", expected " +
                       expected);
  };
  want(reach >= 0 && reach <= 4, "reach", reach, "0 to 4");
  want(least_jump > 0, "least_jump", least_jump, "more than 0");
  want(noise > 0, "noise", noise, "more than 0");
  want(together >= 0 && together <= 16, "together", together, "0 to 16");
  want(stay >= 0, "stay", stay, "at least 0");
}

void align_to_edges(const cv::Mat1f& grey, const cv::Mat1f& inverse_ground, const OcclusionEdgeOptions& options,
                    cv::Mat1f* depth) {
  PARALLAX_CHECK(grey.size() == depth->size() && inverse_ground.size() == depth->size(), "images of one size");
  if (options.reach > 0) EdgeAlignment(grey, inverse_ground, options, depth);
}

}  // namespace parallax
