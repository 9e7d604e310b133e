// A front end's link to a back end in another process, over LCM (docs/sessions.md). The same calls as the link to one
// in this process, and the same results in lockstep.
//
// One thread calls it; a thread of its own sees to the network. InputError and RunError as of BackEndLink: RunError
// when no back end answers for `wait`, InputError when the address cannot be used or the back end refuses what it is
// sent.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "core/image_codec.h"
#include "core/mutex.h"
#include "sessions/back_end_link.h"
#include "sessions/lcm_bus.h"
#include "sessions/session_client.h"

namespace parallax {

struct LcmLinkOptions {
  std::string url;
  Timestamp wait = std::chrono::seconds(30);
  std::function<void(const std::string&)> notice;  // lines for the user; called on the network's thread
};

class LcmLink : public BackEndLink {
 public:
  // `identity`: random, above 0 (random_identity()), another one for every link.
  LcmLink(const LcmLinkOptions& options, std::int64_t identity);
  ~LcmLink() override;

  SessionBeginning begin(const SessionStart& start, bool resume) override PARALLAX_EXCLUDES(mutex_);
  void add(SessionKeyframe keyframe) override;
  void add(SessionWindow window) override;
  void add(std::vector<SessionTiming> timings) override;
  void end() override PARALLAX_EXCLUDES(mutex_);
  void wait() override PARALLAX_EXCLUDES(mutex_);
  std::vector<BackEndAnswer> take_answers() override PARALLAX_EXCLUDES(mutex_);

 private:
  std::int64_t next_number() PARALLAX_EXCLUDES(mutex_);
  void post(std::string message, int keyframe) PARALLAX_EXCLUDES(mutex_);
  void throw_failure() PARALLAX_REQUIRES(mutex_);
  void run(std::stop_token stop) PARALLAX_EXCLUDES(mutex_);

  LcmBus bus_;
  ImageCodec codec_;
  bool ended_ = false;
  Mutex mutex_;
  std::condition_variable_any changed_;
  SessionClient client_ PARALLAX_GUARDED_BY(mutex_);
  std::jthread thread_;  // last: ends before what it uses
};

}  // namespace parallax
