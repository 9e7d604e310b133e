#include "app/map_library.h"

#include <sys/stat.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <opencv2/imgproc.hpp>

#include "app/map_saver.h"
#include "app/user_settings.h"
#include "camera/calibration_file.h"
#include "core/error.h"
#include "core/image_codec.h"
#include "core/parse_text.h"
#include "map/map_file.h"
#include "map/sqlite.h"

namespace parallax {

namespace fs = std::filesystem;

namespace {

constexpr const char* kExtension = ".plxmap";
constexpr std::size_t kNameBytes = 60;

bool ends_with(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

// Names of files in the folder that may be maps: what databases leave beside theirs is none.
std::vector<std::string> library_files(const std::string& folder) {
  std::vector<std::string> out;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (name.front() == '.' || ends_with(name, "-journal") || name.find(".plxmap.new-") != std::string::npos) continue;
    out.push_back(name);
  }
  std::sort(out.begin(), out.end());
  return out;
}

bool has_map_mark(const std::string& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return false;
  std::ifstream in(path, std::ios::binary);
  std::string head(100, '\0');
  in.read(head.data(), static_cast<std::streamsize>(head.size()));
  return is_map_file({head.data(), static_cast<std::size_t>(in.gcount())});
}

// "2026-11-22T14:05:09Z" as the user's clock showed it: "22 Nov 2026, 15:05".
std::string local_time_text(const std::string& utc) {
  std::tm parts{};
  if (strptime(utc.c_str(), "%Y-%m-%dT%H:%M:%SZ", &parts) == nullptr) return "";
  const std::time_t time = timegm(&parts);
  std::tm local{};
  if (localtime_r(&time, &local) == nullptr) return "";
  char text[48];
  return std::strftime(text, sizeof text, "%e %b %Y, %H:%M", &local) > 0 ? std::string(trimmed(text)) : "";
}

std::string without_path(const std::string& text, const std::string& path) {
  return text.rfind(path + ": ", 0) == 0 ? text.substr(path.size() + 2) : text;
}

// Whoever was killed while writing left a journal: rolled back, so that the file can go without it.
void settle_journal(const std::string& path) {
  std::error_code error;
  if (fs::exists(path + "-journal", error)) const MapFile settled(path, "");
}

void check_changeable(const std::string& path, bool own) {
  if (!has_map_mark(path)) throw InputError(path + ": found no map file, expected one; it is left as it is");
  if (is_locked_map(path)) throw InputError(path + ": found a locked map, expected one that is not");
  if (!own && MapLock::is_taken(path)) throw InputError(path + ": found a map that another program uses now");
}

}  // namespace

bool LibraryMap::fits(const CameraModel& camera) const {
  return problem.empty() && width == camera.width() && height == camera.height() && lens == format_calibration(camera);
}

MapStamp map_stamp(const std::string& path) {
  struct stat found {};
  if (stat(path.c_str(), &found) != 0) return {};
  return {found.st_size, found.st_mtim.tv_sec * 1'000'000'000LL + found.st_mtim.tv_nsec};
}

std::string map_library_folder() {
  const std::string state = state_path();
  return state.empty() ? "" : (fs::path(state).parent_path() / "maps").string();
}

bool is_locked_map(const std::string& path) {
  std::error_code error;
  const fs::perms all = fs::status(path, error).permissions();
  return !error &&
         (all & (fs::perms::owner_write | fs::perms::group_write | fs::perms::others_write)) == fs::perms::none;
}

void check_map_folder(const std::string& path) {
  std::error_code error;
  if (fs::exists(path, error) && !fs::is_directory(path, error))
    throw InputError(path + ": found a file, expected a folder of maps");
}

LibraryMap MapLibrary::describe(const std::string& path) const {
  LibraryMap out;
  out.path = path;
  out.file = out.title = fs::path(path).filename().string();
  std::error_code error;
  if (!fs::is_regular_file(path, error)) {
    out.problem = fs::is_directory(path, error) ? "a folder, not a map file" : "not a regular file";
    return out;
  }
  if (!has_map_mark(path)) {
    out.problem = "not a map file";
    return out;
  }
  try {
    out.info = read_map_file_info(path);
    out.name = out.info.name;
    const std::string made = local_time_text(out.info.created);
    out.title = !out.name.empty() ? out.name : !made.empty() ? made : fs::path(path).stem().string();
    SqliteDatabase database(path, SqliteMode::read);
    const auto texts = database.texts("SELECT value FROM meta WHERE key = 'calibration'", 1);
    const CameraModel lens = parse_calibration(texts.empty() ? "" : texts.front(), path + ": calibration");
    out.lens = format_calibration(lens);
    out.width = static_cast<int>(database.number("SELECT width FROM image LIMIT 1"));
    out.height = static_cast<int>(database.number("SELECT height FROM image LIMIT 1"));
    if (out.info.keyframes == 0) out.problem = "no keyframe in it";
  } catch (const std::exception& e) {
    out.problem = without_path(e.what(), path);
  }
  out.locked = is_locked_map(path);
  out.in_use = MapLock::is_taken(path);
  return out;
}

std::vector<LibraryMap> MapLibrary::list() const {
  std::vector<LibraryMap> out;
  for (const std::string& file : library_files(folder_)) out.push_back(describe((fs::path(folder_) / file).string()));
  std::stable_sort(out.begin(), out.end(), [](const LibraryMap& a, const LibraryMap& b) {
    if (a.problem.empty() != b.problem.empty()) return a.problem.empty();
    return a.problem.empty() && a.info.saved > b.info.saved;
  });
  return out;
}

std::vector<std::string> MapLibrary::paths() const {
  std::vector<std::string> out;
  std::error_code error;
  for (const std::string& file : library_files(folder_)) {
    const fs::path path = fs::path(folder_) / file;
    if (fs::is_regular_file(path, error)) out.push_back(path.string());
  }
  return out;
}

MapLibrary::NewMap MapLibrary::new_map() const {
  std::error_code error;
  fs::create_directories(folder_, error);
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  localtime_r(&now, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%d-%H%M%S", &parts);
  const std::string first = (fs::path(folder_) / (std::string(text) + kExtension)).string();
  constexpr int kTries = 1000;
  std::string path = first;
  for (int number = 2; number < kTries; ++number) {
    auto lock = MapLock::try_take(path);
    if (lock && !fs::exists(path, error)) return {path, std::move(lock)};
    path = (fs::path(folder_) / (std::string(text) + "-" + std::to_string(number) + kExtension)).string();
  }
  throw RunError(first + ": cannot be written: no name is free or the folder cannot be written");
}

void MapLibrary::rename(const std::string& path, const std::string& name, bool own) const {
  check_changeable(path, own);
  const std::string clean = clean_map_name(name);
  SqliteDatabase database(path, SqliteMode::write);
  SqliteTransaction transaction(&database);
  SqliteStatement put(&database, "INSERT OR REPLACE INTO meta VALUES(?, ?, ?)");
  put.put(std::string_view("name")).put(std::string_view(clean)).put_checksum().execute();
  transaction.commit();
}

void MapLibrary::set_locked(const std::string& path, bool locked) {
  if (!has_map_mark(path)) throw InputError(path + ": found no map file, expected one; it is left as it is");
  constexpr fs::perms kWrite = fs::perms::owner_write | fs::perms::group_write | fs::perms::others_write;
  std::error_code error;
  fs::permissions(path, locked ? kWrite : fs::perms::owner_write,
                  locked ? fs::perm_options::remove : fs::perm_options::add, error);
  if (error) throw RunError(path + ": cannot be " + (locked ? "locked: " : "unlocked: ") + error.message());
}

std::string MapLibrary::place_in_trash(const std::string& path) const {
  std::error_code error;
  const fs::path trash = fs::path(folder_) / kTrash;
  fs::create_directories(trash, error);
  const std::string to = (trash / fs::path(path).filename()).string();
  return fs::exists(to, error) ? next_map_path(to) : to;
}

std::string MapLibrary::remove(const std::string& path, bool own) const {
  check_changeable(path, own);
  const auto lock = own ? nullptr : MapLock::try_take(path);
  settle_journal(path);
  std::error_code error;
  const std::string to = place_in_trash(path);
  fs::rename(path, to, error);
  if (error) throw RunError(path + ": cannot be deleted: " + error.message());
  fs::last_write_time(to, fs::file_time_type::clock::now(), error);  // since when it lies there
  return to;
}

std::string MapLibrary::restore(const std::string& trashed) const {
  std::error_code error;
  std::string to = (fs::path(folder_) / fs::path(trashed).filename()).string();
  if (fs::exists(to, error)) to = next_map_path(to);
  fs::rename(trashed, to, error);
  if (error) throw RunError(trashed + ": cannot be brought back: " + error.message());
  return to;
}

void MapLibrary::empty_old_trash() const {
  const fs::path trash = fs::path(folder_) / kTrash;
  const auto oldest = fs::file_time_type::clock::now() - std::chrono::hours(24 * kTrashDays);
  std::error_code error;
  std::vector<fs::path> old;
  for (fs::directory_iterator it(trash, error), end; !error && it != end; it.increment(error)) {
    std::error_code unknown;
    const auto since = fs::last_write_time(it->path(), unknown);
    const bool ours = has_map_mark(it->path().string()) || it->path().extension() == kMergeRecord;
    if (!unknown && since < oldest && ours) old.push_back(it->path());
  }
  for (const fs::path& path : old) fs::remove(path, error);
}

std::vector<std::string> MapLibrary::keep_newest_unnamed(int at_most, const std::string& spared) const {
  std::vector<std::string> gone;
  int kept = 0;
  for (const LibraryMap& map : list()) {
    if (!map.problem.empty() || !map.name.empty() || map.locked) continue;
    if (++kept <= at_most || map.in_use || map.path == spared) continue;
    remove(map.path);
    gone.push_back(map.title);
  }
  return gone;
}

std::string clean_map_name(const std::string& name) {
  std::string out;
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    out += byte < 0x20 || byte == 0x7f ? ' ' : c;
  }
  out = std::string(trimmed(out));
  if (out.size() <= kNameBytes) return out;
  std::size_t end = kNameBytes;
  while (end > 0 && (static_cast<unsigned char>(out[end]) & 0xc0) == 0x80) --end;  // not through a letter
  return std::string(trimmed(out.substr(0, end)));
}

GreyImage read_map_picture(const std::string& path, int width_px) {
  SqliteDatabase database(path, SqliteMode::read);
  const std::int64_t count = database.number("SELECT count(*) FROM image");
  SqliteStatement row(&database, "SELECT * FROM image ORDER BY keyframe LIMIT 1 OFFSET ?");
  row.put(count / 2);
  if (!row.next()) throw InputError(path + ": found no image, expected one");
  row.take_integer();
  const std::int64_t width = row.take_integer(), height = row.take_integer();
  const auto grey = row.take_bytes();
  row.take_bytes();
  const cv::Size size(static_cast<int>(width), static_cast<int>(height));
  constexpr std::int64_t kMostSide = 1 << 14;
  const std::string problem = path + ": found a damaged image, expected the picture of a keyframe";
  if (width < 8 || height < 8 || width > kMostSide || height > kMostSide) throw InputError(problem);
  GreyImage image;
  ImageCodec codec;
  // take_checksum() comes last: the bytes live until the next row.
  const bool unpacked =
      codec.unpack_grey({reinterpret_cast<const std::uint8_t*>(grey.data()), grey.size()}, size, &image);
  row.take_checksum();
  if (!unpacked || !row.row_is_sound()) throw InputError(problem);
  if (image.cols <= width_px) return image;
  GreyImage small;
  cv::resize(image, small, {width_px, std::max(1, image.rows * width_px / image.cols)}, 0, 0, cv::INTER_AREA);
  return small;
}

}  // namespace parallax
