// A few threads that share the loops of one solve: the caller is member 0. Created for the length of a solve, and only
// when more than one thread is asked for.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace parallax::solver {

class WorkTeam {
 public:
  explicit WorkTeam(int members);
  ~WorkTeam();
  WorkTeam(const WorkTeam&) = delete;
  WorkTeam& operator=(const WorkTeam&) = delete;

  int members() const { return members_; }

  // Calls work(0) here and work(1), work(2)... on the others; returns when all are done. `work` must not throw.
  void run(const std::function<void(int)>& work);

  // Inside run(): waits until every member is here, for steps too short to hand out anew. All must call it equally
  // often.
  void meet();

 private:
  void member_loop(int member);

  const int members_;
  std::mutex mutex_;
  std::condition_variable start_, done_;
  const std::function<void(int)>* work_ = nullptr;  // guarded by mutex_
  unsigned round_ = 0;                              // guarded by mutex_
  int running_ = 0;                                 // guarded by mutex_
  bool quit_ = false;                               // guarded by mutex_
  std::atomic<int> arrived_{0};
  std::atomic<unsigned> meeting_{0};
  std::vector<std::thread> threads_;
};

}  // namespace parallax::solver
