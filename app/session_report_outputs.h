// The pictures and the report that `parallax slam` leaves of all its sessions together.
//
// Used from one thread.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "app/map_picture.h"
#include "app/slam_sessions.h"

namespace parallax {

struct SessionSheetPaths {
  std::string from_above, elevation;  // PNG or SVG
  std::string html;
  std::string floor_plan;  // read: under what is seen from above
  bool any() const { return !(from_above.empty() && elevation.empty() && html.empty()); }
};

class SessionSheets {
 public:
  // Reads the floor plan and looks at the names: throws InputError before a long run, not after it.
  explicit SessionSheets(const SessionSheetPaths& paths);

  // Each file that was asked for by one call of `step`, so that one that cannot be written keeps none of the others
  // back.
  void write(const SlamSessionsResult& run, const SlamSessionsOptions& options,
             const std::function<void(const std::function<void()>&)>& step) const;

 private:
  SessionSheetPaths paths_;
  std::optional<FloorPlan> floor_plan_;
};

}  // namespace parallax
