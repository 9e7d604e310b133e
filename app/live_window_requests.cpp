// What panels and keys asked the live window for: sessions, edits of the map, videos, recordings, calibration.
#include <imgui.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "app/live_window.h"
#include "calib/target_pdf.h"
#include "core/error.h"
#include "core/parse_text.h"

namespace parallax {

namespace {

// The board that `parallax calibrate --print-target chessboard` prints.
CalibrationTarget window_target() { return {}; }

template <class Value>
bool is_ready(const std::future<Value>& future) {
  return future.valid() && future.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
}

}  // namespace

void LiveWindow::serve_requests() {
  const LiveRequests wanted = std::exchange(state_.requests, {});
  LiveSession* session = engine_.session();
  state_.recording = session != nullptr && session->statistics().recording;
  if (wanted.screenshot) screenshot_wanted_ = true;
  if (wanted.video) toggle_video();
  if (wanted.calibrate) begin_calibration();
  if (wanted.print_marker) print_marker();
  if (session == nullptr) return;
  if (wanted.record) return toggle_recording();
  if (wanted.reset) reset_map();
  if (wanted.maps) maps_.toggle(engine_);
  const bool mapped = shown_ && shown_->map && !shown_->map->empty();
  if ((wanted.measure || wanted.find_plane || wanted.marker) && !mapped)
    return state_.toasts.add("there is no map yet", true);
  if (wanted.measure) {
    state_.task = Task::measure_first;
    state_.measured.clear();
    state_.screen = Screen::augmented;
  }
  if (wanted.find_plane) {
    PlaneEdit edit;
    if (const auto hit = LivePointing::hit(engine_.lens(), *shown_, cursor_px_); hit && hit->kind == HitKind::point)
      edit.seed = hit->position;
    edits_.push_back(
        {session->edit(edit), edit.seed ? "the plane here is the table now" : "the table was found again", false});
  }
  if (wanted.marker) look_for_marker();
}

void LiveWindow::answer_edits() {
  std::erase_if(edits_, [this](Edit& edit) {
    if (!is_ready(edit.reply)) return false;
    const EditReply reply = edit.reply.get();
    if (reply.ok && edit.sets_scale) map_file_.scale_was_set();
    state_.toasts.add(reply.ok ? edit.done : reply.reason, !reply.ok);
    return true;
  });
  std::erase_if(resets_, [](const auto& reset) { return is_ready(reset); });
  if (!is_ready(marker_)) return;
  const MarkerScale scale = marker_.get();
  if (!scale.ok) return state_.toasts.add(scale.reason, true);
  char text[96];
  std::snprintf(text, sizeof text, "scale taken from marker %d, to %.1f %%", scale.id,
                100 * scale.sigma / scale.factor);
  ask_scale(scale.factor, text);
}

void LiveWindow::begin_session(const CameraModel& lens, bool estimated, const std::string& record_path) {
  if (shown_) map_file_.hand_over(*shown_, engine_, state_, games_);
  try {
    games_.leave();  // it was played through another lens
  } catch (const std::exception& e) {
    state_.toasts.add(e.what(), true);
  }
  try {
    engine_.begin(lens, estimated, record_path);
  } catch (const RunError& e) {
    if (record_path.empty() || record_path == options_.record) throw;
    state_.toasts.add(e.what(), true);
    engine_.begin(lens, estimated, "");
  }
  map_file_.begun();
  maps_.close();
  if (const std::string problem = engine_.take_maps_problem(); !problem.empty()) state_.toasts.add(problem, true);
  shown_.reset();
  shown_index_ = -1;
  memory_ = {};
  path_ = CameraPath();
  drop_task();
  selected_keyframe_.reset();
  edits_.clear();
  state_.screen = Screen::augmented;
}

void LiveWindow::reset_map() {
  selected_keyframe_.reset();
  drop_task();
  if (engine_.maps() != nullptr) return engine_.maps()->forget_map();
  resets_.push_back(engine_.session()->reset());
  state_.toasts.add("the map is forgotten");
}

void LiveWindow::toggle_video() {
  if (!video_) {
    try {
      video_ = std::make_unique<ScreenVideo>(new_file_in(state_.video_folder, "mp4"),
                                             cv::Size(window_->framebuffer_width(), window_->framebuffer_height()));
      video_start_ = SteadyClock::now();
      state_.video_running = true;
      state_.toasts.add("video: " + video_->path());
    } catch (const std::exception& e) {
      state_.toasts.add(e.what(), true);
    }
    return;
  }
  try {
    video_->close();
    state_.toasts.add("saved " + video_->path());
  } catch (const std::exception& e) {
    state_.toasts.add(e.what(), true);
  }
  video_.reset();
  state_.video_running = false;
}

// A recording holds a session from its beginning.
void LiveWindow::toggle_recording() {
  std::string path;
  if (!state_.recording) {
    try {
      path = new_file_in(state_.video_folder, "parallax");
    } catch (const std::exception& e) {
      return state_.toasts.add(e.what(), true);
    }
  }
  const std::string ended = engine_.record_path();
  begin_session(CameraModel(engine_.lens()), engine_.lens_is_estimated(), path);
  state_.toasts.add(path.empty() ? "saved " + ended : "recording into " + path);
}

void LiveWindow::ask_scale(double factor, const std::string& said) {
  if (engine_.session() == nullptr) return;
  edits_.push_back({engine_.session()->edit(ScaleEdit{factor}), said, true});
}

void LiveWindow::print_marker() {
  try {
    cv::Mat3b sheet;
    cv::cvtColor(marker_sheet(), sheet, cv::COLOR_GRAY2BGR);
    state_.toasts.add("print " + save_screenshot(sheet, state_.picture_folder) +
                      ", measure the black square, and type its side");
  } catch (const std::exception& e) {
    state_.toasts.add(e.what(), true);
  }
}

// On a thread of its own: it looks at every keyframe.
void LiveWindow::look_for_marker() {
  if (marker_.valid()) return;
  MarkerOptions options;
  options.side_m = state_.marker_cm / 100;
  try {
    options.validate();
  } catch (const InputError& e) {
    return state_.toasts.add(e.what(), true);
  }
  state_.toasts.add("looking for a marker");
  marker_ = std::async(std::launch::async, [lens = engine_.lens(), frame = shown_, options] {
    std::optional<PresentView> present;
    if (frame->tracked.camera_from_world) present = PresentView{frame->frame.grey, *frame->tracked.camera_from_world};
    return scale_from_marker(lens, *frame->map, options, present);
  });
}

// Enter was pressed in the field of the present task.
void LiveWindow::end_task() {
  if (state_.task == Task::name_map) {
    maps_.rename(state_.text.data(), &engine_, &state_);
    state_.task = Task::none;
  } else if (state_.task == Task::write_label) {
    state_.content.rename(state_.editing, state_.text.data());
    state_.task = Task::none;
  } else if (state_.task == Task::measure_distance && state_.measured.size() == 2) {
    double distance_cm = 0;
    if (!parse_number(trimmed(state_.text.data()), &distance_cm))
      return state_.toasts.add("the distance: type a number of centimetres, like 12.5", true);
    const DistanceScale scale = scale_from_distance(state_.measured[0], state_.measured[1], distance_cm / 100);
    if (!scale.ok) return state_.toasts.add(scale.reason, true);
    state_.content.add_line(state_.measured[0], state_.measured[1]);
    ask_scale(scale.factor, "the scale is set");
    state_.measured.clear();
    state_.task = Task::none;
  }
}

// A label that was not given a text keeps the one it has.
void LiveWindow::drop_task() {
  state_.task = Task::none;
  state_.measured.clear();
}

void LiveWindow::begin_calibration() {
  if (!engine_.is_open() || state_.screen == Screen::calibrating) return;
  const auto frame = engine_.feed().newest();
  if (!frame) return state_.toasts.add("no picture from the camera yet", true);
  before_calibration_ = state_.screen;
  calibration_ =
      std::make_unique<LiveCalibration>(&engine_.feed(), window_target(), frame->grey.cols, frame->grey.rows);
  preview_ = frame;
  state_.screen = Screen::calibrating;
}

void LiveWindow::cancel_calibration() {
  calibration_.reset();
  state_.screen = before_calibration_;
}

void LiveWindow::take_calibration() {
  const LiveCalibration::Choice choice = calibration_->draw_panel();
  if (choice == LiveCalibration::Choice::cancel) return cancel_calibration();
  if (choice == LiveCalibration::Choice::print) {
    try {
      const std::string path = new_file_in(state_.picture_folder, "pdf");
      write_target_pdf(window_target(), Paper::a4, path);
      state_.toasts.add("print " + path + " at 100 %");
    } catch (const std::exception& e) {
      state_.toasts.add(e.what(), true);
    }
    return;
  }
  if (choice != LiveCalibration::Choice::use) return;
  const LiveCalibration::State found = calibration_->state();
  if (!found.outcome || !found.outcome->ok) return;
  const CameraModel lens = found.outcome->calibration.camera;
  try {
    remember_calibration(lens, engine_.source().identity);
    state_.toasts.add("calibrated; it is kept for this camera");
  } catch (const std::exception& e) {
    state_.toasts.add(std::string(e.what()) + "; the calibration holds until the end", true);
  }
  calibration_.reset();
  // What --record asked for begins with the first session.
  begin_session(lens, false, engine_.session() == nullptr ? options_.record : "");
}

}  // namespace parallax
