#include "solver/work_team.h"

#include <algorithm>

namespace parallax::solver {

WorkTeam::WorkTeam(int members) : members_(std::max(1, members)) {
  for (int i = 1; i < members_; ++i) threads_.emplace_back([this, i] { member_loop(i); });
}

WorkTeam::~WorkTeam() {
  {
    const std::lock_guard lock(mutex_);
    quit_ = true;
  }
  start_.notify_all();
  for (std::thread& t : threads_) t.join();
}

void WorkTeam::run(const std::function<void(int)>& work) {
  if (members_ == 1) {
    work(0);
    return;
  }
  {
    const std::lock_guard lock(mutex_);
    work_ = &work;
    running_ = members_ - 1;
    ++round_;
  }
  start_.notify_all();
  work(0);
  std::unique_lock lock(mutex_);
  done_.wait(lock, [this] { return running_ == 0; });
}

void WorkTeam::meet() {
  if (members_ == 1) return;
  const unsigned meeting = meeting_.load(std::memory_order_acquire);
  if (arrived_.fetch_add(1, std::memory_order_acq_rel) == members_ - 1) {
    arrived_.store(0, std::memory_order_relaxed);
    meeting_.store(meeting + 1, std::memory_order_release);
    return;
  }
  constexpr int kSpins = 2000;  // some microseconds; then the processor is given to whoever wants it
  for (int i = 0; meeting_.load(std::memory_order_acquire) == meeting; ++i)
    if (i >= kSpins) std::this_thread::yield();
}

void WorkTeam::member_loop(int member) {
  unsigned seen = 0;
  for (;;) {
    const std::function<void(int)>* work = nullptr;
    {
      std::unique_lock lock(mutex_);
      start_.wait(lock, [&] { return quit_ || round_ != seen; });
      if (quit_) return;
      seen = round_;
      work = work_;
    }
    (*work)(member);
    const std::lock_guard lock(mutex_);
    if (--running_ == 0) done_.notify_one();
  }
}

}  // namespace parallax::solver
