#include "app/live_toasts.h"

#include <algorithm>

namespace parallax {

namespace {
constexpr std::size_t kMost = 4;
constexpr std::chrono::seconds kNews{4}, kProblem{8};
}  // namespace

void Toasts::add(const std::string& text, bool problem) {
  std::erase_if(toasts_, [&](const Toast& t) { return t.text == text; });
  toasts_.push_back({text, problem, SteadyClock::now()});
  if (toasts_.size() > kMost) toasts_.pop_front();
}

const std::deque<Toasts::Toast>& Toasts::current() {
  const auto now = SteadyClock::now();
  std::erase_if(toasts_, [&](const Toast& t) { return now - t.since > (t.problem ? kProblem : kNews); });
  return toasts_;
}

}  // namespace parallax
