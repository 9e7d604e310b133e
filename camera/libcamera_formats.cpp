#ifdef PARALLAX_HAVE_LIBCAMERA

#include "camera/libcamera_formats.h"

#include <libcamera/logging.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <condition_variable>
#include <cstdlib>
#include <mutex>
#include <utility>

#include "camera/image_file.h"
#include "core/error.h"

namespace parallax {
namespace {

// libcamera names RGB formats by the bits of a little-endian number: RGB888 lies in memory as blue, green, red.
const std::array<std::pair<PixelFormat, libcamera::PixelFormat>, 7> kFormats{
    {{PixelFormat::yuyv, libcamera::formats::YUYV},
     {PixelFormat::uyvy, libcamera::formats::UYVY},
     {PixelFormat::nv12, libcamera::formats::NV12},
     {PixelFormat::bgr24, libcamera::formats::RGB888},
     {PixelFormat::rgb24, libcamera::formats::BGR888},
     {PixelFormat::grey, libcamera::formats::R8},
     {PixelFormat::mjpeg, libcamera::formats::MJPEG}}};

std::string snake_case(const std::string& camel_case) {
  std::string name;
  for (const char c : camel_case) {
    const auto character = static_cast<unsigned char>(c);
    if (std::isupper(character) != 0 && !name.empty()) name += '_';
    name += static_cast<char>(std::tolower(character));
  }
  return name;
}

std::optional<std::int64_t> to_integer(const libcamera::ControlValue& value) {
  if (value.isArray()) return std::nullopt;
  switch (value.type()) {
    case libcamera::ControlTypeBool:
      return value.get<bool>() ? 1 : 0;
    case libcamera::ControlTypeInteger32:
      return value.get<std::int32_t>();
    case libcamera::ControlTypeInteger64:
      return value.get<std::int64_t>();
    case libcamera::ControlTypeFloat: {
      constexpr double largest = 1e15;
      const double milli = 1e3 * static_cast<double>(value.get<float>());
      return std::isfinite(milli) && std::abs(milli) < largest ? std::optional(std::llround(milli)) : std::nullopt;
    }
    default:
      return std::nullopt;
  }
}

}  // namespace

std::shared_ptr<libcamera::CameraManager> libcamera_manager() {
  // A second manager must not be made before the first one is gone, which takes a while after the last one lets go.
  struct Shared {
    std::mutex mutex;
    std::condition_variable condition;
    std::weak_ptr<libcamera::CameraManager> manager;
    bool exists = false;
  };
  static Shared shared;
  const auto gone = [] {
    {
      const std::lock_guard lock(shared.mutex);
      shared.exists = false;
    }
    shared.condition.notify_all();
  };
  std::unique_lock lock(shared.mutex);
  if (auto manager = shared.manager.lock()) return manager;
  shared.condition.wait(lock, [] { return !shared.exists; });
  // Its log goes to the console unless its user has asked for a file.
  static const bool quiet =
      std::getenv("LIBCAMERA_LOG_FILE") == nullptr && libcamera::logSetTarget(libcamera::LoggingTargetNone) == 0;
  (void)quiet;
  auto started = std::make_unique<libcamera::CameraManager>();
  if (started->start() != 0) throw InputError("libcamera: cannot be started");
  shared.exists = true;
  std::shared_ptr<libcamera::CameraManager> manager(started.release(), [gone](libcamera::CameraManager* stopped) {
    stopped->stop();
    std::default_delete<libcamera::CameraManager>()(stopped);
    gone();
  });
  shared.manager = manager;
  return manager;
}

std::optional<PixelFormat> pixel_format_of(const libcamera::PixelFormat& format) {
  for (const auto& [ours, theirs] : kFormats) {
    if (theirs == format) return ours;
  }
  return std::nullopt;
}

libcamera::PixelFormat libcamera_format_of(PixelFormat format) {
  for (const auto& [ours, theirs] : kFormats) {
    if (ours == format) return theirs;
  }
  return {};
}

std::vector<CameraFormat> libcamera_formats(const libcamera::StreamConfiguration& stream, ImageSize wanted) {
  std::vector<CameraFormat> formats;
  const libcamera::Size also(static_cast<unsigned int>(wanted.width), static_cast<unsigned int>(wanted.height));
  for (const auto& theirs : stream.formats().pixelformats()) {
    const auto ours = pixel_format_of(theirs);
    auto sizes = stream.formats().sizes(theirs);
    // A range without steps is made up from single sizes: what lies between them is not offered.
    const auto range = stream.formats().range(theirs);
    const bool goes_by_steps = range.hStep > 0 && range.vStep > 0;
    if (goes_by_steps && range.contains(also) && std::find(sizes.begin(), sizes.end(), also) == sizes.end()) {
      sizes.push_back(also);
    }
    for (const auto& size : sizes) {
      CameraFormat format;
      format.pixel_format = ours ? fourcc_text(fourcc_of(*ours)) : theirs.toString();
      format.width = static_cast<int>(size.width);
      format.height = static_cast<int>(size.height);
      format.usable = ours.has_value() && image_size_problem({format.width, format.height}).empty();
      formats.push_back(std::move(format));
    }
  }
  return formats;
}

libcamera::ControlValue LibcameraControl::to_value(std::int64_t value) const {
  switch (type) {
    case libcamera::ControlTypeBool:
      return libcamera::ControlValue(value != 0);
    case libcamera::ControlTypeInteger32:
      return libcamera::ControlValue(static_cast<std::int32_t>(value));
    case libcamera::ControlTypeFloat:
      return libcamera::ControlValue(static_cast<float>(static_cast<double>(value) * 1e-3));
    default:
      return libcamera::ControlValue(value);
  }
}

std::vector<LibcameraControl> libcamera_controls(const libcamera::Camera& camera) {
  std::vector<LibcameraControl> controls;
  for (const auto& [id, info] : camera.controls()) {
    const auto minimum = to_integer(info.min()), maximum = to_integer(info.max());
    if (!minimum || !maximum) continue;
    LibcameraControl out;
    out.id = id->id();
    out.type = id->type();
    out.control.name = snake_case(id->name()) + (out.type == libcamera::ControlTypeFloat ? "_milli" : "");
    out.control.minimum = *minimum;
    out.control.maximum = *maximum;
    out.control.default_value = out.control.value = to_integer(info.def()).value_or(*minimum);
    for (const auto& value : info.values()) {
      if (const auto number = to_integer(value)) out.control.menu.emplace_back(*number, value.toString());
    }
    controls.push_back(std::move(out));
  }
  return controls;
}

std::string libcamera_product(const libcamera::Camera& camera) {
  return camera.properties().get(libcamera::properties::Model).value_or(camera.id());
}

std::string libcamera_identity(const libcamera::Camera& camera) {
  return "libcamera, " + libcamera_product(camera) + ", " + camera.id();
}

}  // namespace parallax

#endif  // PARALLAX_HAVE_LIBCAMERA
