// A table keyed by identifiers of one session: look-up by index, iteration in order of age, removal without moving
// others. What is removed costs a pointer from then on, since identifiers are never given out twice.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/check.h"

namespace parallax {

// Not thread-safe; lives inside Map, behind SharedMap's lock.
template <class Id, class T>
class IdTable {
 public:
  IdTable() = default;
  IdTable(const IdTable& other) : size_(other.size_) {
    slots_.reserve(other.slots_.size());
    for (const auto& slot : other.slots_) slots_.push_back(slot ? std::make_unique<T>(*slot) : nullptr);
  }
  IdTable& operator=(const IdTable& other) {
    if (this != &other) *this = IdTable(other);
    return *this;
  }
  IdTable(IdTable&& other) noexcept : slots_(std::move(other.slots_)), size_(std::exchange(other.size_, 0)) {
    other.slots_.clear();
  }
  IdTable& operator=(IdTable&& other) noexcept {
    slots_ = std::move(other.slots_);
    other.slots_.clear();
    size_ = std::exchange(other.size_, 0);
    return *this;
  }
  ~IdTable() = default;

  // The identifier that the next insert() will give out.
  Id next_id(std::int32_t session = 0) const { return Id{session, static_cast<std::int32_t>(slots_.size())}; }

  Id insert(T value, std::int32_t session = 0) {
    const Id id = next_id(session);
    value.id = id;
    slots_.push_back(std::make_unique<T>(std::move(value)));
    ++size_;
    return id;
  }

  // Puts back what had this identifier in a saved map: after all that are there, gaps stay gaps.
  void restore(T value, Id id) {
    PARALLAX_CHECK(id.index >= capacity(), "an entry that is there already");
    slots_.resize(static_cast<std::size_t>(id.index));
    value.id = id;
    slots_.push_back(std::make_unique<T>(std::move(value)));
    ++size_;
  }

  bool contains(Id id) const {
    return id.index >= 0 && static_cast<std::size_t>(id.index) < slots_.size() && slots_[id.index] != nullptr;
  }
  const T* find(Id id) const { return contains(id) ? slots_[id.index].get() : nullptr; }
  T* find(Id id) { return contains(id) ? slots_[id.index].get() : nullptr; }

  const T& at(Id id) const {
    PARALLAX_CHECK(contains(id), "no entry " + std::to_string(id.index));
    return *slots_[id.index];
  }
  T& at(Id id) {
    PARALLAX_CHECK(contains(id), "no entry " + std::to_string(id.index));
    return *slots_[id.index];
  }

  bool erase(Id id) {
    if (!contains(id)) return false;
    slots_[id.index].reset();
    --size_;
    return true;
  }

  void clear() {
    slots_.clear();
    size_ = 0;
  }

  int size() const { return size_; }
  bool empty() const { return size_ == 0; }
  // One more than the largest index ever given out: the size of an array indexed by id.index.
  int capacity() const { return static_cast<int>(slots_.size()); }

  template <class Slot, class Value>
  class Iterator {
   public:
    Iterator(Slot* p, Slot* end) : p_(p), end_(end) { skip(); }
    Value& operator*() const { return **p_; }
    Value* operator->() const { return &**p_; }
    Iterator& operator++() {
      ++p_;
      skip();
      return *this;
    }
    bool operator!=(const Iterator& o) const { return p_ != o.p_; }
    bool operator==(const Iterator& o) const { return p_ == o.p_; }

   private:
    void skip() {
      while (p_ != end_ && !*p_) ++p_;
    }
    Slot* p_;
    Slot* end_;
  };
  using const_iterator = Iterator<const std::unique_ptr<T>, const T>;
  using iterator = Iterator<std::unique_ptr<T>, T>;
  const_iterator begin() const { return {slots_.data(), slots_.data() + slots_.size()}; }
  const_iterator end() const { return {slots_.data() + slots_.size(), slots_.data() + slots_.size()}; }
  iterator begin() { return {slots_.data(), slots_.data() + slots_.size()}; }
  iterator end() { return {slots_.data() + slots_.size(), slots_.data() + slots_.size()}; }

 private:
  std::vector<std::unique_ptr<T>> slots_;
  int size_ = 0;
};

}  // namespace parallax
