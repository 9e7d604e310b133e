// A synthetic sequence (render/synthetic_source.h) seen by two cameras side by side: the sequence's own is the left
// one, and the right one, with the same lens, is `baseline` metres to its right. Rectified when the lens is a
// pinhole's, as that of `synthetic:building` is. The right camera has noise of its own and is a little brighter.
//
// Frames are a pure function of name and index, as those of one camera. Not thread-safe: one thread at a time.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "camera/stereo_source.h"
#include "render/synthetic_source.h"

namespace parallax {

class SyntheticStereoSource final : public StereoSource {
 public:
  explicit SyntheticStereoSource(std::unique_ptr<SyntheticSource> left);

  std::optional<StereoFrame> next() override;
  std::vector<SourceWarning> take_warnings() override { return {}; }
  int frame_count() const override { return left_->frame_count(); }
  double frames_per_second() const override { return left_->frames_per_second(); }
  std::string description() const override { return left_->description(); }
  std::optional<StereoCalibration> calibration() const override;
  std::vector<StampedPose> ground_truth() const override { return left_->ground_truth(); }

  // Any pair of the sequence, in any order; does not move next().
  StereoFrame frame(int index);
  // Of the left camera: depth along z, metres, through pixel centres; 0 where there is nothing.
  cv::Mat1f depth(int index) { return left_->depth(index); }
  RigidTransform world_from_camera(int index) const { return left_->world_from_camera(index); }

 private:
  Frame right_of(int index);

  std::unique_ptr<SyntheticSource> left_;
  RigidTransform right_from_left_;
};

// Any synthetic name. Throws InputError as open_synthetic_source() does.
std::unique_ptr<SyntheticStereoSource> open_synthetic_stereo_source(const std::string& name,
                                                                    const SourceOptions& options = {}, int threads = 1);

}  // namespace parallax
