#include "camera/frame_source.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "camera/image_file.h"
#include "camera/image_sequence.h"
#include "camera/recording_source.h"
#include "camera/video_source.h"
#include "core/error.h"

namespace parallax {
namespace fs = std::filesystem;

namespace {

std::string lower_extension(const std::string& path) {
  std::string extension = fs::path(path).extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

// FFmpeg takes some text files for terminal recordings, and playlists for permission to open other files.
bool is_text_name(const std::string& path) {
  constexpr std::array<const char*, 16> kText{".txt",  ".yaml", ".yml", ".csv", ".json", ".xml", ".md",  ".cfg",
                                              ".html", ".ply",  ".g2o", ".nfo", ".asc",  ".ans", ".m3u", ".m3u8"};
  const std::string extension = lower_extension(path);
  return std::any_of(kText.begin(), kText.end(), [&](const char* text) { return extension == text; });
}

void check_regular_file(const std::string& source) {
  std::ifstream file(source, std::ios::binary);
  if (!file) throw InputError(source + ": cannot be read: " + std::generic_category().message(errno));
  std::string start(64, '\0');
  errno = 0;
  file.read(start.data(), static_cast<std::streamsize>(start.size()));
  if (file.bad()) throw InputError(source + ": cannot be read: " + std::generic_category().message(errno));
  start.resize(static_cast<std::size_t>(std::max<std::streamsize>(file.gcount(), 0)));
  if (start.empty()) throw InputError(source + ": found an empty file, expected a video or a folder");
  const bool motion_jpeg = lower_extension(source) == ".mjpeg" || lower_extension(source) == ".mjpg";
  if (has_image_name(source) || (image_kind(start) != nullptr && !motion_jpeg)) {
    throw InputError(source + ": found a single image, expected a video or a folder of images");
  }
  if (is_text_name(source)) throw InputError(source + ": found a text file, expected a video or a folder");
}

}  // namespace

std::unique_ptr<FrameSource> open_frame_source(const std::string& source, const SourceOptions& options) {
  if (source.empty()) throw InputError("source: found an empty name, expected a video file or a folder");
  if (!(options.fallback_fps > 0 && std::isfinite(options.fallback_fps))) {
    throw InputError("fallback frame rate: found " + std::to_string(options.fallback_fps) + ", expected more than 0");
  }
  if (options.start_frame < 0) {
    throw InputError("start frame: found " + std::to_string(options.start_frame) + ", expected 0 or more");
  }
  std::error_code error;
  const fs::file_status status = fs::status(source, error);
  if (!fs::exists(status)) {
    const std::string reason = error ? error.message() : "no such file or folder";
    throw InputError(source + ": cannot be read: " + reason);
  }
  if (fs::is_directory(status)) {
    // Asked first, so that a folder nobody may look into is not taken for one without the files of a layout.
    fs::directory_iterator look(source, error);
    if (error) throw InputError(source + ": cannot be read: " + error.message());
    if (is_euroc_folder(source)) return make_sequence_source(open_euroc_sequence(source, 0, options), options);
    if (is_tum_folder(source)) return make_sequence_source(open_tum_sequence(source, options), options);
    if (is_kitti_folder(source)) return make_sequence_source(open_kitti_sequence(source, 0, options), options);
    return make_sequence_source(open_numbered_sequence(source, options), options);
  }
  if (!fs::is_regular_file(status)) {
    throw InputError(source + ": found a device or pipe, expected a video file or a folder");
  }
  if (is_recording_file(source)) return std::make_unique<RecordingSource>(source, options);
  check_regular_file(source);
  return open_video_source(source, options);
}

}  // namespace parallax
