// Frames of a recorded session (`live --record`), with the calibration it was recorded with. A session that was killed
// is read as far as it was written.
#pragma once

#include <memory>
#include <string>

#include "camera/frame_source.h"
#include "camera/recording_file.h"

namespace parallax {

class RecordingSource final : public FrameSource {
 public:
  // Throws InputError when the file cannot be read, is no recording or holds no frame.
  RecordingSource(const std::string& path, const SourceOptions& options);
  ~RecordingSource() override;

  std::optional<Frame> next() override;
  std::vector<SourceWarning> take_warnings() override;
  int frame_count() const override;
  double frames_per_second() const override { return fps_; }
  std::string description() const override { return path_; }
  std::optional<CameraModel> calibration() const override { return camera_; }

  // Header, schedule and summary; the list of frames is of those to be delivered.
  const RecordingContents& contents() const { return contents_; }

 private:
  std::string path_;
  SourceOptions options_;
  std::unique_ptr<std::istream> file_;
  RecordingContents contents_;
  std::optional<CameraModel> camera_;
  ImageCodec codec_;
  std::vector<SourceWarning> warnings_;
  double fps_ = 30;
  std::size_t next_ = 0;
};

// Whether the file is a recorded session; false when it cannot be read.
bool is_recording_file(const std::string& path);

// A camera model as text, exact to the last bit, and back; the latter throws InputError naming `name`.
std::string exact_text(const CameraModel& camera);
CameraModel parse_exact_camera(const std::string& text, const std::string& name);

}  // namespace parallax
