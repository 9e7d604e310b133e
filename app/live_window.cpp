#include "app/live_window.h"

#include <imgui.h>

#include <algorithm>
#include <iostream>
#include <utility>

#include "app/augmented_interface.h"
#include "app/command.h"
#include "app/first_run.h"
#include "app/live_outputs.h"
#include "app/panels_draw.h"
#include "app/run_outputs.h"
#include "core/error.h"

namespace parallax {

namespace {

// Nothing new: the window is drawn again after this long, for the clocks in it.
constexpr std::chrono::milliseconds kIdleDraw{100};
// How long the loop waits for a frame before it looks at keys and pointer.
constexpr std::chrono::milliseconds kFrameWait{8};
// Pictures of keyframes, as SceneRenderer::picture() keeps them.
constexpr int kLostPicture = 1, kSelectedPicture = 2, kFirstGamePicture = 10, kFirstMapPicture = 1000;

WindowGeometry geometry_of(const ProgramState& state, bool full_screen) {
  WindowGeometry geometry;
  if (state.window_width > 0) {
    geometry.x = state.window_x;
    geometry.y = state.window_y;
    geometry.width = state.window_width;
    geometry.height = state.window_height;
  }
  geometry.full_screen = full_screen || state.full_screen;
  return geometry;
}

}  // namespace

LiveWindow::LiveWindow(const LiveOptions& options, const UserSettings& settings, const ProgramState& state)
    : options_(options),
      remembered_(state),
      engine_(options, settings, state),
      games_(game_store_path()),
      started_(SteadyClock::now()) {
  state_.settings = settings;
  state_.panels.debug = options.show_fps;
  const auto folder = [&](const std::string& set, const std::string& desktop) {
    return !options.output.empty() ? options.output : !set.empty() ? set : desktop;
  };
  state_.picture_folder = folder(settings.pictures, pictures_folder());
  state_.video_folder = folder(settings.videos, videos_folder());
  std::string remarks;
  for (const std::string& remark : settings.key_remarks) remarks += (remarks.empty() ? "" : "\n") + remark;
  if (!remarks.empty() && remarks != remembered_.key_remarks) state_.toasts.add(remarks, true);
  remembered_.key_remarks = remarks;
  engine_.open();
  window_ = std::make_unique<Window>("Parallax", geometry_of(state, options.full_screen), settings.interface_scale);
  renderer_ = std::make_unique<SceneRenderer>();
}

LiveWindow::~LiveWindow() = default;

void LiveWindow::run() {
  while (!window_->closing() && !end_requested()) {
    follow_source();
    const bool news = has_news();
    take_keys();
    if (!news && !input_seen_ && SteadyClock::now() - last_draw_ < kIdleDraw) continue;
    input_seen_ = false;
    draw();
    serve_requests();
    answer_edits();
    update_title();
    if (options_.seconds > 0 && milliseconds_since(started_) > 1000 * options_.seconds) break;
    if (options_.frames_limit > 0 && engine_.session() != nullptr &&
        engine_.session()->statistics().frames_read >= options_.frames_limit)
      break;
  }
}

// Opening, first frame, the session's beginning, and what source and session have to say.
void LiveWindow::follow_source() {
  if (state_.screen == Screen::opening && engine_.poll_opened()) {
    if (!engine_.opening_remark().empty()) state_.toasts.add(engine_.opening_remark());
    const LiveSource& source = engine_.source();
    remembered_.camera = names_camera(source.name) ? source.name : remembered_.camera;
    if (source.lens) {
      begin_session(*source.lens, false, options_.record);
    } else {
      state_.screen = Screen::first_run;
    }
  }
  if (!engine_.is_open()) return;
  for (const std::string& message : engine_.feed().take_messages()) state_.toasts.add(message, true);
  if (engine_.feed().ended() && !ended_said_) {
    ended_said_ = true;
    state_.toasts.add("the recording has ended");
  }
  if (engine_.session() == nullptr) return;
  for (std::string failure = engine_.session()->take_failure(); !failure.empty();
       failure = engine_.session()->take_failure())
    state_.toasts.add(failure, true);
}

// Waits a moment for a new frame, and takes it.
bool LiveWindow::has_news() {
  if (engine_.session() != nullptr && state_.screen != Screen::calibrating) {
    auto frame = engine_.session()->wait_for_newer(shown_index_, kFrameWait);
    if (!frame) return false;
    shown_ = std::move(frame);
    shown_index_ = shown_->frame.index;
    memory_.update(shown_->tracked);
    path_.add(shown_->tracked);
    if (shown_->map) state_.content.follow(*shown_->map);
    state_.content.set_seen_from(shown_->tracked.seen_from);
    for (const std::string& trashed : map_file_.frame(*shown_, engine_, &state_, &games_)) maps_.forgotten(trashed);
    if (state_.selected && state_.content.find(*state_.selected) == nullptr) state_.selected.reset();
    const double ahead_s = latency_.take(shown_->frame.time, 1e-3 * static_cast<double>(shown_->tracked.times.total),
                                         SteadyClock::now().time_since_epoch());
    games_.frame(*shown_, game_input(game_keys(), game_has_keys() ? pad_ : GamePad{}), ahead_s);
    tapped_.clear();
    ambient_ =
        light_.update(shown_->frame.colour.empty() ? cv::Mat(shown_->frame.grey) : cv::Mat(shown_->frame.colour));
    return true;
  }
  if (!engine_.is_open()) {
    engine_.wait_opening(kFrameWait);
    return false;
  }
  auto frame = engine_.feed().wait_for_other(preview_, kFrameWait);
  if (!frame) return false;
  preview_ = std::move(frame);
  return true;
}

LiveWindow::Picture LiveWindow::picture_area() const {
  Picture picture;
  const int width = window_->framebuffer_width(), height = window_->framebuffer_height();
  int image_width = 640, image_height = 480;
  if (engine_.session() != nullptr) {
    image_width = engine_.lens().width();
    image_height = engine_.lens().height();
  } else if (preview_) {
    image_width = preview_->grey.cols;
    image_height = preview_->grey.rows;
  }
  const ImVec2 display = ImGui::GetIO().DisplaySize;
  const float sx = display.x / static_cast<float>(std::max(1, width));
  const float sy = display.y / static_cast<float>(std::max(1, height));
  // The calibration's panel lies under the picture, not over it.
  const int below = calibration_ ? static_cast<int>(calibration_->panel_height() / std::max(sy, 1e-6f)) : 0;
  picture.viewport = fit_viewport(image_width, image_height, width, std::max(1, height - below));
  picture.viewport.y += below;
  const Viewport& v = picture.viewport;
  picture.area = {static_cast<float>(v.x) * sx, static_cast<float>(height - v.y - v.height) * sy,
                  static_cast<float>(v.width) * sx, static_cast<float>(v.height) * sy};
  return picture;
}

void LiveWindow::draw() {
  const auto start = SteadyClock::now();
  const double interval = std::chrono::duration<double, std::milli>(start - last_draw_).count();
  last_draw_ = start;
  const int width = window_->framebuffer_width(), height = window_->framebuffer_height();
  if (width <= 0 || height <= 0) return;  // made an icon
  DrawList nothing;
  nothing.background_colour = {0.05f, 0.055f, 0.065f, 1};
  renderer_->draw(nothing, {0, 0, width, height});
  window_->begin_interface();
  const Picture picture = picture_area();
  take_pointer(picture);
  draw_scene(picture);
  draw_interface(picture);
  draw_panels();
  window_->end_interface();
  renderer_->draw_interface(*ImGui::GetDrawData(), width, height);
  capture();
  const double ms = milliseconds_since(start);
  window_->swap();
  latency_.shown(SteadyClock::now().time_since_epoch());
  state_.latency = latency_;
  state_.drawing_ms += 0.1 * (ms - state_.drawing_ms);
  state_.slowest_draw_ms = std::max(state_.slowest_draw_ms, ms);
  if (interval < 1000) state_.frame_interval_ms += 0.1 * (interval - state_.frame_interval_ms);
}

void LiveWindow::draw_scene(const Picture& picture) {
  if (state_.screen == Screen::map && shown_ && shown_->map) {
    const int width = window_->framebuffer_width(), height = window_->framebuffer_height();
    const CameraModel& lens = engine_.lens();
    renderer_->draw(map_view({shown_->map.get(), &shown_->tracked, &lens, &path_, &state_.content, selected_keyframe_},
                             orbit_.camera, width, height),
                    {0, 0, width, height});
    return;
  }
  if (engine_.session() != nullptr && shown_ && state_.screen == Screen::augmented) {
    AugmentedInput input;
    input.frame = &shown_->frame;
    input.tracked = &shown_->tracked;
    input.map = shown_->map.get();
    input.content = &state_.content;
    input.ambient_light = ambient_;
    if (!games_.playing()) input.cursor_px = cursor_px_;
    input.selected = state_.selected;
    input.picked_points = state_.measured;
    AugmentedSettings view = state_.view;
    if (games_.playing()) view.points = view.grid = view.other_planes = false;
    DrawList list = augmented_view(engine_.lens(), input, view);
    games_.draw(*shown_, &list);
    renderer_->draw(list, picture.viewport);
    return;
  }
  if (!preview_) return;
  AugmentedInput input;
  input.frame = preview_.get();
  DrawList list = augmented_view(estimated_lens(preview_->grey.cols, preview_->grey.rows), input);
  if (calibration_) calibration_->draw(&list);
  renderer_->draw(list, picture.viewport);
}

void LiveWindow::draw_interface(const Picture& picture) {
  if (state_.screen == Screen::opening || (!preview_ && !shown_)) {
    const ImVec2 display = ImGui::GetIO().DisplaySize;
    const char* text = "opening the camera";
    const ImVec2 size = ImGui::CalcTextSize(text);
    ImGui::GetForegroundDrawList()->AddText({(display.x - size.x) / 2, (display.y - size.y) / 2}, 0xffffffff, text);
  }
  if (state_.screen == Screen::first_run) {
    const FirstRunChoice choice = draw_first_run(engine_.source().identity);
    if (choice == FirstRunChoice::calibrate) state_.requests.calibrate = true;
    if (choice == FirstRunChoice::estimate && preview_)
      begin_session(estimated_lens(preview_->grey.cols, preview_->grey.rows), true, options_.record);
  }
  if (state_.screen == Screen::calibrating && calibration_) take_calibration();
  if (engine_.session() == nullptr || !shown_) return;
  AugmentedInterface view;
  const CameraModel& lens = engine_.lens();
  view.area = picture.area;
  view.camera = &lens;
  view.tracked = &shown_->tracked;
  view.content = &state_.content;
  view.message = memory_.message();
  view.frames_per_second = shown_->frames_per_second;
  view.selected = state_.selected;
  view.hints.automatic = !engine_.run_options().manual_initialisation;
  const auto& keys = state_.settings.keys.chords(Action::initialise);
  view.hints.key = keys.empty() ? "the initialisation key" : key_chord_name(keys.front());
  const CameraStatus status = engine_.feed().status();
  if (engine_.lens_is_estimated()) view.remark = "estimated lens";
  if (state_.recording) view.remark += view.remark.empty() ? "recording" : ", recording";
  if (video_) view.remark += view.remark.empty() ? "video" : ", video";
  if (status.state == CameraState::disconnected)
    view.banner = status.text.empty() ? "camera disconnected: plug it in again" : status.text;
  if (state_.screen == Screen::map) {
    const ImVec2 display = ImGui::GetIO().DisplaySize;
    view.area = {0, 0, display.x, display.y};
    view.hint = false;
    const CameraModel outside = orbit_lens(window_->framebuffer_width(), window_->framebuffer_height());
    view.camera = &outside;
    view.labels_from = orbit_.camera.camera_from_world();
    draw_augmented_interface(view);
    const SnapshotKeyframe* keyframe =
        selected_keyframe_ && shown_->map ? find_keyframe(*shown_->map, *selected_keyframe_) : nullptr;
    if (keyframe == nullptr) return;
    const GreyImage image = keyframe_picture(*keyframe);
    if (image.empty()) return;
    void* texture = renderer_->picture(kSelectedPicture, image);
    const float width = std::min(0.3f * display.x, 16 * ImGui::GetFontSize());
    ImGui::SetNextWindowPos({display.x - 8, display.y - 8}, ImGuiCond_Always, {1, 1});
    ImGui::Begin("Keyframe", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoSavedSettings |
                     ImGuiWindowFlags_NoFocusOnAppearing);
    ImGui::Text("keyframe %d", static_cast<int>(keyframe->id.index));
    ImGui::Image(texture, {width, width * static_cast<float>(image.rows) / static_cast<float>(image.cols)});
    ImGui::End();
    return;
  }
  if (state_.screen != Screen::augmented) return;
  if (shown_->tracked.state == TrackingState::lost && shown_->map) {
    const auto pose = memory_.last_pose(*shown_->map);
    const SnapshotKeyframe* keyframe = pose ? nearest_keyframe(*shown_->map, *pose) : nullptr;
    const GreyImage image = keyframe != nullptr ? keyframe_picture(*keyframe) : GreyImage();
    if (!image.empty()) {
      view.lost_picture = renderer_->picture(kLostPicture, image);
      view.lost_picture_aspect = static_cast<float>(image.cols) / static_cast<float>(image.rows);
    }
  }
  view.lost_text = !games_.playing();
  draw_augmented_interface(view);
  if (shown_->map && !shown_->map->empty()) games_.draw_interface(picture.area, state_.settings.keys);
}

void LiveWindow::draw_panels() {
  const LiveFrame* frame = shown_.get();
  if (state_.panels.help) draw_help_panel(&state_);
  if (state_.panels.camera) draw_camera_panel(&state_, &engine_);
  if (state_.panels.map) draw_map_panel(&state_, &engine_, frame);
  if (state_.panels.content) draw_content_panel(&state_, frame);
  if (state_.panels.record) draw_record_panel(&state_, &engine_);
  if (state_.panels.debug) draw_debug_panel(&state_, &engine_, frame);
  if (state_.screen == Screen::augmented || state_.screen == Screen::map)
    maps_.draw([this](int key, const cv::Mat& image) { return renderer_->picture(kFirstMapPicture + key, image); },
               &engine_, &state_);
  const bool entered = draw_task(&state_);
  if (std::exchange(enter_seen_, false) || entered) end_task();
  if (state_.screen == Screen::augmented && games_.menu_is_open()) {
    try {
      games_.draw_menu(
          state_.settings.keys, pad_.present,
          [this](int key, const cv::Mat& image) { return renderer_->picture(kFirstGamePicture + key, image); },
          engine_.lens());
    } catch (const std::exception& e) {
      state_.toasts.add(e.what(), true);
    }
  }
  draw_toasts(&state_);
}

// Screenshot and video of what has just been drawn. A full disk is a line in the window.
void LiveWindow::capture() {
  const double seconds = milliseconds_since(video_start_) * 1e-3;
  const bool for_video = video_ && video_->due(seconds);
  if (!for_video && !screenshot_wanted_) return;
  const cv::Mat3b picture = read_framebuffer(window_->framebuffer_width(), window_->framebuffer_height());
  if (screenshot_wanted_) {
    screenshot_wanted_ = false;
    try {
      state_.toasts.add("saved " + save_screenshot(picture, state_.picture_folder));
      if (const cv::Mat4b made = games_.picture(); !made.empty())
        state_.toasts.add("and " + save_game_picture(made, state_.picture_folder));
    } catch (const std::exception& e) {
      state_.toasts.add(e.what(), true);
    }
  }
  if (!for_video) return;
  try {
    video_->add(picture, seconds);
    if (video_->has_room()) return;
    toggle_video();
    state_.toasts.add("the disk is nearly full: the video has ended", true);
  } catch (const std::exception& e) {
    state_.toasts.add(e.what(), true);
    video_.reset();
    state_.video_running = false;
  }
}

// "Parallax: tracking": what the task bar says.
void LiveWindow::update_title() {
  std::string what = "opening the camera";
  if (state_.screen == Screen::first_run) what = "first time with this camera";
  if (state_.screen == Screen::calibrating)
    what = calibration_ && calibration_->enough() ? "calibrating, enough" : "calibrating";
  if (state_.screen == Screen::augmented || state_.screen == Screen::map)
    what = shown_ ? to_string(shown_->tracked.state) : "starting";
  if (state_.screen == Screen::map) what += ", map";
  if (state_.screen == Screen::augmented && games_.menu_is_open()) what += ", games";
  if (maps_.is_open()) what += ", maps";
  if (what == title_) return;
  title_ = what;
  window_->set_title("Parallax: " + what);
}

ProgramState LiveWindow::state_to_remember() const { return remembered_; }

std::optional<RunResult> LiveWindow::finish(OutputSteps* steps) {
  const WindowGeometry geometry = window_->geometry();
  remembered_.window_x = geometry.x;
  remembered_.window_y = geometry.y;
  remembered_.window_width = geometry.width;
  remembered_.window_height = geometry.height;
  remembered_.full_screen = geometry.full_screen;
  calibration_.reset();
  if (video_) {
    (*steps)([&] {
      video_->close();
      std::cout << "video: " << video_->path() << '\n';
    });
    video_.reset();
  }
  if (shown_) map_file_.hand_over(*shown_, engine_, state_, games_);
  renderer_.reset();
  window_.reset();
  (*steps)([&] { engine_.end(); });
  return engine_.last_result();
}

int run_live_window(const LiveOptions& options) {
  const UserSettings settings = read_user_settings(settings_path());
  LiveWindow window(options, settings, read_program_state(state_path()));
  window.run();
  OutputSteps steps;
  const std::optional<RunResult> result = window.finish(&steps);
  if (!state_path().empty()) {
    try {
      write_program_state(window.state_to_remember(), state_path());
    } catch (const RunError& e) {
      std::cerr << "parallax: warning: " << e.what() << '\n';
    }
  }
  if (result) {
    for (const SourceWarning& w : result->warnings) std::cerr << "parallax: warning: " << w.text << '\n';
    write_live_outputs(options, window.engine().source(), window.engine().run_options(), window.engine().lens(),
                       *result, &steps);
    std::cout << summary_text(*result);
  }
  steps.finish();
  return kExitDone;
}

}  // namespace parallax
