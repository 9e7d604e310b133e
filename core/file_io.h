// Files, whole or not at all.
#pragma once

#include <cstdint>
#include <functional>
#include <ostream>
#include <span>
#include <string>

namespace parallax {

// The whole file as text. Throws InputError ("PATH: cannot be read: reason").
std::string read_text_file(const std::string& path);

// Writes beside the target (same folder, unique name), flushes, checks, renames. Throws RunError ("PATH: cannot be
// written: reason") and leaves any earlier file untouched. An output that exists and is not a regular file (/dev/null,
// /dev/full, a pipe) is written in place, never renamed over.
void write_file_atomically(const std::string& path, const std::function<void(std::ostream&)>& write);
void write_file_atomically(const std::string& path, std::span<const std::uint8_t> bytes);

// Whether write_file_atomically() could begin: for outputs that are made after minutes of work. Throws as it does.
void check_can_be_written(const std::string& path);

}  // namespace parallax
