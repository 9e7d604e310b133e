// The controls of a V4L2 device: listed, read, set, and put back as they were.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "camera/live_camera.h"
#include "camera/v4l2_device.h"
#include "core/mutex.h"

namespace parallax {

// Safe from any thread. Shares the device.
class V4l2Controls {
 public:
  explicit V4l2Controls(std::shared_ptr<const V4l2Device> device) : device_(std::move(device)) {}
  ~V4l2Controls() { restore(); }
  V4l2Controls(const V4l2Controls&) = delete;
  V4l2Controls& operator=(const V4l2Controls&) = delete;

  // Integers, switches, menus and buttons; text and compound controls are left out.
  std::vector<CameraControl> list() const;

  // By the kernel's number (V4L2_CID_...). find() gives nothing for one that the driver has not.
  std::optional<CameraControl> find(std::uint32_t id) const;
  std::optional<std::int64_t> value(std::uint32_t id) const;
  // False when the driver refuses. What the control was before its first change is remembered.
  bool set(std::uint32_t id, std::int64_t value);

  // By name. Throws InputError for an unknown name, a value out of range, or one that the driver refuses.
  void set_by_name(const std::string& name, std::int64_t value);

  // Puts every control back that was changed, the last one first (a value goes back before the automatic that governs
  // it), and changes none from then on.
  void restore();

 private:
  bool set_locked(std::uint32_t id, std::int64_t value) PARALLAX_REQUIRES(mutex_);
  int write(std::uint32_t id, std::int64_t value) const;

  struct Changed {
    std::uint32_t id;
    std::int64_t before;
  };

  std::shared_ptr<const V4l2Device> device_;
  Mutex mutex_;
  std::vector<Changed> changed_ PARALLAX_GUARDED_BY(mutex_);
  bool restored_ PARALLAX_GUARDED_BY(mutex_) = false;
};

// "Exposure Time, Absolute" -> "exposure_time_absolute".
std::string control_name(const std::string& text);

// Checks a value against a control of a list. Throws InputError that names `source`, what was found and expected.
const CameraControl& require_control(const std::string& source, const std::vector<CameraControl>& controls,
                                     const std::string& name, std::int64_t value);

}  // namespace parallax
