#include "app/session_report.h"

#include <algorithm>
#include <memory>
#include <sstream>

#include "app/session_picture.h"
#include "app/session_report_svg.h"
#include "app/session_report_tables.h"
#include "core/file_io.h"

namespace parallax {
namespace {

constexpr std::size_t kMostSingleMaps = 12;
constexpr CanvasColour kPlainInk{0, 114, 178}, kLoopInk{213, 94, 0}, kRealTimeInk{120, 120, 120};
constexpr const char* kStyle = R"(
body { font-family: sans-serif; color: #222222; background: #ffffff; max-width: 1440px; margin: 1.5em auto; padding: 0 1em; line-height: 1.4; }
table { border-collapse: collapse; margin: 1em 0; font-size: 0.9em; }
caption { text-align: left; font-weight: bold; padding: 0.3em 0; }
th, td { border-bottom: 1px solid #cccccc; padding: 0.2em 0.6em; text-align: left; vertical-align: top; }
th[scope=row] { font-weight: normal; }
td.n { text-align: right; font-variant-numeric: tabular-nums; }
tfoot tr:first-child { font-weight: bold; }
.paper, .paper th, .paper td { color: #595959; font-weight: normal; }
.scroll { overflow-x: auto; }
figure { margin: 1em 0; }
figcaption { font-size: 0.9em; }
.plots { display: flex; flex-wrap: wrap; gap: 1em; }
.plots figure { flex: 1 1 600px; max-width: 760px; margin: 0; }
)";

void write_figure(const std::string& element, const std::string& caption, std::ostream& out) {
  out << "<figure>\n" << element << "<figcaption>" << markup_text(caption) << "</figcaption>\n</figure>\n";
}

// A dot a step, at the keyframe's number when all sessions are put one after the other; a series a session, or of the
// pose graph one of windows with and one without a loop.
std::string steps_plot(const SessionReportData& data, SessionModule module, const PlotAxes& axes) {
  std::map<int, int> offsets;
  int offset = 0;
  for (const auto& [id, seconds] : session_offsets(data)) {
    offsets[id] = offset;
    offset += static_cast<int>(data.scene.session(id)->poses.size());
  }
  std::vector<PlotSeries> series;
  const bool graph = module == SessionModule::pose_graph;
  if (graph) {
    series.push_back({"no loop", kPlainInk, false, false, {}});
    series.push_back({"a loop was closed", kLoopInk, false, false, {}});
  }
  std::map<int, std::size_t> series_of;
  if (!graph)
    for (const auto& [id, begin] : offsets) {
      const SceneSession& session = *data.scene.session(id);
      series_of[id] = series.size();
      series.push_back({session.name, session.colour, false, false, {}});
    }
  for (const SessionTiming& t : data.timings) {
    const auto begin = offsets.find(t.key.session);
    if (t.module != module || begin == offsets.end() || !std::isfinite(t.ms)) continue;
    const std::size_t at = graph ? (t.loop ? 1 : 0) : series_of.at(t.key.session);
    series[at].points.push_back({static_cast<double>(begin->second + t.key.keyframe), t.ms});
  }
  return plot_element(series, axes);
}

std::string cumulative_plot(const SessionReportData& data, const std::vector<SessionModule>& modules,
                            const PlotAxes& axes) {
  std::vector<PlotSeries> series;
  double end = 0;
  for (const SessionModule module : modules) {
    PlotSeries s{name_of(module), session_colour(static_cast<int>(series.size())), true, false,
                 cumulative_times(data, module)};
    if (s.points.empty()) continue;
    end = std::max(end, s.points.back().x);
    series.push_back(std::move(s));
  }
  if (series.empty()) return {};
  series.push_back({"real time", kRealTimeInk, true, true, {{0, 0}, {end, end}}});
  return plot_element(series, axes);
}

void write_plots(const SessionReportData& data, std::ostream& out) {
  out << "<div class=\"plots\">\n";
  const auto plot = [&](const std::string& element, const std::string& caption, const std::string& what) {
    if (element.empty())
      out << "<p>" << markup_text(what) << ": not known.</p>\n";
    else
      write_figure(element, caption, out);
  };
  const auto axes = [](const char* id, const char* title, const char* x, const char* y) {
    PlotAxes a;
    a.id = id;
    a.title = title;
    a.x_label = x;
    a.y_label = y;
    return a;
  };
  const char* poses = "pose, all sessions one after the other";
  plot(steps_plot(data, SessionModule::window, axes("window", "Windowed bundle adjustment", poses, "ms")),
       "(a) Windowed bundle adjustment, a keyframe (the paper's Fig. 8a, 9a, 11a).", "Times of the windows");
  plot(steps_plot(data, SessionModule::place_recognition, axes("place", "Place recognition", poses, "ms")),
       "(b) Place recognition, a keyframe (Fig. 8b, 9b, 11b).", "Times of place recognition");
  plot(steps_plot(data, SessionModule::pose_graph, axes("graph", "Pose graph", poses, "ms")),
       "(c) Pose graph, a window (Fig. 8c, 9c, 11c).", "Times of the pose graph");
  const char* time = "session time, s, all sessions one after the other";
  plot(cumulative_plot(data, {SessionModule::feature_tracking, SessionModule::stereo_odometry, SessionModule::window},
                       axes("front", "Front end, seconds spent so far", time, "s")),
       "(d) Front end (Fig. 8d, 9d, 11d). A module that stays below the line keeps up on a core of its own.",
       "Times of the front end");
  plot(cumulative_plot(data, {SessionModule::place_recognition, SessionModule::pose_graph},
                       axes("back", "Back end, seconds spent so far", time, "s")),
       "(e) Back end (Fig. 8e, 9e, 11e).", "Times of the back end");
  out << "</div>\n";
}

std::string map_element(const SessionScene& scene, const SessionPictureOptions& options, const std::string& label,
                        const std::string& id) {
  std::unique_ptr<SvgSheet> sheet;
  draw_sessions(scene, options, [&](int width, int height) {
    sheet = std::make_unique<SvgSheet>(width, height, SvgWidth::of_page, label, " data-map=\"" + id + "\"");
    return sheet.get();
  });
  return sheet->element();
}

void write_maps(const SessionReportData& data, std::ostream& out) {
  if (data.scene.components().empty()) {
    out << "<p>No session has a pose: there is no map.</p>\n";
    return;
  }
  SessionPictureOptions options;
  options.width_px = 1200;
  options.floor_plan = data.floor_plan;
  const bool textured = std::any_of(data.scene.sessions.begin(), data.scene.sessions.end(),
                                    [](const SceneSession& s) { return s.textured; });
  const std::string points = textured ? "Points have the colours of the images. " : "Grey points are features. ";
  write_figure(map_element(data.scene, options, "map from above", "above"),
               "All sessions from above (Fig. 10f, 12a). " + points +
                   "A ring: a session begins; a cross: it ends; small rings joined by a line: an encounter.",
               out);
  options.view = SessionPictureView::elevation;
  write_figure(map_element(data.scene, options, "elevation by session time", "elevation"),
               "Elevation grows with session time, one session above the other (Fig. 10e), with the links within and "
               "between them.",
               out);
  options.view = SessionPictureView::from_the_side;
  options.most_plot_height_px = 500;
  write_figure(map_element(data.scene, options, "map from the side", "side"), "All sessions from the side (Fig. 12b).",
               out);
  std::size_t drawn = 0;
  for (const SceneSession& session : data.scene.sessions) drawn += session.poses.empty() ? 0 : 1;
  if (drawn < 2) return;
  out << "<div class=\"plots\">\n";
  std::size_t left_out = 0, number = 0;
  options.view = SessionPictureView::from_above;
  options.width_px = 760;
  options.most_plot_height_px = 560;
  for (const SceneSession& session : data.scene.sessions) {
    if (session.poses.empty()) continue;
    if (++number > kMostSingleMaps) {
      ++left_out;
      continue;
    }
    write_figure(map_element(data.scene.only(session.id), options, "map of one session",
                             "session-" + std::to_string(session.id)),
                 session.name + " alone (Fig. 10a to d), in the frame of those it has met.", out);
  }
  out << "</div>\n";
  if (left_out > 0) out << "<p>and " << left_out << " sessions more.</p>\n";
}

void write_warnings(const SessionReportData& data, std::ostream& out) {
  for (const std::string& remark : data.not_known) out << "<p>" << markup_text(remark) << "</p>\n";
  if (!data.warnings_known) {
    out << "<p>Warnings of the run: not known.</p>\n";
    return;
  }
  if (data.warnings.empty()) {
    out << "<p>There were none.</p>\n";
    return;
  }
  out << "<ul id=\"warnings\">\n";
  for (const auto& [session, text] : data.warnings)
    out << "<li>" << markup_text(session) << ": " << markup_text(text) << "</li>\n";
  out << "</ul>\n";
}

}  // namespace

std::string session_report_page(const SessionReportData& data) {
  std::ostringstream out;
  out << "<!DOCTYPE html>\n<html xmlns=\"http://www.w3.org/1999/xhtml\" lang=\"en\">\n<head>\n<meta "
         "charset=\"utf-8\"/>\n<meta name=\"viewport\" content=\"width=device-width, "
         "initial-scale=1\"/>\n<title>Sessions: "
      << markup_text(data.origin) << "</title>\n<style>" << kStyle
      << "</style>\n</head>\n<body>\n<h1>Sessions</h1>\n<p>" << markup_text(data.program) << ", on "
      << markup_text(data.origin) << ".</p>\n";
  out << "<h2>What there is</h2>\n<div class=\"scroll\">\n";
  write_sessions_table(data, out);
  out << "</div>\n<h2>What it takes</h2>\n<div class=\"scroll\">\n";
  write_times_table(data, out);
  out << "</div>\n";
  write_plots(data, out);
  out << "<h2>Maps</h2>\n";
  write_maps(data, out);
  out << "<h2>Encounters</h2>\n<div class=\"scroll\">\n";
  write_encounters_table(data, out);
  out << "</div>\n<h2>Warnings</h2>\n";
  write_warnings(data, out);
  out << "<h2>Settings</h2>\n";
  write_settings_table(data, out);
  out << "</body>\n</html>\n";
  return out.str();
}

void write_session_report(const SessionReportData& data, const std::string& path) {
  const std::string page = session_report_page(data);
  write_file_atomically(path, [&](std::ostream& out) { out << page; });
}

void write_session_report(const std::string& database, const std::string& path) {
  SessionDatabase read(database, SqliteMode::read);
  write_session_report(report_on_database(&read), path);
}

}  // namespace parallax
