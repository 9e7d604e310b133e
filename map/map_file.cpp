#include "map/map_file.h"

#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <set>
#include <utility>

#include "core/check.h"
#include "core/error.h"
#include "core/image_codec.h"
#include "map/map_file_schema.h"
#include "map/sqlite.h"

namespace parallax {
namespace {

using map_file::pack;

std::string now_utc() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  std::tm parts{};
  gmtime_r(&now, &parts);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text.data();
}

const char* kind_name(ContentKind kind) {
  switch (kind) {
    case ContentKind::label:
      return "label";
    case ContentKind::model:
      return "model";
    case ContentKind::line:
      return "line";
  }
  return "";
}

// Any lens of the images' size: what is checked of a map asks for no more.
CameraModel camera_of_size(const Map& map) {
  const ImagePyramid& images = map.keyframes.begin()->images->pyramid;
  return CameraModel(CameraModelKind::pinhole, images.width(), images.height(),
                     Eigen::Vector2d::Constant(images.width()),
                     Eigen::Vector2d(images.width() / 2.0, images.height() / 2.0));
}

}  // namespace

MapFile::MapFile(const std::string& path, std::string program, const std::string& vfs)
    : database_(std::make_unique<SqliteDatabase>(path, SqliteMode::write, vfs)), program_(std::move(program)) {
  // EXTRA: the folder is synchronised too when the journal goes, so that a commit that returned stays.
  database_->run("PRAGMA journal_mode = DELETE; PRAGMA synchronous = EXTRA");
  SqliteTransaction transaction(database_.get());
  const std::int64_t mark = database_->number("PRAGMA application_id");
  const std::int64_t version = database_->number("PRAGMA user_version");
  const bool fresh = database_->number("SELECT count(*) FROM sqlite_master") == 0 && version == 0;
  if (!fresh && mark != map_file::kApplicationId)
    throw InputError(path + ": found another program's database, expected a map file");
  if (version > kVersion)
    throw InputError(path + ": found a map file of version " + std::to_string(version) + ", expected at most " +
                     std::to_string(kVersion));
  if (version == kVersion) return;
  const auto migrations = map_file::migrations();
  for (auto v = static_cast<std::size_t>(version); v < migrations.size(); ++v) database_->run(migrations[v]);
  database_->run("PRAGMA application_id = " + std::to_string(map_file::kApplicationId) +
                 "; PRAGMA user_version = " + std::to_string(kVersion));
  transaction.commit();
}

MapFile::~MapFile() = default;

void MapFile::save_images(const Map& map, bool all) {
  std::set<std::int32_t> there;
  if (all) {
    database_->run("DELETE FROM image");
  } else {
    std::vector<std::int32_t> gone;
    {
      SqliteStatement statement(database_.get(), "SELECT keyframe FROM image");
      while (statement.next()) {
        const auto index = static_cast<std::int32_t>(statement.take_integer());
        if (map.keyframes.contains({0, index})) {
          there.insert(index);
        } else {
          gone.push_back(index);
        }
      }
    }
    SqliteStatement erase(database_.get(), "DELETE FROM image WHERE keyframe = ?");
    for (const std::int32_t index : gone) erase.put(index).execute();
  }
  SqliteStatement insert(database_.get(), "INSERT INTO image VALUES(?, ?, ?, ?, ?, ?)");
  ImageCodec codec;
  std::string grey;
  for (const Keyframe& kf : map.keyframes) {
    if (there.contains(kf.id.index)) continue;
    const GreyImage& image = kf.images->pyramid.level[0];
    grey.clear();
    codec.pack_grey(image, &grey);
    const std::vector<std::byte> corners = pack(kf.images->corners);
    insert.put(kf.id.index).put(image.cols).put(image.rows).put(std::as_bytes(std::span(grey))).put(corners);
    insert.put_checksum().execute();
  }
}

void MapFile::save_keyframes(const Map& map) {
  database_->run("DELETE FROM keyframe");
  SqliteStatement insert(database_.get(), "INSERT INTO keyframe VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?)");
  for (const Keyframe& kf : map.keyframes) {
    const std::vector<std::byte> pose = pack(kf.camera_from_world), measurements = pack(kf.measurements);
    insert.put(kf.id.index).put(kf.frame).put(kf.time.count()).put(pose).put(kf.mean_depth).put(kf.depth_sigma);
    insert.put(kf.fixed).put(measurements).put_checksum().execute();
  }
}

