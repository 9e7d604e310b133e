// Two maps of one desk, begun at either end, meet in a session that walks from one to the other: they become one, and
// are two again when that is undone.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "app/map_merge_record.h"
#include "app/run_settings.h"
#include "app/session_maps.h"
#include "core/error.h"
#include "core/image.h"
#include "map/map_file.h"
#include "mapper/map_join.h"
#include "render/synthetic_source.h"
#include "tests/support/process.h"
#include "tests/support/statistics.h"

namespace parallax {
namespace {

namespace fs = std::filesystem;
using testing::read_all;
using testing::ScratchFolder;

const CameraModel& meeting_camera() {
  static const CameraModel camera(CameraModelKind::pinhole, 320, 240, {290, 290}, {159.5, 119.5});
  return camera;
}

// Along the table, looking down at it.
struct MeetingLeg {
  double from_m, to_m;
  int frames;
};

SyntheticMotion motion_along(const std::vector<MeetingLeg>& legs) {
  SyntheticMotion motion;
  motion.label = [](int) { return FrameLabel{}; };
  motion.gain = [](int) { return 1.0; };
  motion.cover = [](int) { return 0.0; };
  motion.world_from_camera = [legs](int frame, double offset_s) {
    const double now = frame + offset_s * kSyntheticFps;
    double x = legs.back().to_m, begin = 0;
    for (const MeetingLeg& leg : legs) {
      const double part = std::clamp((now - begin) / leg.frames, 0.0, 1.0);
      x = leg.from_m + (leg.to_m - leg.from_m) * part * part * (3 - 2 * part);
      if (part < 1) break;
      begin += leg.frames;
    }
    const Eigen::Vector3d target(x, 0.05 * std::sin(0.03 * now), 0);
    const double turn = 0.15 * std::sin(0.021 * now), tilt = 0.85, distance = 0.6;
    return look_at(target + distance * Eigen::Vector3d(std::sin(turn) * std::cos(tilt),
                                                       -std::cos(turn) * std::cos(tilt), std::sin(tilt)),
                   target);
  };
  return motion;
}

// A walk, whose frames are numbered from `first` on.
class MeetingWalk final : public FrameSource {
 public:
  MeetingWalk(const std::vector<MeetingLeg>& legs, int first) : first_(first) {
    SyntheticOptions options;
    options.camera = meeting_camera();
    options.seed = 3;
    options.exposure_s = 0.002;
    for (const MeetingLeg& leg : legs) count_ += leg.frames;
    options.frames = count_;
    source_ = std::make_unique<SyntheticSource>("walk", options, motion_along(legs));
  }
  std::optional<Frame> next() override {
    if (next_ == count_) return std::nullopt;
    Frame frame = source_->frame(next_++);
    frame.index += first_;
    return frame;
  }
  std::vector<SourceWarning> take_warnings() override { return {}; }
  int frame_count() const override { return count_; }
  double frames_per_second() const override { return kSyntheticFps; }
  std::string description() const override { return "walk"; }

  int first() const { return first_; }
  RigidTransform truth(int frame) const { return source_->world_from_camera(frame - first_); }
  cv::Mat1f depth(int frame) { return source_->depth(frame - first_); }

