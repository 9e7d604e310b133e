#include "app/live_calibration.h"

#include <imgui.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <exception>

namespace parallax {

namespace {

constexpr std::chrono::milliseconds kFrameWait{100};
// A solve is tried by itself when so many views more than at the last one were taken.
constexpr int kViewsBetweenSolves = 5;
constexpr int kFewestToSolve = 4;
// How long it is shown that a view was taken, and corners after the frame they were seen in.
constexpr std::chrono::milliseconds kKeptShown{900}, kCornersShown{400};

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

bool LiveCalibration::enough() const {
  MutexLock lock(mutex_);
  return state_.enough();
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
  // Ends with this function at the latest: the solve asks `stop`, and the future waits for it.
  std::future<CalibrationOutcome> solving;
  while (!stop.stop_requested()) {
    bool solve = false;
    {
      MutexLock lock(mutex_);
      if (drop_wanted_) session.drop_last_view();
      solve = solve_wanted_;
      drop_wanted_ = solve_wanted_ = false;
    }
    if (solving.valid() && solving.wait_for(std::chrono::seconds(0)) == std::future_status::ready)
      take_outcome(&session, solving.get());
    const int views = session.coverage().views;
    if (!solving.valid() && (solve || (session.ready() && views >= views_solved + kViewsBetweenSolves))) {
      views_solved = views;
      CalibrationRequest request;
      request.stop = stop;
      solving =
          std::async(std::launch::async, [request, data = session.data()] { return run_calibration(data, request); });
    }
    auto frame = feed_->wait_for_other(seen, kFrameWait);
    std::optional<CalibrationFrameResult> result;
    if (frame) {
      seen = std::move(frame);
      if (seen->grey.cols == width_ && seen->grey.rows == height_) result = session.add_frame(seen->grey, seen->index);
    }
    MutexLock lock(mutex_);
    state_.solving = solving.valid();
    state_.coverage = session.coverage();
    state_.wanted = session.wanted_view();
    state_.progress = session.progress();
    if (!result) continue;
    state_.newest_time = SteadyClock::now();
    if (result->verdict == FrameVerdict::kept) state_.kept_time = state_.newest_time;
    state_.newest = std::move(*result);
  }
}

void LiveCalibration::take_outcome(CalibrationSession* session, CalibrationOutcome outcome) {
  if (outcome.ok) session->set_estimate(outcome.calibration.camera);
  MutexLock lock(mutex_);
  state_.judgement = session->judge(outcome);
  state_.outcome = std::move(outcome);
}

void LiveCalibration::draw(DrawList* list) const {
  const State now = state();
  const auto time = SteadyClock::now();
  const CalibrationCoverage& coverage = now.coverage;
  const float width = static_cast<float>(width_), height = static_cast<float>(height_);
  // Sizes are for an image 640 pixels wide.
  const float scale = width / 640;
  const float cell_x = coverage.columns > 0 ? width / static_cast<float>(coverage.columns) : 0;
  const float cell_y = coverage.rows > 0 ? height / static_cast<float>(coverage.rows) : 0;
  for (int row = 0; row < coverage.rows; ++row) {
    for (int column = 0; column < coverage.columns; ++column) {
      const int count = coverage.cells[static_cast<std::size_t>(row * coverage.columns + column)];
      const float x = (static_cast<float>(column) + 0.5f) * cell_x, y = (static_cast<float>(row) + 0.5f) * cell_y;
      // A cell's dot grows as corners are seen in it; an empty one is a red ring.
      if (count == 0) {
        list->screen_points.push_back({{x, y}, {0, 0, 0, 0.55f}, 21 * scale, true});
        list->screen_points.push_back({{x, y}, {1, 0.3f, 0.25f, 1}, 18 * scale, true});
      } else {
        const float size = 7 + std::min(15.0f, 0.25f * static_cast<float>(count));
        list->screen_points.push_back({{x, y}, {0.2f, 0.9f, 0.3f, 0.5f}, size * scale, false});
      }
    }
  }
  const auto frame = [&](const auto& corners, const DrawColour& colour, float thick) {
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const Eigen::Vector2f a = corners[i].template cast<float>();
      const Eigen::Vector2f b = corners[(i + 1) % corners.size()].template cast<float>();
      list->screen_lines.push_back({a, b, colour, thick * scale});
    }
  };
  if (!now.enough()) {
    frame(now.wanted.outline_px, {0, 0, 0, 0.6f}, 5);
    frame(now.wanted.outline_px, {1, 0.85f, 0.2f, 1}, 2.5f);
  }
  if (time - now.kept_time < kKeptShown) {
    const float edge = 3 * scale;
    const std::array<Eigen::Vector2f, 4> border{Eigen::Vector2f(edge, edge), Eigen::Vector2f(width - 1 - edge, edge),
                                                Eigen::Vector2f(width - 1 - edge, height - 1 - edge),
                                                Eigen::Vector2f(edge, height - 1 - edge)};
    frame(border, {0.3f, 1, 0.3f, 1}, 6);
  }
  if (!now.newest.detection || time - now.newest_time > kCornersShown) return;
  const bool kept = now.newest.verdict == FrameVerdict::kept;
  for (const TargetCorner& corner : now.newest.detection->corners)
    list->screen_points.push_back(
        {corner.px.cast<float>(), kept ? DrawColour{0.3f, 1, 0.3f, 1} : DrawColour{0.3f, 0.7f, 1, 1}, 5 * scale, true});
}

namespace {

// What the newest frame was good for.
std::string status_text(const LiveCalibration::State& now) {
  if (SteadyClock::now() - now.kept_time < kKeptShown) return "View " + std::to_string(now.coverage.views) + " taken.";
  switch (now.newest.verdict) {
    case FrameVerdict::no_target:
      return "No board found: it has to be seen whole, with its white border.";
    case FrameVerdict::moving:
      return "Board found: hold still.";
    case FrameVerdict::blurred:
      return "Too blurred: hold still; more light helps.";
    case FrameVerdict::seen_before:
      return "Such a view is taken already.";
    case FrameVerdict::kept:
    case FrameVerdict::full:
      break;
  }
  return now.newest.text;
}

std::string wanted_text(const LiveCalibration::State& now, const CalibrationTarget& target) {
  if (!now.failure.empty()) return now.failure;
  if (now.enough()) return "This is good: press \"Use it\". More views make it better still.";
  if (now.coverage.views > 0) return now.wanted.text;
  return "Show a chessboard of " + std::to_string(target.columns + 1) + " x " + std::to_string(target.rows + 1) +
         " squares (\"Board as PDF\" prints one) and hold it still.";
}

std::string outcome_text(const LiveCalibration::State& now) {
  std::string text;
  if (now.outcome && !now.outcome->ok) {
    text = now.outcome->reason;
  } else if (now.outcome) {
    const CameraCalibration& found = now.outcome->calibration;
    char line[160];
    std::snprintf(line, sizeof line, "Found: %s lens, focal length %.1f px, error %.2f px.", to_string(found.model),
                  found.camera.mean_focal_px(), found.rms_px);
    text = line;
    if (!now.enough() && !now.judgement.missing.empty()) text += " " + now.judgement.missing.front();
  }
  if (now.solving) text += text.empty() ? "Working out the lens..." : " Working it out again...";
  return text;
}

}  // namespace

LiveCalibration::Choice LiveCalibration::draw_panel() {
  const State now = state();
  const ImVec2 display = ImGui::GetIO().DisplaySize;
  const float font = ImGui::GetFontSize();
  Choice choice = Choice::none;
  ImGui::SetNextWindowPos({0, display.y}, ImGuiCond_Always, {0, 1});
  ImGui::SetNextWindowSize({display.x, 0});
  ImGui::Begin("Calibration", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
                   ImGuiWindowFlags_NoFocusOnAppearing);
  ImGui::PushTextWrapPos(0);
  ImGui::PushStyleColor(ImGuiCol_Text, now.enough() ? ImVec4{0.45f, 1, 0.5f, 1} : ImVec4{1, 0.87f, 0.4f, 1});
  ImGui::TextUnformatted(wanted_text(now, target_).c_str());
  ImGui::PopStyleColor();
  ImGui::ProgressBar(static_cast<float>(now.progress), {13 * font, 0}, "");
  // The label in the middle of the bar: the bar's own would wander along.
  const std::string views = now.coverage.views == 1 ? "1 view" : std::to_string(now.coverage.views) + " views";
  const ImVec2 from = ImGui::GetItemRectMin(), to = ImGui::GetItemRectMax(), size = ImGui::CalcTextSize(views.c_str());
  const ImVec2 at{(from.x + to.x - size.x) / 2, (from.y + to.y - size.y) / 2};
  ImGui::GetWindowDrawList()->AddText({at.x + 1, at.y + 1}, 0xc0000000, views.c_str());
  ImGui::GetWindowDrawList()->AddText(at, 0xffffffff, views.c_str());
  ImGui::SameLine();
  ImGui::TextUnformatted(status_text(now).c_str());
  // Its line is there from the start, so that the picture keeps its size.
  const std::string outcome = outcome_text(now);
  ImGui::TextUnformatted(outcome.empty() ? " " : outcome.c_str());
  ImGui::PopTextWrapPos();
  ImGui::BeginDisabled(!now.outcome || !now.outcome->ok);
  if (now.enough()) ImGui::PushStyleColor(ImGuiCol_Button, {0.1f, 0.55f, 0.2f, 1});
  if (ImGui::Button("Use it")) choice = Choice::use;
  if (now.enough()) ImGui::PopStyleColor();
  ImGui::EndDisabled();
  ImGui::SameLine();
  ImGui::BeginDisabled(now.coverage.views < kFewestToSolve || now.solving);
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
  panel_height_ = ImGui::GetWindowSize().y;
  ImGui::End();
  return choice;
}

}  // namespace parallax
