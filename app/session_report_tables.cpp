#include "app/session_report_tables.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "app/session_outputs.h"
#include "app/session_report_svg.h"

namespace parallax {
namespace {

constexpr std::size_t kMostEncounterRows = 200;
constexpr SessionModule kAllModules[] = {SessionModule::feature_tracking, SessionModule::stereo_odometry,
                                         SessionModule::window, SessionModule::place_recognition,
                                         SessionModule::pose_graph};

// The paper's Table 2: mean in seconds, variance in square seconds, of its three experiments.
struct PaperTimes {
  double mean_s[3], variance_s2[3];
};
constexpr PaperTimes kPaperTimes[] = {{{0.0309, 0.0315, 0.0374}, {3.29e-5, 4.90e-5, 4.8e-5}},
                                      {{0.0084, 0.0083, 0.0021}, {1.61e-4, 1.62e-4, 5e-5}},
                                      {{0.0755, 0.0665, 0.0611}, {0.0048, 0.0029, 0.0026}},
                                      {{0.1703, 0.1794, 0.1049}, {0.0832, 0.0792, 0.0148}},
                                      {{0.0996, 0.1960, 0.1242}, {0.0040, 0.0242, 0.0170}}};

std::string figure(const char* format, double value) {
  if (!std::isfinite(value)) return "not known";
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), format, value);
  return text.data();
}

std::string minutes_and_seconds(double seconds) {
  std::array<char, 48> text{};
  const auto whole = static_cast<long>(std::lround(seconds));
  std::snprintf(text.data(), text.size(), "%ld:%02ld", whole / 60, whole % 60);
  return text.data();
}

void cell(std::ostream& out, const std::string& text, const std::string& id = "") {
  out << "<td class=\"n\"";
  if (!id.empty()) out << " id=\"" << id << "\"";
  out << ">" << markup_text(text) << "</td>";
}

std::string session_text(const SessionReportData& data, int id) {
  const SceneSession* session = data.scene.session(id);
  return session != nullptr ? session->name : "session " + std::to_string(id);
}

std::string pose_text(const SessionReportData& data, const PoseKey& key) {
  return session_text(data, key.session) + " : " + std::to_string(key.keyframe);
}

const char* id_of(SessionModule module) {
  switch (module) {
    case SessionModule::feature_tracking:
      return "feature_tracking";
    case SessionModule::stereo_odometry:
      return "stereo_odometry";
    case SessionModule::window:
      return "window";
    case SessionModule::place_recognition:
      return "place_recognition";
    case SessionModule::pose_graph:
      return "pose_graph";
  }
  return "";
}

const char* unit_of(SessionModule module) {
  switch (module) {
    case SessionModule::feature_tracking:
    case SessionModule::stereo_odometry:
      return "frame";
    case SessionModule::window:
    case SessionModule::place_recognition:
      return "keyframe";
    case SessionModule::pose_graph:
      return "window";
  }
  return "";
}

void times_row(const SessionReportData& data, SessionModule module, std::optional<bool> loop, const std::string& name,
               const std::string& id, bool known, double session_s, std::ostream& out) {
  const ModuleTimes times = times_of_module(data, module, loop);
  out << "<tr><th scope=\"row\">" << markup_text(name) << "</th><td>" << unit_of(module) << "</td>";
  if (times.count == 0) {
    const std::string none = known ? "0" : "not known";
    cell(out, none, "t2-" + id + "-count");
    for (const char* what : {"mean", "variance", "worst"}) cell(out, "not known", "t2-" + id + "-" + what);
    out << "<td></td><td class=\"n\"></td>";
  } else {
    cell(out, std::to_string(times.count), "t2-" + id + "-count");
    cell(out, figure("%.3f", times.mean_ms), "t2-" + id + "-mean");
    cell(out, figure("%.4g", times.variance_ms2), "t2-" + id + "-variance");
    cell(out, figure("%.2f", times.worst_ms), "t2-" + id + "-worst");
    out << "<td>" << markup_text(pose_text(data, times.worst_at)) << "</td>";
    cell(out, session_s > 0 ? figure("%.2f %%", 100 * times.sum_s / session_s) : "not known", "t2-" + id + "-share");
  }
  if (loop) {
    out << "<td colspan=\"6\"></td></tr>\n";
    return;
  }
  const PaperTimes& paper = kPaperTimes[static_cast<std::size_t>(module)];
  for (int e = 0; e < 3; ++e) {
    cell(out, figure("%.1f", 1e3 * paper.mean_s[e]));
    cell(out, figure("%.4g", 1e6 * paper.variance_s2[e]));
  }
  out << "</tr>\n";
}

int rank_of(EncounterState state) {
  constexpr EncounterState order[] = {EncounterState::active, EncounterState::waiting, EncounterState::refused,
                                      EncounterState::off};
  return static_cast<int>(std::find(std::begin(order), std::end(order), state) - std::begin(order));
}

