// Reading a map file: nothing in it is believed.
#include <algorithm>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <functional>
#include <optional>
#include <sstream>
#include <utility>

#include "core/error.h"
#include "core/image_codec.h"
#include "core/small_blurry_image.h"
#include "map/map_file.h"
#include "map/map_file_schema.h"
#include "map/sqlite.h"

namespace parallax {
namespace {

using map_file::unpack;

constexpr std::size_t kMostProblems = 50;
// Identifiers and sizes that no map reaches; a damaged one shall cost no memory.
constexpr std::int64_t kMostKeyframes = 1'000'000, kMostPoints = 10'000'000, kMostSide = 1 << 14;

constexpr char kSqliteMagic[] = "SQLite format 3";
constexpr std::size_t kMarkAt = 68;  // of the application id, big-endian

class MapFileReader {
 public:
  // Stops at the first problem unless `all` are wanted.
  MapFileReader(const std::string& path, bool all) : database_(path, SqliteMode::read), all_(all) { check_version(); }
  MapFileReader(const std::string& name, std::span<const std::byte> file) : database_(name, file), all_(false) {
    check_version();
  }

  MapDocument read() {
    check_tables();
    read_meta();
    read_images();
    read_keyframes();
    read_points();
    link();
    read_planes();
    read_content();
    read_games();
    check_counts();
    if (problems_.empty() && document_.map.empty()) problem("found no keyframe, expected a map");
    if (problems_.empty()) check_map();
    return std::move(document_);
  }

  MapFileInfo info() {
    check_tables();
    read_meta();
    MapFileInfo out;
    out.version = version_;
    out.keyframes = static_cast<int>(database_.number("SELECT count(*) FROM keyframe"));
    out.points = static_cast<int>(database_.number("SELECT count(*) FROM point"));
    out.content = static_cast<int>(database_.number("SELECT count(*) FROM content"));
    out.games = static_cast<int>(database_.number("SELECT count(*) FROM game"));
    out.name = meta_["name"];
    out.program = meta_["program"];
    out.created = meta_["created"];
    out.saved = meta_["saved"];
    out.scale_is_known = document_.scale_is_known;
    out.merged_from = document_.merged_from;
    return out;
  }

  void check_pages() {
    for (const std::string& line : database_.texts("PRAGMA integrity_check", kMostProblems))
      if (line != "ok") problem("database: " + line);
  }

  std::vector<std::string>& problems() { return problems_; }

 private:
  void problem(const std::string& text) {
    if (!all_) throw InputError(database_.path() + ": " + text);
    if (problems_.size() < kMostProblems) problems_.push_back(text);
  }

  void check_version() {
    if (database_.number("PRAGMA application_id") != map_file::kApplicationId)
      throw InputError(database_.path() + ": found another program's database, expected a map file");
    version_ = static_cast<int>(database_.number("PRAGMA user_version"));
    if (version_ < 1 || version_ > MapFile::kVersion)
      throw InputError(database_.path() + ": found a map file of version " + std::to_string(version_) +
                       ", expected 1 to " + std::to_string(MapFile::kVersion));
  }

  // The tables, and nothing else: what is not ours may do what it likes when it is read.
  void check_tables() {
    const std::vector<std::string> found =
        database_.texts("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name", 100);
    for (const char* table : map_file::kTables)
      if (std::find(found.begin(), found.end(), table) == found.end())
        throw InputError(database_.path() + ": found no table '" + table + "', expected one");
    const std::vector<std::string> others = database_.texts(
        "SELECT name FROM sqlite_master WHERE type IN ('view', 'trigger') OR sql LIKE 'CREATE VIRTUAL%'", 1);
    if (!others.empty()) throw InputError(database_.path() + ": found '" + others.front() + "', which no map file has");
  }

  // Every row of a table: `take` reads the columns and says what is wrong with them, empty for nothing.
  void rows(const std::string& table, const std::string& order,
            const std::function<std::string(SqliteStatement*, std::string* name)>& take) {
    try {
      SqliteStatement statement(&database_, "SELECT * FROM " + table + " ORDER BY " + order);
      while (statement.next()) {
        std::string name = table;
        const std::string wrong = take(&statement, &name);
        if (!statement.row_is_sound())
          problem(name + ": found damaged bytes, expected those of its checksum");
        else if (!wrong.empty())
          problem(name + ": " + wrong);
      }
    } catch (const InputError& e) {
      if (!all_) throw;
      problem(table + ": " + std::string(e.what()).substr(database_.path().size() + 2));
    }
  }

