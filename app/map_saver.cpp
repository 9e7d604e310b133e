#include "app/map_saver.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <utility>

#include "app/session_hash.h"
#include "camera/calibration_file.h"
#include "core/check.h"
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
  add(document.name.data(), document.name.size());
  return sum;
}

std::vector<ContentItem> in_world(const MapExtras& extras, const WorldState& world) {
  std::vector<ContentItem> content = extras.content;
  for (ContentItem& item : content)
    item.world_from_item = world.now_from(extras.world, item.position(), item.seen_from) * item.world_from_item;
  return content;
}

void remove_begun(const std::string& path) {
  std::error_code error;
  std::filesystem::remove(path, error);
  std::filesystem::remove(path + "-journal", error);
}

}  // namespace

// The file of one map, and what of it is in there. Opened when it is first written to.
class MapSaver::Target {
 public:
  void save(const MapDocument& document, const std::string& program) {
    if (!file) file = std::make_unique<MapFile>(path, program);
    file->save(document, replaces);
    replaces = false;
  }

  std::string path;
  std::unique_ptr<MapLock> lock;
  std::unique_ptr<MapFile> file;
  bool locked = false, replaces = false;
  std::uint64_t map_version = 0;
  std::optional<std::uint64_t> saved_hash;
};

MapSaver::MapSaver(const MapSaverOptions& options, std::function<MapCopy()> copy)
    : options_(options),
      copy_(std::move(copy)),
      extras_(options.extras),
      name_(options.name),
      merged_from_(options.merged_from) {
  thread_ = std::jthread([this](std::stop_token stop) { run(std::move(stop)); });
}

MapSaver::~MapSaver() = default;

void MapSaver::set_extras(MapExtras extras) {
  MutexLock lock(mutex_);
  if (extras.map_version != awaited_) extras_ = std::move(extras);
}

void MapSaver::content_is_back() {
  MutexLock lock(mutex_);
  awaited_ = 0;
}

void MapSaver::set_name(std::string name) {
  MutexLock lock(mutex_);
  name_ = std::move(name);
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
      MutexLock saving(save_mutex_);
      save();
    } catch (const std::exception& e) {
      // Tried again at every interval; said once.
      MutexLock lock(mutex_);
      if (!std::exchange(failing_, true)) message_ = std::string("the map is not saved: ") + e.what();
    }
  }
}

// Another map than the file's never takes its place: it gets a file of its own.
void MapSaver::begin_file(const MapCopy& copy) {
  auto target = std::make_unique<Target>();
  target->map_version = copy.map_version;
  if (options_.library) {
    MapLibrary::NewMap made = options_.library->new_map();
    target->path = std::move(made.path);
    target->lock = std::move(made.lock);
  } else {
    const bool into_given = !target_ && (options_.continues || !std::filesystem::exists(options_.path));
    target->path = into_given ? options_.path : next_map_path(options_.path);
    target->replaces = !(into_given && options_.continues);
    target->locked = is_locked_map(target->path);
    MutexLock lock(mutex_);
    if (!into_given) message_ = "this is another map: it is kept in " + target->path;
  }
  target_ = std::move(target);
  MutexLock lock(mutex_);
  path_ = target_->path;
  locked_ = target_->locked;
}

// A file that could not be begun leaves nothing behind.
void MapSaver::drop_file() {
  const std::string path = target_->path;
  target_.reset();
  remove_begun(path);
  MutexLock lock(mutex_);
  path_.clear();
}

// Name and what stands on the map, which the caller has copied.
void MapSaver::put_extras(const MapCopy& copy, MapDocument* document) const {
  document->name = name_;
  document->merged_from = merged_from_;
  if (extras_.map_version != copy.map_version) return;
  // The world may have moved since the window looked at it.
  document->content = in_world(extras_, copy.world());
  document->games = extras_.games;
  document->scale_is_known = extras_.scale_is_known;
}

bool MapSaver::save() {
  const MapCopy copy = copy_();
  if (copy.map.empty()) return false;
  MapDocument document;
  document.map = copy.map;
  document.calibration = options_.calibration;
  const bool fresh = !target_ || target_->map_version != copy.map_version;
  {
    MutexLock lock(mutex_);
    if (fresh && options_.library && !path_.empty()) {
      target_.reset();
      path_.clear();  // another map was begun: it has neither file nor name
      name_.clear();
      merged_from_.clear();
      locked_ = false;
    }
    put_extras(copy, &document);
  }
  if (fresh && options_.library && !is_worth_keeping(document)) return false;
  const std::uint64_t hash = hash_of(document);
  if (fresh) begin_file(copy);
  if (target_->locked || target_->saved_hash == hash) return false;
  try {
    target_->save(document, options_.program);
  } catch (const std::exception&) {
    if (fresh && options_.library) drop_file();
    throw;
  }
  target_->saved_hash = hash;
  {
    MutexLock lock(mutex_);
    ++saves_;
    if (std::exchange(failing_, false)) message_ = "the map is saved again";
  }
  if (fresh && options_.library) {
    const auto gone = options_.library->keep_newest_unnamed(options_.unnamed_kept, target_->path);
    MutexLock lock(mutex_);
    if (!gone.empty())
      message_ = "the oldest map without a name went to the trash (" + gone.front() + "): name what is to stay";
  }
  return true;
}

