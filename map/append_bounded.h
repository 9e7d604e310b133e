// A list that keeps the newest of what was appended, for statistics of sessions without an end.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

namespace parallax {

// Keeps the newest `limit` values at least, and twice as many at most; appending is cheap on average.
template <class T>
void append_bounded(T value, std::size_t limit, std::vector<T>* values) {
  if (values->size() >= 2 * limit) {
    values->erase(values->begin(), values->end() - static_cast<std::ptrdiff_t>(limit));
  }
  values->push_back(std::move(value));
}

}  // namespace parallax
