// The live window: the camera's image with what is virtual, the map from outside, panels, and what keys and pointer do.
// It draws the newest frame that was tracked and never holds up tracking. The main thread's.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/augmented_interface.h"
#include "app/display_latency.h"
#include "app/live_calibration.h"
#include "app/live_engine.h"
#include "app/live_games.h"
#include "app/live_map.h"
#include "app/live_maps.h"
#include "app/live_options.h"
#include "app/live_pointing.h"
#include "app/live_state.h"
#include "app/map_view.h"
#include "app/marker_scale.h"
#include "app/orbit_camera.h"
#include "app/output_steps.h"
#include "app/screenshot.h"
#include "app/view_memory.h"
#include "render/light_estimate.h"
#include "render/scene_renderer.h"
#include "render/synthetic_hand.h"
#include "render/window.h"

namespace parallax {

class LiveWindow {
 public:
  // Opens the window, and the camera beside it. Throws RunError without a display and InputError for bad settings.
  LiveWindow(const LiveOptions& options, const UserSettings& settings, const ProgramState& state);
  ~LiveWindow();

  // Until the user quits, a signal comes or a limit is reached.
  void run();
  // Closes the window, ends the session and says what it was; nothing when none was begun. A video that cannot be
  // finished is a failing step.
  std::optional<RunResult> finish(OutputSteps* steps);
  const LiveEngine& engine() const { return engine_; }
  ProgramState state_to_remember() const;

 private:
  struct Picture {  // where the camera's image is
    Viewport viewport;
    PictureArea area;
  };

  // One turn of the loop; live_window.cpp.
  bool has_news();
  void follow_source();
  void draw();
  void draw_scene(const Picture& picture);
  void draw_interface(const Picture& picture);
  void draw_panels();
  void capture();
  void update_title();
  Picture picture_area() const;

  // What the user did; live_window_input.cpp.
  void take_keys();
  void act(Action action);
  void move_hand();
  bool is_held(Action action) const;
  bool game_has_keys() const;
  GameKeys game_keys() const;
  void next_game();
  // A key while the menu of the games is open; false: it is not the menu's.
  bool menu_takes(const KeyEvent& event);
  void press_in_menu(MenuKey key);
  void take_pad();
  void take_pointer(const Picture& picture);
  // The pixel of the camera's image there (framebuffer); nothing beside it, or on a panel.
  std::optional<Eigen::Vector2d> pixel_at(const Picture& picture, double pointer_x, double pointer_y) const;

  // What panels asked for; live_window_requests.cpp.
  void serve_requests();
  void answer_edits();
  void begin_session(const CameraModel& lens, bool estimated, const std::string& record_path);
  void reset_map();
  void toggle_video();
  void toggle_recording();
  void ask_scale(double factor, const std::string& said);
  void look_for_marker();
  void print_marker();
  void end_task();
  void drop_task();
  void begin_calibration();
  void cancel_calibration();
  void take_calibration();

  LiveOptions options_;
  ProgramState remembered_;
  LiveState state_;
  LiveEngine engine_;
  std::unique_ptr<Window> window_;
  std::unique_ptr<SceneRenderer> renderer_;
  std::unique_ptr<LiveCalibration> calibration_;
  LivePointing pointing_;
  LiveGames games_;
  LiveMap map_file_;
  LiveMaps maps_;
  GamePad pad_;
  std::vector<Action> tapped_;  // pressed since a game had its last frame: a short tap counts for the next one
  PadWatch pad_watch_;
  DisplayLatency latency_;

  // The frame that is shown, and what is remembered from those before.
  std::shared_ptr<const LiveFrame> shown_;
  int shown_index_ = -1;
  std::shared_ptr<const Frame> preview_;  // before there is a session
  ViewMemory memory_;
  CameraPath path_;
  LightEstimate light_;
  Eigen::Vector3f ambient_ = Eigen::Vector3f::Constant(1);
  OrbitControl orbit_;
  std::optional<KeyframeId> selected_keyframe_;

  struct Edit {
    std::future<EditReply> reply;
    std::string done;  // what to say when it was
    bool sets_scale = false;
  };
  std::vector<Edit> edits_;
  std::vector<std::future<void>> resets_;
  std::future<MarkerScale> marker_;

  std::unique_ptr<ScreenVideo> video_;
  SteadyClock::time_point video_start_, started_, last_draw_;
  bool enter_acted_ = false, enter_seen_ = false;  // Enter did something; Enter was let go of while a text was typed
  bool screenshot_wanted_ = false, ended_said_ = false, input_seen_ = false, turning_ = false;
  PointerState pointer_, last_pointer_;
  double pending_scroll_ = 0;
  std::string title_;
  std::optional<Eigen::Vector2d> cursor_px_;  // where the pointer is on the picture
  Screen before_calibration_ = Screen::first_run;
};

}  // namespace parallax
