// A USB device in user space: the kernel's vhci_hcd driver sends it the requests for a device that is "plugged in" over
// a socket, by the USB/IP protocol (Linux documentation, usb/usbip_protocol). Needs root and the vhci_hcd module. Only
// for tests: any failure ends the program.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <vector>

namespace parallax::camera_vm {

using Bytes = std::vector<std::uint8_t>;

// The eight bytes that begin a control transfer (USB 2.0, table 9-2).
struct SetupPacket {
  std::uint8_t request_type = 0, request = 0;
  std::uint16_t value = 0, index = 0, length = 0;
};

// What a control transfer is answered with: data for an IN transfer, or a stall.
struct ControlAnswer {
  bool stall = false;
  Bytes data;
};

class UsbIpLink {
 public:
  // `control` answers control transfers; `bulk_in` gives up to `room` bytes for a bulk IN transfer, or nothing when
  // there are none yet; `next_bulk` says when it is worth asking again.
  struct Device {
    std::function<ControlAnswer(const SetupPacket&, const Bytes& out)> control;
    std::function<Bytes(std::size_t room)> bulk_in;
    std::function<std::chrono::steady_clock::time_point()> next_bulk;
  };

  explicit UsbIpLink(Device device) : device_(std::move(device)) {}
  ~UsbIpLink();
  UsbIpLink(const UsbIpLink&) = delete;
  UsbIpLink& operator=(const UsbIpLink&) = delete;

  // Appears on the simulated bus as a high-speed device.
  void plug_in();
  // Answers requests until `unplug` says so (asked after every answer) or the kernel closes the link. True: unplugged.
  bool serve(const std::function<bool()>& unplug);
  // Disappears from the bus, as when the plug is pulled.
  void pull_out();

 private:
  struct PendingBulk {
    std::uint32_t sequence, length;
  };

  void answer_bulk();
  bool handle_request();
  void handle_unlink(std::uint32_t sequence, std::uint32_t target);
  void reply(std::uint32_t sequence, std::int32_t status, const Bytes& data, std::uint32_t length);
  bool receive(void* data, std::size_t size);
  bool send(const Bytes& data);

  Device device_;
  int socket_ = -1;
  bool closed_ = false;
  std::deque<PendingBulk> pending_;
};

}  // namespace parallax::camera_vm
