// Small recordings made on the spot from the synthetic desk, good enough to be tracked, for tests that then damage
// them.
#pragma once

#include <cstdio>
#include <filesystem>
#include <functional>
#include <string>

#include "camera/calibration_file.h"
#include "camera/image_writer.h"
#include "camera/video_writer.h"
#include "render/synthetic_source.h"

namespace parallax::testing {

inline constexpr int kRecordingStart = 28;   // just before the slide
inline constexpr int kRecordingFrames = 80;  // enough to be tracked for a second

inline std::unique_ptr<SyntheticSource> recording_source(const std::string& keys, int frames, bool colour = false) {
  SourceOptions options;
  options.start_frame = kRecordingStart;
  options.max_frames = frames;
  options.colour = colour;
  return open_synthetic_source("desk?" + keys, options, 2);
}

inline std::string image_name(int i) {
  char name[16];
  std::snprintf(name, sizeof name, "%04d.png", i);
  return name;
}

// A folder of numbered images with its calibration. `change` may replace each image before it is written.
inline void make_image_folder(const std::filesystem::path& folder, int frames = kRecordingFrames,
                              const std::string& keys = "size=320x240",
                              const std::function<cv::Mat(const cv::Mat&)>& change = {}) {
  std::filesystem::create_directories(folder);
  const auto source = recording_source(keys, frames);
  for (int i = 0; auto frame = source->next(); ++i) {
    const cv::Mat image = frame->grey;
    write_png((folder / image_name(i)).string(), change ? change(image) : image);
  }
  write_calibration(*source->calibration(), (folder / "calibration.yaml").string());
}

// A video and, beside it, calibration.yaml.
inline void make_video(const std::filesystem::path& path, int frames = kRecordingFrames,
                       const std::string& keys = "size=320x240") {
  const auto source = recording_source(keys, frames, true);
  const CameraModel camera = *source->calibration();
  VideoWriter writer(path.string(), 30, {camera.width(), camera.height()});
  while (auto frame = source->next()) writer.write(frame->colour);
  writer.close();
  write_calibration(camera, (path.parent_path() / "calibration.yaml").string());
}

}  // namespace parallax::testing
