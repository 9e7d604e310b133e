// libFuzzer target: the text files of data sets and the headers of image files. The first byte picks the parser.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "camera/dataset_text.h"
#include "core/error.h"

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

void check_list(const parallax::ImageList& list) {
  require(!list.images.empty());
  for (std::size_t i = 0; i < list.images.size(); ++i) {
    require(list.images[i].index >= 0 && list.images[i].index < list.positions);
    require(i == 0 ||
            (list.images[i - 1].time < list.images[i].time && list.images[i - 1].index < list.images[i].index));
    (void)parallax::stays_inside("/data/set", list.images[i].name);
  }
  for (const auto& warning : list.warnings) require(warning.find('\n') == std::string::npos);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    switch (data[0] % 7) {
      case 0:
        check_list(parallax::parse_tum_image_list(text, "rgb.txt"));
        break;
      case 1:
        check_list(parallax::parse_euroc_image_list(text, "data.csv"));
        break;
      case 2:
        check_list(parallax::parse_kitti_times(text, "times.txt"));
        break;
      case 3: {
        const auto P = parallax::parse_kitti_projection(text, "calib.txt", 0);
        (void)parallax::kitti_camera0_from_camera(P);
        (void)parallax::kitti_camera(P, {640, 480}, "calib.txt");
        break;
      }
      case 4:
        (void)parallax::parse_euroc_sensor(text, "sensor.yaml");
        break;
      case 5:
        (void)parallax::image_kind(text);
        (void)parallax::image_damage(text);
        (void)parallax::image_size_from_header(text);
        break;
      case 6: {
        const std::size_t half = text.size() / 2;
        const std::string a = text.substr(0, half), b = text.substr(half);
        require(!(parallax::natural_less(a, b) && parallax::natural_less(b, a)));
        require(!parallax::natural_less(a, a));
        require(a == b || parallax::natural_less(a, b) || parallax::natural_less(b, a));
        break;
      }
      default:
        break;
    }
  } catch (const parallax::InputError& error) {
    require(std::string(error.what()).find('\n') == std::string::npos);
  }
  return 0;
}
