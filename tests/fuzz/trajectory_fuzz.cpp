// libFuzzer target: trajectory files, and the extrinsics of a EuRoC sensor.yaml.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "core/error.h"
#include "core/trajectory.h"

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    const parallax::Trajectory read = parallax::parse_trajectory(text, "trajectory.txt");
    require(!read.empty());
    for (std::size_t i = 0; i < read.size(); ++i) {
      const auto& T = read[i].world_from_camera;
      require(i == 0 || read[i - 1].time < read[i].time);
      require(T.t.allFinite() && T.R.allFinite());
      require((T.R.transpose() * T.R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-4);
    }
  } catch (const parallax::InputError& error) {
    require(std::string(error.what()).find('\n') == std::string::npos);
  }
  try {
    (void)parallax::parse_euroc_body_from_sensor(text, "sensor.yaml");
  } catch (const parallax::InputError& error) {
    require(std::string(error.what()).find('\n') == std::string::npos);
  }
  return 0;
}
