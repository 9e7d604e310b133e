// Asks a long computation to stop, and knows at which question it was told so: the stops of a live session are recorded
// by their number and replayed at the same place, so that a replay computes the same bits.
//
// One computation uses one Interruption, handed on by reference. requested() may be called by every thread of a solve;
// with one thread the questions come in a fixed order and their numbers mean something.
#pragma once

#include <atomic>
#include <cstdint>
#include <stop_token>
#include <utility>

namespace parallax {

class Interruption {
 public:
  Interruption() = default;  // never
  // Stops when the token says so.
  Interruption(std::stop_token token) : token_(std::move(token)) {}  // NOLINT: meant to convert
  // Stops at question number `poll` (from 1), never before.
  static Interruption at_poll(std::int64_t poll) { return Interruption(poll); }

  Interruption(const Interruption&) = delete;
  Interruption& operator=(const Interruption&) = delete;

  bool requested() const {
    const std::int64_t poll = polls_.fetch_add(1, std::memory_order_relaxed) + 1;
    if (stopped_at_.load(std::memory_order_relaxed) > 0) return true;
    if (stop_at_ > 0 ? poll < stop_at_ : !token_.stop_requested()) return false;
    std::int64_t first = 0;
    stopped_at_.compare_exchange_strong(first, poll, std::memory_order_relaxed);
    return true;
  }
  // The number of the question that was first answered with yes; 0: none was.
  std::int64_t stopped_at() const { return stopped_at_.load(std::memory_order_relaxed); }

 private:
  explicit Interruption(std::int64_t poll) : stop_at_(poll) {}

  std::stop_token token_;
  std::int64_t stop_at_ = 0;
  mutable std::atomic<std::int64_t> polls_{0}, stopped_at_{0};
};

}  // namespace parallax
