#include "app/calibrate_views.h"

#include <glob.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>

#include "app/calibrate_live.h"
#include "app/live_options.h"
#include "app/progress_bar.h"
#include "app/source.h"
#include "camera/frame_source.h"
#include "camera/image_file.h"
#include "camera/live_camera.h"
#include "core/error.h"
#include "render/synthetic_source.h"

namespace parallax {
namespace {

namespace fs = std::filesystem;

// Folders with more images than this are recordings, whose frames are chosen from.
constexpr int most_plain_images = 100;

bool is_pattern(const std::string& source) {
  return !source.starts_with("synthetic:") && source.find_first_of("*?") != std::string::npos;
}

std::vector<std::string> expand(const std::string& pattern) {
  glob_t found{};
  std::vector<std::string> paths;
  if (glob(pattern.c_str(), 0, nullptr, &found) == 0)
    for (std::size_t i = 0; i < found.gl_pathc; ++i) paths.emplace_back(found.gl_pathv[i]);
  globfree(&found);
  if (paths.empty()) throw InputError(pattern + ": found no file of that pattern, expected images");
  return paths;
}

// Image files one by one, as a source of frames.
class ImageListSource : public FrameSource {
 public:
  explicit ImageListSource(std::vector<std::string> paths) : paths_(std::move(paths)) {}

  std::optional<Frame> next() override {
    while (at_ < paths_.size()) {
      const int index = static_cast<int>(at_);
      const std::string& path = paths_[at_++];
      DecodedImage image;
      std::string problem;
      if (deep_bits_ == 0) {
        ImageProbe probe;
        problem = probe_image(path, &probe);
        if (problem.empty()) deep_bits_ = probe.deep_bits;
      }
      if (problem.empty()) problem = load_image(path, {false, deep_bits_}, &image);
      if (problem.empty() && !size_.empty() && size_ != image.grey.size())
        problem = "its size is not that of the others";
      if (!problem.empty()) {
        warnings_.push_back({index, path + ": skipped: " + problem});
        continue;
      }
      size_ = image.grey.size();
      Frame frame;
      frame.index = index;
      frame.grey = image.grey;
      return frame;
    }
    return std::nullopt;
  }
  std::vector<SourceWarning> take_warnings() override { return std::exchange(warnings_, {}); }
  int frame_count() const override { return static_cast<int>(paths_.size()); }
  double frames_per_second() const override { return 1; }
  std::string description() const override { return std::to_string(paths_.size()) + " images"; }
  const std::vector<std::string>& paths() const { return paths_; }

