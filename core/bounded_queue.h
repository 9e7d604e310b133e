// A bounded first-in first-out queue between threads. Every member may be called from any thread. Values are owned by
// the queue between push and pop. Waiting ends when a std::stop_token asks for it or when the queue is closed.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <optional>
#include <stop_token>
#include <utility>

#include "core/check.h"
#include "core/mutex.h"

namespace parallax {

template <typename T>
class BoundedQueue {
 public:
  explicit BoundedQueue(std::size_t capacity) : capacity_(capacity) {
    PARALLAX_CHECK(capacity > 0, "a queue that can hold nothing");
  }

  // Waits for room. False, and the value is dropped, when stopped or closed first.
  bool push(T value, std::stop_token stop = {}) PARALLAX_EXCLUDES(mutex_) {
    {
      MutexLock lock(mutex_);
      const bool woken = room_.wait(
          mutex_, stop, [this]() PARALLAX_REQUIRES(mutex_) { return closed_ || values_.size() < capacity_; });
      if (!woken || closed_) return false;
      values_.push_back(std::move(value));
    }
    filled_.notify_one();
    return true;
  }

  // Never waits: false, and the value is left where it is, when the queue is full or closed.
  bool try_push(T& value) PARALLAX_EXCLUDES(mutex_) {
    {
      MutexLock lock(mutex_);
      if (closed_ || values_.size() >= capacity_) return false;
      values_.push_back(std::move(value));
    }
    filled_.notify_one();
    return true;
  }

  // Never waits: when the queue is full the oldest value makes room (live video keeps the newest frame). Returns the
  // value that was dropped, if any; when the queue is closed that is `value` itself.
  std::optional<T> push_drop_oldest(T value) PARALLAX_EXCLUDES(mutex_) {
    std::optional<T> dropped;
    {
      MutexLock lock(mutex_);
      if (closed_) return value;
      if (values_.size() >= capacity_) {
        dropped = std::move(values_.front());
        values_.pop_front();
      }
      values_.push_back(std::move(value));
    }
    filled_.notify_one();
    return dropped;
  }

  // Waits for a value. Nothing when stopped, or when the queue is closed and empty: what was pushed before close() is
  // still delivered.
  std::optional<T> pop(std::stop_token stop = {}) PARALLAX_EXCLUDES(mutex_) {
    std::optional<T> value;
    {
      MutexLock lock(mutex_);
      filled_.wait(mutex_, stop, [this]() PARALLAX_REQUIRES(mutex_) { return closed_ || !values_.empty(); });
      if (stop.stop_requested() || values_.empty()) return std::nullopt;
      value = std::move(values_.front());
      values_.pop_front();
    }
    room_.notify_one();
    return value;
  }

  // Never waits: nothing when the queue is empty.
  std::optional<T> try_pop() PARALLAX_EXCLUDES(mutex_) {
    std::optional<T> value;
    {
      MutexLock lock(mutex_);
      if (values_.empty()) return std::nullopt;
      value = std::move(values_.front());
      values_.pop_front();
    }
    room_.notify_one();
    return value;
  }

  // No value is accepted any more, and everybody who waits is woken.
  void close() PARALLAX_EXCLUDES(mutex_) {
    {
      MutexLock lock(mutex_);
      closed_ = true;
    }
    room_.notify_all();
    filled_.notify_all();
  }

  // Throws away what is queued.
  void clear() PARALLAX_EXCLUDES(mutex_) {
    std::deque<T> old;
    {
      MutexLock lock(mutex_);
      old.swap(values_);
    }
    room_.notify_all();
  }

  bool closed() const PARALLAX_EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    return closed_;
  }
  std::size_t size() const PARALLAX_EXCLUDES(mutex_) {
    MutexLock lock(mutex_);
    return values_.size();
  }
  bool empty() const { return size() == 0; }
  std::size_t capacity() const { return capacity_; }

 private:
  const std::size_t capacity_;
  mutable Mutex mutex_;
  std::condition_variable_any room_, filled_;
  std::deque<T> values_ PARALLAX_GUARDED_BY(mutex_);
  bool closed_ PARALLAX_GUARDED_BY(mutex_) = false;
};

}  // namespace parallax
