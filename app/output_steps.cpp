#include "app/output_steps.h"

#include <iostream>

namespace parallax {

void OutputSteps::operator()(const std::function<void()>& step) {
  try {
    step();
  } catch (...) {
    failures_.push_back(std::current_exception());
  }
}

void OutputSteps::finish() const {
  for (std::size_t i = 1; i < failures_.size(); ++i) {
    try {
      std::rethrow_exception(failures_[i]);
    } catch (const std::exception& e) {
      std::cerr << "parallax: warning: " << e.what() << '\n';
    }
  }
  if (failed()) std::rethrow_exception(failures_.front());
}

}  // namespace parallax
