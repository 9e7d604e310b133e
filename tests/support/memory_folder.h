// A scratch folder in memory, where the system has that: for tests that synchronise files often.
#pragma once

#include <unistd.h>

#include <cstdlib>
#include <string>

#include "tests/support/process.h"

namespace parallax::testing {

namespace detail {

// Temporary files go to memory until restore().
class TemporaryFilesInMemory {
 public:
  TemporaryFilesInMemory() {
    const char* before = std::getenv("TMPDIR");
    was_set_ = before != nullptr;
    if (before) before_ = before;
    if (access("/dev/shm", W_OK) == 0) setenv("TMPDIR", "/dev/shm", 1);
  }
  void restore() const {
    if (was_set_)
      setenv("TMPDIR", before_.c_str(), 1);
    else
      unsetenv("TMPDIR");
  }

 private:
  bool was_set_ = false;
  std::string before_;
};

}  // namespace detail

class MemoryFolder : private detail::TemporaryFilesInMemory, public ScratchFolder {
 public:
  MemoryFolder() { restore(); }
};

}  // namespace parallax::testing
