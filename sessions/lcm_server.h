// The back end as a process of its own, for front ends that come over LCM (docs/sessions.md): the caller's thread sees
// to the network, a thread of its own works with the back end.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "core/mutex.h"
#include "sessions/lcm_bus.h"
#include "sessions/session_desk.h"
#include "sessions/session_server.h"

namespace parallax {

struct LcmServerOptions {
  std::string url;
  // Ends when so many sessions have ended and no front end is at work; 0: when told to.
  int once = 0;
  std::function<void(const std::string&)> notice;  // lines for the user
};

// `back_end` outlives it.
std::unique_ptr<DeskBackEnd> make_desk_back_end(BackEnd* back_end);

class LcmServer {
 public:
  // `identity`: random, above 0 (random_identity()). Throws InputError when the address cannot be used.
  LcmServer(const LcmServerOptions& options, std::int64_t identity);

  // Makes sure that no other back end is there: InputError when one is. Returns false when it was told to stop.
  bool listen(const std::function<bool()>& is_stopped) PARALLAX_EXCLUDES(mutex_);
  // Serves `back_end` until `is_stopped` (asked at least twice a second, and after a signal), or as often as `once`
  // says. What has arrived by then and was answered is saved. Throws what the back end throws.
  void run(DeskBackEnd* back_end, const std::function<bool()>& is_stopped) PARALLAX_EXCLUDES(mutex_);

 private:
  void hear() PARALLAX_EXCLUDES(mutex_);
  void work(SessionDesk* desk, const std::stop_token& stop) PARALLAX_EXCLUDES(mutex_);

  LcmServerOptions options_;
  LcmBus bus_;
  Mutex mutex_;
  std::condition_variable_any arrived_;
  SessionServer server_ PARALLAX_GUARDED_BY(mutex_);
  int ended_ PARALLAX_GUARDED_BY(mutex_) = 0;
  std::vector<std::int64_t> at_work_ PARALLAX_GUARDED_BY(mutex_);
  std::exception_ptr failure_ PARALLAX_GUARDED_BY(mutex_);
};

}  // namespace parallax