const char* meaning_of(EncounterState state) {
  switch (state) {
    case EncounterState::active:
      return "in the graph";
    case EncounterState::waiting:
      return "not confirmed by others";
    case EncounterState::refused:
      return "disagrees with others";
    case EncounterState::off:
      return "switched off by the user";
  }
  return "";
}

std::string asked(double eta) { return std::isnan(eta) ? "not asked" : figure("%.3g", eta); }

}  // namespace

void write_sessions_table(const SessionReportData& data, std::ostream& out) {
  out << "<table id=\"table1\"><caption>Table 1. The sessions</caption>\n<thead><tr><th>Session</th><th>Source</th>"
         "<th>Length (m:ss)</th><th>Way (m)</th><th>Poses</th><th>Motion lost</th><th>Intra-session loops</th>"
         "<th>Inter-session encounters</th><th>Frames read</th><th>Frames "
         "dropped</th><th>Met</th></tr></thead>\n<tbody>\n";
  const auto row = [&](const std::string& id, const SessionCounts& c, const SessionFrames* frames) {
    cell(out, minutes_and_seconds(c.seconds), id + "length");
    cell(out, figure("%.2f", c.path_m), id + "path");
    cell(out, std::to_string(c.poses), id + "poses");
    cell(out, std::to_string(c.failures), id + "failures");
    cell(out, std::to_string(c.loops), id + "loops");
    cell(out, std::to_string(c.meetings), id + "meetings");
    cell(out, frames != nullptr ? std::to_string(frames->read) : "not known", id + "read");
    cell(out, frames != nullptr ? std::to_string(frames->dropped) : "not known", id + "dropped");
  };
  SessionFrames all;
  for (const SessionState& state : data.view.sessions) {
    const SceneSession* session = data.scene.session(state.id);
    if (session == nullptr) continue;
    const auto frames = data.frames.find(state.id);
    if (frames != data.frames.end()) {
      all.read += frames->second.read;
      all.dropped += frames->second.dropped;
    }
    out << "<tr><th scope=\"row\">" << markup_text(session->name) << "</th><td>" << markup_text(state.start.source)
        << "</td>";
    row("t1-" + std::to_string(state.id) + "-", counts_of_session(data, state.id),
        frames != data.frames.end() ? &frames->second : nullptr);
    std::string met;
    for (const SceneSession& other : data.scene.sessions)
      if (other.component == session->component && other.id != session->id)
        met += (met.empty() ? "" : ", ") + other.name;
    out << "<td>" << markup_text(met.empty() ? "none" : met) << "</td></tr>\n";
  }
  out << "</tbody>\n<tfoot>\n<tr><th scope=\"row\">all " << data.scene.sessions.size() << "</th><td></td>";
  row("t1-all-", counts_of_all(data), data.frames.empty() ? nullptr : &all);
  out << "<td></td></tr>\n";
  struct PaperColumn {
    const char *name, *length;
    int poses, loops, meetings;
  };
  constexpr PaperColumn paper[] = {{"the paper's experiment 1 (1 session, indoors)", "20:18", 883, 112, 0},
                                   {"the paper's experiment 2 (4 sessions, indoors)", "45:00", 1562, 4, 260},
                                   {"the paper's experiment 3 (3 sessions, outdoors)", "4:42", 1406, 0, 13}};
  for (const PaperColumn& p : paper)
    out << "<tr class=\"paper\"><th scope=\"row\">" << p.name << "</th><td>Stata Center</td><td class=\"n\">"
        << p.length << "</td><td></td><td class=\"n\">" << p.poses << "</td><td></td><td class=\"n\">" << p.loops
        << "</td><td class=\"n\">" << p.meetings << "</td><td></td><td></td><td></td></tr>\n";
  out << "</tfoot></table>\n";
}

void write_times_table(const SessionReportData& data, std::ostream& out) {
  out << "<table id=\"table2\"><caption>Table 2. Milliseconds of each module</caption>\n<thead><tr><th "
         "rowspan=\"2\">Module</th><th rowspan=\"2\">A step is a</th><th rowspan=\"2\">Steps</th><th "
         "rowspan=\"2\">Mean (ms)</th><th rowspan=\"2\">Variance (ms&#178;)</th><th rowspan=\"2\">Worst (ms)</th><th "
         "rowspan=\"2\">at (session : frame or pose)</th><th rowspan=\"2\">Share of session time</th>"
         "<th colspan=\"2\" class=\"paper\">The paper's experiment 1</th><th colspan=\"2\" class=\"paper\">The paper's "
         "experiment 2</th><th colspan=\"2\" class=\"paper\">The paper's experiment 3</th></tr>\n<tr>";
  for (int e = 0; e < 3; ++e) out << "<th class=\"paper\">Mean (ms)</th><th class=\"paper\">Variance (ms&#178;)</th>";
  out << "</tr></thead>\n<tbody>\n";
  double session_s = 0;
  for (const auto& [id, offset] : session_offsets(data)) session_s += data.scene.session(id)->seconds();
  for (const SessionModule module : kAllModules)
    times_row(data, module, {}, name_of(module), id_of(module), false, session_s, out);
  const bool known = times_of_module(data, SessionModule::pose_graph).count > 0;
  times_row(data, SessionModule::pose_graph, true, "pose graph, a loop was closed", "pose_graph_loop", known, session_s,
            out);
  times_row(data, SessionModule::pose_graph, false, "pose graph, no loop", "pose_graph_no_loop", known, session_s, out);
  out << "</tbody></table>\n<p>The paper's figures are those of its Table 2, of its own recordings on another machine "
         "(Intel Core i7 940 at 2.93 GHz, features tracked on an nVidia GeForce 9800 GT), turned into milliseconds; "
         "its "
         "pose graph is iSAM. They are here for the order of size, not as a race.</p>\n";
}