  void read_meta() {
    rows("meta", "key", [this](SqliteStatement* row, std::string* name) -> std::string {
      std::string key(row->take_text()), value(row->take_text());
      row->take_checksum();
      *name = "meta '" + key + "'";
      if (row->row_is_sound()) meta_[std::move(key)] = std::move(value);
      return "";
    });
    document_.calibration = meta_["calibration"];
    document_.name = meta_["name"];
    document_.scale_is_known = meta_["scale"] == "known";
    // Files that were written before maps were merged have no such text.
    std::istringstream merged_from(meta_["merged_from"]);
    for (std::string line; std::getline(merged_from, line);) document_.merged_from.push_back(line);
    if (document_.calibration.empty()) problem("meta 'calibration': found nothing, expected the lens");
  }

  void read_images() {
    rows("image", "keyframe", [this](SqliteStatement* row, std::string* name) -> std::string {
      const std::int64_t index = row->take_integer(), width = row->take_integer(), height = row->take_integer();
      const auto grey = row->take_bytes(), corners = row->take_bytes();
      row->take_checksum();
      *name = "image of keyframe " + std::to_string(index);
      if (!row->row_is_sound()) return "";
      if (index < 0 || index >= kMostKeyframes || width < 8 || height < 8 || width > kMostSide || height > kMostSide)
        return "found an impossible size";
      auto images = std::make_shared<FrameImages>();
      GreyImage image;
      const cv::Size size(static_cast<int>(width), static_cast<int>(height));
      if (!codec_.unpack_grey({reinterpret_cast<const std::uint8_t*>(grey.data()), grey.size()}, size, &image))
        return "found damaged pixels";
      if (!images_.empty() && images_.begin()->second->pyramid.level[0].size() != size)
        return "found another size than that of the others";
      build_pyramid(image, &images->pyramid);
      if (!unpack(corners, images->pyramid, &images->corners)) return "found damaged corners";
      images->small = make_small_blurry_image(images->pyramid);
      images_[static_cast<std::int32_t>(index)] = std::move(images);
      return "";
    });
  }

  void read_keyframes() {
    rows("keyframe", "id", [this](SqliteStatement* row, std::string* name) -> std::string {
      Keyframe kf;
      const std::int64_t index = row->take_integer();
      kf.frame = static_cast<int>(row->take_integer());
      kf.time = Timestamp(row->take_integer());
      const auto pose = row->take_bytes();
      kf.mean_depth = row->take_number();
      kf.depth_sigma = row->take_number();
      kf.fixed = row->take_integer() != 0;
      const auto measurements = row->take_bytes();
      row->take_checksum();
      *name = "keyframe " + std::to_string(index);
      if (!row->row_is_sound()) return "";
      if (index < document_.map.keyframes.capacity() || index >= kMostKeyframes) return "found an impossible number";
      if (!unpack(pose, &kf.camera_from_world)) return "found a damaged pose";
      if (!unpack(measurements, &kf.measurements)) return "found damaged measurements";
      const auto images = images_.find(static_cast<std::int32_t>(index));
      if (images == images_.end()) return "found no image, expected one";
      kf.images = images->second;
      document_.map.keyframes.restore(std::move(kf), {0, static_cast<std::int32_t>(index)});
      return "";
    });
  }

  void read_points() {
    rows("point", "id", [this](SqliteStatement* row, std::string* name) -> std::string {
      MapPoint p;
      const std::int64_t index = row->take_integer();
      for (int i = 0; i < 3; ++i) p.position[i] = row->take_number();
      for (int i = 0; i < 3; ++i) p.normal[i] = row->take_number();
      p.normal_estimated = row->take_integer() != 0;
      p.source = {0, static_cast<std::int32_t>(row->take_integer())};
      p.source_level = static_cast<int>(row->take_integer());
      for (int i = 0; i < 2; ++i) p.source_pixel[i] = row->take_number();
      const auto rays = row->take_bytes();
      p.searched = static_cast<int>(row->take_integer());
      p.found = static_cast<int>(row->take_integer());
      p.pose_outliers = static_cast<int>(row->take_integer());
      const auto failed = row->take_bytes();
      p.refined_everywhere = row->take_integer() != 0;
      row->take_checksum();
      *name = "point " + std::to_string(index);
      if (!row->row_is_sound()) return "";
      if (index < document_.map.points.capacity() || index >= kMostPoints) return "found an impossible number";
      if (!unpack(rays, &p.source_rays)) return "found damaged rays";
      if (!unpack(failed, &p.failed)) return "found a damaged list of keyframes";
      if (!document_.map.keyframes.contains(p.source)) return "found no source keyframe, expected one";
      document_.map.points.restore(std::move(p), {0, static_cast<std::int32_t>(index)});
      return "";
    });
  }

  // Points know who measures them by the keyframes' own lists.
  void link() {
    for (Keyframe& kf : document_.map.keyframes) {
      PointId last;
      for (const Measurement& m : kf.measurements) {
        MapPoint* point = document_.map.points.find(m.point);
        if (!point || m.point <= last) {
          problem("keyframe " + std::to_string(kf.id.index) + ": measures point " + std::to_string(m.point.index) +
                  (point ? " out of order" : ", which is not there"));
          break;
        }
        point->observers.push_back(kf.id);
        last = m.point;
      }
    }
  }

