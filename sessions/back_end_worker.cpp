#include "sessions/back_end_worker.h"

#include <utility>

#include "core/check.h"

namespace parallax {
namespace {

constexpr std::size_t kMostJobs = 64;  // that wait, of all links together: some 25 MB of images

}  // namespace

class BackEndWorker::Link : public BackEndLink {
 public:
  explicit Link(BackEndWorker* worker) : worker_(worker), shared_(std::make_shared<Shared>()) {}

  SessionBeginning begin(const SessionStart& start, bool resume) override {
    SessionBeginning out;
    worker_->ask([&](BackEnd& back_end) {
      if (resume) {
        SessionPose last;
        last.key.keyframe = -1;
        if (const auto state = back_end.resume(start.name, &last)) {
          out.state = *state;
          if (last.key.keyframe >= 0) out.last = last;
          return;
        }
      }
      out.state = back_end.begin(start);
    });
    session_ = out.state.id;
    return out;
  }
  void add(SessionKeyframe keyframe) override {
    worker_->push([shared = shared_, session = session_, keyframe = std::move(keyframe)](BackEnd& back_end) {
      shared->keep(back_end.add(session, keyframe));
    });
  }
  void add(SessionWindow window) override {
    worker_->push([shared = shared_, session = session_, window = std::move(window)](BackEnd& back_end) {
      shared->keep(back_end.add(session, window));
    });
  }
  void add(std::vector<SessionTiming> timings) override {
    worker_->push([timings = std::move(timings)](BackEnd& back_end) { back_end.add(timings); });
  }
  void end() override {
    worker_->push([session = session_](BackEnd& back_end) { back_end.end(session); });
  }
  void wait() override {
    worker_->ask([](BackEnd&) {});
  }
  std::vector<BackEndAnswer> take_answers() override { return shared_->take(); }

 private:
  // What the worker's thread leaves for this one's.
  class Shared {
   public:
    void keep(BackEndAnswer answer) PARALLAX_EXCLUDES(mutex_) {
      MutexLock lock(mutex_);
      answers_.push_back(std::move(answer));
    }
    std::vector<BackEndAnswer> take() PARALLAX_EXCLUDES(mutex_) {
      MutexLock lock(mutex_);
      return std::exchange(answers_, {});
    }

   private:
    Mutex mutex_;
    std::vector<BackEndAnswer> answers_ PARALLAX_GUARDED_BY(mutex_);
  };

  BackEndWorker* worker_;
  std::shared_ptr<Shared> shared_;
  int session_ = 0;
};

BackEndWorker::BackEndWorker(std::unique_ptr<BackEnd> back_end) : back_end_(std::move(back_end)), jobs_(kMostJobs) {
  PARALLAX_CHECK(back_end_ != nullptr, "a worker without a back end");
  thread_ = std::jthread([this] { work(); });
}

BackEndWorker::~BackEndWorker() { jobs_.close(); }

std::unique_ptr<BackEndLink> BackEndWorker::make_link() { return std::make_unique<Link>(this); }

void BackEndWorker::throw_failure() {
  MutexLock lock(mutex_);
  if (failure_) std::rethrow_exception(failure_);
}

void BackEndWorker::push(Job job) {
  throw_failure();
  jobs_.push(std::move(job));
}

void BackEndWorker::ask(const std::function<void(BackEnd&)>& question) {
  throw_failure();
  std::uint64_t mine = 0;
  {
    // Numbered and queued as one, or another's question could be taken for this one's answer.
    MutexLock lock(asking_);
    {
      MutexLock count(mutex_);
      mine = ++asked_;
    }
    jobs_.push([this, &question](BackEnd& back_end) {
      question(back_end);
      MutexLock count(mutex_);
      ++answered_;
    });
  }
  MutexLock lock(mutex_);
  done_.wait(mutex_, [&]() PARALLAX_REQUIRES(mutex_) { return failure_ != nullptr || answered_ >= mine; });
  if (answered_ < mine) std::rethrow_exception(failure_);
}

void BackEndWorker::work() {
  while (auto job = jobs_.pop()) {
    {
      MutexLock lock(mutex_);
      if (failure_) continue;
    }
    try {
      (*job)(*back_end_);
    } catch (...) {
      MutexLock lock(mutex_);
      failure_ = std::current_exception();
    }
    done_.notify_all();
  }
}

}  // namespace parallax
