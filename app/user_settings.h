// What the user may set and what the program remembers, in YAML, under the XDG directories:
//
//   $XDG_CONFIG_HOME/parallax/settings.yaml   written by the user (keys, camera...), see docs/live.md
//   $XDG_DATA_HOME/parallax/state.yaml        window and camera of the last time
//   $XDG_DATA_HOME/parallax/calibrations/     one calibration a camera and image size
//
// Top-level keys that this version does not know are left in the files. All functions may be called from any thread.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/key_bindings.h"
#include "core/camera_model.h"

namespace parallax {

struct UserSettings {
  KeyBindings keys;
  std::vector<std::string> key_remarks;  // which actions gave up a default key for one of the file, a sentence each
  std::string camera;                    // as behind --camera; empty: the one of the last time, else the first found
  int width = 0, height = 0;             // wanted image size; 0: 640x480
  std::string pictures;                  // folder of screenshots; empty: the desktop's own
  std::string videos;                    // folder of videos and recordings; empty: the desktop's own
  double interface_scale = 1;            // of text and panels, on top of the screen's own
  bool keep_maps = true;                 // keep maps by itself, and know them again (app/map_library.h)
  bool merge_maps = true;                // those that meet (app/session_maps.h)
  bool tracking_profile = true;          // lock exposure, focus and white balance once settled
};

// Reads the file; nothing there: the defaults. Throws InputError: "FILE: key K: found X, expected Y".
UserSettings read_user_settings(const std::string& path);
UserSettings parse_user_settings(const std::string& text, const std::string& name);

struct ProgramState {
  int window_x = -1, window_y = -1, window_width = 0, window_height = 0;  // 0: never seen
  bool full_screen = false;
  std::string camera;       // the last one
  std::string key_remarks;  // the last that were said (UserSettings::key_remarks, joined): they are said once
};

// A state that cannot be read is none: it is only a convenience.
ProgramState read_program_state(const std::string& path);
// Written beside and renamed; keys it does not know are kept. Throws RunError.
void write_program_state(const ProgramState& state, const std::string& path);

// $XDG_CONFIG_HOME/parallax/settings.yaml and so on; PARALLAX_SETTINGS names another settings file. Empty when there is
// no home.
std::string settings_path();
std::string state_path();
// Pictures and videos: $XDG_PICTURES_DIR, $XDG_VIDEOS_DIR (or what user-dirs.dirs says), else the home's Pictures and
// Videos, else where the program was started.
std::string pictures_folder();
std::string videos_folder();

// The file of a camera's calibration; `identity` is LiveCamera::identity(). Empty when there is no home.
std::string calibration_path(const std::string& identity, int width, int height);
// Nothing when there is none. Throws InputError when the file is there and bad.
std::optional<CameraModel> remembered_calibration(const std::string& identity, int width, int height);
// Makes the folders that are missing. Throws RunError.
void remember_calibration(const CameraModel& camera, const std::string& identity);

// A wide-angle lens as cameras at desks have it (a horizontal field of view of 75 degrees), for images of this size:
// for a start without calibration.
CameraModel estimated_lens(int width, int height);

}  // namespace parallax