  void read_planes() {
    rows("plane", "id", [this](SqliteStatement* row, std::string* name) -> std::string {
      Plane plane;
      *name = "plane " + std::to_string(row->take_integer());
      const auto pose = row->take_bytes();
      plane.extent_m = row->take_number();
      const bool dominant = row->take_integer() != 0;
      row->take_checksum();
      if (!row->row_is_sound()) return "";
      if (!unpack(pose, &plane.world_from_plane)) return "found a damaged pose";
      if (!(plane.extent_m > 0)) return "found an impossible extent";
      if (dominant)
        document_.map.plane = plane;
      else
        document_.map.planes.push_back(plane);
      return "";
    });
  }

  void read_content() {
    rows("content", "id", [this](SqliteStatement* row, std::string* name) -> std::string {
      ContentItem item;
      item.id = static_cast<int>(row->take_integer());
      *name = "content " + std::to_string(item.id);
      const std::string kind(row->take_text());
      item.text = row->take_text();
      const auto pose = row->take_bytes();
      item.size_m = row->take_number();
      const auto end = row->take_bytes();
      row->take_checksum();
      if (!row->row_is_sound()) return "";
      if (kind == "label")
        item.kind = ContentKind::label;
      else if (kind == "model")
        item.kind = ContentKind::model;
      else if (kind == "line")
        item.kind = ContentKind::line;
      else
        return "found kind '" + kind + "', expected label, model or line";
      if (!unpack(pose, &item.world_from_item) || !unpack(end, &item.end_in_item) || !(item.size_m > 0))
        return "found a damaged place";
      document_.content.push_back(std::move(item));
      return "";
    });
  }

  void read_games() {
    rows("game", "name", [this](SqliteStatement* row, std::string* name) -> std::string {
      std::string game(row->take_text()), state(row->take_text());
      row->take_checksum();
      *name = "game '" + game + "'";
      if (row->row_is_sound()) document_.games[std::move(game)] = std::move(state);
      return "";
    });
  }

  void check_counts() {
    const auto check = [this](const std::string& what, int found) {
      const std::string& text = meta_[what];
      int expected = -1;
      std::from_chars(text.data(), text.data() + text.size(), expected);
      if (found != expected)
        problem(what + ": found " + std::to_string(found) + ", expected " +
                (expected < 0 ? text : std::to_string(expected)));
    };
    check("keyframes", document_.map.keyframes.size());
    check("points", document_.map.points.size());
  }

  void check_map() {
    const ImagePyramid& images = document_.map.keyframes.begin()->images->pyramid;
    const CameraModel camera(CameraModelKind::pinhole, images.width(), images.height(),
                             Eigen::Vector2d::Constant(images.width()),
                             Eigen::Vector2d(images.width() / 2.0, images.height() / 2.0));
    for (const std::string& line : check_consistency(document_.map, camera)) problem("map: " + line);
  }

  SqliteDatabase database_;
  bool all_;
  int version_ = 0;
  std::vector<std::string> problems_;
  std::map<std::string, std::string> meta_;
  std::map<std::int32_t, std::shared_ptr<const FrameImages>> images_;
  ImageCodec codec_;
  MapDocument document_;
};

}  // namespace

MapDocument read_map_file(const std::string& path) { return MapFileReader(path, false).read(); }

MapDocument read_map_bytes(std::span<const std::byte> file, const std::string& name) {
  return MapFileReader(name, file).read();
}

MapFileInfo read_map_file_info(const std::string& path) {
  MapFileInfo out = MapFileReader(path, false).info();
  std::error_code error;
  const auto bytes = std::filesystem::file_size(path, error);
  if (!error) out.bytes = static_cast<std::int64_t>(bytes);
  return out;
}

std::vector<std::string> verify_map_file(const std::string& path) {
  std::optional<MapFileReader> reader;
  std::vector<std::string> out;
  const auto note = [&](const InputError& e) {
    const std::string text = e.what();
    out.push_back(text.rfind(path + ": ", 0) == 0 ? text.substr(path.size() + 2) : text);
  };
  try {
    reader.emplace(path, true);
    reader->check_pages();
  } catch (const InputError& e) {
    note(e);
  }
  if (!reader) return out;
  try {
    reader->read();
  } catch (const InputError& e) {
    note(e);
  }
  out.insert(out.begin(), reader->problems().begin(), reader->problems().end());
  return out;
}

bool is_map_file(std::string_view start) {
  if (start.size() < kMarkAt + 4 || std::memcmp(start.data(), kSqliteMagic, sizeof kSqliteMagic) != 0) return false;
  std::int64_t mark = 0;
  for (std::size_t i = 0; i < 4; ++i) mark = mark << 8 | static_cast<unsigned char>(start[kMarkAt + i]);
  return mark == map_file::kApplicationId;
}

}  // namespace parallax
