#include "app/source.h"

#include <utility>

#include "app/user_settings.h"
#include "camera/calibration_file.h"
#include "core/error.h"
#include "render/synthetic_handheld.h"
#include "render/synthetic_source.h"
#include "render/synthetic_stereo_source.h"

namespace parallax {

namespace {

constexpr const char* kSynthetic = "synthetic:";

class LimitedSource final : public FrameSource {
 public:
  LimitedSource(std::shared_ptr<FrameSource> source, int max_frames)
      : source_(std::move(source)), left_(max_frames), limit_(max_frames) {}
  std::optional<Frame> next() override {
    if (left_ <= 0) return std::nullopt;
    --left_;
    return source_->next();
  }
  std::vector<SourceWarning> take_warnings() override { return source_->take_warnings(); }
  int frame_count() const override {
    const int all = source_->frame_count();
    return all < 0 ? all : std::min(all, limit_);
  }
  double frames_per_second() const override { return source_->frames_per_second(); }
  std::string description() const override { return source_->description(); }
  std::optional<CameraModel> calibration() const override { return source_->calibration(); }
  std::vector<StampedPose> ground_truth() const override { return source_->ground_truth(); }

 private:
  std::shared_ptr<FrameSource> source_;
  int left_, limit_;
};

}  // namespace

bool names_camera(const std::string& source) { return source.starts_with("v4l2:") || source.starts_with("libcamera:"); }

std::unique_ptr<FrameSource> make_limited(std::shared_ptr<FrameSource> source, int max_frames) {
  return std::make_unique<LimitedSource>(std::move(source), max_frames);
}

std::unique_ptr<FrameSource> open_frames(const std::string& source, const SourceOptions& options) {
  if (names_camera(source)) throw InputError(source + ": found a camera, expected a recording");
  if (source.starts_with(kSynthetic)) return open_synthetic_source(source, options);
  return open_frame_source(source, options);
}

std::unique_ptr<StereoSource> open_stereo(const std::string& source, const SourceOptions& options) {
  if (names_camera(source)) throw InputError(source + ": found a camera, expected a stereo recording");
  if (source.starts_with(kSynthetic)) return open_synthetic_stereo_source(source, options);
  return open_stereo_source(source, options);
}

OpenedSource open_source(const std::string& source, const std::string& calibration_path, const SourceOptions& options) {
  OpenedSource out;
  std::optional<CameraModel> remembered;
  if (names_camera(source)) {
    LiveCameraOptions camera_options;
    camera_options.colour = options.colour;
    std::shared_ptr<LiveCamera> camera = open_live_camera(source, camera_options);
    remembered = remembered_calibration(camera->identity(), camera->width(), camera->height());
    if (options.max_frames < 0)
      throw InputError(source + ": a camera has no end; expected --frames-limit, or `parallax live --camera " + source +
                       "`");
    out.frames = make_limited(std::move(camera), options.max_frames);
  } else {
    out.frames = open_frames(source, options);
  }
  if (!calibration_path.empty()) {
    out.camera = read_calibration(calibration_path);
  } else if (const auto carried = out.frames->calibration()) {
    out.camera = *carried;
  } else if (remembered) {
    out.camera = *remembered;
  } else {
    throw InputError(source + ": carries no calibration; expected --calibration FILE");
  }
  return out;
}

LiveSource open_live_source(const std::string& source, const std::string& calibration_path,
                            const LiveSourceOptions& options) {
  LiveSource out;
  out.name = source;
  SourceOptions source_options;
  source_options.colour = options.camera.colour;
  if (names_camera(source)) {
    std::shared_ptr<LiveCamera> camera = open_live_camera(source, options.camera);
    out.camera = camera.get();
    out.frames = std::move(camera);
  } else if (source.starts_with(kSynthetic) && (options.by_hand || source.find("path=") != std::string::npos)) {
    HandheldOptions handheld_options;
    handheld_options.colour = options.camera.colour;
    handheld_options.threads = options.threads;
    auto camera = std::make_shared<SyntheticHandheld>(source, handheld_options);
    out.camera = camera.get();
    if (camera->by_hand()) out.hand = &camera->hand();
    out.frames = std::move(camera);
  } else if (source.starts_with(kSynthetic)) {
    out.frames = open_synthetic_source(source, source_options, options.threads);
  } else {
    out.frames = open_frame_source(source, source_options);
  }
  out.identity = out.camera != nullptr ? out.camera->identity() : out.frames->description();
  if (out.camera != nullptr) {
    out.width = out.camera->width();
    out.height = out.camera->height();
  }
  if (!calibration_path.empty()) {
    out.lens = read_calibration(calibration_path, 0, out.width, out.height);
    out.lens_origin = "calibration " + calibration_path;
  } else if ((out.lens = out.frames->calibration())) {
    out.lens_origin = "carried";
  } else if (out.camera != nullptr && (out.lens = remembered_calibration(out.identity, out.width, out.height))) {
    out.lens_origin = "remembered";
  }
  if (out.camera != nullptr && out.lens && (out.lens->width() != out.width || out.lens->height() != out.height)) {
    throw InputError((calibration_path.empty() ? source : calibration_path) + ": the calibration is for images of " +
                     std::to_string(out.lens->width()) + "x" + std::to_string(out.lens->height()) +
                     ", found images of " + std::to_string(out.width) + "x" + std::to_string(out.height));
  }
  return out;
}

}  // namespace parallax
