#include "camera/v4l2_controls.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <cctype>
#include <cstring>

namespace parallax {
namespace {

constexpr int kMaxControls = 1000;  // a driver that lists more is stuck
constexpr int kMaxMenuEntries = 256;

bool is_plain(const v4l2_queryctrl& query) {
  switch (query.type) {
    case V4L2_CTRL_TYPE_INTEGER:
    case V4L2_CTRL_TYPE_BOOLEAN:
    case V4L2_CTRL_TYPE_MENU:
    case V4L2_CTRL_TYPE_INTEGER_MENU:
    case V4L2_CTRL_TYPE_BUTTON:
      return (query.flags & V4L2_CTRL_FLAG_DISABLED) == 0;
    default:
      return false;
  }
}

std::string text_of(const __u8* field, std::size_t size) {
  const auto* text = reinterpret_cast<const char*>(field);
  return {text, strnlen(text, size)};
}

std::vector<std::pair<std::int64_t, std::string>> menu_of(const V4l2Device& device, const v4l2_queryctrl& query) {
  std::vector<std::pair<std::int64_t, std::string>> menu;
  const bool numbers = query.type == V4L2_CTRL_TYPE_INTEGER_MENU;
  if (!numbers && query.type != V4L2_CTRL_TYPE_MENU) return menu;
  for (int i = query.minimum; i <= query.maximum && i - query.minimum < kMaxMenuEntries; ++i) {
    v4l2_querymenu entry{};
    entry.id = query.id;
    entry.index = static_cast<__u32>(i);
    if (device.ioctl(VIDIOC_QUERYMENU, &entry) < 0) continue;  // menus may have gaps
    menu.emplace_back(i, numbers ? std::to_string(entry.value) : text_of(entry.name, sizeof entry.name));
  }
  return menu;
}

std::optional<std::int64_t> read_value(const V4l2Device& device, std::uint32_t id) {
  v4l2_control control{};
  control.id = id;
  if (device.ioctl(VIDIOC_G_CTRL, &control) < 0) return std::nullopt;
  return control.value;
}

CameraControl describe(const V4l2Device& device, const v4l2_queryctrl& query) {
  CameraControl control;
  control.name = control_name(text_of(query.name, sizeof query.name));
  control.minimum = query.minimum;
  control.maximum = query.maximum;
  control.step = std::max(query.step, 1);
  control.default_value = query.default_value;
  control.read_only = (query.flags & (V4L2_CTRL_FLAG_READ_ONLY | V4L2_CTRL_FLAG_GRABBED)) != 0;
  control.inactive = (query.flags & V4L2_CTRL_FLAG_INACTIVE) != 0;
  control.menu = menu_of(device, query);
  if (query.type == V4L2_CTRL_TYPE_BUTTON) {
    control.maximum = 1;  // pressed by any value
  } else {
    control.value = read_value(device, query.id).value_or(query.default_value);
  }
  return control;
}

// Walks over all plain controls until the function says it has seen enough.
template <class Function>
void for_each_control(const V4l2Device& device, Function function) {
  v4l2_queryctrl query{};
  for (int i = 0; i < kMaxControls; ++i) {
    const __u32 last = query.id;
    query = {};
    query.id = last | V4L2_CTRL_FLAG_NEXT_CTRL;
    if (device.ioctl(VIDIOC_QUERYCTRL, &query) < 0 || query.id <= last) return;
    if (is_plain(query) && function(query)) return;
  }
}

}  // namespace

std::string control_name(const std::string& text) {
  std::string name;
  bool gap = false;
  for (const char c : text) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) {
      gap = !name.empty();
      continue;
    }
    if (gap) name += '_';
    gap = false;
    name += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return name;
}

const CameraControl& require_control(const std::string& source, const std::vector<CameraControl>& controls,
                                     const std::string& name, std::int64_t value) {
  const auto found = std::find_if(controls.begin(), controls.end(), [&](const auto& c) { return c.name == name; });
  if (found == controls.end()) {
    std::string names;
    for (const auto& control : controls) names += (names.empty() ? "" : ", ") + control.name;
    throw InputError(source + ": has no control '" + name + "', expected " +
                     (names.empty() ? "none: it has no controls" : "one of " + names));
  }
  if (found->read_only) throw InputError(source + ": control " + name + " cannot be set");
  const auto refuse = [&](const std::string& expected) {
    throw InputError(source + ": control " + name + ": found " + std::to_string(value) + ", expected " + expected);
  };
  if (!found->menu.empty()) {
    std::string entries;
    for (const auto& [number, text] : found->menu) {
      if (number == value) return *found;
      entries += (entries.empty() ? "" : ", ") + std::to_string(number) + " (" + text + ")";
    }
    refuse(entries);
  }
  if (value < found->minimum || value > found->maximum) {
    refuse(std::to_string(found->minimum) + " to " + std::to_string(found->maximum));
  }
  return *found;
}

std::vector<CameraControl> V4l2Controls::list() const {
  std::vector<CameraControl> controls;
  for_each_control(*device_, [&](const v4l2_queryctrl& query) {
    controls.push_back(describe(*device_, query));
    return false;
  });
  return controls;
}

std::optional<CameraControl> V4l2Controls::find(std::uint32_t id) const {
  v4l2_queryctrl query{};
  query.id = id;
  if (device_->ioctl(VIDIOC_QUERYCTRL, &query) < 0 || !is_plain(query)) return std::nullopt;
  return describe(*device_, query);
}

std::optional<std::int64_t> V4l2Controls::value(std::uint32_t id) const { return read_value(*device_, id); }

int V4l2Controls::write(std::uint32_t id, std::int64_t value) const {
  v4l2_control control{};
  control.id = id;
  control.value = static_cast<__s32>(value);
  return device_->ioctl(VIDIOC_S_CTRL, &control);
}

bool V4l2Controls::set(std::uint32_t id, std::int64_t value) {
  const MutexLock lock(mutex_);
  return set_locked(id, value);
}

bool V4l2Controls::set_locked(std::uint32_t id, std::int64_t value) {
  if (restored_) return false;
  const auto before = read_value(*device_, id);
  if (write(id, value) < 0) return false;
  const bool known = std::any_of(changed_.begin(), changed_.end(), [id](const auto& c) { return c.id == id; });
  if (before && !known) changed_.push_back({id, *before});
  return true;
}

void V4l2Controls::set_by_name(const std::string& name, std::int64_t value) {
  std::uint32_t id = 0;
  std::vector<CameraControl> controls;
  for_each_control(*device_, [&](const v4l2_queryctrl& query) {
    controls.push_back(describe(*device_, query));
    if (controls.back().name == name) id = query.id;
    return id != 0;
  });
  const bool inactive = require_control(device_->source(), controls, name, value).inactive;
  const MutexLock lock(mutex_);
  if (restored_) throw InputError(device_->source() + ": control " + name + " cannot be set: the camera was stopped");
  if (!set_locked(id, value)) {
    throw InputError(device_->source() + ": control " + name + ": the driver refuses " + std::to_string(value) +
                     (inactive ? ": switch the automatic off that governs it" : ""));
  }
}

void V4l2Controls::restore() {
  const MutexLock lock(mutex_);
  restored_ = true;
  for (auto changed = changed_.rbegin(); changed != changed_.rend(); ++changed) write(changed->id, changed->before);
  changed_.clear();
}

}  // namespace parallax
