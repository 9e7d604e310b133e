// Several maps in one session (after PTAMM): while the camera is lost, or before there is a map, the stored maps are
// asked for the place; the one that knows it takes the place of the present map, which is saved to its own file first.
// While the camera is tracked they are asked too, now and then: a map that knows what the present one shows is merged
// into it. Begins new maps, and forgets maps, for the user.
//
// Has a thread of its own, of low priority, which waits for disk and mapper; or none, and works within frame(). Public
// members are safe from any thread, but for frame() without a thread.
#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "app/map_finder.h"
#include "app/map_saver.h"
#include "app/run_session.h"
#include "core/mutex.h"
#include "map/messages.h"
#include "mapper/map_merge.h"

namespace parallax {

// What a session offers to who changes its map. Everything outlives SessionMaps.
struct SessionPort {
  MapperInbox* inbox = nullptr;
  std::function<void()> work;       // lets the mapper take what was sent; empty: it has a thread
  std::function<void()> press_key;  // the initialisation key; may be empty
};

struct SessionMapsOptions {
  bool automatic = true;  // the session initialises by itself; so are new maps begun where no map knows the place
  bool threaded = true;
  // Where no map knows the place a new one is begun after so long, by the frames' time, and so many looks.
  std::chrono::milliseconds new_map_after{4000};
  int new_map_looks = 20;
  // Maps that meet are merged. The others are asked so often, by the frames' time, once the present map has so many
  // keyframes; one that could not be merged is asked again when it has so many more.
  bool merge = true;
  std::chrono::milliseconds meeting_interval{1000};
  int meeting_keyframes = 5;
  int meeting_again_keyframes = 4;
  TrackerOptions tracker;
  MapperOptions mapper;
};
// As the options of a session say.
SessionMapsOptions session_maps_options(const RunOptions& options);

// What happened, for the user. With a document: the map of this version was stored, and what was on it is to come back;
// or it was merged with another, and what was on that one is to come to it (no map is in the document then, and what it
// holds is in the given world).
struct MapNews {
  std::string text;
  bool problem = false;
  std::uint64_t map_version = 0;
  std::shared_ptr<const MapDocument> document;
  std::string trashed;  // a map that was forgotten: where it lies
  int frame = -1;       // the newest then
  bool merged = false;
  std::uint64_t world_version = 0;
  WorldState world;
};

class SessionMaps {
 public:
  // `saver` keeps the maps of the session in the same library.
  SessionMaps(const CameraModel& camera, const SessionMapsOptions& options, std::shared_ptr<const MapLibrary> library,
              std::shared_ptr<const Vocabulary> vocabulary, MapSaver* saver, SessionPort port);
  ~SessionMaps();
  SessionMaps(const SessionMaps&) = delete;
  SessionMaps& operator=(const SessionMaps&) = delete;

  // The newest frame, tracked. Its images are shared.
  void frame(const Frame& frame, const TrackingResult& tracked);

  // What the user wants; done soon.
  void begin_new_map();              // the present one is kept; the initialisation key is pressed then
  void forget_map();                 // its file goes to the trash
  void go_to(std::string path);      // the camera is looked for on that map
  void set_locked(bool locked);      // the present one
  void separate(std::string path);   // the merge of two maps is undone
  std::vector<MapNews> take_news();  // since the last call

  int switches() const;
  int merges() const;

 private:
  struct Seen {
    Frame frame;
    TrackingState state = TrackingState::waiting;
    TrackingQuality quality = TrackingQuality::lost;
    std::uint64_t map_version = 0;
    int map_keyframes = 0;
  };
  struct Wish {
    enum class Kind { new_map, forget, go_to, lock, unlock, separate } kind;
    std::string path;
  };