 private:
  std::vector<std::string> paths_;
  std::vector<SourceWarning> warnings_;
  std::size_t at_ = 0;
  cv::Size size_;
  int deep_bits_ = 0;
};

struct OpenedImages {
  std::unique_ptr<FrameSource> frames;
  std::vector<std::string> names;  // by frame number, where they are files
};

OpenedImages open_images(const std::vector<std::string>& sources) {
  OpenedImages out;
  std::vector<std::string> paths;
  for (const auto& source : sources) {
    if (is_pattern(source)) {
      for (const auto& path : expand(source)) paths.push_back(path);
    } else if (sources.size() > 1 || has_image_name(source)) {
      std::error_code error;
      if (!fs::exists(source, error)) throw InputError(source + ": found no such file, expected an image");
      paths.push_back(source);
    }
  }
  if (paths.empty()) {
    const std::string& source = sources.at(0);
    if (source.starts_with("synthetic:")) {
      out.frames = open_synthetic_source(source);
    } else {
      out.frames = open_frame_source(source, {});
    }
    return out;
  }
  for (const auto& path : paths) out.names.push_back(fs::path(path).filename().string());
  out.frames = std::make_unique<ImageListSource>(std::move(paths));
  return out;
}

std::string frame_name(const OpenedImages& images, int index) {
  const auto i = static_cast<std::size_t>(index);
  return i < images.names.size() ? images.names[i] : "frame " + std::to_string(index);
}

void say_warnings(FrameSource* source) {
  for (const auto& warning : source->take_warnings()) std::cerr << "parallax: warning: " << warning.text << "\n";
}

std::string board_words(const CalibrationTarget& target) {
  return std::string(to_string(target.kind)) + " board of " + std::to_string(target.columns) + "x" +
         std::to_string(target.rows);
}

// Ctrl-C ends the looking, not the program: the views taken until then are used.
GatheredViews gather_live(const CalibrateSettings& settings) {
  LiveCameraOptions options;
  options.colour = false;
  const auto camera = open_live_camera(settings.sources.at(0), options);
  catch_end_signals();
  LiveGathering live =
      gather_live_views(camera.get(), {settings.target, settings.max_views, settings.live_seconds, end_requested,
                                       [](const std::string& line) { std::cerr << line << std::endl; }});
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
  return {std::move(live.data), live.frames, {}};
}

GatheredViews gather_frames(const CalibrateSettings& settings) {
  OpenedImages images = open_images(settings.sources);
  const int total = images.frames->frame_count();
  const bool files = !images.names.empty();
  std::error_code error;
  const bool folder = fs::is_directory(settings.sources.at(0), error);
  bool choose = settings.take == "chosen";
  if (settings.take == "auto") choose = !files && !(folder && total >= 0 && total <= most_plain_images);
  GatheredViews out;
  out.data.target = settings.target;
  std::unique_ptr<CalibrationSession> session;
  ProgressBar bar("looking for the board", total);
  while (auto frame = images.frames->next()) {
    bar.update(++out.frames);
    out.data.width = frame->grey.cols;
    out.data.height = frame->grey.rows;
    if (choose) {
      if (!session) {
        CalibrationSessionOptions options;
        options.most_views = settings.max_views;
        session = std::make_unique<CalibrationSession>(settings.target, frame->grey.cols, frame->grey.rows, options);
      }
      (void)session->add_frame(frame->grey, frame->index);
      continue;
    }
    const auto detection = detect_target(frame->grey, settings.target);
    const std::string name = frame_name(images, frame->index);
    if (detection) {
      out.data.views.push_back({frame->index, name, detection->corners});
    } else {
      out.unused.push_back(name);
    }
  }
  bar.clear();
  say_warnings(images.frames.get());
  if (session) out.data = session->data();
  return out;
}

}  // namespace

GatheredViews gather_views(const CalibrateSettings& settings) {
  GatheredViews out = names_camera(settings.sources.at(0)) ? gather_live(settings) : gather_frames(settings);
  if (out.data.views.size() < 2)
    throw RunError(settings.sources[0] + ": found a " + board_words(settings.target) + " in " +
                   std::to_string(out.data.views.size()) + " of " + std::to_string(out.frames) +
                   " images, expected it in 10 or more (--target and --board say what it is)");
  return out;
}

GatheredPairs gather_pairs(const CalibrateSettings& settings) {
  GatheredPairs out;
  out.data.target = settings.target;
  std::map<int, StereoView> views;
  for (int side = 0; side < 2; ++side) {
    const std::string& source = settings.stereo.at(static_cast<std::size_t>(side));
    OpenedImages images = open_images({source});
    ProgressBar bar(side == 0 ? "left images" : "right images", images.frames->frame_count());
    int seen = 0, frames = 0;
    while (auto frame = images.frames->next()) {
      bar.update(++frames);
      if (side == 0 && frames == 1) {
        out.data.width = frame->grey.cols;
        out.data.height = frame->grey.rows;
      }
      if (frame->grey.cols != out.data.width || frame->grey.rows != out.data.height)
        throw InputError(source + ": found images of " + std::to_string(frame->grey.cols) + "x" +
                         std::to_string(frame->grey.rows) + ", expected " + std::to_string(out.data.width) + "x" +
                         std::to_string(out.data.height) + " as on the left");
      const auto detection = detect_target(frame->grey, settings.target);
      if (!detection) continue;
      ++seen;
      StereoView& view = views[frame->index];
      view.frame = frame->index;
      (side == 0 ? view.left : view.right) = detection->corners;
      if (side == 0) view.name = frame_name(images, frame->index);
    }
    bar.clear();
    say_warnings(images.frames.get());
    out.frames = std::max(out.frames, frames);
    if (seen < 3)
      throw RunError(source + ": found a " + board_words(settings.target) + " in " + std::to_string(seen) + " of " +
                     std::to_string(frames) +
                     " images, expected it in 10 or more (--target and --board say what it is)");
  }
  for (auto& [index, view] : views) out.data.views.push_back(std::move(view));
  return out;
}

}  // namespace parallax
