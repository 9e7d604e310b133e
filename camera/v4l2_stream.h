// Streaming from a V4L2 device through buffers that the driver shares (mmap).
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "camera/v4l2_device.h"
#include "camera/v4l2_formats.h"
#include "core/time.h"

namespace parallax {

// Streams from construction to destruction. One thread. Shares the device.
class V4l2Stream {
 public:
  // Throws InputError (busy, out of memory).
  explicit V4l2Stream(std::shared_ptr<const V4l2Device> device);
  ~V4l2Stream();
  V4l2Stream(const V4l2Stream&) = delete;
  V4l2Stream& operator=(const V4l2Stream&) = delete;

  struct Buffer {
    std::uint32_t index = 0;
    std::uint32_t sequence = 0;             // of the driver; a gap is frames that were lost on the way
    Timestamp time{0};                      // CLOCK_MONOTONIC: begin or end of the exposure, as the driver has it
    bool damaged = false;                   // the driver says so
    std::span<const std::uint8_t> bytes{};  // valid until give_back
  };

  // A filled buffer; -EAGAIN when there is none, -ENODEV when the camera has gone.
  int take(Buffer* buffer);
  // Hands it to the driver again; -errno.
  int give_back(const Buffer& buffer);

  int buffer_count() const { return static_cast<int>(memory_.size()); }

 private:
  void allocate();
  void release();

  std::shared_ptr<const V4l2Device> device_;
  std::vector<std::span<const std::uint8_t>> memory_;
};

}  // namespace parallax
