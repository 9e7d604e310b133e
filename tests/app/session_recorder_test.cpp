// The recorder: what it does when the disk is slow or full, and what its files say when they are damaged.
#include "app/session_recorder.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <random>

#include "app/run_outputs.h"
#include "app/session_options.h"
#include "core/error.h"
#include "tests/app/recorded_session.h"
#include "tests/support/process.h"

namespace parallax::testing {
namespace {

Frame noise_frame(int index, int width, int height) {
  std::mt19937 rng(static_cast<unsigned>(index));
  Frame frame;
  frame.index = index;
  frame.time = Timestamp(33000000LL * (index + 1));
  frame.grey.create(height, width);
  for (auto& value : frame.grey) value = static_cast<std::uint8_t>(rng());
  return frame;
}

CameraModel pinhole(int width, int height) {
  return CameraModel(CameraModelKind::pinhole, width, height, {300.0 + 1.0 / 3.0, 301}, {width / 2.0, height / 2.0});
}

// Files may not grow beyond so many bytes while it lives: what a full disk looks like to the program.
class SmallDisk {
 public:
  explicit SmallDisk(rlim_t bytes) {
    handler_ = std::signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &before_);
    rlimit small = before_;
    small.rlim_cur = bytes;
    setrlimit(RLIMIT_FSIZE, &small);
  }
  ~SmallDisk() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;

