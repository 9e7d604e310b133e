#include "camera/recording_source.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <system_error>

#include "core/error.h"

namespace parallax {
namespace {

constexpr double kLeastFps = 0.01, kMostFps = 10000;

std::string hex(double value) {
  char text[64];
  std::snprintf(text, sizeof text, "%a", value);
  return text;
}

double parse_number(const std::string& text) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  return text.empty() || end != text.c_str() + text.size() ? NAN : value;
}

// For messages of one line.
std::string printable(std::string text) {
  for (char& c : text)
    if (c < ' ' || c > '~') c = '?';
  return text;
}

double median_rate(const std::vector<RecordingContents::FrameAt>& frames, double fallback) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < frames.size(); ++i) intervals.push_back(to_seconds(frames[i].time - frames[i - 1].time));
  if (intervals.empty()) return fallback;
  const auto middle = intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2);
  std::nth_element(intervals.begin(), middle, intervals.end());
  return std::clamp(1.0 / std::max(*middle, 1e-9), kLeastFps, kMostFps);
}

}  // namespace

std::string exact_text(const CameraModel& camera) {
  std::string out = std::string(to_string(camera.kind())) + " " + std::to_string(camera.width()) + " " +
                    std::to_string(camera.height());
  for (const Eigen::Vector2d& pair : {camera.focal_px(), camera.centre_px()})
    out += " " + hex(pair.x()) + " " + hex(pair.y());
  for (int i = 0; i < camera.n_distortion(); ++i) out += " " + hex(camera.distortion()[static_cast<std::size_t>(i)]);
  return out;
}

CameraModel parse_exact_camera(const std::string& text, const std::string& name) {
  std::istringstream in(text);
  std::string kind_name, word;
  int width = 0, height = 0;
  std::vector<double> values;
  in >> kind_name >> width >> height;
  const bool sized = !in.fail();
  while (sized && values.size() < 13 && in >> word) values.push_back(parse_number(word));
  constexpr std::array kKinds{CameraModelKind::pinhole, CameraModelKind::radtan, CameraModelKind::kannala_brandt,
                              CameraModelKind::fov};
  const auto kind =
      std::find_if(kKinds.begin(), kKinds.end(), [&](CameraModelKind known) { return kind_name == to_string(known); });
  if (!sized || kind == kKinds.end() || values.size() < 4 || values.size() > 12) {
    throw InputError(name + ": calibration: found '" + printable(text.substr(0, 40)) + "', expected a camera model");
  }
  std::array<double, 8> distortion{};
  std::copy(values.begin() + 4, values.end(), distortion.begin());
  try {
    return CameraModel(*kind, width, height, {values[0], values[1]}, {values[2], values[3]}, distortion,
                       static_cast<int>(values.size()) - 4);
  } catch (const InputError& e) {
    throw InputError(name + ": calibration: " + e.what());
  }
}

bool is_recording_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  char start[8] = {};
  file.read(start, sizeof start);
  return file.gcount() == sizeof start && is_recording({start, sizeof start});
}

RecordingSource::RecordingSource(const std::string& path, const SourceOptions& options)
    : path_(path), options_(options) {
  auto file = std::make_unique<std::ifstream>(path, std::ios::binary);
  if (!*file) throw InputError(path + ": cannot be read: " + std::generic_category().message(errno));
  file_ = std::move(file);
  contents_ = read_recording(*file_, path);
  auto& frames = contents_.frames;
  if (frames.empty()) throw InputError(path + ": found no frame, expected a recording with at least one");
  const auto calibration = contents_.header.find("calibration");
  if (calibration != contents_.header.end()) camera_ = parse_exact_camera(calibration->second, path);
  const auto fps = contents_.header.find("frames_per_second");
  const double stated = fps == contents_.header.end() ? NAN : parse_number(fps->second);
  fps_ = stated >= kLeastFps && stated <= kMostFps ? stated : median_rate(frames, options.fallback_fps);
  if (!contents_.damage.empty()) {
    warnings_.push_back({-1, path + ": " + contents_.damage + ": the recording is read up to there"});
  }
  std::erase_if(frames, [&](const auto& frame) { return frame.index < options.start_frame; });
  if (options.max_frames >= 0 && frames.size() > static_cast<std::size_t>(options.max_frames)) {
    frames.resize(static_cast<std::size_t>(options.max_frames));
  }
}

RecordingSource::~RecordingSource() = default;

std::optional<Frame> RecordingSource::next() {
  while (next_ < contents_.frames.size()) {
    const RecordingContents::FrameAt& at = contents_.frames[next_++];
    Frame frame;
    std::string why;
    if (!read_recorded_frame(*file_, at, options_.colour, &codec_, &frame, &why)) {
      warnings_.push_back({at.index, path_ + ": frame " + std::to_string(at.index) + ": found " + why + ", skipped"});
    } else if (camera_ && frame.grey.size() != cv::Size(camera_->width(), camera_->height())) {
      warnings_.push_back({at.index, path_ + ": frame " + std::to_string(at.index) + ": found another size, skipped"});
    } else {
      return frame;
    }
  }
  return std::nullopt;
}

std::vector<SourceWarning> RecordingSource::take_warnings() { return std::exchange(warnings_, {}); }

int RecordingSource::frame_count() const { return static_cast<int>(contents_.frames.size()); }

}  // namespace parallax
