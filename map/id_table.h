// A table keyed by identifiers of one session: look-up by index, iteration in order of age, removal without moving
// others.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/check.h"

namespace parallax {

// Not thread-safe; lives inside Map, behind SharedMap's lock.
template <class Id, class T>
class IdTable {
 public:
  // The identifier that the next insert() will give out.
  Id next_id(std::int32_t session = 0) const { return Id{session, static_cast<std::int32_t>(slots_.size())}; }

  Id insert(T value, std::int32_t session = 0) {
    const Id id = next_id(session);
    value.id = id;
    slots_.emplace_back(std::move(value));
    ++size_;
    return id;
  }

  bool contains(Id id) const {
    return id.index >= 0 && static_cast<std::size_t>(id.index) < slots_.size() && slots_[id.index].has_value();
  }
  const T* find(Id id) const { return contains(id) ? &*slots_[id.index] : nullptr; }
  T* find(Id id) { return contains(id) ? &*slots_[id.index] : nullptr; }

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
      while (p_ != end_ && !p_->has_value()) ++p_;
    }
    Slot* p_;
    Slot* end_;
  };
  using const_iterator = Iterator<const std::optional<T>, const T>;
  using iterator = Iterator<std::optional<T>, T>;
  const_iterator begin() const { return {slots_.data(), slots_.data() + slots_.size()}; }
  const_iterator end() const { return {slots_.data() + slots_.size(), slots_.data() + slots_.size()}; }
  iterator begin() { return {slots_.data(), slots_.data() + slots_.size()}; }
  iterator end() { return {slots_.data() + slots_.size(), slots_.data() + slots_.size()}; }

 private:
  std::vector<std::optional<T>> slots_;
  int size_ = 0;
};

}  // namespace parallax
