// `parallax sessions export`: what a session database holds, as files of other programs. Files are written beside and
// renamed. Called on the main thread.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sessions/session_database.h"
#include "sessions/session_export.h"

namespace parallax {

struct SessionExport {
  // A trajectory each: of one session a file; of several, or where there is such a folder, files in a folder.
  std::string tum, kitti, euroc;
  std::string graph;                          // g2o, all in one
  std::string cloud, cloud_model;             // feature maps, coloured by session: PLY, glTF
  std::string textured;                       // dense disparity of the stored images: PLY
  std::string colmap, images;                 // folders
  SessionFrame frame = SessionFrame::global;  // of trajectories

  bool any() const;
  // Whether sessions that have not met would lie in one file, each in a frame of its own.
  bool joins() const;
};

// Of the sessions named by number. Each file by one call of `step`, so that one that cannot be written keeps none of
// the others back. Throws what `step` throws; RunError when a file cannot be written or nothing is there to write.
void export_sessions(SessionDatabase* database, const SessionDocument& document, const std::vector<int>& sessions,
                     const SessionExport& what, const std::function<void(const std::function<void()>&)>& step);

// The name of a session as a file's: letters and digits, dash, underscore and dot; others become dashes, and the number
// of the session tells two apart that would be the same.
std::string session_file_name(const SessionDocument& document, int session);

}  // namespace parallax
