#include "app/map_merge_record.h"

#include <algorithm>
#include <filesystem>
#include <sstream>

#include "core/error.h"
#include "core/file_io.h"
#include "map/map_file.h"

namespace parallax {
namespace {

namespace fs = std::filesystem;

// Pairs of file names of the library, a line each, with a tab between.
constexpr const char* kApart = ".apart";
constexpr std::size_t kMostApart = 1000;  // the newest

std::string file_name(const std::string& path) { return fs::path(path).filename().string(); }

fs::path record_of(const std::string& merged) {
  const fs::path path(merged);
  return path.parent_path() / MapLibrary::kTrash / (path.filename().string() + MapLibrary::kMergeRecord);
}

std::vector<std::string> lines_of(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return {};
  std::istringstream text(read_text_file(path.string()));
  std::vector<std::string> lines;
  for (std::string line; std::getline(text, line);)
    if (!line.empty()) lines.push_back(line);
  return lines;
}

void write_lines(const std::vector<std::string>& lines, const fs::path& path) {
  write_file_atomically(path.string(), [&](std::ostream& out) {
    for (const std::string& line : lines) out << line << '\n';
  });
}

std::string apart_line(const MergedPair& pair) {
  const std::string base = file_name(pair.base), other = file_name(pair.other);
  return std::min(base, other) + '\t' + std::max(base, other);
}

}  // namespace

void note_merge(const MapLibrary& library, const std::string& merged, const MergedPair& pair) {
  // The note first: whenever the program ends, what has been moved can be brought back.
  const std::vector<std::string> expected{file_name(library.place_in_trash(pair.base)),
                                          file_name(library.place_in_trash(pair.other))};
  write_lines(expected, record_of(merged));
  const std::string other = library.remove(pair.other, true);
  const std::vector<std::string> now{file_name(library.remove(pair.base)), file_name(other)};
  if (now != expected) write_lines(now, record_of(merged));
}

std::optional<MergedPair> merged_pair(const std::string& merged) {
  const fs::path record = record_of(merged);
  std::error_code error;
  if (!fs::exists(merged, error)) return std::nullopt;
  std::vector<std::string> lines;
  try {
    lines = lines_of(record);
  } catch (const InputError&) {
    return std::nullopt;
  }
  if (lines.size() != 2) return std::nullopt;
  for (std::string& line : lines) {
    if (fs::path(line).filename() != line) return std::nullopt;
    const fs::path in_trash = record.parent_path() / line, not_moved = fs::path(merged).parent_path() / line;
    line = (fs::is_regular_file(in_trash, error) ? in_trash : not_moved).string();
    if (!fs::is_regular_file(line, error)) return std::nullopt;
  }
  return MergedPair{lines[0], lines[1]};
}

UndoneMerge undo_merge(const MapLibrary& library, const std::string& merged, bool own) {
  const auto pair = merged_pair(merged);
  if (!pair)
    throw InputError(merged + ": found no map that was merged within the last " +
                     std::to_string(MapLibrary::kTrashDays) + " days, expected one: the two are no longer there");
  UndoneMerge out;
  out.trashed = library.remove(merged, own);
  const auto back = [&](const std::string& path) {
    const bool in_trash = fs::path(path).parent_path().filename() == MapLibrary::kTrash;
    return in_trash ? library.restore(path) : path;
  };
  out.pair.base = back(pair->base);
  out.pair.other = back(pair->other);
  std::error_code error;
  fs::remove(record_of(merged), error);
  const fs::path apart = fs::path(library.folder()) / kApart;
  std::vector<std::string> lines = lines_of(apart);
  lines.push_back(apart_line(out.pair));
  if (lines.size() > kMostApart) lines.erase(lines.begin());
  write_lines(lines, apart);
  return out;
}

bool are_kept_apart(const MapLibrary& library, const MergedPair& pair) {
  const std::vector<std::string> lines = lines_of(fs::path(library.folder()) / kApart);
  return std::find(lines.begin(), lines.end(), apart_line(pair)) != lines.end();
}

std::vector<std::string> merge_origin(const std::string& path, const MapDocument& document) {
  if (!document.merged_from.empty()) return document.merged_from;
  const MapFileInfo info = read_map_file_info(path);
  return {file_name(path) + (info.name.empty() ? "" : " (" + info.name + ")") + ", made " + info.created + ", saved " +
          info.saved};
}

}  // namespace parallax
