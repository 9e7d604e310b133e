#include "app/map_finder.h"

#include <algorithm>
#include <utility>

#include "camera/calibration_file.h"
#include "core/error.h"
#include "core/log.h"
#include "map/map_file.h"

namespace parallax {

MapFinder::MapFinder(const CameraModel& camera, const TrackerOptions& tracker,
                     std::shared_ptr<const Vocabulary> vocabulary, const MapFinderOptions& options)
    : camera_(camera),
      tracker_options_(tracker),
      options_(options),
      memory_(std::move(vocabulary)),
      features_(camera.width(), camera.height(), tracker) {}

void MapFinder::forget(const std::string& path) {
  const auto known = known_.find(path);
  if (known == known_.end()) return;
  for (const int entry : known->second.entries) {
    memory_.erase(entry);
    row_.erase(entry);
  }
  known_.erase(known);
  loaded_.remove_if([&](const Loaded& loaded) { return loaded.path == path; });
  if (candidate_ && candidate_->path == path) candidate_.reset();
}

void MapFinder::set_files(const std::vector<std::string>& paths) {
  const std::set<std::string> there(paths.begin(), paths.end());
  std::vector<std::string> gone;
  for (const auto& [path, known] : known_)
    if (!there.contains(path) || map_stamp(path) != known.stamp) gone.push_back(path);
  for (const std::string& path : gone) forget(path);
  to_learn_.clear();
  for (const std::string& path : there)
    if (!known_.contains(path)) to_learn_.push_back(path);
  std::reverse(to_learn_.begin(), to_learn_.end());
}

// Null when it is not a whole map of this lens.
std::shared_ptr<const MapDocument> MapFinder::read(const std::string& path) const {
  try {
    auto document = std::make_shared<MapDocument>(read_map_file(path));
    const ImagePyramid& images = document->map.keyframes.begin()->images->pyramid;
    if (images.width() != camera_.width() || images.height() != camera_.height()) return nullptr;
    const CameraModel lens = parse_calibration(document->calibration, path + ": calibration");
    if (format_calibration(lens) != format_calibration(camera_)) return nullptr;
    return document;
  } catch (const std::exception& e) {
    log::debug("not a map to look for: ", e.what());
    return nullptr;
  }
}

bool MapFinder::learn_one() {
  if (to_learn_.empty()) return false;
  const std::string path = to_learn_.back();
  to_learn_.pop_back();
  Known known;
  known.stamp = map_stamp(path);
  const LibraryMap described = MapLibrary("").describe(path);
  const auto document = described.fits(camera_) ? read(path) : nullptr;
  if (document) {
    for (const Keyframe& keyframe : document->map.keyframes) {
      memory_.add(next_entry_, memory_.bag_of(keyframe.images->pyramid));
      row_[next_entry_] = {path, keyframe.id};
      known.entries.push_back(next_entry_++);
    }
  }
  known_[path] = std::move(known);
  return true;
}

int MapFinder::maps() const {
  return static_cast<int>(
      std::count_if(known_.begin(), known_.end(), [](const auto& k) { return !k.second.entries.empty(); }));
}

MapFinder::Loaded* MapFinder::load(const std::string& path) {
  const auto found =
      std::find_if(loaded_.begin(), loaded_.end(), [&](const Loaded& loaded) { return loaded.path == path; });
  if (found != loaded_.end() && found->stamp == map_stamp(path)) {
    loaded_.splice(loaded_.begin(), loaded_, found);
    return &loaded_.front();
  }
  if (found != loaded_.end()) loaded_.erase(found);
  Loaded made;
  made.path = path;
  made.stamp = map_stamp(path);
  made.document = read(path);
  if (!made.document) return nullptr;
  made.snapshot = make_snapshot(made.document->map);
  made.relocaliser = std::make_unique<Relocaliser>(camera_, tracker_options_);
  made.two_stage = std::make_unique<TwoStageTracker>(camera_, tracker_options_);
  loaded_.push_front(std::move(made));
  if (static_cast<int>(loaded_.size()) > options_.maps_in_memory) loaded_.pop_back();
  return &loaded_.front();
}

std::optional<RigidTransform> MapFinder::verify(Loaded* map, const FrameImages& images,
                                                const RigidTransform& hint) const {
  TwoStageResult result;
  if (!map->relocaliser->recover(*map->snapshot, images, hint, map->two_stage.get(), &result)) return std::nullopt;
  return result.camera_from_world;
}

std::optional<FoundMap> MapFinder::look(const Frame& frame, const std::set<std::string>& except) {
  const auto images = features_.compute(frame.grey);
  if (candidate_ && candidate_->frame != frame.index && !except.contains(candidate_->path)) {
    Loaded* map = load(candidate_->path);
    const auto pose = map ? verify(map, *images, candidate_->camera_from_world) : std::nullopt;
    if (pose) return FoundMap{map->path, map->stamp, map->document, *pose};
  }
  candidate_.reset();
  const auto skip = [&](int entry) { return except.contains(row_.at(entry).first); };
  const std::vector<PlaceMatch> alike = memory_.query(memory_.bag_of(images->pyramid), options_.keyframes_asked, skip);
  std::set<std::string> tried;
  for (const PlaceMatch& match : alike) {
    const auto& [path, keyframe] = row_.at(match.entry);
    if (static_cast<int>(tried.size()) >= options_.maps_verified) break;
    if (!tried.insert(path).second) continue;
    Loaded* map = load(path);
    const Keyframe* seen_from = map ? map->document->map.keyframes.find(keyframe) : nullptr;
    if (seen_from == nullptr) continue;
    if (const auto pose = verify(map, *images, seen_from->camera_from_world)) {
      candidate_ = Candidate{path, frame.index, *pose};
      break;
    }
  }
  return std::nullopt;
}

}  // namespace parallax
