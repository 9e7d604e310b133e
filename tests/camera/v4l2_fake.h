// V4L2 devices that are made up, with a clock of their own: time passes only while somebody waits (or in advance()), so
// that tests of streaming, unplugging and controls take no time and are the same every time.
#pragma once

#include <linux/videodev2.h>
#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "camera/pixel_format.h"
#include "camera/v4l2_system.h"

namespace parallax::testing {

struct FakeControl {
  std::uint32_t id;
  std::string name;
  int minimum, maximum, default_value, value;
  std::uint32_t type = V4L2_CTRL_TYPE_INTEGER;
  std::uint32_t flags = 0;
  std::map<int, std::string> menu = {};
};

struct FakeFormat {
  std::uint32_t code;
  int width, height;
  std::vector<int> rates;
  int step = 0;  // sizes from 48x48 to this one go by so many pixels; 0: only this size
};

struct FakeDevice {
  std::string driver = "fake", card = "Fake camera", bus = "usb-1";
  std::uint32_t capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  std::vector<FakeFormat> formats{{fourcc('Y', 'U', 'Y', 'V'), 640, 480, {30, 15}}};
  std::vector<FakeControl> controls;
  int open_error = 0;  // positive errno
  bool busy = false;   // another program streams
  bool plugged = true;
  int widen = 0;        // pixels by which it adjusts what it is asked for: -4
  int align = 1;        // it makes the size a multiple of this
  int start_error = 0;  // positive errno of starting the stream
  std::uint32_t extra_stride = 0;
  // What a frame holds; default: all bytes the frame's number.
  std::function<void(std::uint32_t sequence, std::vector<std::uint8_t>& bytes)> paint;
  std::function<std::uint32_t(std::uint32_t sequence)> flags;  // further flags of a buffer
  bool silent = false;                                         // sends nothing

  // State.
  v4l2_pix_format format{};
  int rate = 30;
  bool streaming = false;
  std::uint32_t sequence = 0;
  Timestamp due{0};
  std::vector<std::vector<std::uint8_t>> memory;
  std::deque<std::uint32_t> queued;
  std::deque<v4l2_buffer> done;
  int opened = 0;                                      // descriptors
  std::vector<std::pair<std::uint32_t, int>> written;  // controls, in order

  FakeControl& control(std::uint32_t id) {
    for (auto& c : controls) {
      if (c.id == id) return c;
    }
    throw std::out_of_range("no such control");
  }
};

class FakeV4l2 : public V4l2System {
 public:
  std::map<std::string, std::shared_ptr<FakeDevice>> devices;
  // Called before every wait, with the time.
  std::function<void(Timestamp)> on_wait;
  int mapped = 0;  // buffers, at present

  std::shared_ptr<FakeDevice> plug(const std::string& path, FakeDevice device = {}) {
    return devices[path] = std::make_shared<FakeDevice>(std::move(device));
  }
  void pull(const std::string& path) {
    devices.at(path)->plugged = false;
    devices.erase(path);
  }
  // Time passes while the reader does something else.
  void advance(Timestamp by) { advance_to(now_ + by); }

  int open(const std::string& path) override {
    const auto found = devices.find(path);
    if (found == devices.end()) return -ENOENT;
    if (found->second->open_error != 0) return -found->second->open_error;
    ++found->second->opened;
    open_[next_fd_] = found->second;
    return next_fd_++;
  }
  void close(int fd) override {
    --open_.at(fd)->opened;
    open_.erase(fd);
  }
  const void* map(int fd, std::size_t, off_t offset) override {
    ++mapped;
    return open_.at(fd)->memory.at(static_cast<std::size_t>(offset)).data();
  }
  void unmap(const void*, std::size_t) override { --mapped; }
  Timestamp now() const override { return now_; }
  std::vector<std::string> device_paths() const override {
    std::vector<std::string> paths;
    for (const auto& [path, device] : devices) paths.push_back(path);
    return paths;
  }

  int poll(std::span<pollfd> descriptors, std::chrono::milliseconds timeout) override {
    if (on_wait) on_wait(now_);
    const Timestamp end = now_ + timeout;
    while (true) {
      int ready = 0;
      Timestamp next = end;
      for (auto& descriptor : descriptors) {
        descriptor.revents = 0;
        const auto found = open_.find(descriptor.fd);
        if (found == open_.end()) {
          ::poll(&descriptor, 1, 0);  // the real event
        } else if (!found->second->plugged) {
          descriptor.revents = POLLIN | POLLERR | POLLHUP;
        } else if (!found->second->done.empty()) {
          descriptor.revents = POLLIN;
        } else if (found->second->streaming && !found->second->silent) {
          next = std::min(next, found->second->due);
        }
        ready += descriptor.revents != 0;
      }
      if (ready > 0 || now_ >= end) return ready;
      advance_to(next);
    }
  }

