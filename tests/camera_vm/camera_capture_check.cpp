// Captures through the program's own camera interface from a driver of a real kernel, and checks every picture against
// what the simulated devices are known to show. One check a run; says what it saw; exit code 0 when all was as it
// should.
//
//   camera_capture_check frames   SOURCE WIDTH HEIGHT FPS FORMAT PICTURE COUNT   COUNT pictures
//   camera_capture_check replug   SOURCE WIDTH HEIGHT FPS FORMAT PICTURE COUNT   the same, again after an unplugging
//   camera_capture_check profile  SOURCE WIDTH HEIGHT FPS       locks what it should and puts it back
//   camera_capture_check gone     SOURCE WIDTH HEIGHT FPS       vivid's own unplugging, then stop()
//   camera_capture_check busy     SOURCE WIDTH HEIGHT FPS       a second opening is refused
//   camera_capture_check refused  [SOURCE TEXT]...                 opening fails with a line that holds TEXT
//
// FORMAT: a fourcc. PICTURE: `test` (the test picture, to the last bit; through JPEG nearly so), `bars` (vivid's colour
// bars), `any` (nothing is known of it, and the size may be another than was asked for; the last one is kept as
// seen.pgm).
#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <mutex>
#include <opencv2/core.hpp>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "camera/live_camera.h"
#include "core/error.h"
#include "tests/camera_vm/test_picture.h"

namespace parallax::camera_vm {
namespace {

void require(bool condition, const std::string& what) {
  if (!condition) throw std::runtime_error(what);
}

// Mean difference of grey levels from the test picture, and the phase that fits best.
double difference(const GreyImage& grey, int phase, int every) {
  double sum = 0;
  int count = 0;
  for (int y = 0; y < grey.rows; y += every) {
    for (int x = 0; x < grey.cols; x += every, ++count) sum += std::abs(grey(y, x) - test_picture_level(x, y, phase));
  }
  return sum / count;
}

void check_test_picture(const GreyImage& grey, double tolerance) {
  int best = 0;
  double least = 1e9;
  constexpr int coarse = 16;  // every so many pixels
  for (int phase = 0; phase < kPhases; ++phase) {
    const double found = difference(grey, phase, coarse);
    if (found < least) {
      least = found;
      best = phase;
    }
  }
  const double found = difference(grey, best, 1);
  require(found <= tolerance, "differs from the test picture by " + std::to_string(found) + " grey levels");
}

// Eight bars from white to black, below the text: each is darker than the one before it, and nearly of one level.
void check_bars(const GreyImage& grey, bool colour_known, const cv::Mat3b& colour) {
  double last = 256;
  for (int bar = 0; bar < 8; ++bar) {
    const int centre = grey.cols * (2 * bar + 1) / 16;
    const cv::Rect place(centre - 3, grey.rows * 11 / 12, 7, 9);
    cv::Scalar mean, deviation;
    cv::meanStdDev(grey(place), mean, deviation);
    require(mean[0] < last - 5, "bar " + std::to_string(bar) + " is not darker than the one before: " +
                                    std::to_string(mean[0]) + " after " + std::to_string(last));
    require(deviation[0] < 8, "bar " + std::to_string(bar) + " is not of one level");
    last = mean[0];
    if (!colour_known) continue;
    // Yellow has no blue, cyan no red, green neither; red and blue are the sixth and the seventh.
    const cv::Scalar bgr = cv::mean(colour(place));
    const bool blue = bgr[0] > 100, green = bgr[1] > 100, red = bgr[2] > 100;
    const std::string seen = std::string(red ? "r" : "") + (green ? "g" : "") + (blue ? "b" : "");
    static const std::vector<std::string> expected{"rgb", "rg", "gb", "g", "rb", "r", "b", ""};
    require(seen == expected[static_cast<std::size_t>(bar)],
            "(bgr " + std::to_string(bgr[0]) + " " + std::to_string(bgr[1]) + " " + std::to_string(bgr[2]) + ", grey " +
                std::to_string(mean[0]) + ") bar " + std::to_string(bar) + " is '" + seen + "', expected '" +
                expected[static_cast<std::size_t>(bar)] + "'");
  }
}

struct Request {
  std::string source;
  LiveCameraOptions options;
  std::string picture;
  int count = 0;
};

class Reader {
 public:
  explicit Reader(const Request& request)
      : request_(request), camera_(open_live_camera(request.source, request.options)) {
    const bool as_asked = camera_->width() == request.options.width && camera_->height() == request.options.height;
    require(as_asked || request.picture == "any",
            "opened " + std::to_string(camera_->width()) + "x" + std::to_string(camera_->height()));
  }

  void read(int count) {
    for (int i = 0; i < count; ++i) {
      const auto frame = camera_->next();
      require(frame.has_value(), "no more frames");
      check(*frame);
    }
  }

