// libFuzzer target: map files, and what is inside their blobs. The first byte picks: the checksums of a whole file keep
// damage from getting far.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>

#include "core/error.h"
#include "map/map_file.h"
#include "map/map_file_schema.h"

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

void check_file(std::span<const std::byte> bytes) {
  const parallax::MapDocument document = parallax::read_map_bytes(bytes, "file");
  require(!document.map.empty() && !document.calibration.empty());
}

// What unpacks packs again to the same bytes.
template <class T>
void check_blob(std::span<const std::byte> bytes) {
  T value;
  if (!parallax::map_file::unpack(bytes, &value)) return;
  const std::vector<std::byte> again = parallax::map_file::pack(value);
  require(std::equal(again.begin(), again.end(), bytes.begin(), bytes.end()));
}

void check_corners(std::span<const std::byte> bytes) {
  parallax::ImagePyramid pyramid;
  parallax::build_pyramid(parallax::GreyImage(40, 48, std::uint8_t{7}), &pyramid);
  std::array<parallax::CornerList, parallax::kPyramidLevels> corners;
  if (!parallax::map_file::unpack(bytes, pyramid, &corners)) return;
  for (std::size_t level = 0; level < corners.size(); ++level) {
    require(corners[level].rows.size() == static_cast<std::size_t>(pyramid.level[level].rows) + 1);
    require(corners[level].rows.back() == static_cast<int>(corners[level].corners.size()));
  }
  const std::vector<std::byte> again = parallax::map_file::pack(corners);
  require(std::equal(again.begin(), again.end(), bytes.begin(), bytes.end()));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const auto bytes = std::as_bytes(std::span(data + 1, size - 1));
  try {
    switch (data[0] % 6) {
      case 0:
        check_file(bytes);
        break;
      case 1:
        check_corners(bytes);
        break;
      case 2:
        check_blob<std::vector<parallax::Measurement>>(bytes);
        break;
      case 3:
        check_blob<parallax::SimilarityTransform>(bytes);
        break;
      case 4:
        check_blob<parallax::RigidTransform>(bytes);
        break;
      default:
        check_blob<std::vector<parallax::KeyframeId>>(bytes);
        break;
    }
  } catch (const parallax::InputError& e) {
    require(std::string(e.what()).find('\n') == std::string::npos);
  }
  return 0;
}
