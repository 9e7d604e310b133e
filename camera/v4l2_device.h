// One open V4L2 device node that captures video: what it is, and its errors as lines that say what to do.
#pragma once

#include <memory>
#include <string>

#include "camera/v4l2_system.h"
#include "core/error.h"

namespace parallax {

// The node is there, but it is no camera (metadata, an encoder, an output).
class NotACaptureDevice : public InputError {
 public:
  using InputError::InputError;
};

// Owns the descriptor. Calls are safe from any thread, as the kernel's are.
class V4l2Device {
 public:
  // Throws InputError: no such device, permission denied, busy; NotACaptureDevice.
  V4l2Device(std::shared_ptr<V4l2System> system, const std::string& path);
  ~V4l2Device();
  V4l2Device(const V4l2Device&) = delete;
  V4l2Device& operator=(const V4l2Device&) = delete;

  int ioctl(unsigned long request, void* argument) const { return system_->ioctl(fd_, request, argument); }
  int descriptor() const { return fd_; }
  V4l2System& system() const { return *system_; }

  const std::string& path() const { return path_; }
  const std::string& card() const { return card_; }  // the product's name
  const std::string& bus() const { return bus_; }
  std::string source() const { return "v4l2:" + path_; }
  std::string identity() const { return driver_ + ", " + card_ + ", " + bus_; }

  // Throws the InputError for a call that failed with -errno: `doing` is what was tried ("setting the format").
  [[noreturn]] void fail(int error, const std::string& doing) const;

 private:
  void read_capabilities();

  std::shared_ptr<V4l2System> system_;
  std::string path_, driver_, card_, bus_;
  int fd_ = -1;
};

// The one-line text for a failed call on a device.
std::string v4l2_problem(const std::string& path, int error, const std::string& doing);

}  // namespace parallax
