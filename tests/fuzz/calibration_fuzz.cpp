// libFuzzer target: no text whatever makes parse_calibration and parse_stereo_calibration do anything but return a
// camera or a rig, or throw InputError. Corpus: tests/fuzz/corpus/calibration.
#include <Eigen/LU>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "camera/calibration_file.h"
#include "core/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  for (const int camera_index : {0, 1}) {
    try {
      const parallax::CameraModel camera = parallax::parse_calibration(text, "fuzz", camera_index, 640, 480);
      // What was accepted is a camera: it sees its own centre of the image or says that it does not, and it can be
      // written and read back unchanged.
      Eigen::Vector3d ray;
      Eigen::Vector2d pixel(camera.width() / 2.0, camera.height() / 2.0), back;
      if (camera.unproject(pixel, &ray)) (void)camera.project(ray, &back);
      const std::string written = parallax::format_calibration(camera);
      if (!(parallax::parse_calibration(written, "fuzz") == camera)) std::abort();
    } catch (const parallax::InputError& error) {
      if (std::string(error.what()).find('\n') != std::string::npos) std::abort();  // one line
    }
  }
  try {
    const parallax::StereoCalibration rig = parallax::parse_stereo_calibration(text, "fuzz", 640, 480);
    if (!rig.right_from_left.t.allFinite() || !(rig.right_from_left.R.determinant() > 0.99)) std::abort();
  } catch (const parallax::InputError& error) {
    if (std::string(error.what()).find('\n') != std::string::npos) std::abort();
  }
  return 0;
}
