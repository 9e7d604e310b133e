// What was asked for on the command line of `parallax live`.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace parallax {

// Of a live session, which may never end, the results of so many of the newest frames are kept (100 s).
inline constexpr std::size_t kLiveKeptFrames = 3'000;

struct LiveOptions {
  std::string camera;       // SOURCE; empty: the settings' one, the last one, the first found, the synthetic desk
  std::string calibration;  // file; empty: what the camera is known by
  std::string record;       // file for a recording of the session
  std::string maps;         // folder of the maps that are kept by themselves; empty: in the window the user's own
  bool no_merge = false;    // maps that meet stay two
  std::string map;          // file to go on with where there is one, and to keep the map in
  int width = 0, height = 0;
  std::string init;       // auto or manual; empty: manual in the window, auto without
  bool show_fps = false;  // in the window: the timing panel is open at the start
  bool headless = false;
  bool full_screen = false;
  int frames_limit = -1;  // frames read
  double seconds = 0;     // 0: no limit
  std::string trajectory, keyframes, report, truth, video;
  std::string output;                 // folder for screenshots and videos of the window
  std::vector<std::string> settings;  // NAME=VALUE, as in run
};

// Set by SIGINT and SIGTERM once catch_end_signals() was called; a second signal ends the program at once.
void catch_end_signals();
bool end_requested();

// Each returns an exit code. The second throws RunError when there is no display.
int run_live_headless(const LiveOptions& options);
int run_live_window(const LiveOptions& options);
// The window where there is a display; else headless, leaving a video and saying where.
int run_live(const LiveOptions& options);

}  // namespace parallax