  int ioctl(int fd, unsigned long request, void* argument) override {
    FakeDevice& device = *open_.at(fd);
    if (!device.plugged) return -ENODEV;
    switch (request) {
      case VIDIOC_QUERYCAP:
        return query(device, static_cast<v4l2_capability*>(argument));
      case VIDIOC_ENUM_FMT:
        return enumerate(device, static_cast<v4l2_fmtdesc*>(argument));
      case VIDIOC_ENUM_FRAMESIZES:
        return enumerate(device, static_cast<v4l2_frmsizeenum*>(argument));
      case VIDIOC_ENUM_FRAMEINTERVALS:
        return enumerate(device, static_cast<v4l2_frmivalenum*>(argument));
      case VIDIOC_S_FMT:
        return set_format(device, static_cast<v4l2_format*>(argument));
      case VIDIOC_S_PARM: {
        auto& interval = static_cast<v4l2_streamparm*>(argument)->parm.capture.timeperframe;
        device.rate = static_cast<int>((interval.denominator + interval.numerator / 2) / interval.numerator);
        interval = {1, static_cast<__u32>(device.rate)};
        return 0;
      }
      case VIDIOC_REQBUFS:
        return request_buffers(device, static_cast<v4l2_requestbuffers*>(argument));
      case VIDIOC_QUERYBUF: {
        auto& buffer = *static_cast<v4l2_buffer*>(argument);
        buffer.length = static_cast<__u32>(device.memory.at(buffer.index).size());
        buffer.m.offset = buffer.index;
        return 0;
      }
      case VIDIOC_QBUF:
        device.queued.push_back(static_cast<v4l2_buffer*>(argument)->index);
        return 0;
      case VIDIOC_DQBUF:
        if (device.done.empty()) return -EAGAIN;
        *static_cast<v4l2_buffer*>(argument) = device.done.front();
        device.done.pop_front();
        return 0;
      case VIDIOC_STREAMON:
        if (device.start_error != 0) return -device.start_error;
        device.streaming = true;
        device.due = now_ + interval_of(device);
        return 0;
      case VIDIOC_STREAMOFF:
        device.streaming = false;
        device.queued.clear();
        device.done.clear();
        return 0;
      case VIDIOC_QUERYCTRL:
        return query(device, static_cast<v4l2_queryctrl*>(argument));
      case VIDIOC_QUERYMENU:
        return query(device, static_cast<v4l2_querymenu*>(argument));
      case VIDIOC_G_CTRL:
      case VIDIOC_S_CTRL:
        return access(device, request == VIDIOC_S_CTRL, static_cast<v4l2_control*>(argument));
      default:
        return -ENOTTY;
    }
  }

 private:
  static Timestamp interval_of(const FakeDevice& device) { return from_seconds(1.0 / device.rate); }

  void advance_to(Timestamp time) {
    for (auto& [fd, device] : open_) {
      while (device->streaming && device->plugged && !device->silent && device->due <= time) {
        if (!device->queued.empty()) fill(*device);
        ++device->sequence;
        device->due += interval_of(*device);
      }
    }
    now_ = std::max(now_, time);
  }

  static void fill(FakeDevice& device) {
    v4l2_buffer buffer{};
    buffer.index = device.queued.front();
    device.queued.pop_front();
    auto& bytes = device.memory.at(buffer.index);
    if (device.paint) {
      device.paint(device.sequence, bytes);
    } else {
      std::fill(bytes.begin(), bytes.end(), static_cast<std::uint8_t>(device.sequence));
    }
    buffer.bytesused = static_cast<__u32>(bytes.size());
    buffer.sequence = device.sequence;
    buffer.flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | (device.flags ? device.flags(device.sequence) : 0);
    buffer.timestamp.tv_sec = static_cast<long>(device.due.count() / 1000000000);
    buffer.timestamp.tv_usec = static_cast<long>(device.due.count() % 1000000000 / 1000);
    device.done.push_back(buffer);
  }

  template <std::size_t N>
  static void put(__u8 (&field)[N], const std::string& text) {
    std::memcpy(field, text.data(), std::min(N - 1, text.size()));
  }

  static int query(const FakeDevice& device, v4l2_capability* out) {
    put(out->driver, device.driver);
    put(out->card, device.card);
    put(out->bus_info, device.bus);
    out->capabilities = V4L2_CAP_DEVICE_CAPS | V4L2_CAP_VIDEO_CAPTURE;
    out->device_caps = device.capabilities;
    return 0;
  }

