#include "camera/v4l2_device.h"

#include <linux/videodev2.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace parallax {
namespace {

// Fixed-size text of the kernel, which need not end with a zero.
template <std::size_t N>
std::string text_of(const __u8 (&field)[N]) {
  std::string text;
  for (const __u8 c : field) {
    if (c == 0) break;
    text += c < ' ' || c == 127 ? '?' : static_cast<char>(c);
  }
  return text;
}

}  // namespace

std::string v4l2_problem(const std::string& path, int error, const std::string& doing) {
  const std::string where = "v4l2:" + path + ": ";
  switch (error < 0 ? -error : error) {
    case ENOENT:
    case ENODEV:
    case ENXIO:
      return where + "no such device: is the camera plugged in? `parallax cameras` lists what is there";
    case EACCES:
    case EPERM:
      return where +
             "permission denied: add yourself to the `video` group (sudo usermod -aG video $USER) and log in again";
    case EBUSY:
      return where + "busy: another program is using the camera; close it and try again";
    case EPIPE:
      return where +
             "is one part of several that have to be set up together, which only libcamera does: use libcamera:";
    default:
      return where + doing + " failed: " + std::strerror(error < 0 ? -error : error);
  }
}

V4l2Device::V4l2Device(std::shared_ptr<V4l2System> system, const std::string& path)
    : system_(std::move(system)), path_(path) {
  fd_ = system_->open(path_);
  if (fd_ < 0) throw InputError(v4l2_problem(path_, fd_, "opening it"));
  try {
    read_capabilities();
  } catch (...) {
    system_->close(fd_);
    throw;
  }
}

V4l2Device::~V4l2Device() { system_->close(fd_); }

void V4l2Device::fail(int error, const std::string& doing) const {
  throw InputError(v4l2_problem(path_, error, doing));
}

void V4l2Device::read_capabilities() {
  v4l2_capability capability{};
  if (const int error = ioctl(VIDIOC_QUERYCAP, &capability); error < 0) {
    if (error == -ENOTTY || error == -EINVAL) {
      throw NotACaptureDevice("v4l2:" + path_ + ": is not a video device; `parallax cameras` lists the cameras");
    }
    fail(error, "asking what it is");
  }
  driver_ = text_of(capability.driver);
  card_ = text_of(capability.card);
  bus_ = text_of(capability.bus_info);
  const auto able = capability.capabilities & V4L2_CAP_DEVICE_CAPS ? capability.device_caps : capability.capabilities;
  const std::string is = "v4l2:" + path_ + ": " + card_;
  if (!(able & V4L2_CAP_VIDEO_CAPTURE) && (able & V4L2_CAP_VIDEO_CAPTURE_MPLANE)) {
    throw InputError(is + " delivers its planes one by one, which only libcamera handles: use libcamera:");
  }
  if (!(able & V4L2_CAP_VIDEO_CAPTURE)) {
    throw NotACaptureDevice(is + " does not capture video; `parallax cameras` lists the cameras");
  }
  if (!(able & V4L2_CAP_STREAMING)) throw InputError(is + " cannot stream into memory; use another camera");
}

}  // namespace parallax