void MapFile::save_points(const Map& map) {
  database_->run("DELETE FROM point");
  SqliteStatement insert(database_.get(),
                         "INSERT INTO point VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  for (const MapPoint& p : map.points) {
    const std::vector<std::byte> rays = pack(p.source_rays), failed = pack(p.failed);
    insert.put(p.id.index).put(p.position.x()).put(p.position.y()).put(p.position.z());
    insert.put(p.normal.x()).put(p.normal.y()).put(p.normal.z()).put(p.normal_estimated);
    insert.put(p.source.index).put(p.source_level).put(p.source_pixel.x()).put(p.source_pixel.y()).put(rays);
    insert.put(p.searched).put(p.found).put(p.pose_outliers).put(failed).put(p.refined_everywhere);
    insert.put_checksum().execute();
  }
}

void MapFile::save_rest(const MapDocument& document) {
  database_->run("DELETE FROM plane; DELETE FROM content; DELETE FROM game");
  SqliteStatement plane(database_.get(), "INSERT INTO plane VALUES(?, ?, ?, ?, ?)");
  const auto put_plane = [&](int id, const Plane& p, bool dominant) {
    const std::vector<std::byte> pose = pack(p.world_from_plane);
    plane.put(id).put(pose).put(p.extent_m).put(dominant).put_checksum().execute();
  };
  int id = 0;
  if (document.map.plane) put_plane(id, *document.map.plane, true);
  for (const Plane& p : document.map.planes) put_plane(++id, p, false);

  SqliteStatement content(database_.get(), "INSERT INTO content VALUES(?, ?, ?, ?, ?, ?, ?)");
  for (const ContentItem& item : document.content) {
    const std::vector<std::byte> pose = pack(item.world_from_item), end = pack(item.end_in_item);
    content.put(item.id).put(std::string_view(kind_name(item.kind))).put(std::string_view(item.text)).put(pose);
    content.put(item.size_m).put(end).put_checksum().execute();
  }
  SqliteStatement game(database_.get(), "INSERT INTO game VALUES(?, ?, ?)");
  for (const auto& [name, state] : document.games)
    game.put(std::string_view(name)).put(std::string_view(state)).put_checksum().execute();

  const std::vector<std::string> created = database_->texts("SELECT value FROM meta WHERE key = 'created'", 1);
  const std::string now = now_utc();
  std::string merged_from;
  for (const std::string& line : document.merged_from) merged_from += line + '\n';
  const std::pair<std::string, std::string> meta[] = {
      {"calibration", document.calibration},
      {"created", created.empty() ? now : created.front()},
      {"keyframes", std::to_string(document.map.keyframes.size())},
      {"merged_from", merged_from},
      {"name", document.name},
      {"points", std::to_string(document.map.points.size())},
      {"program", program_},
      {"saved", now},
      {"scale", document.scale_is_known ? "known" : "unknown"},
  };
  database_->run("DELETE FROM meta");
  SqliteStatement put(database_.get(), "INSERT INTO meta VALUES(?, ?, ?)");
  for (const auto& [key, value] : meta)
    put.put(std::string_view(key)).put(std::string_view(value)).put_checksum().execute();
}

void MapFile::save(const MapDocument& document, bool another_map) {
  PARALLAX_CHECK(!document.map.empty(), "an empty map is not saved");
  // What is there is better than a map that could not be read again.
  const std::vector<std::string> problems = check_consistency(document.map, camera_of_size(document.map));
  if (!problems.empty())
    throw RunError(database_->path() + ": not written: the map is not consistent: " + problems.front());
  SqliteTransaction transaction(database_.get());
  save_images(document.map, another_map);
  save_keyframes(document.map);
  save_points(document.map);
  save_rest(document);
  transaction.commit();
}

void write_map_file(const MapDocument& document, const std::string& path, const std::string& program) {
  namespace fs = std::filesystem;
  std::error_code error;
  if (fs::exists(path, error) && !fs::is_regular_file(path, error))
    throw RunError(path + ": cannot be written: a map needs a regular file");
  const std::string beside = path + ".new-" + std::to_string(getpid());
  fs::remove(beside, error);
  try {
    MapFile(beside, program).save(document);
    fs::rename(beside, path, error);
    if (error) throw RunError(beside + ": cannot be renamed to " + path + ": " + error.message());
  } catch (const RunError& e) {
    fs::remove(beside, error);
    fs::remove(beside + "-journal", error);
    std::string text = e.what();
    if (text.rfind(beside, 0) == 0) text.replace(0, beside.size(), path);
    throw RunError(text);
  }
}

}  // namespace parallax
