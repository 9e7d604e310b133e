// The tables of a map file, version by version, and how bytes are laid out in their blobs. Internal to map_file*.cpp.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/fast.h"
#include "core/se3.h"
#include "map/byte_packing.h"
#include "map/entities.h"

namespace parallax::map_file {

// "PLXM": SQLite's application id, at byte 68 of the file.
inline constexpr std::int64_t kApplicationId = 0x504c584d;

// What makes a file of version v out of one of version v - 1 (index 0: version 1 out of nothing).
std::span<const char* const> migrations();
// The tables of the newest version.
inline constexpr const char* kTables[] = {"meta", "keyframe", "image", "point", "plane", "content", "game"};

// Little-endian, no padding.
using parallax::pack;                                        // transforms
std::vector<std::byte> pack(const Eigen::Matrix3d& matrix);  // row by row
std::vector<std::byte> pack(const Eigen::Vector3d& vector);
std::vector<std::byte> pack(const std::vector<Measurement>& measurements);  // 32 bytes each
std::vector<std::byte> pack(const std::vector<KeyframeId>& ids);            // 4 bytes each
std::vector<std::byte> pack(const std::array<CornerList, kPyramidLevels>& corners);

// False when the bytes are not what pack() makes.
bool unpack(std::span<const std::byte> bytes, RigidTransform* transform);
bool unpack(std::span<const std::byte> bytes, SimilarityTransform* transform);
bool unpack(std::span<const std::byte> bytes, Eigen::Matrix3d* matrix);
bool unpack(std::span<const std::byte> bytes, Eigen::Vector3d* vector);
bool unpack(std::span<const std::byte> bytes, std::vector<Measurement>* measurements);
bool unpack(std::span<const std::byte> bytes, std::vector<KeyframeId>* ids);
// Corners of images of the pyramid's sizes.
bool unpack(std::span<const std::byte> bytes, const ImagePyramid& pyramid,
            std::array<CornerList, kPyramidLevels>* corners);

}  // namespace parallax::map_file