  LiveCamera& camera() { return *camera_; }
  int frames() const { return frames_; }
  Timestamp time() const { return time_; }

  void summary() {
    const auto status = camera_->status();
    std::printf("%s: %d frames %dx%d, measured %.1f of %.1f frames a second, %llu skipped\n",
                camera_->description().c_str(), frames_, camera_->width(), camera_->height(), status.measured_fps,
                status.requested_fps, static_cast<unsigned long long>(status.skipped));
    require(frames_ < 2 || status.measured_fps > 0, "no frame rate was measured");
  }

 private:
  void check(const Frame& frame) {
    require(frame.index > index_, "frame numbers do not grow");
    require(frame.time > time_, "time stamps do not grow");
    const auto age = SteadyClock::now().time_since_epoch() - frame.time;
    // vivid stamps frames with the times they should have been ready at; an emulated machine is late at times.
    require(age > -std::chrono::seconds(1) && age < std::chrono::seconds(60),
            "the time stamp is not of this clock: " + std::to_string(to_seconds(age)) + " s old");
    require(frame.grey.cols == camera_->width() && frame.grey.rows == camera_->height(), "the size is another one");
    const bool has_colour = request_.options.pixel_format != "GREY" && request_.picture == "bars";
    require(request_.options.pixel_format == "GREY" ? frame.colour.empty() : frame.colour.size() == frame.grey.size(),
            "the colour image is not as expected");
    index_ = frame.index;
    time_ = frame.time;
    ++frames_;
    try {
      if (request_.picture == "any") {
        keep(frame.grey, "seen.pgm");
      } else if (request_.picture == "bars") {
        check_bars(frame.grey, has_colour, frame.colour);
      } else {
        check_test_picture(frame.grey, request_.options.pixel_format == "MJPG" ? 3.0 : 0.0);
      }
    } catch (const std::exception&) {
      keep(frame.grey, "failed.pgm");
      throw;
    }
  }

  // To look at.
  static void keep(const GreyImage& grey, const std::string& file) {
    std::ofstream out(file, std::ios::binary);
    out << "P5 " << grey.cols << " " << grey.rows << " 255\n";
    for (int y = 0; y < grey.rows; ++y) out.write(reinterpret_cast<const char*>(grey.ptr(y)), grey.cols);
  }

  Request request_;
  std::unique_ptr<LiveCamera> camera_;
  int index_ = -1, frames_ = 0;
  Timestamp time_{0};
};

const std::string kDisconnected = "camera disconnected: plug it in again";

// Looks at the status from another thread, as the window does, and keeps what it says while there are no pictures, in
// order and with the seconds since it began to look.
class StatusWatch {
 public:
  explicit StatusWatch(const LiveCamera& camera) : thread_([this, &camera] { watch(camera); }) {}
  ~StatusWatch() {
    {
      const std::lock_guard lock(mutex_);
      stopped_ = true;
    }
    condition_.notify_all();
    thread_.join();
  }
  StatusWatch(const StatusWatch&) = delete;
  StatusWatch& operator=(const StatusWatch&) = delete;

  bool saw(const std::string& text) {
    const std::lock_guard lock(mutex_);
    for (const auto& [time, seen] : texts_) {
      if (seen == text) return true;
    }
    return false;
  }
  void print() {
    const std::lock_guard lock(mutex_);
    for (const auto& [time, text] : texts_) std::printf("  %5.1f s: %s\n", time, text.c_str());
  }

 private:
  void watch(const LiveCamera& camera) {
    const auto begin = SteadyClock::now();
    std::unique_lock lock(mutex_);
    while (!stopped_) {
      const auto status = camera.status();
      const std::string text = status.state == CameraState::disconnected ? status.text
                               : status.state == CameraState::starting   ? "starting"
                                                                         : "streaming";
      if (texts_.empty() || texts_.back().second != text) {
        texts_.emplace_back(to_seconds(SteadyClock::now() - begin), text);
      }
      condition_.wait_for(lock, std::chrono::milliseconds(20));
    }
  }