 private:
  int first_, count_ = 0, next_ = 0;
  std::unique_ptr<SyntheticSource> source_;
};

constexpr int kLeft = 0, kRight = 1000, kAcross = 2000, kAgain = 3000;
const std::vector<MeetingLeg>& legs_of(int first) {
  static const std::map<int, std::vector<MeetingLeg>> legs{
      {kLeft, {{-0.50, -0.40, 45}, {-0.40, -0.24, 60}, {-0.24, -0.32, 45}}},
      {kRight, {{0.30, 0.40, 45}, {0.40, 0.28, 60}, {0.28, 0.36, 45}}},
      {kAcross, {{0.36, 0.26, 40}, {0.26, -0.28, 160}, {-0.28, -0.36, 50}}},
      {kAgain, {{0.36, 0.30, 70}}}};
  return legs.at(first);
}

// Where the points of a map are: as the map says, and in truth, by the depth where their patch was seen.
struct SeenPoints {
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> map_to_truth;
  std::vector<int> session;  // that saw them first
};
SeenPoints points_in_truth(const Map& map) {
  SeenPoints out;
  std::map<int, std::unique_ptr<MeetingWalk>> walks;
  std::map<int, cv::Mat1f> depths;
  for (const MapPoint& p : map.points) {
    const int frame = map.keyframes.at(p.source).frame, session = frame / 1000 * 1000;
    if (!walks.contains(session)) walks[session] = std::make_unique<MeetingWalk>(legs_of(session), session);
    if (!depths.contains(frame)) depths[frame] = walks[session]->depth(frame);
    const Eigen::Vector2d pixel = level_to_level0(p.source_pixel, p.source_level);
    const float depth =
        depths[frame](static_cast<int>(std::lround(pixel.y())), static_cast<int>(std::lround(pixel.x())));
    const Eigen::Vector3d ray((pixel.x() - 159.5) / 290, (pixel.y() - 119.5) / 290, 1);
    const Eigen::Vector3d in_camera = depth * ray;
    const Eigen::Vector3d place = walks[session]->truth(frame) * in_camera;
    out.map_to_truth.emplace_back(p.position, place);
    out.session.push_back(session);
  }
  return out;
}

struct MeetingRun {
  RunResult result;
  std::vector<MapNews> news;
  int switches = 0, merges = 0;
  std::string text() const {
    std::string out;
    for (const MapNews& n : news) out += std::to_string(n.frame) + ": " + n.text + "\n";
    return out;
  }
};

MeetingRun run_walk(int first, const std::string& folder) {
  MeetingWalk source(legs_of(first), first);
  RunOptions options;
  options.pace = Pace::lockstep;
  RunMaps maps(meeting_camera(), options, std::make_shared<const MapLibrary>(folder));
  MeetingRun out;
  out.result = run_session(&source, meeting_camera(), options, {}, &maps);
  out.news = maps.news();
  out.switches = maps.switches();
  out.merges = maps.merges();
  return out;
}

// The folder with a map of either end of the desk, each with a label; then a session has walked across.
class TwoEndsOfADesk : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    apart_ = std::make_unique<ScratchFolder>();
    joined_ = std::make_unique<ScratchFolder>();
    run_walk(kLeft, apart_->path().string());
    run_walk(kRight, apart_->path().string());
    for (const std::string& path : MapLibrary(apart_->path().string()).paths()) {
      MapDocument document = read_map_file(path);
      const bool left = document.map.keyframes.begin()->frame < kRight;
      (left ? left_ : right_) = fs::path(path).filename();
      document.name = left ? "left" : "right";
      ContentItem label;
      label.id = 1;
      label.text = document.name;
      label.world_from_item.t = document.map.points.begin()->position;
      document.content.push_back(label);
      if (left) document.games["marbles"] = "left's";
      (left ? true_left_ : true_right_) = fit_similarity(points_in_truth(document.map).map_to_truth) * label.position();
      write_map_file(document, path, "test");
    }
    for (const std::string& name : {left_, right_})
      if (!name.empty()) fs::copy_file(apart_->path() / name, joined_->path() / name);
    across_ = std::make_unique<MeetingRun>(run_walk(kAcross, joined_->path().string()));
  }
  static void TearDownTestSuite() {
    across_.reset();
    apart_.reset();
    joined_.reset();
  }

  static inline std::unique_ptr<ScratchFolder> apart_, joined_;
  static inline std::string left_, right_;  // file names
  static inline Eigen::Vector3d true_left_, true_right_;
  static inline std::unique_ptr<MeetingRun> across_;
};

