// The list of maps in the live window: what is in it, and what the user's choices do to the library.
//
// The window's thread; the folder is read on another one.
#pragma once

#include <future>
#include <string>
#include <vector>

#include "app/live_engine.h"
#include "app/live_state.h"
#include "app/maps_panel_view.h"

namespace parallax {

class LiveMaps {
 public:
  bool is_open() const { return panel_.is_open(); }
  // Opens or closes the list.
  void toggle(const LiveEngine& engine);
  void close() { panel_.close(); }
  // A key while the list is open; false: it is not the list's.
  bool takes(int key, int modifiers, LiveEngine* engine, LiveState* state);
  void draw(const MakeMapPicture& picture, LiveEngine* engine, LiveState* state);
  // The new name of the map that was to be renamed.
  void rename(const std::string& name, LiveEngine* engine, LiveState* state);
  // A map went to the trash without the list.
  void forgotten(const std::string& trashed) { trashed_.push_back(trashed); }
  // Something has changed: the folder is read again.
  void refresh(const LiveEngine& engine);

 private:
  void carry_out(const MapsChoice& choice, LiveEngine* engine, LiveState* state);

  MapsPanel panel_;
  std::future<std::vector<MapCard>> reading_;
  bool stale_ = false;
  SteadyClock::time_point read_{};
  std::string renaming_;              // path
  std::vector<std::string> trashed_;  // in the order of deletion
};

}  // namespace parallax
