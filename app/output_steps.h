// Several outputs, one of which may fail: the others are written all the same, and what went wrong is told at the end.
#pragma once

#include <exception>
#include <functional>
#include <vector>

namespace parallax {

class OutputSteps {
 public:
  // Does the step, and keeps what it throws.
  void operator()(const std::function<void()>& step);
  bool failed() const { return !failures_.empty(); }
  // Throws what the first failing step threw, if any did; those of later ones go to stderr before, a line each.
  void finish() const;

 private:
  std::vector<std::exception_ptr> failures_;
};

}  // namespace parallax
