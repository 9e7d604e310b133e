// A back end of cameras that follow a script, with a clock of its own: time passes only while somebody waits for it.
#pragma once

#include <algorithm>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "camera/camera_connection.h"
#include "core/error.h"

namespace parallax::testing {

// A camera on the bus: what it answers when it is opened, and what it sends.
struct ScriptedCamera {
  std::string identity = "fake, camera, bus 1";
  int width = 320, height = 240;
  std::deque<std::string> refusals;  // one for each opening, the first of them first; then it can be opened
  std::string always_refuses;        // when there are no others
  Timestamp interval = std::chrono::milliseconds(100);
  bool silent = false;
  std::function<bool(int number)> damaged = [](int) { return false; };  // the bytes are no picture
  std::function<bool(int number)> driver_says_damaged = [](int) { return false; };
  std::function<int(int number)> lost_before = [](int) { return 0; };
  std::function<Timestamp(Timestamp time, int number)> stamp = [](Timestamp time, int) { return time; };
  std::map<std::string, std::int64_t> controls{{"brightness", 5}};
  std::string slow_because;

  int sent = 0;      // frames, over all connections
  int open = 0;      // connections at present
  int openings = 0;  // that were tried
  bool plugged = true;
  bool lent = false;  // a picture has not been given back
};

struct FakeBus {
  std::map<std::string, std::shared_ptr<ScriptedCamera>> cameras;  // by name
  Timestamp now = std::chrono::hours(1);
  bool woken = false;
  int looks = 0;
  std::function<void()> on_wait;  // at every step of time

  std::shared_ptr<ScriptedCamera> plug(const std::string& name, ScriptedCamera camera = {}) {
    return cameras[name] = std::make_shared<ScriptedCamera>(std::move(camera));
  }
  void pull(const std::string& name) {
    cameras.at(name)->plugged = false;
    cameras.erase(name);
  }
  void pass(Timestamp time) {
    now += time;
    if (on_wait) on_wait();
  }
};

class FakeConnection final : public CameraConnection {
 public:
  FakeConnection(std::shared_ptr<FakeBus> bus, std::shared_ptr<ScriptedCamera> camera, const std::string& name)
      : bus_(std::move(bus)), camera_(std::move(camera)), due_(bus_->now + camera_->interval) {
    ++camera_->open;
    facts_.source = facts_.description = "fake:" + name;
    facts_.identity = camera_->identity;
    facts_.width = camera_->width;
    facts_.height = camera_->height;
    facts_.fps = 10;
  }
  ~FakeConnection() override { --camera_->open; }

  const Facts& facts() const override { return facts_; }
  CameraArrival next(std::chrono::milliseconds wait) override {
    CameraArrival arrival;
    if (!camera_->plugged) {
      arrival.kind = CameraArrival::Kind::gone;
      return arrival;
    }
    const Timestamp end = bus_->now + wait;
    if (camera_->silent || due_ > end) {
      bus_->pass(end - bus_->now);
      return arrival;
    }
    const Timestamp came = std::max(due_, bus_->now);
    bus_->pass(came - bus_->now);
    due_ = came + camera_->interval;
    const int number = camera_->sent++;
    arrival.skipped = camera_->lost_before(number);
    if (camera_->driver_says_damaged(number)) {
      arrival.damaged = 1;
      return arrival;
    }
    bytes_.assign(static_cast<std::size_t>(camera_->width * camera_->height), static_cast<std::uint8_t>(number));
    if (camera_->damaged(number)) bytes_.resize(100);
    arrival.kind = CameraArrival::Kind::picture;
    arrival.time = camera_->stamp(came, number);
    arrival.picture.format = PixelFormat::grey;
    arrival.picture.width = camera_->width;
    arrival.picture.height = camera_->height;
    arrival.picture.bytes = bytes_;
    camera_->lent = true;
    return arrival;
  }
  void give_back() override { camera_->lent = false; }
  std::optional<std::string> settle(const Frame&) override { return std::nullopt; }
  std::string slow_reason(double) const override { return camera_->slow_because; }
  std::vector<CameraControl> controls() const override {
    std::vector<CameraControl> out;
    for (const auto& [name, value] : camera_->controls) {
      out.emplace_back();
      out.back().name = name;
      out.back().value = value;
    }
    return out;
  }
  void set_control(const std::string& name, std::int64_t value) override {
    if (camera_->controls.count(name) == 0) throw InputError("no control " + name);
    camera_->controls[name] = value;
  }
  void restore() override {}

 private:
  const std::shared_ptr<FakeBus> bus_;
  const std::shared_ptr<ScriptedCamera> camera_;
  Facts facts_;
  Timestamp due_;
  std::vector<std::uint8_t> bytes_;
};

class FakeBackend final : public CameraBackend {
 public:
  explicit FakeBackend(std::shared_ptr<FakeBus> bus) : bus_(std::move(bus)) {}

  std::vector<std::string> candidates(const std::string& identity) override {
    ++bus_->looks;
    std::vector<std::string> names;
    for (const auto& [name, camera] : bus_->cameras) {
      names.insert(camera->identity == identity ? names.begin() : names.end(), name);
    }
    return names;
  }
  std::unique_ptr<CameraConnection> open(const std::string& name, const LiveCameraOptions&) override {
    const auto camera = bus_->cameras.at(name);
    ++camera->openings;
    std::string refusal = camera->always_refuses;
    if (!camera->refusals.empty()) {
      refusal = camera->refusals.front();
      camera->refusals.pop_front();
    }
    if (!refusal.empty()) throw InputError("fake:" + name + ": " + refusal);
    return std::make_unique<FakeConnection>(bus_, camera, name);
  }
  std::string none_found() const override { return "fake: no camera found"; }
  void wait(std::chrono::milliseconds time) override {
    if (!bus_->woken) bus_->pass(time);
  }
  void wake() override { bus_->woken = true; }
  Timestamp now() const override { return bus_->now; }

 private:
  const std::shared_ptr<FakeBus> bus_;
};

}  // namespace parallax::testing
