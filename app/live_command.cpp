// `parallax live`, which is what `parallax` without a command does: the live window, or the same without one.
#include <atomic>
#include <csignal>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>

#include "app/command.h"
#include "app/live_options.h"
#include "app/user_settings.h"
#include "core/error.h"
#include "core/parse_text.h"
#include "render/window.h"

namespace parallax {

namespace {

std::atomic<bool> g_end_requested{false};

extern "C" void note_end_signal(int signal_number) {
  g_end_requested.store(true);
  std::signal(signal_number, SIG_DFL);
}

void parse_size(const std::string& text, LiveOptions* options) {
  const auto x = text.find('x');
  std::int64_t width = 0, height = 0;
  if (x == std::string::npos || !parse_number(text.substr(0, x), &width) ||
      !parse_number(text.substr(x + 1), &height) || width < 64 || width > 8192 || height < 48 || height > 8192)
    throw InputError("--size: found '" + text + "', expected WIDTHxHEIGHT, like 640x480");
  options->width = static_cast<int>(width);
  options->height = static_cast<int>(height);
}

// Without a display there is still something to see afterwards.
LiveOptions without_display(LiveOptions options) {
  options.headless = true;
  if (options.camera.empty()) options.camera = "synthetic:desk";
  if (options.video.empty()) {
    const std::string folder = options.output.empty() ? std::filesystem::current_path().string() : options.output;
    options.video = (std::filesystem::path(folder) / "parallax-demo.mp4").string();
  }
  return options;
}

}  // namespace

void catch_end_signals() {
  std::signal(SIGINT, note_end_signal);
  std::signal(SIGTERM, note_end_signal);
}

bool end_requested() { return g_end_requested.load(); }

int run_live(const LiveOptions& options) {
  catch_end_signals();
  if (options.headless) return run_live_headless(options);
  if (Window::available()) return run_live_window(options);
  const LiveOptions headless = without_display(options);
  std::cout << "no display: " << headless.camera << " without a window; the video goes to " << headless.video
            << std::endl;
  return run_live_headless(headless);
}

void add_live_command(CLI::App& app, int* exit_code) {
  auto options = std::make_shared<LiveOptions>();
  auto size = std::make_shared<std::string>();
  CLI::App* command = app.add_subcommand("live", "Track a camera live, in a window (what `parallax` alone does)");
  command->add_option(
      "--camera", options->camera,
      "v4l2:/dev/video0, libcamera:NAME, synthetic:desk (held by you), or a recording to play; default: "
      "the first camera found");
  command->add_option("--calibration", options->calibration, "Calibration file; default: what is known of the camera");
  command->add_option("--record", options->record, "Keep frames, keys and schedule in this file, for `parallax run`");
  CLI::Option* one_map =
      command->add_option("--map", options->map, "Go on with this saved map when it is there, and keep the map in it");
  command
      ->add_option("--maps", options->maps,
                   "Keep every map in this folder, and know its places again; in the window the default is the "
                   "user's own folder")
      ->excludes(one_map);
  command->add_flag("--no-merge", options->no_merge, "Do not merge maps that meet");
  command->add_option("--size", *size, "Wanted image size, WIDTHxHEIGHT");
  command->add_flag("--fps", options->show_fps, "Open the timing panel");
  command->add_option("--init", options->init, "auto, or manual: by key (default in the window)")
      ->check(CLI::IsMember({"auto", "manual"}));
  command->add_flag("--headless", options->headless, "No window: initialises by itself, until a limit or Ctrl-C");
  command->add_flag("--full-screen", options->full_screen, "Fill the screen");
  command->add_option("--frames-limit", options->frames_limit, "End after so many frames")
      ->check(CLI::Range(1, 1000000000));
  command->add_option("--seconds", options->seconds, "End after so many seconds")->check(CLI::Range(0.01, 1e7));
  command->add_option("--trajectory", options->trajectory, "Write every tracked pose (TUM form)");
  command->add_option("--keyframes", options->keyframes, "Write the keyframes' poses (TUM form)");
  command->add_option("--report", options->report, "Write counts, timings and settings (JSON)");
  command->add_option("--truth", options->truth, "Write the source's true poses, where it carries them (TUM form)");
  command->add_option("--video", options->video, "Write a video of what is tracked, or of the window (.mp4 or .avi)");
  command->add_option("--output", options->output, "Folder for screenshots and videos; default: the desktop's own");
  command->add_option("--set", options->settings, "NAME=VALUE: an option of the tracker or mapper (may be repeated)");
  command->callback([options, size, exit_code] {
    if (!size->empty()) parse_size(*size, options.get());
    *exit_code = run_live(*options);
  });
}

}  // namespace parallax
