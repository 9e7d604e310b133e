#include "app/map_saver.h"

#include <filesystem>
#include <optional>
#include <utility>

#include "app/session_hash.h"
#include "camera/calibration_file.h"
#include "core/checksum.h"
#include "core/error.h"
#include "map/map_file.h"

namespace parallax {

namespace {

// Of all that a save would change.
std::uint64_t hash_of(const MapDocument& document) {
  std::uint64_t sum = hash_of(document.map);
  const auto add = [&sum](const void* data, std::size_t size) { sum = checksum(data, size, sum); };
  for (const ContentItem& item : document.content) {
    add(&item.id, sizeof item.id);
    add(item.text.data(), item.text.size());
    add(&item.world_from_item.s, sizeof item.world_from_item.s);
    add(item.world_from_item.R.data(), sizeof(double) * 9);
    add(item.world_from_item.t.data(), sizeof(double) * 3);
    add(&item.size_m, sizeof item.size_m);
    add(item.end_in_item.data(), sizeof(double) * 3);
  }
  for (const auto& [name, state] : document.games) {
    add(name.data(), name.size());
    add(state.data(), state.size());
  }
  add(&document.scale_is_known, sizeof document.scale_is_known);
  return sum;
}

}  // namespace

// The file of one map, and what of it is in there.
class MapSaver::Target {
 public:
  Target(const std::string& path, const std::string& program) : file(path, program) {}
  MapFile file;
  std::uint64_t map_version = 0;
  std::optional<std::uint64_t> saved_hash;
};

MapSaver::MapSaver(const MapSaverOptions& options, std::function<MapCopy()> copy)
    : options_(options), copy_(std::move(copy)), extras_(options.extras) {
  thread_ = std::jthread([this](std::stop_token stop) { run(std::move(stop)); });
}

MapSaver::~MapSaver() = default;

void MapSaver::set_extras(MapExtras extras) {
  MutexLock lock(mutex_);
  extras_ = std::move(extras);
}

void MapSaver::save_soon() {
  {
    MutexLock lock(mutex_);
    soon_ = true;
  }
  wake_.notify_all();
}

void MapSaver::run(std::stop_token stop) {
  while (!stop.stop_requested()) {
    {
      MutexLock lock(mutex_);
      wake_.wait_for(mutex_, stop, options_.interval, [this]() PARALLAX_REQUIRES(mutex_) { return soon_; });
      soon_ = false;
    }
    if (stop.stop_requested()) return;
    try {
      save();
    } catch (const std::exception& e) {
      // Tried again at every interval; said once.
      MutexLock lock(mutex_);
      if (!std::exchange(failing_, true)) message_ = std::string("the map is not saved: ") + e.what();
    }
  }
}

bool MapSaver::save() {
  const MapCopy copy = copy_();
  if (copy.map.empty()) return false;
  MapDocument document;
  document.map = copy.map;
  document.calibration = options_.calibration;
  document.name = options_.name;
  {
    MutexLock lock(mutex_);
    if (extras_.map_version == copy.map_version) {
      // The world may have moved since the window looked at it.
      const SimilarityTransform copy_from_theirs = copy.world_from_first * extras_.world_from_first.inverse();
      document.content = extras_.content;
      for (ContentItem& item : document.content) item.world_from_item = copy_from_theirs * item.world_from_item;
      document.games = extras_.games;
      document.scale_is_known = extras_.scale_is_known;
    }
  }
  const std::uint64_t hash = hash_of(document);

  bool another = false;
  if (!target_ || target_->map_version != copy.map_version) {
    // Another map than the file's never takes its place.
    const bool into_given = !target_ && (options_.continues || !std::filesystem::exists(options_.path));
    const std::string path = into_given ? options_.path : next_map_path(options_.path);
    target_ = std::make_unique<Target>(path, options_.program);
    target_->map_version = copy.map_version;
    another = !(into_given && options_.continues);
    MutexLock lock(mutex_);
    path_ = path;
    if (!into_given) message_ = "this is another map: it is kept in " + path;
  }
  if (target_->saved_hash == hash) return false;
  target_->file.save(document, another);
  target_->saved_hash = hash;
  MutexLock lock(mutex_);
  ++saves_;
  if (std::exchange(failing_, false)) message_ = "the map is saved again";
  return true;
}

void MapSaver::finish() {
  thread_.request_stop();
  thread_.join();
  save();
}

std::string MapSaver::take_message() {
  MutexLock lock(mutex_);
  return std::exchange(message_, {});
}

int MapSaver::saves() const {
  MutexLock lock(mutex_);
  return saves_;
}

std::string MapSaver::path() const {
  MutexLock lock(mutex_);
  return path_;
}

MapSaverOptions begin_map_file(const std::string& path, const CameraModel& camera, RunOptions* options) {
  MapSaverOptions out;
  if (path.empty()) return out;
  out.path = path;
  out.program = std::string("parallax ") + PARALLAX_VERSION;
  out.calibration = format_calibration(camera);
  if (std::filesystem::exists(path)) {
    options->initial_map = open_initial_map(path, camera);
    out.name = options->initial_map->name;
    out.continues = true;
    out.extras = {kInitialMapVersion,
                  {},
                  options->initial_map->content,
                  options->initial_map->games,
                  options->initial_map->scale_is_known};
  }
  return out;
}

std::string next_map_path(const std::string& path) {
  const std::filesystem::path whole(path);
  for (int number = 2;; ++number) {
    const std::filesystem::path name =
        whole.parent_path() / (whole.stem().string() + "-" + std::to_string(number) + whole.extension().string());
    if (!std::filesystem::exists(name)) return name.string();
  }
}

std::shared_ptr<const MapDocument> open_initial_map(const std::string& path, const CameraModel& camera) {
  auto document = std::make_shared<MapDocument>(read_map_file(path));
  const CameraModel lens = parse_calibration(document->calibration, path + ": calibration");
  const ImagePyramid& images = document->map.keyframes.begin()->images->pyramid;
  if (images.width() != camera.width() || images.height() != camera.height())
    throw InputError(path + ": found a map of images of " + std::to_string(images.width()) + "x" +
                     std::to_string(images.height()) + ", expected " + std::to_string(camera.width()) + "x" +
                     std::to_string(camera.height()) + " as the camera gives");
  if (format_calibration(lens) != format_calibration(camera))
    throw InputError(path + ": found a map made with another lens, expected the calibration that is used now");
  return document;
}

}  // namespace parallax
