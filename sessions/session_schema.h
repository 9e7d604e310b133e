// The tables of a session database, version by version, and how values are laid out in their blobs. Internal to
// session_database*.cpp; docs/sessions.md describes the tables.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "map/byte_packing.h"
#include "sessions/session_types.h"

namespace parallax::session_file {

// "PLXS": SQLite's application id, at byte 68 of the file.
inline constexpr std::int64_t kApplicationId = 0x504c5853;

// What makes a file of version v out of one of version v - 1 (index 0: version 1 out of nothing).
std::span<const char* const> migrations();

// A table of the newest version. `columns`, a letter each, without the checksum that ends every row: S the number of a
// session, K that of a keyframe, E that of an encounter, M that of an attached map, i integer, n number, t text, b
// blob.
struct Table {
  const char* name;
  const char* columns;
  bool counted;  // how many rows there must be stands in `meta`
};
inline constexpr Table kTables[] = {
    {"meta", "tt", false},      {"session", "SttbbniSbbt", true},  {"keyframe", "SKiiii", true},
    {"pose", "SKb", true},      {"feature", "SKb", true},          {"image", "SKiibb", true},
    {"edge", "SKKbbi", true},   {"point", "SKKb", true},           {"encounter", "ESKSKbbbiit", true},
    {"timing", "SKiin", false}, {"attached_map", "MttSKbi", true},
};

const char* name_of(EncounterState state);
bool state_of(std::string_view name, EncounterState* state);

// What may be written, and is believed when read. Rotations to 1e-6.
bool is_sound(const RigidTransform& transform);
bool is_sound(const SimilarityTransform& transform);
bool is_sound(const StereoCamera& camera);
bool is_sound(const SessionFeatures& features);
bool is_sound(const std::vector<SessionPoint>& points);
// Symmetric, and positive definite or (not `definite`) without negative eigenvalues.
bool is_covariance(const Matrix6d& matrix, bool definite);
// The scores of Eq. 4 and 5; those of Eq. 5 may be NaN.
bool are_scores(const Encounter& encounter);

// Little-endian, no padding.
using parallax::pack;                                          // transforms
std::vector<std::byte> pack(const Matrix6d& matrix);           // row by row: 36 doubles
std::vector<std::byte> pack(const StereoCamera& camera);       // 2 int32, 5 doubles
std::vector<std::byte> pack(const SessionFeatures& features);  // each x, y, right x (float), level (uint8), 4 uint64
std::vector<std::byte> pack(const std::vector<SessionPoint>& points);  // keyframe (int32), 3 floats, poses (int32)
std::vector<std::byte> pack_scores(const Encounter& encounter);        // 3 doubles

// False when the bytes are not what pack() makes of something sound.
bool unpack(std::span<const std::byte> bytes, RigidTransform* transform);
bool unpack(std::span<const std::byte> bytes, SimilarityTransform* transform);
bool unpack(std::span<const std::byte> bytes, Matrix6d* matrix);  // finite; is_covariance() is the caller's to ask
bool unpack(std::span<const std::byte> bytes, StereoCamera* camera);
bool unpack(std::span<const std::byte> bytes, SessionFeatures* features);
bool unpack(std::span<const std::byte> bytes, std::vector<SessionPoint>* points);
bool unpack_scores(std::span<const std::byte> bytes, Encounter* encounter);

}  // namespace parallax::session_file
