#include "app/session_maps.h"

#include <sys/resource.h>
#include <unistd.h>

#include <filesystem>
#include <utility>

#include "app/place_vocabulary.h"
#include "camera/calibration_file.h"
#include "core/error.h"
#include "map/map_file.h"

namespace parallax {
namespace {

// The folder is looked through again so often while the camera is lost.
constexpr std::chrono::seconds kFolderRefresh{2};
constexpr int kFinderNice = 5;

std::string title_of(const MapDocument& document, const std::string& path) {
  return document.name.empty() ? MapLibrary("").describe(path).title : document.name;
}

}  // namespace

SessionMapsOptions session_maps_options(const RunOptions& options) {
  SessionMapsOptions out;
  out.automatic = options.automatic_initialisation();
  out.merge = options.merge_maps;
  out.tracker = options.tracker;
  out.mapper = options.mapper;
  return out;
}

SessionMaps::SessionMaps(const CameraModel& camera, const SessionMapsOptions& options,
                         std::shared_ptr<const MapLibrary> library, std::shared_ptr<const Vocabulary> vocabulary,
                         MapSaver* saver, SessionPort port)
    : camera_(camera),
      options_(options),
      vocabulary_(std::move(vocabulary)),
      library_(std::move(library)),
      saver_(saver),
      port_(std::move(port)),
      finder_(camera, options.tracker, vocabulary_) {
  if (options_.threaded) thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

SessionMaps::~SessionMaps() {
  MutexLock lock(mutex_);
  ending_ = true;
  if (merging_) merging_->request_stop();
}

void SessionMaps::frame(const Frame& frame, const TrackingResult& tracked) {
  Seen seen{frame, tracked.state, tracked.quality, tracked.map_version, tracked.map_keyframes};
  seen.frame.colour.release();
  {
    MutexLock lock(mutex_);
    newest_ = seen;
    unseen_ = true;
    if (merging_ && tracked.state == TrackingState::lost) merging_->request_stop();  // the place is looked for
  }
  if (options_.threaded) return wake_.notify_one();
  std::vector<Wish> wishes;
  {
    MutexLock lock(mutex_);
    wishes.swap(wishes_);
  }
  try {
    for (const Wish& wish : wishes) fulfil(wish);
    while (step(seen)) {
    }
  } catch (const std::exception& e) {
    failed(e.what());
  }
}

void SessionMaps::run(const std::stop_token& stop) {
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kFinderNice);
  while (!stop.stop_requested()) {
    std::optional<Seen> seen;
    std::vector<Wish> wishes;
    {
      MutexLock lock(mutex_);
      wake_.wait(mutex_, stop, [this]() PARALLAX_REQUIRES(mutex_) { return unseen_ || !wishes_.empty(); });
      if (std::exchange(unseen_, false)) seen = newest_;
      wishes.swap(wishes_);
    }
    try {
      for (const Wish& wish : wishes) fulfil(wish);
      bool more = seen.has_value();
      while (more && !stop.stop_requested()) {
        more = step(*seen);
        MutexLock lock(mutex_);
        more = more && !unseen_ && wishes_.empty();  // the newest frame is worth more
      }
    } catch (const std::exception& e) {
      failed(e.what());
    }
  }
}

void SessionMaps::wish(Wish wish) {
  {
    MutexLock lock(mutex_);
    wishes_.push_back(std::move(wish));
    if (merging_) merging_->request_stop();
  }
  wake_.notify_one();
}

void SessionMaps::begin_new_map() { wish({Wish::Kind::new_map, ""}); }
void SessionMaps::forget_map() { wish({Wish::Kind::forget, ""}); }
void SessionMaps::go_to(std::string path) { wish({Wish::Kind::go_to, std::move(path)}); }
void SessionMaps::separate(std::string path) { wish({Wish::Kind::separate, std::move(path)}); }
void SessionMaps::set_locked(bool locked) { wish({locked ? Wish::Kind::lock : Wish::Kind::unlock, ""}); }

std::vector<MapNews> SessionMaps::take_news() {
  MutexLock lock(mutex_);
  return std::exchange(news_, {});
}

int SessionMaps::switches() const {
  MutexLock lock(mutex_);
  return switches_;
}

int SessionMaps::merges() const {
  MutexLock lock(mutex_);
  return merges_;
}

void SessionMaps::tell(MapNews news) {
  MutexLock lock(mutex_);
  if (newest_) news.frame = newest_->frame.index;
  news_.push_back(std::move(news));
}

// Said once, however often it is tried again.
void SessionMaps::failed(const std::string& text) {
  if (std::exchange(last_failure_, text) == text) return;
  MapNews news;
  news.text = text;
  news.problem = true;
  tell(std::move(news));
}

bool SessionMaps::is_lost(std::uint64_t map_version) const {
  MutexLock lock(mutex_);
  return newest_ && newest_->map_version == map_version &&
         (newest_->state == TrackingState::lost || newest_->map_keyframes == 0);
}

bool SessionMaps::send(MapperMessage message) {
  if (port_.inbox->closed()) return false;
  const bool sent = port_.inbox->push(std::move(message));
  if (sent && port_.work) port_.work();
  return sent;
}

bool SessionMaps::go_over(const std::string& path, const MapStamp& stamp,
                          const std::shared_ptr<const MapDocument>& document, std::uint64_t instead_of,
                          bool only_while_lost) {
  auto lock = MapLock::try_take(path);
  if (!lock || map_stamp(path) != stamp) return false;  // another program has it, or has changed it
  const bool locked = is_locked_map(path);
  std::uint64_t version = 0;
  const bool changed = saver_->change_map(true, [&]() -> std::optional<MapOnFile> {
    if (only_while_lost && !is_lost(instead_of)) return std::nullopt;
    LoadMapRequest request{document->map, !locked, instead_of, {}};
    auto reply = request.reply.get_future();
    if (!send(std::move(request))) return std::nullopt;
    const auto loaded = answer(std::move(reply));
    if (!loaded || !loaded->ok) return std::nullopt;
    version = loaded->map_version;
    return MapOnFile{path, std::move(lock), locked, version, document};
  });
  if (!changed) return false;
  {
    MutexLock guard(mutex_);
    ++switches_;
  }
  MapNews news;
  news.text = "this is " + title_of(*document, path) + (locked ? " (locked: what changes is not kept)" : "");
  news.map_version = version;
  news.document = document;
  tell(std::move(news));
  return true;
}

bool SessionMaps::new_map(bool keep_present) {
  return saver_->change_map(keep_present, [&]() -> std::optional<MapOnFile> {
    ResetRequest request;
    auto done = request.done.get_future();
    if (!send(std::move(request))) return std::nullopt;
    if (!is_answered(done)) return std::nullopt;
    return MapOnFile{};
  });
}

void SessionMaps::fulfil(const Wish& wish) {
  MapNews news;
  switch (wish.kind) {
    case Wish::Kind::new_map: {
      const bool kept = !saver_->path().empty();
      if (!new_map(true)) return;
      news.text = kept ? "a new map begins; the other one is kept" : "a new map begins";
      if (port_.press_key) port_.press_key();
      return tell(std::move(news));
    }
    case Wish::Kind::forget: {
      const std::string path = saver_->path();
      const bool locked = saver_->is_locked();
      if (!new_map(false)) return;
      news.text = "the map is forgotten";
      if (!path.empty()) ignored_.insert(path);
      if (!path.empty() && locked) news.text = "the map is left; it is locked and stays in the list";
      if (!path.empty() && !locked && std::filesystem::exists(path)) {
        news.trashed = library_->remove(path);
        news.text = "the map is forgotten: the list of maps brings it back";
      }
      return tell(std::move(news));
    }
    case Wish::Kind::go_to: {
      if (wish.path == saver_->path()) return;
      const MapStamp stamp = map_stamp(wish.path);
      const auto document = std::make_shared<const MapDocument>(read_map_file(wish.path));
      std::uint64_t present = 0;
      {
        MutexLock lock(mutex_);
        if (newest_) present = newest_->map_version;
      }
      ignored_.erase(wish.path);
      if (!go_over(wish.path, stamp, document, present, false))
        throw RunError(title_of(*document, wish.path) + ": another program uses this map now");
      return;
    }
    case Wish::Kind::lock:
    case Wish::Kind::unlock: {
      const bool locked = wish.kind == Wish::Kind::lock;
      saver_->set_locked(locked);
      AdaptRequest request;
      request.adapt = !locked;
      send(request);
      return;
    }
    case Wish::Kind::separate:
      return undo_merge_of(wish.path);
  }
}

void SessionMaps::refresh() {
  refreshed_ = SteadyClock::now();
  asked_except_ = saver_->path();
  std::vector<std::string> paths = library_->paths();
  std::erase_if(paths, [&](const std::string& path) { return ignored_.contains(path) || path == asked_except_; });
  finder_.set_files(paths);
}

bool SessionMaps::step(const Seen& seen) {
  const bool without_map = seen.map_keyframes == 0, lost = seen.state == TrackingState::lost;
  if (!lost && !without_map) {
    lost_since_.reset();
    meet(seen);
    return false;
  }
  if (!lost_since_) {
    lost_since_ = seen.frame.time;
    looks_ = 0;
    finder_.forget_candidate();
    refresh();
  } else if (asked_except_ != saver_->path() ||
             (options_.threaded && SteadyClock::now() - refreshed_ > kFolderRefresh)) {
    refresh();
  }
  if (finder_.learn_one()) return true;
  // Who has pressed the key is making a map.
  if (!options_.automatic && without_map && seen.state != TrackingState::waiting) return false;
  if (finder_.maps() > 0) {
    const auto found = finder_.look(seen.frame, saver_->path());
    if (found && go_over(found->path, found->stamp, found->document, seen.map_version, true)) {
      lost_since_.reset();
      return false;
    }
  }
  ++looks_;
  if (options_.automatic && lost && looks_ >= options_.new_map_looks &&
      seen.frame.time - *lost_since_ >= options_.new_map_after && is_lost(seen.map_version)) {
    if (!new_map(true)) return false;
    lost_since_.reset();
    MapNews news;
    news.text = "no map knows this place: a new one begins";
    tell(std::move(news));
  }
  return false;
}

RunMaps::RunMaps(const CameraModel& camera, const RunOptions& options, std::shared_ptr<const MapLibrary> library,
                 const SessionMapsOptions& wanted)
    : camera_(camera), wanted_(wanted), library_(std::move(library)) {
  const SessionMapsOptions asked = session_maps_options(options);
  wanted_.automatic = asked.automatic;
  wanted_.merge = wanted.merge && asked.merge;
  wanted_.tracker = asked.tracker;
  wanted_.mapper = asked.mapper;
}

RunMaps::~RunMaps() = default;

void RunMaps::begin(SharedMap* map, MapperInbox* inbox, std::function<void()> work) {
  const bool threaded = !work;
  MapSaverOptions saving;
  saving.library = library_;
  saving.program = std::string("parallax ") + PARALLAX_VERSION;
  saving.calibration = format_calibration(camera_);
  // In lockstep only where the frames say so.
  if (!threaded) saving.interval = std::chrono::hours(24 * 365);
  saver_ = std::make_unique<MapSaver>(saving, [map] { return map->copy(); });
  wanted_.threaded = threaded;
  maps_ = std::make_unique<SessionMaps>(camera_, wanted_, library_, place_vocabulary(), saver_.get(),
                                        SessionPort{inbox, std::move(work), {}});
}

void RunMaps::frame(const Frame& frame, const TrackingResult& tracked) { maps_->frame(frame, tracked); }

void RunMaps::end() {
  if (!maps_) return;
  switches_ = maps_->switches();
  merges_ = maps_->merges();
  news_ = maps_->take_news();
  maps_.reset();
}

void RunMaps::finish() {
  const std::unique_ptr<MapSaver> saver = std::move(saver_);
  if (!saver) return;
  saver->finish();
  const std::string message = saver->take_message();
  if (message.empty()) return;
  MapNews news;
  news.text = message;
  news_.push_back(std::move(news));
}

}  // namespace parallax
