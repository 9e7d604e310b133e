#include "camera/v4l2_formats.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <set>
#include <tuple>

#include "camera/image_file.h"

namespace parallax {
namespace {

constexpr __u32 kMaxEntries = 1000;  // a driver that lists more is stuck
constexpr std::array<ImageSize, 6> kCustomarySizes{
    {{320, 240}, {640, 360}, {640, 480}, {800, 600}, {1280, 720}, {1920, 1080}}};
constexpr std::array<double, 5> kCustomaryRates{10, 15, 25, 30, 60};  // frames a second

double rate_of(const v4l2_fract& interval) {
  return interval.numerator == 0 ? 0 : static_cast<double>(interval.denominator) / interval.numerator;
}

std::vector<double> rates_of(const V4l2Device& device, std::uint32_t code, ImageSize size) {
  std::set<double, std::greater<>> rates;
  for (__u32 i = 0; i < kMaxEntries; ++i) {
    v4l2_frmivalenum entry{};
    entry.index = i;
    entry.pixel_format = code;
    entry.width = static_cast<__u32>(size.width);
    entry.height = static_cast<__u32>(size.height);
    if (device.ioctl(VIDIOC_ENUM_FRAMEINTERVALS, &entry) < 0) break;
    if (entry.type == V4L2_FRMIVAL_TYPE_DISCRETE) {
      rates.insert(rate_of(entry.discrete));
      continue;
    }
    const double lowest = rate_of(entry.stepwise.max), highest = rate_of(entry.stepwise.min);
    rates.insert(highest);
    for (const double rate : kCustomaryRates) {
      if (rate > lowest && rate < highest) rates.insert(rate);
    }
    rates.insert(lowest);
    break;
  }
  rates.erase(0.0);
  return {rates.begin(), rates.end()};
}

// The largest value up to `wanted` that a range goes through.
__u32 on_step(int wanted, __u32 minimum, __u32 maximum, __u32 step) {
  const __u32 value = std::clamp(static_cast<__u32>(std::max(wanted, 0)), minimum, std::max(minimum, maximum));
  return value - (value - minimum) % std::max<__u32>(step, 1);
}

bool is_within(const ImageSize& size, const v4l2_frmsize_stepwise& range) {
  const auto width = static_cast<__u32>(std::max(size.width, 0)), height = static_cast<__u32>(std::max(size.height, 0));
  return width >= range.min_width && width <= range.max_width && height >= range.min_height &&
         height <= range.max_height;
}

std::vector<ImageSize> sizes_of(const V4l2Device& device, std::uint32_t code, ImageSize wanted) {
  std::vector<ImageSize> sizes;
  const auto add = [&sizes](__u32 width, __u32 height) {
    constexpr __u32 sane = 1 << 15;
    const ImageSize size{static_cast<int>(std::min(width, sane)), static_cast<int>(std::min(height, sane))};
    if (size.width > 0 && size.height > 0 && std::find(sizes.begin(), sizes.end(), size) == sizes.end()) {
      sizes.push_back(size);
    }
  };
  for (__u32 i = 0; i < kMaxEntries; ++i) {
    v4l2_frmsizeenum entry{};
    entry.index = i;
    entry.pixel_format = code;
    if (device.ioctl(VIDIOC_ENUM_FRAMESIZES, &entry) < 0) break;
    if (entry.type == V4L2_FRMSIZE_TYPE_DISCRETE) {
      add(entry.discrete.width, entry.discrete.height);
      continue;
    }
    const auto& range = entry.stepwise;
    add(range.min_width, range.min_height);
    const auto add_within = [&](const ImageSize& size) {
      if (!is_within(size, range)) return;
      add(on_step(size.width, range.min_width, range.max_width, range.step_width),
          on_step(size.height, range.min_height, range.max_height, range.step_height));
    };
    for (const auto& size : kCustomarySizes) add_within(size);
    add_within(wanted);
    add(range.max_width, range.max_height);
    break;
  }
  if (!sizes.empty()) return sizes;
  // A driver that lists no sizes: what it is set to.
  v4l2_format now{};
  now.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (device.ioctl(VIDIOC_G_FMT, &now) >= 0) add(now.fmt.pix.width, now.fmt.pix.height);
  return sizes;
}

// The rate of the list that comes nearest to the one wanted: not below it if possible.
double best_rate(const std::vector<double>& rates, double wanted) {
  double best = 0;
  for (const double rate : rates) {
    const bool enough = rate >= 0.95 * wanted, best_enough = best >= 0.95 * wanted;
    if (enough != best_enough ? enough : enough ? rate < best : rate > best) best = rate;
  }
  return best;
}

int cost_rank(PixelFormat format, bool colour) {
  if (format == PixelFormat::grey) return colour ? 100 : -1;
  return static_cast<int>(format);
}

// Tells the driver how fast; what it makes of it.
double set_rate(const V4l2Device& device, double rate) {
  v4l2_streamparm parameters{};
  parameters.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (rate > 0) {
    constexpr __u32 units = 10000;
    parameters.parm.capture.timeperframe = {units, static_cast<__u32>(std::lround(rate * units))};
    if (device.ioctl(VIDIOC_S_PARM, &parameters) < 0) return rate;
  } else if (device.ioctl(VIDIOC_G_PARM, &parameters) < 0) {
    return 0;
  }
  const double set = rate_of(parameters.parm.capture.timeperframe);
  return set > 0 ? set : rate;
}

// What became of the mode, or -errno.
int try_mode(const V4l2Device& device, V4l2Mode* mode) {
  v4l2_format wanted{};
  wanted.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  wanted.fmt.pix.width = static_cast<__u32>(mode->width);
  wanted.fmt.pix.height = static_cast<__u32>(mode->height);
  wanted.fmt.pix.pixelformat = mode->code;
  wanted.fmt.pix.field = V4L2_FIELD_NONE;
  if (const int error = device.ioctl(VIDIOC_S_FMT, &wanted); error < 0) return error;
  const auto& got = wanted.fmt.pix;
  const auto format = pixel_format_of(got.pixelformat);
  if (!format || got.width > kMaxImageWidth || got.height > kMaxImageHeight) return -EINVAL;
  mode->code = got.pixelformat;
  mode->format = *format;
  mode->width = static_cast<int>(got.width);
  mode->height = static_cast<int>(got.height);
  mode->stride = got.bytesperline;
  if (!image_size_problem({mode->width, mode->height}).empty()) return -EINVAL;
  mode->rate = set_rate(device, mode->rate);
  return 0;
}

}  // namespace

std::vector<CameraFormat> v4l2_formats(const V4l2Device& device, ImageSize wanted) {
  std::vector<CameraFormat> formats;
  for (__u32 i = 0; i < kMaxEntries; ++i) {
    v4l2_fmtdesc description{};
    description.index = i;
    description.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (device.ioctl(VIDIOC_ENUM_FMT, &description) < 0) break;
    for (const auto& size : sizes_of(device, description.pixelformat, wanted)) {
      CameraFormat format;
      format.pixel_format = fourcc_text(description.pixelformat);
      format.width = size.width;
      format.height = size.height;
      format.rates = rates_of(device, description.pixelformat, size);
      format.usable = pixel_format_of(description.pixelformat).has_value() && image_size_problem(size).empty();
      formats.push_back(std::move(format));
    }
  }
  return formats;
}

std::vector<V4l2Mode> rank_modes(const std::vector<CameraFormat>& formats, const LiveCameraOptions& options) {
  using Key = std::tuple<double, double, int>;
  std::vector<std::pair<Key, V4l2Mode>> ranked;
  for (const auto& offered : formats) {
    if (!offered.usable || offered.pixel_format.size() != 4) continue;
    if (!options.pixel_format.empty() && offered.pixel_format != options.pixel_format) continue;
    const auto& name = offered.pixel_format;
    V4l2Mode mode;
    mode.code = fourcc(name[0], name[1], name[2], name[3]);
    mode.format = *pixel_format_of(mode.code);
    mode.width = offered.width;
    mode.height = offered.height;
    mode.rate = best_rate(offered.rates, options.fps);
    const double off_size = std::abs(std::log(static_cast<double>(mode.width) / options.width)) +
                            std::abs(std::log(static_cast<double>(mode.height) / options.height));
    const double known_rate = offered.rates.empty() ? options.fps : mode.rate;
    const double off_rate = std::max(0.0, 0.95 * options.fps - known_rate);
    ranked.emplace_back(Key{off_size, off_rate, cost_rank(mode.format, options.colour)}, mode);
  }
  std::stable_sort(ranked.begin(), ranked.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<V4l2Mode> modes;
  for (const auto& [key, mode] : ranked) modes.push_back(mode);
  return modes;
}

V4l2Mode set_best_mode(const V4l2Device& device, const LiveCameraOptions& options) {
  const auto formats = v4l2_formats(device, {options.width, options.height});
  for (auto& mode : rank_modes(formats, options)) {
    const int error = try_mode(device, &mode);
    if (error >= 0) return mode;
    if (error != -EINVAL) device.fail(error, "setting the format");
  }
  throw InputError(device.source() + ": no usable format: " + device.card() + " offers " + format_summary(formats) +
                   ", expected " +
                   (options.pixel_format.empty() ? "one of " + known_pixel_formats() : options.pixel_format) +
                   " from " + to_string(ImageSize{kMinImageWidth, kMinImageHeight}) + " to " +
                   to_string(ImageSize{kMaxImageWidth, kMaxImageHeight}));
}

std::string format_summary(const std::vector<CameraFormat>& formats) {
  if (formats.empty()) return "nothing";
  std::string text, last;
  for (const auto& format : formats) {
    if (format.pixel_format != last) {
      text += (last.empty() ? "" : ", ") + format.pixel_format;
      last = format.pixel_format;
    }
    text += " " + to_string(ImageSize{format.width, format.height});
  }
  return text;
}

}  // namespace parallax