  void run(const std::stop_token& stop);
  void wish(Wish wish);
  void fulfil(const Wish& wish);
  // True when there is more to do on the same frame.
  bool step(const Seen& seen);
  void refresh();
  void meet(const Seen& seen);
  std::set<std::string> not_to_meet(const Seen& seen) const;
  void merge_with(const FoundMap& found, const Seen& seen);
  std::optional<std::stop_token> begin_merging();
  std::optional<MergedIn> send_merged(const MapSaver::Present& present, const MapDocument& merged, MapNews* news);
  void undo_merge_of(const std::string& path);
  bool go_over(const std::string& path, const MapStamp& stamp, const std::shared_ptr<const MapDocument>& document,
               std::uint64_t instead_of, bool only_while_lost);
  bool new_map(bool keep_present);
  bool send(MapperMessage message);
  // Waits for the mapper, which answers within moments; false when it has ended. The map may change until it has
  // answered: nobody goes before.
  template <class Reply>
  bool is_answered(const std::future<Reply>& reply) const {
    constexpr std::chrono::milliseconds kLook{20};
    constexpr std::chrono::seconds kPatience{10};
    const auto end = SteadyClock::now() + kPatience;
    while (reply.wait_for(kLook) != std::future_status::ready)
      if (port_.inbox->closed() || SteadyClock::now() > end) return false;
    return true;
  }
  template <class Reply>
  std::optional<Reply> answer(std::future<Reply> reply) const {
    try {
      if (is_answered(reply)) return reply.get();
    } catch (const std::future_error&) {
      // It went without an answer.
    }
    return std::nullopt;
  }
  void tell(MapNews news);
  void failed(const std::string& text);
  bool is_lost(std::uint64_t map_version) const;

  const CameraModel camera_;
  const SessionMapsOptions options_;
  const std::shared_ptr<const Vocabulary> vocabulary_;
  const std::shared_ptr<const MapLibrary> library_;
  MapSaver* const saver_;
  const SessionPort port_;

  // The thread's own, or frame()'s.
  MapFinder finder_;
  std::optional<Timestamp> lost_since_;
  int looks_ = 0;
  SteadyClock::time_point refreshed_{};
  std::string asked_except_;
  std::set<std::string> ignored_;  // maps that the user has had enough of, for this session
  std::string last_failure_;
  std::optional<Timestamp> met_;  // when the other maps were asked last
  // Maps that could not be merged with the present one, of this version: not before it has so many keyframes.
  std::map<std::string, int> meet_again_at_;
  std::uint64_t meeting_version_ = 0;

  mutable Mutex mutex_;
  std::condition_variable_any wake_;
  std::optional<Seen> newest_ PARALLAX_GUARDED_BY(mutex_);
  bool unseen_ PARALLAX_GUARDED_BY(mutex_) = false;
  std::vector<Wish> wishes_ PARALLAX_GUARDED_BY(mutex_);
  std::vector<MapNews> news_ PARALLAX_GUARDED_BY(mutex_);
  int switches_ PARALLAX_GUARDED_BY(mutex_) = 0, merges_ PARALLAX_GUARDED_BY(mutex_) = 0;
  std::optional<std::stop_source> merging_ PARALLAX_GUARDED_BY(mutex_);  // a merge that goes on
  bool ending_ PARALLAX_GUARDED_BY(mutex_) = false;
  std::jthread thread_;
};

// `parallax run --maps FOLDER`: the same beside a run; in lockstep within the frames, always the same.
class RunMaps final : public SessionCompanion {
 public:
  RunMaps(const CameraModel& camera, const RunOptions& options, std::shared_ptr<const MapLibrary> library,
          const SessionMapsOptions& wanted = {});
  ~RunMaps() override;

  void begin(SharedMap* map, MapperInbox* inbox, std::function<void()> work) override;
  void frame(const Frame& frame, const TrackingResult& tracked) override;
  void end() override;
  // Throws RunError when the last save fails.
  void finish() override;

  // All that happened, and what the saver said.
  const std::vector<MapNews>& news() const { return news_; }
  int switches() const { return switches_; }
  int merges() const { return merges_; }
  // For what a user wants; null before begin() and after end().
  SessionMaps* maps() const { return maps_.get(); }

 private:
  CameraModel camera_;
  SessionMapsOptions wanted_;
  std::shared_ptr<const MapLibrary> library_;
  std::unique_ptr<MapSaver> saver_;
  std::unique_ptr<SessionMaps> maps_;
  std::vector<MapNews> news_;
  int switches_ = 0, merges_ = 0;
};

}  // namespace parallax