  std::mutex mutex_;
  std::condition_variable condition_;
  bool stopped_ = false;
  std::vector<std::pair<double, std::string>> texts_;
  std::thread thread_;  // the last member: it starts when all else is there
};

// The camera is unplugged when it has sent some frames; how many of them are read before that depends on the load of
// the machine, so what is waited for is that it has been said.
void check_replug(const Request& request) {
  Reader reader(request);
  StatusWatch watch(reader.camera());
  constexpr int most = 300;
  while (!watch.saw(kDisconnected)) {
    reader.read(1);
    require(reader.frames() < most, "was never told of the unplugging");
  }
  reader.read(request.count);
  watch.print();
  reader.summary();
}

std::map<std::string, std::int64_t> values_of(LiveCamera& camera) {
  std::map<std::string, std::int64_t> values;
  for (const auto& control : camera.controls()) values[control.name] = control.value;
  return values;
}

void check_profile(Request request) {
  std::map<std::string, std::int64_t> before;
  request.picture = "test";
  request.options.tracking_profile = false;
  {
    Reader reader(request);
    reader.read(2);
    before = values_of(reader.camera());
  }
  require(before.count("sharpness") == 1 && before["sharpness"] > 0, "the camera has no sharpness to turn off");
  request.options.tracking_profile = true;
  {
    Reader reader(request);
    reader.read(1);
    const Timestamp start = reader.time();
    while (reader.time() - start < std::chrono::milliseconds(1600)) reader.read(1);
    const auto held = values_of(reader.camera());
    for (const auto& [name, value] : held)
      std::printf("  %s: %ld, held at %ld\n", name.c_str(), static_cast<long>(before[name]), static_cast<long>(value));
    require(held.at("sharpness") == 0, "sharpening was not turned off");
    require(held.at("auto_exposure") == 1, "exposure was not locked");
    require(held.at("exposure_time_absolute") == before["exposure_time_absolute"], "the exposure time was changed");
    require(held.at("white_balance_automatic") == 0, "white balance was not locked");
    require(held.at("focus_automatic_continuous") == 0, "focus was not locked");
    require(held.at("focus_absolute") == before["focus_absolute"], "the focus was changed");
    for (const auto& warning : reader.camera().take_warnings()) require(false, warning.text);
    reader.camera().stop();
    require(!reader.camera().next().has_value(), "frames came after stop()");
  }
  request.options.tracking_profile = false;
  Reader reader(request);
  require(values_of(reader.camera()) == before, "controls were not put back");
  reader.read(1);
}

void check_gone(Request request) {
  request.picture = "bars";
  Reader reader(request);
  reader.read(3);
  std::thread unplug([&] {
    reader.camera().set_control("disconnect", 1);
    StatusWatch watch(reader.camera());
    std::mutex mutex;
    std::condition_variable never;
    std::unique_lock lock(mutex);
    // Long enough to look for it twice; then the user gives up.
    never.wait_for(lock, std::chrono::milliseconds(2500));
    if (!watch.saw(kDisconnected)) std::printf("never said: %s\n", kDisconnected.c_str());
    reader.camera().stop();
  });
  bool ended = false;
  for (int i = 0; i < 1000 && !ended; ++i) ended = !reader.camera().next().has_value();
  unplug.join();
  require(ended, "frames went on");
}

void check_busy(const Request& request) {
  Reader reader(request);
  reader.read(1);
  try {
    open_live_camera(request.source, request.options);
  } catch (const InputError& error) {
    std::printf("%s\n", error.what());
    require(std::string(error.what()).find("busy: another program is using the camera") != std::string::npos,
            "not the line for a busy camera");
    return;
  }
  require(false, "was opened twice");
}

void check_refused(const std::string& source, const std::string& text) {
  try {
    open_live_camera(source);
  } catch (const InputError& error) {
    std::printf("%s\n", error.what());
    require(std::string(error.what()).find(text) != std::string::npos, "the line does not hold: " + text);
    return;
  }
  require(false, "was opened");
}

void run(const std::vector<std::string>& arguments) {
  const auto at = [&](std::size_t i) { return i < arguments.size() ? arguments[i] : std::string(); };
  const std::string check = at(0);
  if (check == "refused") {
    for (std::size_t i = 1; i + 1 < arguments.size(); i += 2) check_refused(at(i), at(i + 1));
    return;
  }
  Request request;
  request.source = at(1);
  request.options.width = std::atoi(at(2).c_str());
  request.options.height = std::atoi(at(3).c_str());
  request.options.fps = std::atof(at(4).c_str());
  request.options.pixel_format = at(5);
  request.options.tracking_profile = false;
  request.picture = at(6);
  request.count = std::atoi(at(7).c_str());
  if (check == "replug") return check_replug(request);
  if (check == "profile") return check_profile(request);
  if (check == "gone") return check_gone(request);
  require(check == "frames" || check == "busy", "no check of that name: " + check);
  if (check == "busy") {
    request.picture = "bars";
    return check_busy(request);
  }
  std::istringstream formats(request.options.pixel_format);
  for (std::string format; std::getline(formats, format, ',');) {
    std::printf("  %s: ", format.c_str());
    request.options.pixel_format = format;
    Reader reader(request);
    reader.read(request.count);
    reader.summary();
  }
}

}  // namespace
}  // namespace parallax::camera_vm

int main(int count, char** values) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  try {
    parallax::camera_vm::run(std::vector<std::string>(values + 1, values + count));
    return 0;
  } catch (const std::exception& error) {
    std::printf("FAILED: %s\n", error.what());
    return 1;
  }
}