bool MapSaver::change_map(bool keep_present, const std::function<std::optional<MapOnFile>()>& change) {
  PARALLAX_CHECK(options_.library != nullptr, "sessions with a library go over to other maps");
  MutexLock saving(save_mutex_);
  if (keep_present) save();
  std::optional<MapOnFile> next = change();
  if (!next) return false;
  target_.reset();
  if (!next->path.empty()) {
    target_ = std::make_unique<Target>();
    target_->path = next->path;
    target_->lock = std::move(next->lock);
    target_->locked = next->locked;
    target_->map_version = next->map_version;
  }
  MutexLock lock(mutex_);
  path_ = next->path;
  locked_ = next->locked;
  name_.clear();
  merged_from_.clear();
  extras_ = {};
  awaited_ = 0;
  if (next->document) {
    name_ = next->document->name;
    merged_from_ = next->document->merged_from;
    extras_ = {next->map_version, {}, next->document->content, next->document->games, next->document->scale_is_known};
    awaited_ = next->map_version;
  }
  return true;
}

std::string MapSaver::save_now() {
  {
    MutexLock saving(save_mutex_);
    save();
  }
  return path();
}

MapSaver::Present MapSaver::present() const {
  MapCopy copy = copy_();
  Present out;
  out.map_version = copy.map_version;
  out.world_version = copy.world_version;
  out.document.calibration = options_.calibration;
  {
    MutexLock lock(mutex_);
    put_extras(copy, &out.document);
  }
  out.document.map = std::move(copy.map);
  return out;
}

std::string MapSaver::merge_map(const MapDocument& merged, const std::function<std::optional<MergedIn>()>& change) {
  PARALLAX_CHECK(options_.library != nullptr, "sessions with a library merge maps");
  MutexLock saving(save_mutex_);
  save();
  if (!target_ || target_->locked) return "";
  const std::string before = target_->path;
  auto next = std::make_unique<Target>();
  MapLibrary::NewMap made = options_.library->new_map();
  next->path = std::move(made.path);
  next->lock = std::move(made.lock);
  next->map_version = target_->map_version;
  std::optional<MergedIn> in;
  try {
    next->save(merged, options_.program);
    in = change();
  } catch (...) {
    next->file.reset();
    remove_begun(next->path);
    throw;
  }
  if (!in) {
    next->file.reset();
    remove_begun(next->path);
    return "";
  }
  target_ = std::move(next);
  take_over(merged, *in);
  try {
    save();
  } catch (const std::exception& e) {
    MutexLock lock(mutex_);  // what was merged is in the file; what has come since is tried again
    if (!std::exchange(failing_, true)) message_ = std::string("the map is not saved: ") + e.what();
  }
  return before;
}

// What belongs to the present map after a merge.
void MapSaver::take_over(const MapDocument& merged, const MergedIn& in) {
  MutexLock lock(mutex_);
  path_ = target_->path;
  if (name_.empty()) name_ = merged.name;
  merged_from_ = merged.merged_from;
  if (extras_.map_version != target_->map_version) extras_ = {};
  extras_.content = in_world(extras_, in.world);
  extras_.content.insert(extras_.content.end(), in.content.begin(), in.content.end());
  extras_.games.insert(in.games.begin(), in.games.end());
  extras_.scale_is_known = extras_.scale_is_known || in.scale_is_known;
  extras_.world = {in.world.world_from_first, in.world.warps.size()};
  extras_.map_version = awaited_ = target_->map_version;
}

void MapSaver::finish() {
  thread_.request_stop();
  thread_.join();
  MutexLock saving(save_mutex_);
  save();
}

void MapSaver::set_locked(bool locked) {
  MutexLock saving(save_mutex_);
  if (locked) save();
  if (!target_) throw RunError("the map has no file yet");
  MapLibrary::set_locked(target_->path, locked);
  target_->locked = locked;
  MutexLock lock(mutex_);
  locked_ = locked;
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

std::string MapSaver::name() const {
  MutexLock lock(mutex_);
  return name_;
}

bool MapSaver::is_locked() const {
  MutexLock lock(mutex_);
  return locked_;
}

bool is_worth_keeping(const MapDocument& document) {
  // A map that was gone on with, or on which something was put.
  constexpr int kKeyframes = 4;
  constexpr std::chrono::seconds kSpan{3};
  if (!document.name.empty() || !document.content.empty() || !document.games.empty()) return true;
  Timestamp first = Timestamp::max(), last = Timestamp::min();
  for (const Keyframe& keyframe : document.map.keyframes) {
    first = std::min(first, keyframe.time);
    last = std::max(last, keyframe.time);
  }
  return document.map.keyframes.size() >= kKeyframes && last - first >= kSpan;
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
    out.merged_from = options->initial_map->merged_from;
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
