#include "app/session_report_outputs.h"

#include "app/session_picture.h"
#include "app/session_report.h"

namespace parallax {

SessionSheets::SessionSheets(const SessionSheetPaths& paths) : paths_(paths) {
  for (const std::string& picture : {paths.from_above, paths.elevation})
    if (!picture.empty()) check_canvas_path(picture);
  if (paths.any() && !paths.floor_plan.empty()) floor_plan_ = read_floor_plan(paths.floor_plan);
}

void SessionSheets::write(const SlamSessionsResult& run, const SlamSessionsOptions& options,
                          const std::function<void(const std::function<void()>&)>& step) const {
  if (!paths_.any()) return;
  std::optional<SessionReportData> data;
  step([&] { data = report_on_run(run, options); });
  if (!data) return;
  data->floor_plan = floor_plan_;
  SessionPictureOptions picture;
  picture.floor_plan = floor_plan_;
  for (const SceneSession& session : data->scene.sessions)
    picture.title += (picture.title.empty() ? "" : ", ") + session.name;
  if (picture.title.size() > 90) picture.title = std::to_string(data->scene.sessions.size()) + " sessions";
  if (!paths_.from_above.empty()) step([&] { write_session_picture(data->scene, picture, paths_.from_above); });
  picture.view = SessionPictureView::elevation;
  if (!paths_.elevation.empty()) step([&] { write_session_picture(data->scene, picture, paths_.elevation); });
  if (!paths_.html.empty()) step([&] { write_session_report(*data, paths_.html); });
}

}  // namespace parallax
