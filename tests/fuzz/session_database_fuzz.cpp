// libFuzzer target: session databases, and what is inside their blobs. The first byte picks: the checksums of a whole
// file keep damage from getting far.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>

#include "core/error.h"
#include "sessions/session_database.h"
#include "sessions/session_schema.h"

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

void check_file(std::span<const std::byte> bytes) {
  const parallax::SessionDocument document = parallax::read_session_bytes(bytes, "file");
  const auto is_there = [&](const parallax::PoseKey& key) {
    return std::any_of(document.poses.begin(), document.poses.end(), [&](const auto& pose) { return pose.key == key; });
  };
  for (const auto& [session, c] : document.constraints)
    require(is_there({session, c.from}) && is_there({session, c.to}) && c.covariance.allFinite());
  for (const parallax::Encounter& e : document.encounters) require(is_there(e.found) && is_there(e.query));
}

// What unpacks packs again to the same bytes.
template <class T>
void check_blob(std::span<const std::byte> bytes) {
  T value;
  if (!parallax::session_file::unpack(bytes, &value)) return;
  const std::vector<std::byte> again = parallax::session_file::pack(value);
  require(std::equal(again.begin(), again.end(), bytes.begin(), bytes.end()));
}

void check_scores(std::span<const std::byte> bytes) {
  parallax::Encounter encounter;
  if (!parallax::session_file::unpack_scores(bytes, &encounter)) return;
  const std::vector<std::byte> again = parallax::session_file::pack_scores(encounter);
  require(std::equal(again.begin(), again.end(), bytes.begin(), bytes.end()));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const auto bytes = std::as_bytes(std::span(data + 1, size - 1));
  try {
    switch (data[0] % 8) {
      case 0:
        check_file(bytes);
        break;
      case 1:
        check_blob<parallax::SessionFeatures>(bytes);
        break;
      case 2:
        check_blob<std::vector<parallax::SessionPoint>>(bytes);
        break;
      case 3:
        check_blob<parallax::SimilarityTransform>(bytes);
        break;
      case 4:
        check_blob<parallax::RigidTransform>(bytes);
        break;
      case 5:
        check_blob<parallax::StereoCamera>(bytes);
        break;
      case 6:
        check_blob<parallax::Matrix6d>(bytes);
        break;
      default:
        check_scores(bytes);
        break;
    }
  } catch (const parallax::InputError& e) {
    require(std::string(e.what()).find('\n') == std::string::npos);
  }
  return 0;
}