void write_encounters_table(const SessionReportData& data, std::ostream& out) {
  std::vector<const Encounter*> rows;
  std::map<EncounterState, std::pair<int, int>> count;  // within, between
  for (const Encounter& e : data.view.encounters) {
    rows.push_back(&e);
    ++(e.within_session() ? count[e.state].first : count[e.state].second);
  }
  out << "<table id=\"states\"><caption>Encounters by "
         "state</caption>\n<thead><tr><th>State</th><th>Meaning</th><th>Within "
         "a session</th><th>Between sessions</th></tr></thead>\n<tbody>\n";
  for (const EncounterState state :
       {EncounterState::active, EncounterState::waiting, EncounterState::refused, EncounterState::off}) {
    out << "<tr><th scope=\"row\">" << to_string(state) << "</th><td>" << meaning_of(state) << "</td>";
    cell(out, std::to_string(count[state].first), std::string("e-") + to_string(state) + "-within");
    cell(out, std::to_string(count[state].second), std::string("e-") + to_string(state) + "-between");
    out << "</tr>\n";
  }
  out << "</tbody></table>\n";
  if (!data.refused_places_known) {
    out << "<p>Candidates that place recognition itself refused: not known.</p>\n";
  } else {
    int all = 0;
    std::string reasons;
    for (const auto& [reason, n] : data.refused_places) {
      all += n;
      reasons += (reasons.empty() ? ": " : "; ") + reason + " (" + std::to_string(n) + ")";
    }
    out << "<p id=\"refused\">Candidates that place recognition itself refused: " << all << markup_text(reasons)
        << ".</p>\n";
  }
  if (rows.empty()) return;
  std::stable_sort(rows.begin(), rows.end(), [](const Encounter* a, const Encounter* b) {
    return std::pair(rank_of(a->state), a->id) < std::pair(rank_of(b->state), b->id);
  });
  out << "<table id=\"encounters\"><caption>Encounters and where they come from</caption>\n<thead><tr><th>Id</th>"
         "<th>State</th><th>Seen again (session : pose)</th><th>by (session : pose)</th><th>&#951; (Eq. 4)</th><th>CRF "
         "near (Eq. 5)</th><th>CRF far (Eq. 5)</th><th>Matches</th><th>Inliers</th><th>Distance (m)</th><th>&#963; "
         "place (m)</th><th>&#963; turn (&#176;)</th></tr></thead>\n<tbody>\n";
  for (std::size_t i = 0; i < std::min(rows.size(), kMostEncounterRows); ++i) {
    const Encounter& e = *rows[i];
    out << "<tr>";
    cell(out, std::to_string(e.id));
    out << "<td>" << to_string(e.state) << "</td><td>" << markup_text(pose_text(data, e.found)) << "</td><td>"
        << markup_text(pose_text(data, e.query)) << "</td>";
    cell(out, figure("%.3f", e.bow));
    cell(out, asked(e.crf_near));
    cell(out, asked(e.crf_far));
    cell(out, std::to_string(e.matches));
    cell(out, std::to_string(e.inliers));
    cell(out, figure("%.2f", e.found_from_query.t.norm()));
    cell(out, figure("%.3f", std::sqrt(e.covariance.topLeftCorner<3, 3>().trace())));
    cell(out, figure("%.2f", std::sqrt(e.covariance.bottomRightCorner<3, 3>().trace()) * 180 / M_PI));
    out << "</tr>\n";
  }
  out << "</tbody></table>\n";
  if (rows.size() > kMostEncounterRows)
    out << "<p id=\"more\">and " << rows.size() - kMostEncounterRows << " more.</p>\n";
}

void write_settings_table(const SessionReportData& data, std::ostream& out) {
  if (data.settings.empty()) {
    out << "<p>Settings: not known.</p>\n";
    return;
  }
  out << "<table id=\"settings\"><caption>Settings</caption>\n<tbody>\n";
  for (const auto& [name, value] : data.settings)
    out << "<tr><th scope=\"row\">" << markup_text(name) << "</th><td>" << markup_text(value) << "</td></tr>\n";
  out << "</tbody></table>\n";
}

}  // namespace parallax
