// The system calls that V4L2 cameras are made of, behind an interface, so that everything above it is tested on a fake
// device without a kernel driver. See the kernel's documentation, "Linux Media Subsystem, Part I: Video for Linux".
#pragma once

#include <poll.h>
#include <sys/types.h>

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/time.h"

namespace parallax {

// Calls return what the system call returns, or -errno. Safe from any thread, as far as the kernel is.
class V4l2System {
 public:
  virtual ~V4l2System() = default;

  virtual int open(const std::string& path) = 0;  // non-blocking; a descriptor
  virtual void close(int fd) = 0;
  virtual int ioctl(int fd, unsigned long request, void* argument) = 0;  // repeats what a signal interrupted
  // Read-only memory shared with the driver; null when it cannot be had.
  virtual const void* map(int fd, std::size_t length, off_t offset) = 0;
  virtual void unmap(const void* memory, std::size_t length) = 0;
  // At most `timeout` (never for ever); 0 when it passed or a signal came.
  virtual int poll(std::span<pollfd> descriptors, std::chrono::milliseconds timeout) = 0;

  // CLOCK_MONOTONIC, by which drivers stamp frames.
  virtual Timestamp now() const = 0;
  // Paths of the video device nodes, /dev/video2 before /dev/video10.
  virtual std::vector<std::string> device_paths() const = 0;
};

// The kernel itself.
std::shared_ptr<V4l2System> kernel_v4l2_system();

// Wakes a thread that waits in V4l2System::poll: an eventfd. Safe from any thread.
class WakeEvent {
 public:
  WakeEvent();  // throws RunError when the system is out of descriptors
  ~WakeEvent();
  WakeEvent(const WakeEvent&) = delete;
  WakeEvent& operator=(const WakeEvent&) = delete;

  int descriptor() const { return fd_; }  // readable once signalled, and from then on
  void signal();

 private:
  int fd_;
};

}  // namespace parallax
