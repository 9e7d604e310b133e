// The back end on a thread of its own (MS Fig. 1: place recognition and the pose graph work beside the front ends), and
// links to it for the front ends of this process.
//
// The worker may be called from any thread; each of its links belongs to one thread. What the back end throws is kept
// and thrown on by the links and by ask(); nothing is worked on after that.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <thread>

#include "core/bounded_queue.h"
#include "core/mutex.h"
#include "sessions/back_end_link.h"

namespace parallax {

class BackEndWorker {
 public:
  // Takes the back end over.
  explicit BackEndWorker(std::unique_ptr<BackEnd> back_end);
  // Works off what waits.
  ~BackEndWorker();
  BackEndWorker(const BackEndWorker&) = delete;
  BackEndWorker& operator=(const BackEndWorker&) = delete;

  std::unique_ptr<BackEndLink> make_link();

  // Runs `question` between two messages, and waits for it.
  void ask(const std::function<void(BackEnd&)>& question) PARALLAX_EXCLUDES(mutex_);

 private:
  class Link;
  using Job = std::function<void(BackEnd&)>;

  // Waits for room; throws what has gone wrong before.
  void push(Job job) PARALLAX_EXCLUDES(mutex_);
  void work();
  void throw_failure() PARALLAX_EXCLUDES(mutex_);

  std::unique_ptr<BackEnd> back_end_;  // the thread's
  BoundedQueue<Job> jobs_;
  Mutex asking_;  // questions are numbered and queued one at a time; taken before mutex_
  Mutex mutex_;
  std::condition_variable_any done_;
  std::uint64_t asked_ PARALLAX_GUARDED_BY(mutex_) = 0, answered_ PARALLAX_GUARDED_BY(mutex_) = 0;
  std::exception_ptr failure_ PARALLAX_GUARDED_BY(mutex_);
  std::jthread thread_;
};

}  // namespace parallax
