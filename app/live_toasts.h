// Short messages in the window that go away by themselves: what was saved, what could not be done and why. One thread.
#pragma once

#include <chrono>
#include <deque>
#include <string>

#include "core/time.h"

namespace parallax {

class Toasts {
 public:
  // The same text again only stays longer.
  void add(const std::string& text, bool problem = false);
  struct Toast {
    std::string text;
    bool problem = false;
    SteadyClock::time_point since;
  };
  // What is to be seen now, the oldest first; at most four.
  const std::deque<Toast>& current();

 private:
  std::deque<Toast> toasts_;
};

}  // namespace parallax
