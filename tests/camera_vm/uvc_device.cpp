#include "tests/camera_vm/uvc_device.h"

#include <cmath>
#include <utility>

namespace parallax::camera_vm {
namespace {

// Requests and descriptor numbers of USB 2.0 and UVC 1.1.
constexpr std::uint8_t kGetStatus = 0, kGetDescriptor = 6, kGetConfiguration = 8, kGetInterface = 10;
constexpr std::uint8_t kSetCur = 0x01, kGetCur = 0x81, kGetMin = 0x82, kGetMax = 0x83, kGetRes = 0x84, kGetLen = 0x85,
                       kGetInfo = 0x86, kGetDef = 0x87;
constexpr int kProbe = 1, kCommit = 2;
constexpr std::size_t kProbeLength = 34;
constexpr int kCameraTerminal = 1, kProcessingUnit = 2;
constexpr std::uint32_t kClock_hz = 48'000'000, kPayload = 16384;

void add16(Bytes* out, std::uint32_t value) {
  out->push_back(static_cast<std::uint8_t>(value));
  out->push_back(static_cast<std::uint8_t>(value >> 8));
}
void add32(Bytes* out, std::uint32_t value) {
  add16(out, value & 0xffff);
  add16(out, value >> 16);
}
void add(Bytes* out, const Bytes& more) { out->insert(out->end(), more.begin(), more.end()); }

void put32(Bytes* out, std::size_t at, std::uint32_t value) {
  for (int i = 0; i < 4; ++i) (*out)[at + static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(value >> 8 * i);
}

Bytes text_descriptor(const std::string& text) {
  Bytes out{static_cast<std::uint8_t>(2 + 2 * text.size()), 3};
  for (const char c : text) add16(&out, static_cast<unsigned char>(c));
  return out;
}

ControlAnswer stalled() { return {true, {}}; }
ControlAnswer answer(Bytes data) { return {false, std::move(data)}; }

}  // namespace

UvcDevice::UvcDevice(int width, int height, double frames_per_second)
    : width_(width), height_(height), interval_(static_cast<std::uint32_t>(std::lround(1e7 / frames_per_second))) {
  settle(&probe_);
  commit_ = probe_;
  // Automatic exposure mode is a set of bits: 1 manual, 8 aperture priority; GET_RES tells which there are.
  controls_[{kCameraTerminal, 0x02}] = {1, 1, 8, 8, 8};
  controls_[{kCameraTerminal, 0x03}] = {1, 0, 1, 0, 1};              // exposure may lower the rate
  controls_[{kCameraTerminal, 0x04}] = {4, 1, 5000, 156, 156};       // exposure time, 100 us
  controls_[{kCameraTerminal, 0x06}] = {2, 0, 250, 0, 40};           // focus
  controls_[{kCameraTerminal, 0x08}] = {1, 0, 1, 1, 1};              // focus by itself
  controls_[{kProcessingUnit, 0x08}] = {2, 0, 7, 3, 3};              // sharpness
  controls_[{kProcessingUnit, 0x0a}] = {2, 2800, 6500, 4600, 4200};  // white balance, kelvin
  controls_[{kProcessingUnit, 0x0b}] = {1, 0, 1, 1, 1};              // white balance by itself
}

UvcFormat UvcDevice::format() const { return commit_[2] == 2 ? UvcFormat::mjpeg : UvcFormat::yuyv; }

bool UvcDevice::take_restart() { return std::exchange(restart_, false); }

// Frame descriptor (UVC payload specifications, tables 3-2): one size, one rate.
Bytes UvcDevice::frame_descriptor(int subtype) const {
  const auto size = static_cast<std::uint32_t>(width_ * height_ * 2);
  const double rate = 1e7 / interval_;
  Bytes out{30, 0x24, static_cast<std::uint8_t>(subtype), 1, 0};
  add16(&out, static_cast<std::uint32_t>(width_));
  add16(&out, static_cast<std::uint32_t>(height_));
  add32(&out, static_cast<std::uint32_t>(size * 8 * rate));
  add32(&out, static_cast<std::uint32_t>(size * 8 * rate));
  add32(&out, size);
  add32(&out, interval_);
  out.push_back(1);
  add32(&out, interval_);
  return out;
}

Bytes UvcDevice::configuration() const {
  const Bytes colour{6, 0x24, 0x0d, 1, 1, 4};
  // Camera terminal: exposure mode, priority and time, focus and automatic focus. Processing unit: sharpness, white
  // balance and automatic white balance. Output terminal.
  const Bytes camera{18, 0x24, 2, kCameraTerminal, 1, 2, 0, 0, 0, 0, 0, 0, 0, 0, 3, 0x2e, 0x00, 0x02};
  const Bytes processing{13, 0x24, 5, kProcessingUnit, kCameraTerminal, 0, 0, 3, 0x50, 0x10, 0x00, 0, 0};
  const Bytes output{9, 0x24, 3, 3, 1, 1, 0, kProcessingUnit, 0};
  Bytes video_control{13, 0x24, 1, 0x10, 1};
  add16(&video_control, static_cast<std::uint32_t>(13 + camera.size() + processing.size() + output.size()));
  add32(&video_control, kClock_hz);
  video_control.push_back(1);
  video_control.push_back(1);
  add(&video_control, camera);
  add(&video_control, processing);
  add(&video_control, output);

  Bytes formats{27, 0x24, 4,    1, 1,    'Y',  'U',  'Y', '2', 0, 0, 0x10, 0, 0x80,
                0,  0,    0xaa, 0, 0x38, 0x9b, 0x71, 16,  1,   0, 0, 0,    0};
  add(&formats, frame_descriptor(5));
  add(&formats, colour);
  add(&formats, {11, 0x24, 6, 2, 1, 1, 1, 0, 0, 0, 0});
  add(&formats, frame_descriptor(7));
  add(&formats, colour);
  Bytes video_streaming{15, 0x24, 1, 2};
  add16(&video_streaming, static_cast<std::uint32_t>(15 + formats.size()));
  add(&video_streaming, {0x81, 0, 3, 0, 0, 0, 1, 0, 0});
  add(&video_streaming, formats);

  Bytes out{9, 2, 0, 0, 2, 1, 0, 0x80, 250};
  add(&out, {8, 0x0b, 0, 2, 0x0e, 3, 0, 0});  // the two interfaces belong together
  add(&out, {9, 4, 0, 0, 0, 0x0e, 1, 0, 0});  // video control
  add(&out, video_control);
  add(&out, {9, 4, 1, 0, 1, 0x0e, 2, 0, 0});  // video streaming
  add(&out, video_streaming);
  add(&out, {7, 5, 0x81, 2, 0, 2, 0});  // bulk IN endpoint, 512 bytes
  out[2] = static_cast<std::uint8_t>(out.size());
  out[3] = static_cast<std::uint8_t>(out.size() >> 8);
  return out;
}

// Makes of the host's wishes what the camera can do.
void UvcDevice::settle(Bytes* probe) const {
  probe->resize(kProbeLength);
  if ((*probe)[2] != 2) (*probe)[2] = 1;
  (*probe)[3] = 1;
  put32(probe, 4, interval_);
  put32(probe, 18, static_cast<std::uint32_t>(width_ * height_ * 2));
  put32(probe, 22, kPayload);
  put32(probe, 26, kClock_hz);
  (*probe)[30] = 0;
  (*probe)[31] = (*probe)[32] = (*probe)[33] = 1;
}

ControlAnswer UvcDevice::control(const SetupPacket& setup, const Bytes& out) {
  constexpr std::uint8_t to_interface = 0x21;  // class request, either direction
  if ((setup.request_type & 0x7f) != to_interface) return standard(setup);
  return (setup.index & 0xff) == 1 ? streaming(setup, out) : unit(setup, out);
}

ControlAnswer UvcDevice::standard(const SetupPacket& setup) const {
  if (setup.request_type == 0x80 && setup.request == kGetDescriptor) {
    switch (setup.value >> 8) {
      case 1:  // 1d6b:0102, with a product's name
        return answer({18, 1, 0, 2, 0xef, 2, 1, 64, 0x6b, 0x1d, 0x02, 0x01, 0, 1, 1, 2, 0, 1});
      case 2:
        return answer(configuration());
      case 3:
        if ((setup.value & 0xff) == 0) return answer({4, 3, 9, 4});
        return answer(text_descriptor((setup.value & 0xff) == 1 ? "Parallax tests" : "Simulated camera"));
      default:
        return stalled();
    }
  }
  if (setup.request == kGetStatus && (setup.request_type & 0x80)) return answer({0, 0});
  if (setup.request == kGetConfiguration) return answer({1});
  if (setup.request == kGetInterface) return answer({0});
  return answer({});
}

ControlAnswer UvcDevice::streaming(const SetupPacket& setup, const Bytes& out) {
  const int selector = setup.value >> 8;
  if (selector != kProbe && selector != kCommit) return stalled();
  Bytes& current = selector == kCommit ? commit_ : probe_;
  switch (setup.request) {
    case kSetCur:
      current = out;
      settle(&current);
      if (selector == kCommit) restart_ = true;
      return answer({});
    case kGetInfo:
      return answer({3});
    case kGetLen:
      return answer({kProbeLength, 0});
    case kGetCur:
      return answer(current);
    default: {
      Bytes limits = probe_;
      settle(&limits);
      return answer(limits);
    }
  }
}

ControlAnswer UvcDevice::unit(const SetupPacket& setup, const Bytes& out) {
  const auto found = controls_.find({setup.index >> 8, setup.value >> 8});
  if (found == controls_.end()) return stalled();
  Control& control = found->second;
  const bool is_mode = setup.index >> 8 == kCameraTerminal && setup.value >> 8 == 0x02;
  const auto number = [&](std::int32_t value) {
    Bytes data;
    add32(&data, static_cast<std::uint32_t>(value));
    data.resize(static_cast<std::size_t>(control.length));
    return answer(data);
  };
  switch (setup.request) {
    case kSetCur: {
      std::uint32_t value = 0;
      for (std::size_t i = 0; i < out.size() && i < 4; ++i) value |= static_cast<std::uint32_t>(out[i]) << 8 * i;
      control.value = static_cast<std::int32_t>(value);
      return answer({});
    }
    case kGetCur:
      return number(control.value);
    case kGetMin:
      return number(control.minimum);
    case kGetMax:
      return number(control.maximum);
    case kGetRes:
      return number(is_mode ? 1 | 8 : 1);
    case kGetDef:
      return number(control.default_value);
    case kGetInfo:
      return answer({control.info});
    case kGetLen:
      return answer({static_cast<std::uint8_t>(control.length), 0});
    default:
      return stalled();
  }
}

}  // namespace parallax::camera_vm
