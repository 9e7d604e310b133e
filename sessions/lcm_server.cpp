#include "sessions/lcm_server.h"

#include <algorithm>
#include <utility>

#include "core/error.h"

namespace parallax {
namespace {

// For the next session of a front end that was lost and begins anew.
constexpr Timestamp kNextSession = std::chrono::milliseconds(700);
constexpr Timestamp kLinger = std::chrono::seconds(3);  // for front ends to confirm the last that was said

std::chrono::steady_clock::time_point time_point(Timestamp t) {
  return std::chrono::steady_clock::time_point(std::chrono::duration_cast<std::chrono::steady_clock::duration>(t));
}

class RealBackEnd : public DeskBackEnd {
 public:
  explicit RealBackEnd(BackEnd* back_end) : back_end_(back_end) {}
  SessionState begin(const SessionStart& start) override { return back_end_->begin(start); }
  std::optional<SessionState> resume(const std::string& name, SessionPose* last) override {
    return back_end_->resume(name, last);
  }
  BackEndAnswer add(int session, const SessionKeyframe& keyframe) override { return back_end_->add(session, keyframe); }
  BackEndAnswer add(int session, const SessionWindow& window) override { return back_end_->add(session, window); }
  void add(const std::vector<SessionTiming>& timings) override { back_end_->add(timings); }
  void end(int session) override { back_end_->end(session); }
  void save() override { back_end_->save(); }
  BackEndView view() override { return back_end_->view(); }

 private:
  BackEnd* back_end_;
};

}  // namespace

std::unique_ptr<DeskBackEnd> make_desk_back_end(BackEnd* back_end) { return std::make_unique<RealBackEnd>(back_end); }

LcmServer::LcmServer(const LcmServerOptions& options, std::int64_t identity)
    : options_(options),
      bus_(options.url, LcmSide::back_end),
      server_(
          identity, {}, [this](const std::string& datagram) { bus_.send(datagram); }, options.notice, steady_now()) {}

// What arrives, until something is due.
void LcmServer::hear() {
  Timestamp due;
  {
    MutexLock lock(mutex_);
    due = server_.due();
  }
  const std::vector<std::vector<std::uint8_t>> datagrams = bus_.wait(due);
  {
    MutexLock lock(mutex_);
    for (const auto& datagram : datagrams) server_.receive(datagram, steady_now());
    server_.step(steady_now());
  }
  arrived_.notify_all();
}

bool LcmServer::listen(const std::function<bool()>& is_stopped) {
  for (;;) {
    hear();
    MutexLock lock(mutex_);
    if (server_.yielded())
      throw InputError("--lcm " + options_.url + ": found another back end there, expected none: one address has one");
    if (server_.running()) return true;
    if (is_stopped()) return false;
  }
}

void LcmServer::work(SessionDesk* desk, const std::stop_token& stop) {
  std::vector<DeskReply> replies;
  for (;;) {
    std::optional<DeskJob> job;
    {
      MutexLock lock(mutex_);
      for (const DeskReply& reply : std::exchange(replies, {})) server_.send(reply, steady_now());
      ended_ = desk->sessions_ended();
      at_work_ = desk->at_work();
      const auto has_job = [&]() PARALLAX_REQUIRES(mutex_) {
        job = server_.next_job(steady_now());
        return job.has_value();
      };
      if (const std::optional<Timestamp> due = desk->save_due())
        arrived_.wait_until(mutex_, stop, time_point(*due), has_job);
      else
        arrived_.wait(mutex_, stop, has_job);
    }
    bus_.wake();  // what was sent changes what is due
    if (stop.stop_requested()) return;
    if (job) replies.push_back(desk->work(*job, steady_now()));
    for (DeskReply& reply : desk->save_if_due(steady_now())) replies.push_back(std::move(reply));
  }
}

void LcmServer::run(DeskBackEnd* back_end, const std::function<bool()>& is_stopped) {
  SessionDesk desk(back_end);
  {
    std::jthread worker([&](std::stop_token stop) {
      try {
        work(&desk, stop);
      } catch (...) {
        MutexLock lock(mutex_);
        failure_ = std::current_exception();
        bus_.wake();
      }
    });
    Timestamp at_work = steady_now();
    while (!is_stopped()) {
      hear();
      const Timestamp now = steady_now();
      MutexLock lock(mutex_);
      if (failure_) break;
      const bool is_over =
          options_.once > 0 && ended_ >= options_.once &&
          std::none_of(at_work_.begin(), at_work_.end(),
                       [&](std::int64_t id) PARALLAX_REQUIRES(mutex_) { return server_.is_alive(id, now); });
      if (!is_over) at_work = now;
      if (is_over && now - at_work >= (server_.delivered(now) ? kNextSession : kLinger)) break;
    }
  }
  MutexLock lock(mutex_);
  if (failure_) std::rethrow_exception(failure_);
  for (const DeskReply& reply : desk.save()) server_.send(reply, steady_now());
}

}  // namespace parallax
