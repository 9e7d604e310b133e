// The live view of sessions while they run: trajectories in 3D, the newest images, times, and what place recognition
// has found. The window is the main thread's; the run has a thread of its own.
#pragma once

#include <functional>

#include "app/session_view_feed.h"

namespace parallax {

// Opens the window, then runs `run` on a thread of its own, with `feed` as its watcher, until that is over; what it
// throws is thrown on. Closing the window does not end the run: it goes on without. The window stays open after the run
// until it is closed. Throws InputError when no window can be opened; nothing was run then.
void watch_sessions(SessionFeed* feed, const std::vector<std::string>& names, const std::function<void()>& run);

}  // namespace parallax
