// A USB camera in user space, for tests: plugs itself into the kernel's simulated bus (vhci_hcd), so that the real
// uvcvideo driver serves it. Shows a film (a file of raw 8-bit grey frames, over and over) or the test picture.
//
//   uvc_camera WIDTH HEIGHT FPS [FILM|-] [UNPLUG_AFTER_FRAMES [PLUGGED_IN_AGAIN_AFTER_MS]]
//
// Without the last number it stays unplugged and ends. Film frames are shown one after another, from the first at every
// start of the stream; after the last one it stays. Of every film frame FILM.times gets a line "FRAME SECONDS", when it
// was shown by CLOCK_MONOTONIC; it begins anew with the stream.
#include <poll.h>
#include <turbojpeg.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include "tests/camera_vm/test_picture.h"
#include "tests/camera_vm/usbip_link.h"
#include "tests/camera_vm/uvc_device.h"

namespace parallax::camera_vm {
namespace {

using Clock = std::chrono::steady_clock;

class Camera {
 public:
  Camera(int width, int height, double fps, const std::string& film)
      : width_(width),
        height_(height),
        interval_(std::chrono::nanoseconds(static_cast<long>(1e9 / fps))),
        device_(width, height, fps) {
    if (film == "-") return;
    times_name_ = film + ".times";
    film_.open(film, std::ios::binary | std::ios::ate);
    film_frames_ = static_cast<long>(film_.tellg()) / (width * height);
    if (!film_ || film_frames_ < 1) {
      std::fprintf(stderr, "uvc_camera: %s holds no frame of %dx%d\n", film.c_str(), width, height);
      std::exit(2);
    }
  }
  ~Camera() { tjDestroy(compressor_); }
  Camera(const Camera&) = delete;
  Camera& operator=(const Camera&) = delete;

  UsbIpLink::Device usb() {
    return {[this](const SetupPacket& setup, const Bytes& out) { return device_.control(setup, out); },
            [this](std::size_t room) { return payload(room); }, [this] { return due_; }};
  }
  long frames() const { return frames_; }

 private:
  // The next piece of the frame under way with UVC's payload header before it; nothing before a frame is due.
  Bytes payload(std::size_t room) {
    if (device_.take_restart()) {
      stream_frames_ = 0;
      frame_.clear();
      sent_ = 0;
      due_ = Clock::now();
    }
    if (sent_ >= frame_.size()) {
      if (Clock::now() < due_) return {};
      due_ = std::max(due_ + interval_, Clock::now());
      draw();
    }
    constexpr std::size_t header = 2;
    const std::size_t piece = std::min(room - header, frame_.size() - sent_);
    const bool last = sent_ + piece == frame_.size();
    Bytes out{header, static_cast<std::uint8_t>(0x80 | (frames_ & 1) | (last ? 2 : 0))};
    out.insert(out.end(), frame_.begin() + static_cast<long>(sent_), frame_.begin() + static_cast<long>(sent_ + piece));
    sent_ += piece;
    return out;
  }

  void draw() {
    const auto pixels = static_cast<std::size_t>(width_ * height_);
    Bytes grey(pixels);
    if (film_frames_ > 0) {
      const long frame = std::min(stream_frames_, film_frames_ - 1);
      film_.seekg(frame * static_cast<long>(pixels));
      film_.read(reinterpret_cast<char*>(grey.data()), static_cast<std::streamsize>(pixels));
      note_time(frame);
    } else {
      const int phase = static_cast<int>(stream_frames_ % kPhases);
      for (int y = 0; y < height_; ++y) {
        for (int x = 0; x < width_; ++x) {
          grey[static_cast<std::size_t>(y * width_ + x)] = static_cast<std::uint8_t>(test_picture_level(x, y, phase));
        }
      }
    }
    if (device_.format() == UvcFormat::mjpeg) {
      // As webcams send it: with colour, which is grey here, at half the width.
      const Bytes chroma(pixels / 2, 128);
      const unsigned char* planes[] = {grey.data(), chroma.data(), chroma.data()};
      unsigned char* jpeg = nullptr;
      unsigned long size = 0;
      constexpr int quality = 92;
      if (tjCompressFromYUVPlanes(compressor_, planes, width_, nullptr, height_, TJSAMP_422, &jpeg, &size, quality,
                                  0) != 0) {
        std::fprintf(stderr, "uvc_camera: %s\n", tjGetErrorStr2(compressor_));
        std::exit(2);
      }
      frame_.assign(jpeg, jpeg + size);
      tjFree(jpeg);
    } else {
      frame_.assign(2 * pixels, 128);
      for (std::size_t i = 0; i < pixels; ++i) frame_[2 * i] = grey[i];
    }
    sent_ = 0;
    ++frames_;
    ++stream_frames_;
  }

  void note_time(long frame) {
    if (stream_frames_ == 0) times_ = std::ofstream(times_name_);
    if (stream_frames_ >= film_frames_) return;
    char line[64];
    std::snprintf(line, sizeof line, "%ld %.6f\n", frame,
                  std::chrono::duration<double>(Clock::now().time_since_epoch()).count());
    times_ << line << std::flush;
  }

  int width_, height_;
  std::chrono::nanoseconds interval_;
  UvcDevice device_;
  std::ifstream film_;
  std::ofstream times_;
  std::string times_name_;
  long film_frames_ = 0;
  tjhandle compressor_ = tjInitCompress();
  Bytes frame_;
  std::size_t sent_ = 0;
  long frames_ = 0, stream_frames_ = 0;
  Clock::time_point due_ = Clock::now();
};

int run(const std::vector<std::string>& arguments) {
  if (arguments.size() < 3) {
    std::fprintf(stderr, "usage: uvc_camera WIDTH HEIGHT FPS [FILM|-] [UNPLUG_AFTER_FRAMES [AGAIN_AFTER_MS]]\n");
    return 2;
  }
  const auto number = [&](std::size_t at) { return arguments.size() > at ? std::atoi(arguments[at].c_str()) : -1; };
  Camera camera(number(0), number(1), std::atof(arguments[2].c_str()), arguments.size() > 3 ? arguments[3] : "-");
  const int unplug_after = number(4), again_after_ms = number(5);
  UsbIpLink link(camera.usb());
  link.plug_in();
  bool may_unplug = unplug_after >= 0;
  while (link.serve([&] { return may_unplug && camera.frames() >= unplug_after; })) {
    link.pull_out();
    std::printf("uvc_camera: unplugged after %ld frames\n", camera.frames());
    if (again_after_ms < 0) return 0;
    may_unplug = false;
    ::poll(nullptr, 0, again_after_ms);
    link.plug_in();
    std::printf("uvc_camera: plugged in again\n");
  }
  return 0;
}

}  // namespace
}  // namespace parallax::camera_vm

int main(int count, char** values) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  return parallax::camera_vm::run(std::vector<std::string>(values + 1, values + count));
}
