// A textured plane seen through homographies: frames with exactly known image motion.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "core/image.h"

namespace parallax::test {

// Texture with detail at every scale and many corners, larger than the frames cut from it.
class PlanarScene {
 public:
  static constexpr int kOversample = 2;
  static constexpr int kMargin_px = 400;  // of the texture around the first frame, frame pixels

  PlanarScene(int width, int height, unsigned seed) : width_(width), height_(height) {
    cv::RNG rng(seed);
    const cv::Size size((width + 2 * kMargin_px) * kOversample, (height + 2 * kMargin_px) * kOversample);
    cv::Mat1f texture(size, 120.0F);
    for (int cell : {256, 64, 16}) {
      cv::Mat1f noise(size.height / cell + 2, size.width / cell + 2);
      rng.fill(noise, cv::RNG::NORMAL, 0, cell == 16 ? 12 : 20);
      cv::Mat1f large;
      cv::resize(noise, large, size, 0, 0, cv::INTER_CUBIC);
      texture += large;
    }
    const int shapes = size.area() / 1800;
    for (int i = 0; i < shapes; ++i) {
      const cv::Point2f at(rng.uniform(0.0F, static_cast<float>(size.width)),
                           rng.uniform(0.0F, static_cast<float>(size.height)));
      const cv::Size2f extent(rng.uniform(6.0F, 50.0F), rng.uniform(6.0F, 50.0F));
      cv::Point2f corners[4];
      cv::RotatedRect(at, extent, rng.uniform(0.0F, 360.0F)).points(corners);
      cv::Point whole[4];
      for (int k = 0; k < 4; ++k) whole[k] = corners[k];
      cv::fillConvexPoly(texture, whole, 4, cv::Scalar(rng.uniform(20, 235)), cv::LINE_AA);
    }
    cv::GaussianBlur(texture, texture_, cv::Size(), 1.4);
  }

  // The frame in which a pixel p of the first frame appears at `frame_from_first` * p. Noise in grey levels.
  cv::Mat1b render(const Eigen::Matrix3d& frame_from_first, double gain = 1, double offset = 0, double noise = 0,
                   unsigned noise_seed = 1) const {
    Eigen::Matrix3d texture_from_first;
    texture_from_first << kOversample, 0, kOversample * kMargin_px, 0, kOversample, kOversample * kMargin_px, 0, 0, 1;
    const Eigen::Matrix3d texture_from_frame = texture_from_first * frame_from_first.inverse();
    cv::Mat1d m(3, 3);
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) m(r, c) = texture_from_frame(r, c);
    }
    cv::Mat1f frame;
    cv::warpPerspective(texture_, frame, m, cv::Size(width_, height_), cv::INTER_CUBIC | cv::WARP_INVERSE_MAP,
                        cv::BORDER_REFLECT);
    frame = frame * gain + offset;
    if (noise > 0) {
      cv::RNG rng(noise_seed);
      cv::Mat1f n(frame.size());
      rng.fill(n, cv::RNG::NORMAL, 0, noise);
      frame += n;
    }
    cv::Mat1b out;
    frame.convertTo(out, CV_8U);
    return out;
  }

  Eigen::Vector2d centre() const { return {0.5 * (width_ - 1), 0.5 * (height_ - 1)}; }

 private:
  int width_, height_;
  cv::Mat1f texture_;
};

inline std::shared_ptr<const ImagePyramid> pyramid_of(const cv::Mat1b& image) {
  auto p = std::make_shared<ImagePyramid>();
  build_pyramid(image, p.get());
  return p;
}

inline Eigen::Vector2d apply(const Eigen::Matrix3d& H, const Eigen::Vector2d& p) {
  return (H * p.homogeneous()).hnormalized();
}

// Rotation by `angle` and scaling about `centre`, then a shift, with a perspective part (1/px).
inline Eigen::Matrix3d similarity(const Eigen::Vector2d& centre, double angle, double scale,
                                  const Eigen::Vector2d& shift, const Eigen::Vector2d& perspective = {0, 0}) {
  Eigen::Matrix3d to_centre = Eigen::Matrix3d::Identity(), back = to_centre, H = to_centre;
  to_centre.topRightCorner<2, 1>() = -centre;
  back.topRightCorner<2, 1>() = centre + shift;
  H(0, 0) = H(1, 1) = scale * std::cos(angle);
  H(1, 0) = scale * std::sin(angle);
  H(0, 1) = -H(1, 0);
  H(2, 0) = perspective.x();
  H(2, 1) = perspective.y();
  return back * H * to_centre;
}

}  // namespace parallax::test
