#include "render/synthetic_stereo_source.h"

#include <utility>

namespace parallax {

namespace {

constexpr double kRightGain = 1.015;  // no two cameras are alike

}  // namespace

SyntheticStereoSource::SyntheticStereoSource(std::unique_ptr<SyntheticSource> left)
    : left_(std::move(left)),
      right_from_left_(Eigen::Matrix3d::Identity(), Eigen::Vector3d(-left_->options().baseline_m, 0, 0)) {}

Frame SyntheticStereoSource::right_of(int index) { return left_->frame_beside(index, right_from_left_, kRightGain, 1); }

std::optional<StereoFrame> SyntheticStereoSource::next() {
  auto left = left_->next();
  if (!left) return std::nullopt;
  Frame right = right_of(left->index);
  return StereoFrame{std::move(*left), std::move(right)};
}

StereoFrame SyntheticStereoSource::frame(int index) { return {left_->frame(index), right_of(index)}; }

std::optional<StereoCalibration> SyntheticStereoSource::calibration() const {
  const CameraModel& camera = left_->options().camera;
  return StereoCalibration{camera, camera, right_from_left_};
}

std::unique_ptr<SyntheticStereoSource> open_synthetic_stereo_source(const std::string& name,
                                                                    const SourceOptions& options, int threads) {
  return std::make_unique<SyntheticStereoSource>(open_synthetic_source(name, options, threads));
}

}  // namespace parallax
