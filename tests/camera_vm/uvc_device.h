// The simulated camera as its driver sees it: USB Video Class 1.1 descriptors and requests of a camera with one bulk
// endpoint, YUYV and Motion JPEG of one size, and the controls that the tracking profile uses. Knows no pictures and no
// kernel.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "tests/camera_vm/usbip_link.h"

namespace parallax::camera_vm {

enum class UvcFormat { yuyv = 1, mjpeg = 2 };

class UvcDevice {
 public:
  UvcDevice(int width, int height, double frames_per_second);

  ControlAnswer control(const SetupPacket& setup, const Bytes& out);

  // What the driver committed to.
  UvcFormat format() const;
  // True once after the driver committed a format: frames begin anew.
  bool take_restart();

 private:
  struct Control {
    int length;  // bytes
    std::int32_t minimum, maximum, default_value, value;
    std::uint8_t info = 3;  // may be read and set
  };

  Bytes configuration() const;
  Bytes frame_descriptor(int subtype) const;
  ControlAnswer standard(const SetupPacket& setup) const;
  ControlAnswer streaming(const SetupPacket& setup, const Bytes& out);
  ControlAnswer unit(const SetupPacket& setup, const Bytes& out);
  void settle(Bytes* probe) const;

  int width_, height_;
  std::uint32_t interval_;  // 100 ns
  Bytes probe_, commit_;
  bool restart_ = false;
  std::map<std::pair<int, int>, Control> controls_;  // by unit and selector
};

}  // namespace parallax::camera_vm
