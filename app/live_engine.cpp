#include "app/live_engine.h"

#include <utility>

#include "app/place_vocabulary.h"
#include "app/run_settings.h"
#include "app/session_recorder.h"
#include "camera/calibration_file.h"
#include "core/error.h"
#include "core/file_io.h"

namespace parallax {

namespace {

constexpr const char* kSyntheticDesk = "synthetic:desk";

}  // namespace

std::pair<LiveSource, std::string> open_wanted_source(const LiveOptions& options, const UserSettings& settings,
                                                      const ProgramState& state, LiveSourceOptions source_options) {
  if (options.width > 0) {
    source_options.camera.width = options.width;
    source_options.camera.height = options.height;
  } else if (settings.width > 0) {
    source_options.camera.width = settings.width;
    source_options.camera.height = settings.height;
  }
  source_options.camera.tracking_profile = settings.tracking_profile;
  const auto open = [&](const std::string& name) {
    return open_live_source(name, options.calibration, source_options);
  };
  if (!options.camera.empty()) return {open(options.camera), ""};
  if (!settings.camera.empty()) return {open(settings.camera), ""};
  const std::vector<CameraInfo> cameras = list_cameras();
  std::string problem;
  // The last one first, then in the order they were found.
  for (const bool last : {true, false}) {
    for (const CameraInfo& camera : cameras) {
      if ((camera.source == state.camera) != last) continue;
      if (!camera.problem.empty()) {
        if (problem.empty()) problem = camera.problem;
        continue;
      }
      try {
        return {open(camera.source), ""};
      } catch (const InputError& e) {
        if (problem.empty()) problem = e.what();
      }
    }
  }
  const std::string remark = problem.empty() ? "no camera found: this is the built-in synthetic desk"
                                             : problem + ": this is the built-in synthetic desk";
  return {open(kSyntheticDesk), remark};
}

std::unique_ptr<SessionRecorder> open_recorder(const std::string& path, const LiveSource& source,
                                               const MapSaverOptions& saving) {
  RecordingDescription description;
  description.source = source.name;
  if (saving.continues) description.map = read_text_file(saving.path);
  description.camera["identity"] = source.identity;
  if (source.camera != nullptr)
    for (const CameraControl& control : source.camera->controls())
      description.camera[control.name] = std::to_string(control.value);
  return std::make_unique<SessionRecorder>(path, description);
}

std::shared_ptr<const MapLibrary> open_live_library(const LiveOptions& options, const UserSettings& settings) {
  if (!options.map.empty()) return nullptr;
  const bool own = options.maps.empty() && settings.keep_maps && !options.headless;
  const std::string folder = own ? map_library_folder() : options.maps;
  if (folder.empty()) return nullptr;
  check_map_folder(folder);
  auto library = std::make_shared<const MapLibrary>(folder);
  library->empty_old_trash();
  return library;
}

MapSaverOptions begin_library(const std::shared_ptr<const MapLibrary>& library, const CameraModel& lens) {
  MapSaverOptions saving;
  saving.library = library;
  saving.program = std::string("parallax ") + PARALLAX_VERSION;
  saving.calibration = format_calibration(lens);
  return saving;
}

LiveEngine::LiveEngine(const LiveOptions& options, const UserSettings& settings, const ProgramState& state)
    : options_(options), settings_(settings), state_(state) {
  run_options_.manual_initialisation = options.init != "auto";
  run_options_.kept_frames = kLiveKeptFrames;
  run_options_.keep_trajectory = !options.trajectory.empty();
  run_options_.merge_maps = settings.merge_maps && !options.no_merge;
  apply_settings(options.settings, &run_options_);
  library_ = open_live_library(options, settings);
}

LiveEngine::~LiveEngine() = default;

void LiveEngine::open() {
  opening_ = std::async(std::launch::async, [this] {
    LiveSourceOptions source_options;
    source_options.camera.colour = true;
    return open_wanted_source(options_, settings_, state_, source_options);
  });
}

bool LiveEngine::poll_opened() {
  if (!opening_.valid() || opening_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return false;
  auto [source, remark] = opening_.get();
  opening_remark_ = std::move(remark);
  feed_ = std::make_unique<LiveFeed>(std::move(source));
  return true;
}

void LiveEngine::wait_opening(std::chrono::milliseconds at_most) const {
  if (opening_.valid()) opening_.wait_for(at_most);
}

void LiveEngine::begin(const CameraModel& lens, bool estimated, const std::string& record_path) {
  try {
    end();
  } catch (const std::exception&) {
    // What the session before failed of was told when it happened (LiveSession::take_failure).
  }
  run_options_.initial_map.reset();
  MapSaverOptions saving = begin_library(library_, lens);
  try {
    if (!library_) saving = begin_map_file(options_.map, lens, &run_options_);
  } catch (const InputError&) {
    // A map of the lens before does not fit a new one: it stays, and the next goes beside it.
    if (!begun_) throw;
    saving = begin_map_file(next_map_path(options_.map), lens, &run_options_);
  }
  begun_ = true;
  std::unique_ptr<SessionRecorder> recorder;
  if (!record_path.empty()) recorder = open_recorder(record_path, source(), saving);
  lens_ = lens;
  estimated_ = estimated;
  record_path_ = record_path;
  const std::shared_ptr<LiveCamera> tap = feed_->tap();
  session_ = std::make_unique<LiveSession>(tap, lens, run_options_, std::move(recorder), [tap] { tap->stop(); });
  if (!saving.path.empty() || library_) {
    saver_ = std::make_unique<MapSaver>(saving, [session = session_.get()] { return session->copy_map_and_world(); });
  }
  if (library_ && record_path.empty()) begin_maps();
}

void LiveEngine::begin_maps() {
  const SessionMapsOptions wanted = session_maps_options(run_options_);
  LiveSession* session = session_.get();
  try {
    maps_ =
        std::make_unique<SessionMaps>(lens_, wanted, library_, place_vocabulary(), saver_.get(),
                                      SessionPort{&session->inbox(), {}, [session] { session->press_initialise(); }});
  } catch (const InputError& e) {
    maps_problem_ = std::string("places are not known again: ") + e.what();
  }
}

void LiveEngine::end() {
  maps_.reset();
  const std::unique_ptr<LiveSession> session = std::move(session_);
  const std::unique_ptr<MapSaver> saver = std::move(saver_);
  if (!session) return;
  // Whatever the session failed of, its map is kept.
  std::exception_ptr failure;
  try {
    last_result_ = session->stop();
  } catch (...) {
    failure = std::current_exception();
  }
  if (saver) saver->finish();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace parallax