TEST_F(TwoEndsOfADesk, BecomeOneMapWithoutALostFrame) {
  ASSERT_FALSE(left_.empty() || right_.empty()) << "one map of each end";
  const std::vector<LibraryMap> maps = MapLibrary(joined_->path().string()).list();
  ASSERT_EQ(maps.size(), 1U) << across_->text();
  EXPECT_EQ(across_->merges, 1) << across_->text();
  ASSERT_EQ(across_->news.size(), 2U) << across_->text();
  EXPECT_EQ(across_->news[0].text, "this is right");
  EXPECT_EQ(across_->news[1].text, "merged with left");
  EXPECT_TRUE(verify_map_file(maps[0].path).empty());
  const MapDocument document = read_map_file(maps[0].path);
  EXPECT_EQ(document.name, "right");
  EXPECT_EQ(document.merged_from.size(), 2U);
  EXPECT_EQ(document.games.at("marbles"), "left's");

  // The camera was tracked all the way from the first frame on that found the place.
  int first_tracked = -1, lost = 0;
  const int merged_at = across_->news[1].frame - kAcross;
  for (const TrackingResult& frame : across_->result.frames) {
    if (frame.camera_from_world && first_tracked < 0) first_tracked = frame.frame;
    lost += first_tracked >= 0 && !frame.camera_from_world;
  }
  EXPECT_EQ(lost, 0);
  ASSERT_LT(merged_at, 240) << "early enough to see what comes of it";
  RecordProperty("merged_at_frame", std::to_string(merged_at));

  // Points and cameras of both, in one world.
  const SeenPoints points = points_in_truth(document.map);
  const SimilarityTransform truth = fit_similarity(points.map_to_truth);
  std::map<int, std::vector<double>> error_mm;
  for (std::size_t i = 0; i < points.session.size(); ++i)
    error_mm[points.session[i]].push_back(
        1e3 * (truth * points.map_to_truth[i].first - points.map_to_truth[i].second).norm());
  for (const int session : {kLeft, kRight}) {
    ASSERT_GT(error_mm[session].size(), 100U) << session;
    const double middle = testing::median(error_mm[session]);
    EXPECT_LT(middle, 3.0) << session;
    RecordProperty("points_mm_" + std::to_string(session), std::to_string(middle));
  }
  const MeetingWalk walk(legs_of(kAcross), kAcross);
  double worst_mm = 0;
  for (const TrackingResult& frame : across_->result.frames) {
    if (frame.frame - kAcross <= merged_at + 1) continue;
    const Eigen::Vector3d centre = truth * frame.camera_from_world->inverse().t;
    worst_mm = std::max(worst_mm, 1e3 * (centre - walk.truth(frame.frame).t).norm());
  }
  EXPECT_LT(worst_mm, 8.0);
  RecordProperty("camera_mm", std::to_string(worst_mm));

  // What stood on either is where it was.
  ASSERT_EQ(document.content.size(), 2U);
  EXPECT_EQ(document.content[0].text, "right");
  EXPECT_EQ(document.content[1].text, "left");
  EXPECT_LT((truth * document.content[0].position() - true_right_).norm(), 0.006);
  EXPECT_LT((truth * document.content[1].position() - true_left_).norm(), 0.006);
}

TEST_F(TwoEndsOfADesk, AreTwoAgainByteForByte) {
  const ScratchFolder folder;
  fs::copy(joined_->path(), folder.path(), fs::copy_options::recursive | fs::copy_options::overwrite_existing);
  const MapLibrary library(folder.path().string());
  ASSERT_EQ(library.paths().size(), 1U) << across_->text();
  const std::string merged = library.paths().front();
  const auto pair = merged_pair(merged);
  ASSERT_TRUE(pair);
  const std::string base = read_all(pair->base);
  for (const Keyframe& kf : read_map_file(pair->base).map.keyframes) EXPECT_GE(kf.frame, kRight) << "none of the left";
  const UndoneMerge undone = undo_merge(library, merged);
  EXPECT_TRUE(read_all(folder.file(left_)) == read_all(apart_->file(left_)));
  EXPECT_TRUE(read_all(folder.file(right_)) == base);
  EXPECT_EQ(undone.pair.base, folder.file(right_));
  EXPECT_EQ(library.paths().size(), 2U);
  EXPECT_TRUE(fs::exists(undone.trashed));
  EXPECT_TRUE(are_kept_apart(library, {folder.file(left_), folder.file(right_)}));
  EXPECT_TRUE(are_kept_apart(library, {folder.file(right_), folder.file(left_)}));
  EXPECT_FALSE(are_kept_apart(library, {folder.file(right_), merged}));
  EXPECT_THROW(undo_merge(library, folder.file(right_)), InputError);
}

