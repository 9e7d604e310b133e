#include "sessions/lcm_link.h"

#include <utility>

#include "core/check.h"
#include "core/error.h"

namespace parallax {
namespace {

SessionClientOptions client_options(const LcmLinkOptions& options) {
  SessionClientOptions out;
  out.where = options.url;
  out.give_up = options.wait;
  return out;
}

}  // namespace

LcmLink::LcmLink(const LcmLinkOptions& options, std::int64_t identity)
    : bus_(options.url, LcmSide::front_end),
      client_(
          identity, client_options(options), [this](const std::string& datagram) { bus_.send(datagram); },
          options.notice) {
  thread_ = std::jthread([this](std::stop_token stop) { run(std::move(stop)); });
}

LcmLink::~LcmLink() {
  thread_.request_stop();
  bus_.wake();
}

void LcmLink::run(std::stop_token stop) {
  while (!stop.stop_requested()) {
    Timestamp due;
    {
      MutexLock lock(mutex_);
      due = client_.due();
    }
    const std::vector<std::vector<std::uint8_t>> arrived = bus_.wait(due);
    {
      MutexLock lock(mutex_);
      for (const auto& datagram : arrived) client_.receive(datagram, steady_now());
      client_.step(steady_now());
    }
    changed_.notify_all();
  }
}

void LcmLink::throw_failure() {
  if (client_.failure().empty()) return;
  if (client_.failed_by_input()) throw InputError(client_.failure());
  throw RunError(client_.failure());
}

SessionBeginning LcmLink::begin(const SessionStart& start, bool resume) {
  MutexLock lock(mutex_);
  client_.begin(start, resume, steady_now());
  bus_.wake();
  changed_.wait(mutex_, [&]() PARALLAX_REQUIRES(mutex_) { return client_.beginning() || !client_.failure().empty(); });
  throw_failure();
  return *client_.beginning();
}

std::int64_t LcmLink::next_number() {
  MutexLock lock(mutex_);
  return client_.next_number();
}

void LcmLink::post(std::string message, int keyframe) {
  auto shared = std::make_shared<const std::string>(std::move(message));
  MutexLock lock(mutex_);
  changed_.wait(mutex_, [&]() PARALLAX_REQUIRES(mutex_) { return client_.has_room() || !client_.failure().empty(); });
  throw_failure();
  client_.post(std::move(shared), keyframe, steady_now());
  bus_.wake();
}

void LcmLink::add(SessionKeyframe keyframe) {
  const int index = keyframe.index;
  post(encode(KeyframeMessage{next_number(), std::move(keyframe)}, &codec_), index);
}

void LcmLink::add(SessionWindow window) { post(encode(WindowMessage{next_number(), std::move(window)}), -1); }

void LcmLink::add(std::vector<SessionTiming> timings) {
  post(encode(TimingsMessage{next_number(), std::move(timings)}), -1);
}

void LcmLink::end() {
  auto message = std::make_shared<const std::string>(encode(EndMessage{next_number()}));
  ended_ = true;
  MutexLock lock(mutex_);
  throw_failure();
  client_.post_end(std::move(message), steady_now());
  bus_.wake();
}

void LcmLink::wait() {
  MutexLock lock(mutex_);
  changed_.wait(mutex_, [&]() PARALLAX_REQUIRES(mutex_) {
    return !client_.failure().empty() || (client_.all_done() && (!ended_ || client_.is_over()));
  });
  throw_failure();
}

std::vector<BackEndAnswer> LcmLink::take_answers() {
  MutexLock lock(mutex_);
  return client_.take_answers();
}

}  // namespace parallax