  static int enumerate(const FakeDevice& device, v4l2_fmtdesc* out) {
    std::vector<std::uint32_t> codes;
    for (const auto& format : device.formats) {
      if (std::find(codes.begin(), codes.end(), format.code) == codes.end()) codes.push_back(format.code);
    }
    if (out->index >= codes.size()) return -EINVAL;
    out->pixelformat = codes[out->index];
    return 0;
  }
  static int enumerate(const FakeDevice& device, v4l2_frmsizeenum* out) {
    __u32 index = 0;
    for (const auto& format : device.formats) {
      if (format.code != out->pixel_format || index++ != out->index) continue;
      if (format.step > 0) {
        constexpr __u32 least = 48;
        out->type = format.step == 1 ? V4L2_FRMSIZE_TYPE_CONTINUOUS : V4L2_FRMSIZE_TYPE_STEPWISE;
        const auto step = static_cast<__u32>(format.step);
        out->stepwise = {least, static_cast<__u32>(format.width), step, least, static_cast<__u32>(format.height), step};
        return 0;
      }
      out->type = V4L2_FRMSIZE_TYPE_DISCRETE;
      out->discrete = {static_cast<__u32>(format.width), static_cast<__u32>(format.height)};
      return 0;
    }
    return -EINVAL;
  }
  static int enumerate(const FakeDevice& device, v4l2_frmivalenum* out) {
    for (const auto& format : device.formats) {
      const bool has_size = format.step > 0 || (format.width == static_cast<int>(out->width) &&
                                                format.height == static_cast<int>(out->height));
      if (format.code != out->pixel_format || !has_size || out->index >= format.rates.size()) {
        continue;
      }
      out->type = V4L2_FRMIVAL_TYPE_DISCRETE;
      out->discrete = {1, static_cast<__u32>(format.rates[out->index])};
      return 0;
    }
    return -EINVAL;
  }

  static int set_format(FakeDevice& device, v4l2_format* out) {
    if (device.busy) return -EBUSY;
    auto& pix = out->fmt.pix;
    pix.width = static_cast<__u32>(static_cast<int>(pix.width) + device.widen);
    pix.width -= pix.width % static_cast<__u32>(device.align);
    pix.height -= pix.height % static_cast<__u32>(device.align);
    std::uint32_t row = pix.width;
    if (pix.pixelformat == fourcc('Y', 'U', 'Y', 'V')) row *= 2;
    if (pix.pixelformat == fourcc('R', 'G', 'B', '3')) row *= 3;
    pix.bytesperline = row + device.extra_stride;
    pix.sizeimage = pix.bytesperline * pix.height;
    device.format = pix;
    return 0;
  }

  static int request_buffers(FakeDevice& device, v4l2_requestbuffers* out) {
    if (device.busy) return -EBUSY;
    device.memory.assign(out->count, std::vector<std::uint8_t>(device.format.sizeimage));
    device.queued.clear();
    device.done.clear();
    return 0;
  }

  static int query(const FakeDevice& device, v4l2_queryctrl* out) {
    const bool next = (out->id & V4L2_CTRL_FLAG_NEXT_CTRL) != 0;
    const std::uint32_t id = out->id & ~static_cast<std::uint32_t>(V4L2_CTRL_FLAG_NEXT_CTRL);
    const FakeControl* best = nullptr;
    for (const auto& control : device.controls) {
      if (next ? control.id > id && (best == nullptr || control.id < best->id) : control.id == id) best = &control;
    }
    if (best == nullptr) return -EINVAL;
    *out = {};
    out->id = best->id;
    out->type = best->type;
    put(out->name, best->name);
    out->minimum = best->minimum;
    out->maximum = best->maximum;
    out->step = 1;
    out->default_value = best->default_value;
    out->flags = best->flags;
    return 0;
  }
  static int query(FakeDevice& device, v4l2_querymenu* out) {
    const auto& menu = device.control(out->id).menu;
    const auto found = menu.find(static_cast<int>(out->index));
    if (found == menu.end()) return -EINVAL;
    std::memcpy(out->name, found->second.data(), std::min(sizeof out->name - 1, found->second.size()));
    return 0;
  }
  static int access(FakeDevice& device, bool write, v4l2_control* out) {
    for (auto& control : device.controls) {
      if (control.id != out->id) continue;
      if (write) {
        if (control.flags & V4L2_CTRL_FLAG_READ_ONLY) return -EACCES;
        control.value = out->value;
        device.written.emplace_back(control.id, control.value);
      }
      out->value = control.value;
      return 0;
    }
    return -EINVAL;
  }

  std::map<int, std::shared_ptr<FakeDevice>> open_;
  int next_fd_ = 1000000;  // no real descriptor
  Timestamp now_ = std::chrono::seconds(1000);
};

}  // namespace parallax::testing
