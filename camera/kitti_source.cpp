// The KITTI odometry layout: image_0 and image_1 (or the colour pair image_2 and image_3), times.txt, calib.txt and
// poses.txt (camera 0) where they are there.
#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "camera/dataset_text.h"
#include "camera/image_sequence.h"
#include "core/error.h"
#include "core/file_io.h"
#include "core/trajectory.h"

namespace parallax {
namespace fs = std::filesystem;

namespace {

// 0 for the grey pair, 2 for the colour pair, -1 for neither.
int first_camera(const fs::path& folder) {
  std::error_code error;
  for (const int camera : {0, 2}) {
    if (fs::is_directory(folder / ("image_" + std::to_string(camera)), error)) return camera;
  }
  return -1;
}

// The images by their number: 000012.png is image 12. Other files are not looked at.
std::vector<std::pair<int, std::string>> numbered_files(const fs::path& folder) {
  std::vector<std::pair<int, std::string>> files;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string stem = it->path().stem().string();
    const bool number = !stem.empty() && stem.size() <= 9 &&
                        std::all_of(stem.begin(), stem.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
    if (number && has_image_name(it->path().string())) files.emplace_back(std::stoi(stem), it->path().string());
  }
  if (error) throw InputError(folder.string() + ": cannot be read: " + error.message());
  std::sort(files.begin(), files.end());
  return files;
}

std::string numbered_name(const fs::path& folder, int index) {
  char name[32];
  std::snprintf(name, sizeof name, "%06d.png", index);
  return (folder / name).string();
}

// Times from times.txt, or by the rate when there is none.
ImageList read_times(const fs::path& folder, int images, double fallback_fps, std::vector<SourceWarning>* warnings) {
  const std::string name = (folder / "times.txt").string();
  std::error_code error;
  ImageList list;
  if (fs::exists(name, error)) {
    list = parse_kitti_times(read_text_file(name), name);
    for (const auto& text : list.warnings) warnings->push_back({-1, text});
    return list;
  }
  warnings->push_back({-1, name + ": not found; " + std::to_string(fallback_fps) + " frames a second are assumed"});
  list.positions = images;
  for (int i = 0; i < images; ++i) list.images.push_back({i, 0, from_seconds(i / fallback_fps), ""});
  return list;
}

void read_truth(const fs::path& folder, const ImageList& times, ImageSequence* sequence) {
  const std::string name = (folder / "poses.txt").string();
  std::error_code error;
  if (!fs::exists(name, error)) return;
  try {
    TrajectoryFormat format{};
    const Trajectory poses = read_trajectory(name, &format);
    if (format != TrajectoryFormat::kitti) throw InputError(name + ": found another form, expected KITTI matrices");
    for (const auto& time : times.images) {
      const auto i = static_cast<std::size_t>(time.index);
      if (i >= poses.size()) break;
      sequence->ground_truth.push_back({time.time, poses[i].world_from_camera * sequence->body_from_camera});
    }
    if (static_cast<int>(poses.size()) != times.positions) {
      sequence->warnings.push_back({-1, name + ": found " + std::to_string(poses.size()) + " poses, expected " +
                                            std::to_string(times.positions) + ", one a frame"});
    }
  } catch (const InputError& problem) {
    sequence->warnings.push_back({-1, std::string(problem.what()) + "; the ground truth is not used"});
  }
}

}  // namespace

bool is_kitti_folder(const std::string& folder) { return first_camera(folder) >= 0; }

ImageSequence open_kitti_sequence(const std::string& folder, int camera, const SourceOptions& options) {
  const int number = first_camera(folder) + camera;
  const fs::path images = fs::path(folder) / ("image_" + std::to_string(number));
  ImageSequence sequence;
  sequence.description = "KITTI folder " + folder;
  const auto files = numbered_files(images);
  if (files.empty()) throw InputError(images.string() + ": found no image, expected 000000.png and so on");
  const int in_folder = files.back().first + 1;
  const ImageList times = read_times(folder, in_folder, options.fallback_fps, &sequence.warnings);
  auto file = files.begin();
  for (const auto& time : times.images) {
    while (file != files.end() && file->first < time.index) ++file;
    const bool there = file != files.end() && file->first == time.index;
    // One that is missing is told about when its turn comes.
    sequence.images.push_back({time.index, time.time, there ? file->second : numbered_name(images, time.index)});
  }
  if (in_folder > times.positions) {
    sequence.warnings.push_back({-1, images.string() + ": found images up to number " + std::to_string(in_folder - 1) +
                                         ", expected " + std::to_string(times.positions) +
                                         " as times.txt has times; the rest is not read"});
  }
  sequence.positions = times.positions;
  sequence.frames_per_second = median_rate(sequence.images, options.fallback_fps);
  probe_sequence(&sequence);
  const std::string calibration = (fs::path(folder) / "calib.txt").string();
  std::error_code error;
  if (fs::exists(calibration, error)) {
    const ProjectionMatrix P = parse_kitti_projection(read_text_file(calibration), calibration, number);
    sequence.calibration = kitti_camera(P, sequence.probe.size, calibration);
    sequence.body_from_camera = kitti_camera0_from_camera(P);
  }
  if (camera == 0) read_truth(folder, times, &sequence);
  return sequence;
}

}  // namespace parallax
