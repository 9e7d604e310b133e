#include "map/map_file_schema.h"

#include <algorithm>
#include <cmath>

namespace parallax::map_file {
namespace {

// Version 1.
constexpr const char* kVersion1 = R"(
CREATE TABLE meta(key TEXT PRIMARY KEY NOT NULL, value TEXT NOT NULL, checksum INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE keyframe(id INTEGER PRIMARY KEY, frame INTEGER NOT NULL, time_ns INTEGER NOT NULL,
  camera_from_world BLOB NOT NULL, mean_depth REAL NOT NULL, depth_sigma REAL NOT NULL, fixed INTEGER NOT NULL,
  measurements BLOB NOT NULL, checksum INTEGER NOT NULL);
CREATE TABLE image(keyframe INTEGER PRIMARY KEY, width INTEGER NOT NULL, height INTEGER NOT NULL, grey BLOB NOT NULL,
  corners BLOB NOT NULL, checksum INTEGER NOT NULL);
CREATE TABLE point(id INTEGER PRIMARY KEY, x REAL NOT NULL, y REAL NOT NULL, z REAL NOT NULL,
  normal_x REAL NOT NULL, normal_y REAL NOT NULL, normal_z REAL NOT NULL, normal_estimated INTEGER NOT NULL,
  source INTEGER NOT NULL, source_level INTEGER NOT NULL, source_x REAL NOT NULL, source_y REAL NOT NULL,
  source_rays BLOB NOT NULL, searched INTEGER NOT NULL, found INTEGER NOT NULL, outliers INTEGER NOT NULL,
  failed BLOB NOT NULL, refined INTEGER NOT NULL, checksum INTEGER NOT NULL);
CREATE TABLE plane(id INTEGER PRIMARY KEY, world_from_plane BLOB NOT NULL, extent REAL NOT NULL,
  dominant INTEGER NOT NULL, checksum INTEGER NOT NULL);
CREATE TABLE content(id INTEGER PRIMARY KEY, kind TEXT NOT NULL, text TEXT NOT NULL, world_from_item BLOB NOT NULL,
  size REAL NOT NULL, end BLOB NOT NULL, checksum INTEGER NOT NULL);
CREATE TABLE game(name TEXT PRIMARY KEY NOT NULL, state TEXT NOT NULL, checksum INTEGER NOT NULL) WITHOUT ROWID;
)";
constexpr const char* kMigrations[] = {kVersion1};

constexpr std::size_t kMeasurementBytes = 32;

}  // namespace

std::span<const char* const> migrations() { return kMigrations; }

std::vector<std::byte> pack(const Eigen::Matrix3d& matrix) {
  std::vector<std::byte> out;
  append_rows(matrix, &out);
  return out;
}

std::vector<std::byte> pack(const Eigen::Vector3d& vector) {
  std::vector<std::byte> out;
  append_rows(vector, &out);
  return out;
}

std::vector<std::byte> pack(const std::vector<Measurement>& measurements) {
  std::vector<std::byte> out;
  out.reserve(kMeasurementBytes * measurements.size());
  for (const Measurement& m : measurements) {
    append(m.point.index, &out);
    append(m.sigma_px, &out);
    append(m.pixel.x(), &out);
    append(m.pixel.y(), &out);
    append<std::int32_t>(m.level, &out);
    append(static_cast<std::int32_t>(m.source), &out);
  }
  return out;
}

std::vector<std::byte> pack(const std::vector<KeyframeId>& ids) {
  std::vector<std::byte> out;
  for (const KeyframeId id : ids) append(id.index, &out);
  return out;
}

std::vector<std::byte> pack(const std::array<CornerList, kPyramidLevels>& corners) {
  std::vector<std::byte> out;
  for (const CornerList& level : corners) {
    append(static_cast<std::uint32_t>(level.corners.size()), &out);
    for (const Corner& corner : level.corners) {
      append(corner.x, &out);
      append(corner.y, &out);
    }
  }
  return out;
}

bool unpack(std::span<const std::byte> bytes, RigidTransform* transform) {
  ByteReader reader(bytes);
  return reader.take_rows(&transform->R) && reader.take_rows(&transform->t) && reader.at_end();
}

bool unpack(std::span<const std::byte> bytes, SimilarityTransform* transform) {
  ByteReader reader(bytes);
  return reader.take(&transform->s) && std::isfinite(transform->s) && transform->s > 0 &&
         reader.take_rows(&transform->R) && reader.take_rows(&transform->t) && reader.at_end();
}

bool unpack(std::span<const std::byte> bytes, Eigen::Matrix3d* matrix) {
  ByteReader reader(bytes);
  return reader.take_rows(matrix) && reader.at_end();
}

bool unpack(std::span<const std::byte> bytes, Eigen::Vector3d* vector) {
  ByteReader reader(bytes);
  return reader.take_rows(vector) && reader.at_end();
}

bool unpack(std::span<const std::byte> bytes, std::vector<Measurement>* measurements) {
  if (bytes.size() % kMeasurementBytes != 0) return false;
  ByteReader reader(bytes);
  measurements->reserve(bytes.size() / kMeasurementBytes);
  while (!reader.at_end()) {
    Measurement m;
    std::int32_t level = 0, source = 0;
    if (!reader.take(&m.point.index) || !reader.take(&m.sigma_px) || !reader.take(&m.pixel.x()) ||
        !reader.take(&m.pixel.y()) || !reader.take(&level) || !reader.take(&source))
      return false;
    if (m.point.index < 0 || level < 0 || level >= kPyramidLevels || source < 0 ||
        source > static_cast<std::int32_t>(MeasurementSource::second_chance) || !(m.sigma_px > 0) ||
        !std::isfinite(m.sigma_px) || !m.pixel.allFinite())
      return false;
    m.level = static_cast<std::int8_t>(level);
    m.source = static_cast<MeasurementSource>(source);
    measurements->push_back(m);
  }
  return true;
}

bool unpack(std::span<const std::byte> bytes, std::vector<KeyframeId>* ids) {
  ByteReader reader(bytes);
  while (!reader.at_end()) {
    KeyframeId id;
    if (!reader.take(&id.index) || id.index < 0) return false;
    ids->push_back(id);
  }
  return true;
}

bool unpack(std::span<const std::byte> bytes, const ImagePyramid& pyramid,
            std::array<CornerList, kPyramidLevels>* corners) {
  ByteReader reader(bytes);
  for (std::size_t l = 0; l < kPyramidLevels; ++l) {
    CornerList& level = (*corners)[l];
    const int width = pyramid.level[l].cols, height = pyramid.level[l].rows;
    std::uint32_t count = 0;
    if (!reader.take(&count) || count > static_cast<std::uint32_t>(width) * static_cast<std::uint32_t>(height))
      return false;
    level.rows.assign(static_cast<std::size_t>(height) + 1, 0);
    for (std::uint32_t i = 0; i < count; ++i) {
      Corner corner;
      if (!reader.take(&corner.x) || !reader.take(&corner.y)) return false;
      if (corner.x < 0 || corner.y < 0 || corner.x >= width || corner.y >= height) return false;
      if (i > 0) {
        const Corner& last = level.corners.back();
        if (corner.y < last.y || (corner.y == last.y && corner.x <= last.x)) return false;
      }
      level.corners.push_back(corner);
      ++level.rows[static_cast<std::size_t>(corner.y) + 1];
    }
    for (std::size_t y = 1; y < level.rows.size(); ++y) level.rows[y] += level.rows[y - 1];
  }
  return reader.at_end();
}

}  // namespace parallax::map_file
