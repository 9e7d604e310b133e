// Files, whole or not at all.
#pragma once

#include <functional>
#include <ostream>
#include <string>

namespace parallax {

// The whole file as text. Throws InputError ("PATH: cannot be read: reason").
std::string read_text_file(const std::string& path);

// Writes beside the target (same folder, unique name), flushes, checks, renames. Throws RunError ("PATH: cannot be
// written: reason") and leaves any earlier file untouched. An output that exists and is not a regular file (/dev/null,
// /dev/full, a pipe) is written in place, never renamed over.
void write_file_atomically(const std::string& path, const std::function<void(std::ostream&)>& write);

}  // namespace parallax