// While the session is on the merged map.
class Undoing final : public SessionCompanion {
 public:
  Undoing(RunMaps* maps, std::string path) : maps_(maps), path_(std::move(path)) {}
  void begin(SharedMap* map, MapperInbox* inbox, std::function<void()> work) override {
    maps_->begin(map, inbox, std::move(work));
  }
  void frame(const Frame& frame, const TrackingResult& tracked) override {
    if (tracked.camera_from_world && ++tracked_ == 20) maps_->maps()->separate(path_);
    maps_->frame(frame, tracked);
  }
  void end() override { maps_->end(); }
  void finish() override { maps_->finish(); }

 private:
  RunMaps* maps_;
  std::string path_;
  int tracked_ = 0;
};

TEST_F(TwoEndsOfADesk, AreTwoAgainWhileTheCameraIsThere) {
  const ScratchFolder folder;
  fs::copy(joined_->path(), folder.path(), fs::copy_options::recursive | fs::copy_options::overwrite_existing);
  const auto library = std::make_shared<const MapLibrary>(folder.path().string());
  ASSERT_EQ(library->paths().size(), 1U) << across_->text();
  RunOptions options;
  options.pace = Pace::lockstep;
  RunMaps maps(meeting_camera(), options, library);
  Undoing undoing(&maps, library->paths().front());
  MeetingWalk source(legs_of(kAgain), kAgain);
  const RunResult result = run_session(&source, meeting_camera(), options, {}, &undoing);
  MeetingRun told;
  told.news = maps.news();
  ASSERT_EQ(maps.news().size(), 2U) << told.text();
  EXPECT_EQ(maps.news()[1].text, "two maps again: this is right");
  EXPECT_EQ(maps.merges(), 0) << told.text();
  ASSERT_TRUE(maps.news()[1].document);
  EXPECT_EQ(maps.news()[1].document->content.size(), 1U) << "the left one's label is with the left one";
  EXPECT_TRUE(result.frames.back().camera_from_world) << "found again on the map of before";
  EXPECT_TRUE(read_all(folder.file(left_)) == read_all(apart_->file(left_)));
  for (const Keyframe& kf : read_map_file(folder.file(right_)).map.keyframes) EXPECT_GE(kf.frame, kRight);
}

TEST_F(TwoEndsOfADesk, StayTwoWhenOneIsLocked) {
  const ScratchFolder folder;
  for (const std::string& name : {left_, right_}) fs::copy_file(apart_->path() / name, folder.path() / name);
  MapLibrary::set_locked(folder.file(left_), true);
  const MeetingRun walked = run_walk(kAcross, folder.path().string());
  EXPECT_EQ(walked.merges, 0) << walked.text();
  EXPECT_EQ(MapLibrary(folder.path().string()).paths().size(), 2U);
  EXPECT_TRUE(read_all(folder.file(left_)) == read_all(apart_->file(left_)));
}

TEST(MapMeeting, IsSwitchedOff) {
  RunOptions options;
  EXPECT_TRUE(session_maps_options(options).merge);
  apply_settings({"maps.merge=0"}, &options);
  EXPECT_FALSE(session_maps_options(options).merge);
}

}  // namespace
}  // namespace parallax
