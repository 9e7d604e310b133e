// Opens whatever a SOURCE on the command line names, with its calibration.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "camera/frame_source.h"
#include "camera/live_camera.h"
#include "camera/stereo_source.h"

namespace parallax {

class HandControl;

// Whether the name is that of a camera: v4l2:... or libcamera:...
bool names_camera(const std::string& source);

struct OpenedSource {
  std::unique_ptr<FrameSource> frames;
  CameraModel camera;
};

// For `run`. `calibration_path` empty: the one the source carries, or, for a camera, the one that is remembered for it.
// Throws InputError when there is none. A camera is read until options.max_frames.
OpenedSource open_source(const std::string& source, const std::string& calibration_path, const SourceOptions& options);

// Frames only, with no calibration: anything but a camera.
std::unique_ptr<FrameSource> open_frames(const std::string& source, const SourceOptions& options);

// Pairs of frames with their calibration: a stereo recording (camera/stereo_source.h), or a synthetic name seen by two
// cameras. Throws InputError when it is neither, or a camera.
std::unique_ptr<StereoSource> open_stereo(const std::string& source, const SourceOptions& options = {});

// A source for `live`: a camera, the synthetic desk held by the user, or a recording.
struct LiveSource {
  std::shared_ptr<FrameSource> frames;
  LiveCamera* camera = nullptr;  // of `frames`; null: a recording, or a synthetic sequence that is played
  HandControl* hand = nullptr;   // of `frames`; null: not moved by hand
  std::string name;              // as it was asked for
  std::string identity;          // names the camera across restarts
  int width = 0, height = 0;     // of the images; 0: not known before the first one
  std::optional<CameraModel> lens;
  // Where `lens` is from, for the user: "calibration FILE", "remembered", "carried"; empty when there is none.
  std::string lens_origin;

  // Wakes whoever waits for a frame, for good. A source that is not a camera never waits long.
  void stop() const {
    if (camera != nullptr) camera->stop();
  }
};

struct LiveSourceOptions {
  LiveCameraOptions camera;
  // synthetic: names are held by the user (render/synthetic_handheld.h) unless their path says otherwise; else they are
  // played as they are.
  bool by_hand = true;
  int threads = 2;  // that draw a synthetic frame
};

// Never throws for want of a calibration.
LiveSource open_live_source(const std::string& source, const std::string& calibration_path,
                            const LiveSourceOptions& options);

// At most so many frames of another source.
std::unique_ptr<FrameSource> make_limited(std::shared_ptr<FrameSource> source, int max_frames);

}  // namespace parallax
