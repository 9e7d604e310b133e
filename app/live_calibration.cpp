#include "app/live_calibration.h"

#include <imgui.h>

#include <algorithm>
#include <exception>

namespace parallax {

namespace {

constexpr std::chrono::milliseconds kFrameWait{100};
// A solve is tried by itself when so many views more than at the last one were taken.
constexpr int kViewsBetweenSolves = 5;

}  // namespace

LiveCalibration::LiveCalibration(const LiveFeed* feed, const CalibrationTarget& target, int width, int height)
    : feed_(feed), target_(target), width_(width), height_(height) {
  thread_ = std::jthread([this](std::stop_token stop) {
    try {
      run(stop);
    } catch (const std::exception& e) {
      MutexLock lock(mutex_);
      state_.failure = e.what();
    }
  });
}

LiveCalibration::~LiveCalibration() {
  thread_.request_stop();
  thread_.join();
}

LiveCalibration::State LiveCalibration::state() const {
  MutexLock lock(mutex_);
  return state_;
}

void LiveCalibration::solve() {
  MutexLock lock(mutex_);
  solve_wanted_ = true;
}

void LiveCalibration::drop_last_view() {
  MutexLock lock(mutex_);
  drop_wanted_ = true;
}

void LiveCalibration::run(std::stop_token stop) {
  CalibrationSession session(target_, width_, height_);
  std::shared_ptr<const Frame> seen;
  int views_solved = 0;
  while (!stop.stop_requested()) {
    bool solve = false;
    {
      MutexLock lock(mutex_);
      if (drop_wanted_) session.drop_last_view();
      solve = solve_wanted_;
      drop_wanted_ = solve_wanted_ = false;
    }
    const int views = session.coverage().views;
    if (solve || (session.ready() && views >= views_solved + kViewsBetweenSolves)) {
      views_solved = views;
      solve_now(&session, stop);
    }
    auto frame = feed_->wait_for_other(seen, kFrameWait);
    if (!frame) continue;
    seen = std::move(frame);
    if (seen->grey.cols != width_ || seen->grey.rows != height_) continue;
    CalibrationFrameResult result = session.add_frame(seen->grey, seen->index);
    MutexLock lock(mutex_);
    state_.newest = std::move(result);
    state_.coverage = session.coverage();
    state_.wanted = session.wanted_view();
    state_.progress = session.progress();
  }
}

void LiveCalibration::solve_now(CalibrationSession* session, std::stop_token stop) {
  {
    MutexLock lock(mutex_);
    state_.solving = true;
  }
  CalibrationRequest request;
  request.stop = stop;
  CalibrationOutcome outcome = run_calibration(session->data(), request);
  if (outcome.ok) session->set_estimate(outcome.calibration.camera);
  MutexLock lock(mutex_);
  state_.solving = false;
  state_.judgement = session->judge(outcome);
  state_.outcome = std::move(outcome);
}

void LiveCalibration::draw(DrawList* list) const {
  const State now = state();
  const CalibrationCoverage& coverage = now.coverage;
  const float cell_x = coverage.columns > 0 ? static_cast<float>(width_) / static_cast<float>(coverage.columns) : 0;
  const float cell_y = coverage.rows > 0 ? static_cast<float>(height_) / static_cast<float>(coverage.rows) : 0;
  for (int row = 0; row < coverage.rows; ++row) {
    for (int column = 0; column < coverage.columns; ++column) {
      const int count = coverage.cells[static_cast<std::size_t>(row * coverage.columns + column)];
      const float x = (static_cast<float>(column) + 0.5f) * cell_x, y = (static_cast<float>(row) + 0.5f) * cell_y;
      // A cell fills with dots as corners are seen in it.
      const float size = 4 + std::min(20.0f, 0.4f * static_cast<float>(count));
      list->screen_points.push_back(
          {{x, y},
           count > 0 ? DrawColour{0.2f, 0.9f, 0.3f, 0.55f} : DrawColour{0.9f, 0.3f, 0.2f, 0.7f},
           size,
           count == 0});
    }
  }
  const auto& outline = now.wanted.outline_px;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2d& next = outline[(i + 1) % outline.size()];
    list->screen_lines.push_back({outline[i].cast<float>(), next.cast<float>(), {1, 0.85f, 0.2f, 0.9f}, 2.5f});
  }
  if (!now.newest.detection) return;
  const bool kept = now.newest.verdict == FrameVerdict::kept;
  for (const TargetCorner& corner : now.newest.detection->corners)
    list->screen_points.push_back(
        {corner.px.cast<float>(), kept ? DrawColour{0.3f, 1, 0.3f, 1} : DrawColour{0.3f, 0.7f, 1, 1}, 5, true});
}

LiveCalibration::Choice LiveCalibration::draw_panel() {
  const State now = state();
  const ImVec2 display = ImGui::GetIO().DisplaySize;
  const float font = ImGui::GetFontSize();
  Choice choice = Choice::none;
  ImGui::SetNextWindowPos({display.x / 2, display.y - 0.5f * font}, ImGuiCond_Always, {0.5f, 1});
  ImGui::SetNextWindowSize({std::min(32 * font, display.x - font), 0});
  ImGui::SetNextWindowBgAlpha(0.85f);
  ImGui::Begin("Calibration", nullptr,
               ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoResize |
                   ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoFocusOnAppearing);
  ImGui::PushTextWrapPos(0);
  if (!now.failure.empty()) ImGui::TextUnformatted(now.failure.c_str());
  ImGui::TextUnformatted(now.coverage.views == 0
                             ? "Show the printed board to the camera. Views are taken by themselves when it is still."
                             : now.wanted.text.c_str());
  ImGui::TextUnformatted(now.newest.text.c_str());
  ImGui::ProgressBar(static_cast<float>(now.progress), {-1, 0},
                     (std::to_string(now.coverage.views) + " views").c_str());
  if (now.solving) ImGui::TextUnformatted("working it out...");
  if (now.outcome && now.outcome->ok) {
    const CameraCalibration& found = now.outcome->calibration;
    ImGui::Text("%s lens, focal length %.1f px, error %.2f px%s", to_string(found.camera.kind()),
                found.camera.mean_focal_px(), found.rms_px, now.judgement.enough ? ": this is good" : "");
    if (!now.judgement.enough && !now.judgement.missing.empty())
      ImGui::TextUnformatted(now.judgement.missing.front().c_str());
  } else if (now.outcome) {
    ImGui::TextUnformatted(now.outcome->reason.c_str());
  }
  ImGui::PopTextWrapPos();
  ImGui::BeginDisabled(!now.outcome || !now.outcome->ok);
  if (ImGui::Button("Use it")) choice = Choice::use;
  ImGui::EndDisabled();
  ImGui::SameLine();
  ImGui::BeginDisabled(now.coverage.views < 4 || now.solving);
  if (ImGui::Button("Work it out now")) solve();
  ImGui::EndDisabled();
  ImGui::SameLine();
  ImGui::BeginDisabled(now.coverage.views == 0);
  if (ImGui::Button("Drop the last view")) drop_last_view();
  ImGui::EndDisabled();
  ImGui::SameLine();
  if (ImGui::Button("Board as PDF")) choice = Choice::print;
  ImGui::SameLine();
  if (ImGui::Button("Cancel")) choice = Choice::cancel;
  ImGui::End();
  return choice;
}

}  // namespace parallax
