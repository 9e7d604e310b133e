// Two maps of one place that meet: the stored maps are asked for what the present one shows while the camera is
// tracked; the one that knows it is merged into the present map in the background (mapper/map_merge), the mapper takes
// the result, and both files go to the trash, so that it can be undone.
#include <filesystem>
#include <utility>

#include "app/map_merge_record.h"
#include "app/session_maps.h"
#include "core/error.h"
#include "core/log.h"
#include "map/map_file.h"

namespace parallax {
namespace {

// While the camera is tracked there is time to learn what lies in the folder.
constexpr std::chrono::seconds kIdleRefresh{10};

std::string map_title(const MapDocument& document, const std::string& path) {
  return document.name.empty() ? MapLibrary("").describe(path).title : document.name;
}

// What the other map brings: things and games that the present one does not have. Identifiers of its keyframes are
// those of the merged map.
MapDocument brought_along(const MapDocument& present, const MapDocument& merged) {
  MapDocument out;
  const auto first = merged.content.begin() + static_cast<std::ptrdiff_t>(present.content.size());
  out.content.assign(first, merged.content.end());
  for (const auto& [name, state] : merged.games)
    if (!present.games.contains(name)) out.games[name] = state;
  out.name = merged.name;
  out.scale_is_known = merged.scale_is_known;
  return out;
}

}  // namespace

// One look every second or so, and one at the next frame where that found a map.
void SessionMaps::meet(const Seen& seen) {
  const bool tells = seen.quality == TrackingQuality::good && seen.map_keyframes >= options_.meeting_keyframes;
  if (options_.threaded) {
    if (SteadyClock::now() - refreshed_ > kIdleRefresh) refresh();
    if (finder_.learn_one()) return;
  }
  if (!options_.merge || !tells || saver_->is_locked()) return finder_.forget_candidate();
  const bool asked_again = finder_.has_candidate();
  if (!asked_again && met_ && seen.frame.time - *met_ < options_.meeting_interval) return;
  met_ = seen.frame.time;
  if (meeting_version_ != seen.map_version) {
    meeting_version_ = seen.map_version;
    meet_again_at_.clear();
  }
  if (!options_.threaded && !asked_again) {
    refresh();
    while (finder_.learn_one()) {
    }
  }
  if (finder_.maps() == 0) return;
  const auto found = finder_.look(seen.frame, not_to_meet(seen));
  if (asked_again) finder_.forget_candidate();
  if (found) merge_with(*found, seen);
}

std::set<std::string> SessionMaps::not_to_meet(const Seen& seen) const {
  const std::string present = saver_->path();
  std::set<std::string> out{present};
  for (const auto& [path, keyframes] : meet_again_at_)
    if (seen.map_keyframes < keyframes) out.insert(path);
  for (const std::string& path : library_->paths())
    if (is_locked_map(path) || (!present.empty() && are_kept_apart(*library_, {present, path}))) out.insert(path);
  return out;
}

// The token says when it is to stop; nothing when the session ends.
std::optional<std::stop_token> SessionMaps::begin_merging() {
  MutexLock lock(mutex_);
  if (ending_) return std::nullopt;
  merging_.emplace();
  return merging_->get_token();
}

void SessionMaps::merge_with(const FoundMap& found, const Seen& seen) {
  const auto later = [&] { meet_again_at_[found.path] = seen.map_keyframes + options_.meeting_again_keyframes; };
  const auto lock = MapLock::try_take(found.path);
  if (!lock || map_stamp(found.path) != found.stamp) return;  // another program has it, or has changed it
  const std::string own_path = saver_->save_now();
  if (own_path.empty() || are_kept_apart(*library_, {own_path, found.path})) return later();
  const MapSaver::Present present = saver_->present();
  if (present.map_version != seen.map_version) return;
  const std::string title = map_title(*found.document, found.path);

  MapMergeOptions wanted;
  wanted.mapper = options_.mapper;
  const auto began = SteadyClock::now();
  const auto stop = begin_merging();
  if (!stop) return;
  MapMergeResult result =
      merge_maps(present.document, *found.document, camera_, vocabulary_, wanted, Interruption(*stop));
  {
    MutexLock guard(mutex_);
    merging_.reset();
  }
  log::debug("merging with ", found.path, ": ", result.merged ? "done" : result.reason, ", ", milliseconds_since(began),
             " ms");
  if (!result.merged) {
    if (!stop->stop_requested()) later();
    return;
  }
  if (is_locked_map(found.path)) return;
  MapDocument& merged = result.document;
  merged.merged_from = merge_origin(own_path, present.document);
  for (std::string& line : merge_origin(found.path, *found.document)) merged.merged_from.push_back(std::move(line));
  MapNews news;
  const std::string before = saver_->merge_map(merged, [&] { return send_merged(present, merged, &news); });
  if (before.empty()) {
    meet_again_at_[found.path] = seen.map_keyframes + 1;
    return;
  }
  {
    MutexLock guard(mutex_);
    ++merges_;
  }
  news.text = "merged with " + title;
  tell(std::move(news));
  note_merge(*library_, saver_->path(), {before, found.path});
  refresh();
}

// The mapper takes the merged map; nothing when it refuses.
std::optional<MergedIn> SessionMaps::send_merged(const MapSaver::Present& present, const MapDocument& merged,
                                                 MapNews* news) {
  MergeMapRequest request;
  request.base = std::make_shared<const Map>(present.document.map);
  request.merged = merged.map;
  request.map_version = present.map_version;
  request.world_version = present.world_version;
  auto reply = request.reply.get_future();
  if (!send(std::move(request))) return std::nullopt;
  const auto taken = answer(std::move(reply));
  if (!taken || !taken->ok) {
    log::debug("the merged map is not taken: ", taken ? taken->reason : "no answer");
    return std::nullopt;
  }
  auto brought = std::make_shared<MapDocument>(brought_along(present.document, merged));
  for (ContentItem& item : brought->content)
    if (item.seen_from.index >= present.document.map.keyframes.capacity())
      item.seen_from.index += taken->keyframe_shift;
  news->merged = true;
  news->map_version = present.map_version;
  news->world_version = taken->world_version;
  news->world = taken->world;
  news->document = brought;
  return MergedIn{taken->world, brought->content, brought->games, merged.scale_is_known};
}

// The two maps are back as they were. When the session is on the merged one it goes on with the one that it was on
// before, and finds itself there.
void SessionMaps::undo_merge_of(const std::string& path) {
  MapNews news;
  if (path != saver_->path()) {
    undo_merge(*library_, path);
    news.text = "two maps again: the merged one is in the trash";
    return tell(std::move(news));
  }
  if (saver_->is_locked()) throw RunError("this map is locked");
  const auto pair = merged_pair(path);
  if (!pair) throw RunError("what this map was merged from is no longer there");
  const auto document = std::make_shared<const MapDocument>(read_map_file(pair->base));
  std::uint64_t present = 0;
  {
    MutexLock lock(mutex_);
    if (newest_) present = newest_->map_version;
  }
  saver_->change_map(true, [&]() -> std::optional<MapOnFile> {
    LoadMapRequest request{document->map, true, present, {}};
    auto reply = request.reply.get_future();
    if (!send(std::move(request))) return std::nullopt;
    const auto loaded = answer(std::move(reply));
    if (!loaded || !loaded->ok) return std::nullopt;
    const UndoneMerge undone = undo_merge(*library_, path, true);
    news.document = document;
    news.map_version = loaded->map_version;
    auto lock = MapLock::try_take(undone.pair.base);
    return MapOnFile{undone.pair.base, std::move(lock), false, loaded->map_version, document};
  });
  if (!news.document) throw RunError("the merge is not undone: the map has changed meanwhile");
  refresh();
  news.text = "two maps again: this is " + map_title(*document, saver_->path());
  tell(std::move(news));
}

}  // namespace parallax
