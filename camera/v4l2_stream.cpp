#include "camera/v4l2_stream.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>

namespace parallax {
namespace {

// One being filled, one waiting, one being read, one spare.
constexpr __u32 kBuffers = 4;

v4l2_buffer buffer_of(std::uint32_t index) {
  v4l2_buffer buffer{};
  buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  buffer.memory = V4L2_MEMORY_MMAP;
  buffer.index = index;
  return buffer;
}

Timestamp time_of(const v4l2_buffer& buffer, const V4l2System& system) {
  if ((buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC) return system.now();
  return std::chrono::seconds(buffer.timestamp.tv_sec) + std::chrono::microseconds(buffer.timestamp.tv_usec);
}

}  // namespace

V4l2Stream::V4l2Stream(std::shared_ptr<const V4l2Device> device) : device_(std::move(device)) {
  try {
    allocate();
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (const int error = device_->ioctl(VIDIOC_STREAMON, &type); error < 0)
      device_->fail(error, "starting the stream");
  } catch (...) {
    release();
    throw;
  }
}

V4l2Stream::~V4l2Stream() {
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  device_->ioctl(VIDIOC_STREAMOFF, &type);
  release();
}

void V4l2Stream::allocate() {
  v4l2_requestbuffers request{};
  request.count = kBuffers;
  request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  request.memory = V4L2_MEMORY_MMAP;
  if (const int error = device_->ioctl(VIDIOC_REQBUFS, &request); error < 0) {
    device_->fail(error, "asking for buffers");
  }
  if (request.count < 2) device_->fail(ENOMEM, "asking for buffers");
  for (__u32 i = 0; i < request.count; ++i) {
    v4l2_buffer buffer = buffer_of(i);
    if (const int error = device_->ioctl(VIDIOC_QUERYBUF, &buffer); error < 0)
      device_->fail(error, "asking for a buffer");
    const void* memory = device_->system().map(device_->descriptor(), buffer.length, buffer.m.offset);
    if (memory == nullptr) device_->fail(ENOMEM, "mapping a buffer");
    memory_.emplace_back(static_cast<const std::uint8_t*>(memory), buffer.length);
    if (const int error = device_->ioctl(VIDIOC_QBUF, &buffer); error < 0) device_->fail(error, "queueing a buffer");
  }
}

void V4l2Stream::release() {
  for (const auto& memory : memory_) device_->system().unmap(memory.data(), memory.size());
  memory_.clear();
  v4l2_requestbuffers none{};
  none.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  none.memory = V4L2_MEMORY_MMAP;
  device_->ioctl(VIDIOC_REQBUFS, &none);
}

int V4l2Stream::take(Buffer* buffer) {
  v4l2_buffer filled = buffer_of(0);
  if (const int error = device_->ioctl(VIDIOC_DQBUF, &filled); error < 0) return error;
  if (filled.index >= memory_.size()) return -EIO;
  const auto memory = memory_[filled.index];
  buffer->index = filled.index;
  buffer->sequence = filled.sequence;
  buffer->time = time_of(filled, device_->system());
  buffer->damaged = (filled.flags & V4L2_BUF_FLAG_ERROR) != 0;
  buffer->bytes = memory.first(std::min<std::size_t>(filled.bytesused, memory.size()));
  return 0;
}

int V4l2Stream::give_back(const Buffer& buffer) {
  v4l2_buffer empty = buffer_of(buffer.index);
  return device_->ioctl(VIDIOC_QBUF, &empty);
}

}  // namespace parallax
