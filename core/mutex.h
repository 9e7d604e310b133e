// A mutex that clang's thread-safety analysis knows, and the attribute macros. std::mutex carries no attributes, so
// fields shared between threads are guarded by this one and say so: `int count_ PARALLAX_GUARDED_BY(mutex_);`.
// With other compilers the macros are empty. To wait, use std::condition_variable_any on the Mutex itself while a
// MutexLock holds it: `condition.wait(mutex_, stop, [this]() PARALLAX_REQUIRES(mutex_) { return ready_; });`
#pragma once

#include <mutex>

#if defined(__clang__)
#define PARALLAX_THREAD_ATTRIBUTE(x) __attribute__((x))
#else
#define PARALLAX_THREAD_ATTRIBUTE(x)
#endif

// On types.
#define PARALLAX_CAPABILITY(name) PARALLAX_THREAD_ATTRIBUTE(capability(name))
#define PARALLAX_SCOPED_CAPABILITY PARALLAX_THREAD_ATTRIBUTE(scoped_lockable)
// On fields: the field, or what the pointer points to, is touched only while the mutex is held.
#define PARALLAX_GUARDED_BY(mutex) PARALLAX_THREAD_ATTRIBUTE(guarded_by(mutex))
#define PARALLAX_PT_GUARDED_BY(mutex) PARALLAX_THREAD_ATTRIBUTE(pt_guarded_by(mutex))
// On functions and lambdas: held by the caller; not held by the caller; taken; given back; taken when it returns
// `value`.
#define PARALLAX_REQUIRES(...) PARALLAX_THREAD_ATTRIBUTE(requires_capability(__VA_ARGS__))
#define PARALLAX_EXCLUDES(...) PARALLAX_THREAD_ATTRIBUTE(locks_excluded(__VA_ARGS__))
#define PARALLAX_ACQUIRE(...) PARALLAX_THREAD_ATTRIBUTE(acquire_capability(__VA_ARGS__))
#define PARALLAX_RELEASE(...) PARALLAX_THREAD_ATTRIBUTE(release_capability(__VA_ARGS__))
#define PARALLAX_TRY_ACQUIRE(...) PARALLAX_THREAD_ATTRIBUTE(try_acquire_capability(__VA_ARGS__))
#define PARALLAX_RETURN_CAPABILITY(mutex) PARALLAX_THREAD_ATTRIBUTE(lock_returned(mutex))
// For the few functions the analysis cannot follow; say why beside it.
#define PARALLAX_NO_THREAD_SAFETY_ANALYSIS PARALLAX_THREAD_ATTRIBUTE(no_thread_safety_analysis)

namespace parallax {

class PARALLAX_CAPABILITY("mutex") Mutex {
 public:
  Mutex() = default;
  Mutex(const Mutex&) = delete;
  Mutex& operator=(const Mutex&) = delete;

  void lock() PARALLAX_ACQUIRE() { mutex_.lock(); }
  void unlock() PARALLAX_RELEASE() { mutex_.unlock(); }
  bool try_lock() PARALLAX_TRY_ACQUIRE(true) { return mutex_.try_lock(); }

 private:
  std::mutex mutex_;
};

// Holds a Mutex for the length of a scope; unlock() gives it back early and lock() takes it again.
class PARALLAX_SCOPED_CAPABILITY MutexLock {
 public:
  explicit MutexLock(Mutex& mutex) PARALLAX_ACQUIRE(mutex) : mutex_(mutex) { mutex_.lock(); }
  ~MutexLock() PARALLAX_RELEASE() {
    if (held_) mutex_.unlock();
  }
  MutexLock(const MutexLock&) = delete;
  MutexLock& operator=(const MutexLock&) = delete;

  void lock() PARALLAX_ACQUIRE() {
    mutex_.lock();
    held_ = true;
  }
  void unlock() PARALLAX_RELEASE() {
    held_ = false;
    mutex_.unlock();
  }

 private:
  Mutex& mutex_;
  bool held_ = true;
};

}  // namespace parallax
