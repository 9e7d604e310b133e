// What the live window shows and what the user is in the middle of. Belongs to the window's thread; panels change it,
// the window acts on it.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "app/augmented_view.h"
#include "app/display_latency.h"
#include "app/live_toasts.h"
#include "app/user_settings.h"
#include "camera/live_camera.h"
#include "map/content.h"

namespace parallax {

enum class Screen {
  opening,      // the camera is being opened
  first_run,    // nothing is known of its lens
  calibrating,  // a board is shown to it
  augmented,    // the camera's image with what is virtual
  map,          // the map from outside
};

// What the next clicks or the keyboard are for.
enum class Task { none, write_label, measure_first, measure_second, measure_distance, name_map };

struct LivePanels {
  bool help = false, camera = false, map = false, content = false, record = false, debug = false;
};

// What a panel asks the window to do, once.
struct LiveRequests {
  bool reset = false, screenshot = false, video = false, record = false, measure = false, find_plane = false,
       marker = false, first_run = false, calibrate = false, print_marker = false, maps = false;
  std::optional<double> scale;
};

struct LiveState {
  UserSettings settings;
  Screen screen = Screen::opening;
  LivePanels panels;
  LiveRequests requests;
  Toasts toasts;

  AugmentedSettings view;
  Content content;
  std::optional<int> selected;  // item of the content

  Task task = Task::none;
  std::array<char, 64> text{};                   // being typed
  bool focus_text = false;                       // the text field takes the keyboard in the next frame
  int editing = 0;                               // the label whose text is typed
  std::vector<Eigen::Vector3d> measured;         // points picked, world
  double marker_cm = 5;                          // being typed
  double drawing_ms = 0, frame_interval_ms = 0;  // of the window, smoothed
  double slowest_draw_ms = 0;                    // since the start
  DisplayLatency latency;

  bool video_running = false, recording = false;
  std::string picture_folder, video_folder;

  // Controls of the camera, asked for now and then, not every frame.
  std::vector<CameraControl> controls;
  SteadyClock::time_point controls_time{};

  // Whether the keyboard belongs to a text field of the present task.
  bool typing() const { return task == Task::write_label || task == Task::measure_distance || task == Task::name_map; }
};

}  // namespace parallax
