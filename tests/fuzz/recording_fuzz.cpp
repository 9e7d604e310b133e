// libFuzzer target: recorded sessions: the file, its images, its schedule and its calibration. The first byte picks.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <sstream>
#include <string>

#include "camera/recording_file.h"
#include "camera/recording_source.h"
#include "core/error.h"
#include "map/schedule_log.h"

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

void check_file(const std::string& bytes) {
  std::istringstream file(bytes);
  const parallax::RecordingContents contents = parallax::read_recording(file, "file");
  require(contents.damage.find('\n') == std::string::npos);
  parallax::ImageCodec codec;
  for (std::size_t i = 0; i < contents.frames.size(); ++i) {
    const auto& at = contents.frames[i];
    require(at.index >= 0 && at.offset + at.size <= bytes.size());
    require(i == 0 || (contents.frames[i - 1].index < at.index && contents.frames[i - 1].time < at.time));
    parallax::Frame frame;
    std::string why;
    if (parallax::read_recorded_frame(file, at, true, &codec, &frame, &why)) {
      require(!frame.grey.empty() && (frame.colour.empty() || frame.colour.size() == frame.grey.size()));
    } else {
      require(!why.empty());
    }
  }
}

void check_schedule(const std::uint8_t* data, std::size_t size) {
  const parallax::ScheduleLog log = parallax::parse_schedule({data, size}, "file");
  std::string again;
  for (const auto& frame : log.frames) parallax::write_entry(frame, &again);
  for (const auto& step : log.steps) parallax::write_entry(step, &again);
  require(again.size() == size);
}

void check_codec(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return;
  parallax::ImageCodec codec;
  parallax::GreyImage grey;
  const cv::Size shape(1 + data[0] % 64, 1 + data[1] % 64);
  if (codec.unpack_grey({data + 2, size - 2}, shape, &grey)) require(grey.size() == shape);
  grey = parallax::GreyImage(shape, 7);
  cv::Mat3b colour;
  if (codec.unpack_colour({data + 2, size - 2}, grey, &colour)) require(colour.size() == shape);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    switch (data[0] % 4) {
      case 0:
        check_file(text);
        break;
      case 1:
        check_schedule(data + 1, size - 1);
        break;
      case 2:
        check_codec(data + 1, size - 1);
        break;
      default:
        (void)parallax::parse_exact_camera(text, "file");
        break;
    }
  } catch (const parallax::InputError& error) {
    require(std::string(error.what()).find('\n') == std::string::npos);
  }
  return 0;
}