 private:
  rlimit before_{};
  void (*handler_)(int);
};

TEST(SessionRecorder, FramesBeyondTheQueueAreDroppedAndCounted) {
  const ScratchFolder folder;
  const std::string path = folder.file("session.plx");
  constexpr int kFrames = 60;
  int dropped = 0;
  {
    RecordingDescription description;
    description.queue = 2;
    SessionRecorder recorder(path, description);
    recorder.begin(pinhole(1280, 960), RunOptions(), 30);
    const Frame first = noise_frame(0, 1280, 960);
    for (int i = 0; i < kFrames; ++i) {
      Frame frame = first;
      frame.index = i;
      frame.time = Timestamp(33000000LL * i);
      recorder.add_frame(frame);  // faster than any disk
    }
    EXPECT_TRUE(recorder.recording());
    recorder.finish(1);
    dropped = recorder.frames_dropped();
    EXPECT_FALSE(recorder.recording());
    EXPECT_EQ(recorder.take_failure(), "");
  }
  EXPECT_GT(dropped, 0);
  RecordingSource source(path, {});
  EXPECT_EQ(source.frame_count() + dropped, kFrames);
  ASSERT_TRUE(source.contents().summary);
  EXPECT_EQ(source.contents().summary->at("frames_dropped"), std::to_string(dropped));
}

TEST(SessionRecorder, AFullDiskIsOneLine) {
  const ScratchFolder folder;
  const std::string path = folder.file("session.plx");
  SessionRecorder recorder(path, {});
  recorder.begin(pinhole(320, 240), RunOptions(), 30);
  {
    const SmallDisk small(400000);
    for (int i = 0; i < 20; ++i) recorder.add_frame(noise_frame(i, 320, 240));
    recorder.finish(1);
  }
  const std::string failure = recorder.take_failure();
  EXPECT_NE(failure.find(path), std::string::npos) << failure;
  EXPECT_NE(failure.find("cannot be written"), std::string::npos) << failure;
  EXPECT_EQ(failure.find('\n'), std::string::npos);
  EXPECT_EQ(recorder.take_failure(), "") << "said once";
  EXPECT_FALSE(recorder.recording());
  RecordingSource source(path, {});
  EXPECT_GE(source.frame_count(), 3) << "what was written before";
  EXPECT_LT(source.frame_count(), 20);
  EXPECT_FALSE(source.contents().summary);
}

TEST(RealtimeRecorder, TheSessionGoesOnWhenTheDiskIsFull) {
  const ScratchFolder folder;
  std::vector<std::string> failures;
  RunResult live;
  bool stopped_recording = false;
  {
    auto recorder = std::make_unique<SessionRecorder>(folder.file("session.plx"), RecordingDescription());
    const SmallDisk small(3000000);
    RunOptions options;
    options.kept_frames = 20;
    live = run_live(
        std::move(recorder), options,
        [&](LiveSession* session, const LiveFrame&) { stopped_recording |= !session->statistics().recording; },
        &failures);
  }
  EXPECT_TRUE(stopped_recording);
  ASSERT_EQ(failures.size(), 1U);
  EXPECT_NE(failures[0].find("session.plx"), std::string::npos);
  EXPECT_GT(live.frames_tracked, 30) << "to the end";
  EXPECT_EQ(live.frames.back().frame, kept_desk().frames->back().index);
  // Few of the frames are kept, every pose is.
  EXPECT_LE(live.frames.size(), 40U);
  EXPECT_GT(live.frames_delivered, 40);
  EXPECT_EQ(live.counts.tracked, live.frames_tracked);
  const Trajectory trajectory = tracked_trajectory(live);
  ASSERT_EQ(static_cast<int>(trajectory.size()), live.frames_tracked);
  const TrackingResult& last = live.frames.back();
  ASSERT_TRUE(last.camera_from_world);
  const SimilarityTransform now_from_then = live.world_from_first * last.world_from_first.inverse();
  const RigidTransform expected = now_from_then.rebase(*last.camera_from_world).inverse();
  EXPECT_LT((trajectory.back().world_from_camera.t - expected.t).norm(), 1e-9);
}

TEST(SessionRecorder, AFileThatCannotBeMadeIsSaid) {
  EXPECT_THROW(SessionRecorder("/nowhere/at/all.plx", {}), RunError);
  EXPECT_THROW(SessionRecorder("/dev/full", {}), RunError);
}

TEST(SessionOptions, AreExactToTheLastBit) {
  RunOptions options;
  options.manual_initialisation = true;
  options.tracker.corner_targets[2] = 617;
  options.tracker.coarse_radius_px = 1.0 / 3.0;
  options.tracker.align_without_corner = false;
  options.tracker.motion.smoothing = std::nextafter(0.5, 1.0);
  options.mapper.seed = 0xfedcba9876543210ULL;
  options.mapper.two_view.sigma_px = 0.1;
  options.mapper.max_new_points[3] = 41;
  options.mapper.remeasure = false;
  const std::string text = exact_text(options);
  const RunOptions again = parse_exact_options(text, "file");
  EXPECT_EQ(exact_text(again), text);
  EXPECT_FALSE(again.automatic_initialisation());
  EXPECT_EQ(again.tracker.corner_targets[2], 617);
  EXPECT_EQ(again.tracker.coarse_radius_px, 1.0 / 3.0);
  EXPECT_FALSE(again.tracker.align_without_corner);
  EXPECT_EQ(again.tracker.motion.smoothing, options.tracker.motion.smoothing);
  EXPECT_EQ(again.mapper.seed, options.mapper.seed);
  EXPECT_EQ(again.mapper.two_view.sigma_px, 0.1);
  EXPECT_EQ(again.mapper.max_new_points[3], 41);
  EXPECT_FALSE(again.mapper.remeasure);
}

TEST(SessionOptions, DamageIsAnInputErrorOfOneLine) {
  const std::string text = exact_text(RunOptions());
  std::mt19937 rng(5);
  int refused = 0;
  for (int i = 0; i < 300; ++i) {
    std::string damaged = text;
    if (i % 3 == 0) damaged.resize(rng() % text.size());
    if (i % 3 == 1) damaged[rng() % text.size()] = static_cast<char>(rng());
    if (i % 3 == 2) damaged += "more 1\n";
    try {
      (void)parse_exact_options(damaged, "file");
    } catch (const InputError& error) {
      ++refused;
      EXPECT_EQ(std::string(error.what()).find("file: options"), 0U) << error.what();
    }
  }
  EXPECT_GT(refused, 200);
}

}  // namespace
}  // namespace parallax::testing
