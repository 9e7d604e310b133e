#include "camera/libcamera_camera.h"

#ifndef PARALLAX_HAVE_LIBCAMERA

#include "core/error.h"

namespace parallax {

std::unique_ptr<LiveCamera> open_libcamera_camera(const std::string& name, const LiveCameraOptions&) {
  throw InputError("libcamera:" + name +
                   ": this program was built without libcamera; install libcamera-dev and build again");
}

std::vector<CameraInfo> list_libcamera_cameras() { return {}; }

}  // namespace parallax

#else

#include "camera/libcamera_connection.h"
#include "camera/reconnecting_camera.h"
#include "core/error.h"
#include "core/log.h"

namespace parallax {
namespace {

class LibcameraBackend final : public CameraBackend {
 public:
  explicit LibcameraBackend(std::string name)
      : name_(std::move(name)), signal_(std::make_shared<LibcameraSignal>()), manager_(libcamera_manager()) {}

  std::vector<std::string> candidates(const std::string& identity) override;
  std::unique_ptr<CameraConnection> open(const std::string& name, const LiveCameraOptions& options) override {
    auto camera = manager_ ? manager_->get(name) : nullptr;
    if (!camera) throw InputError("libcamera:" + name + ": no such camera: is it plugged in?");
    return std::make_unique<LibcameraConnection>(manager_, std::move(camera), options, signal_);
  }
  std::string none_found() const override {
    return name_.empty()
               ? "libcamera: no camera found: plug one in, or use synthetic:desk"
               : "libcamera:" + name_ + ": no such camera: is it plugged in? `parallax cameras` lists what is there";
  }

  void wait(std::chrono::milliseconds time) override {
    const MutexLock lock(signal_->mutex);
    signal_->condition.wait_for(signal_->mutex, time,
                                [this]() PARALLAX_REQUIRES(signal_->mutex) { return signal_->stopped; });
  }
  void wake() override {
    {
      const MutexLock lock(signal_->mutex);
      signal_->stopped = true;
    }
    signal_->condition.notify_all();
  }
  Timestamp now() const override { return SteadyClock::now().time_since_epoch(); }

 private:
  void start_anew();

  const std::string name_;  // or a part of it; empty: any
  const std::shared_ptr<LibcameraSignal> signal_;
  std::shared_ptr<libcamera::CameraManager> manager_;
};

// A manager that has seen a camera go is not to be trusted with its return. libcamera (0.0.3) keeps, by the number of
// the device, what it waited for when the camera came for the first time, and gives the next device of that number to
// what is no longer there: it depends on the order in which the parts of the camera are announced whether it is seen
// again. What is announced while a manager starts is missed by that one, too. So there is a new one for every look.
void LibcameraBackend::start_anew() {
  manager_ = nullptr;  // there is one at a time; another thread that still holds it keeps it
  try {
    manager_ = libcamera_manager();
  } catch (const InputError& error) {
    log::debug(error.what());
  }
}

std::vector<std::string> LibcameraBackend::candidates(const std::string& identity) {
  if (!identity.empty()) start_anew();
  std::vector<std::string> same, named, others;
  if (!manager_) return {};
  for (const auto& camera : manager_->cameras()) {
    const std::string id = camera->id();
    if (libcamera_identity(*camera) == identity) {
      same.push_back(id);
    } else if (id == name_) {
      named.push_back(id);
    } else if (id.find(name_) != std::string::npos || libcamera_product(*camera).find(name_) != std::string::npos) {
      others.push_back(id);
    }
  }
  same.insert(same.end(), named.begin(), named.end());
  same.insert(same.end(), others.begin(), others.end());
  return same;
}

}  // namespace

std::unique_ptr<LiveCamera> open_libcamera_camera(const std::string& name, const LiveCameraOptions& options) {
  return std::make_unique<ReconnectingCamera>(std::make_unique<LibcameraBackend>(name), options);
}

std::vector<CameraInfo> list_libcamera_cameras() {
  std::vector<CameraInfo> cameras;
  try {
    const auto manager = libcamera_manager();
    for (const auto& camera : manager->cameras()) {
      CameraInfo info;
      info.source = "libcamera:" + camera->id();
      info.name = libcamera_product(*camera);
      info.bus = camera->id();
      if (const auto configuration = camera->generateConfiguration({libcamera::StreamRole::Viewfinder});
          configuration && !configuration->empty()) {
        info.formats = libcamera_formats(configuration->at(0));
      }
      for (const auto& control : libcamera_controls(*camera)) info.controls.push_back(control.control);
      cameras.push_back(std::move(info));
    }
  } catch (const InputError& error) {
    log::debug(error.what());
  }
  return cameras;
}

}  // namespace parallax

#endif  // PARALLAX_HAVE_LIBCAMERA
