// A session of two threads, recorded, and replayed on one: the same to the last bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>

#include "app/replay_session.h"
#include "core/error.h"
#include "tests/app/recorded_session.h"
#include "tests/support/process.h"

namespace parallax::testing {
namespace {

std::unique_ptr<SessionRecorder> recorder_to(const std::string& path, std::size_t queue = 90) {
  RecordingDescription description;
  description.source = "synthetic:desk";
  description.camera["exposure"] = "100";
  description.queue = queue;
  return std::make_unique<SessionRecorder>(path, description);
}

void expect_same(const RunResult& live, const Replayed& replayed) {
  EXPECT_EQ(replayed.report.verdict, ReplayReport::Verdict::identical) << replayed.report.text;
  ASSERT_EQ(live.frames.size(), replayed.result.frames.size());
  for (std::size_t i = 0; i < live.frames.size(); ++i) {
    const TrackingResult &a = live.frames[i], &b = replayed.result.frames[i];
    ASSERT_EQ(a.frame, b.frame);
    ASSERT_EQ(a.state, b.state) << "frame " << a.frame;
    ASSERT_EQ(a.found, b.found) << "frame " << a.frame;
    ASSERT_EQ(a.map_version, b.map_version) << "frame " << a.frame;
    ASSERT_EQ(a.camera_from_world.has_value(), b.camera_from_world.has_value()) << "frame " << a.frame;
    if (!a.camera_from_world) continue;
    ASSERT_EQ(a.camera_from_world->R, b.camera_from_world->R) << "frame " << a.frame;
    ASSERT_EQ(a.camera_from_world->t, b.camera_from_world->t) << "frame " << a.frame;
  }
  EXPECT_EQ(hash_of(live.map), hash_of(replayed.result.map));
  EXPECT_EQ(live.map.points.size(), replayed.result.map.points.size());
  EXPECT_EQ(live.mapper.keyframes_inserted, replayed.result.mapper.keyframes_inserted);
  EXPECT_EQ(live.mapper.adjustments_interrupted, replayed.result.mapper.adjustments_interrupted);
}

TEST(RealtimeReplay, IsTheSessionToTheLastBit) {
  const ScratchFolder folder;
  const std::string path = folder.file("session.plx");
  std::vector<std::uint64_t> drawn, drawn_again;
  const RunResult live = run_live(recorder_to(path), RunOptions(), [&](LiveSession*, const LiveFrame&) {});
  EXPECT_GT(live.frames_tracked, 40);
  EXPECT_GE(live.map.keyframes.size(), 3);
  const Replayed replayed = replay(path);
  expect_same(live, replayed);
  // What a drawing is made of is the same in two replays.
  const auto note = [](std::vector<std::uint64_t>* out) {
    return
        [out](const Frame& frame, const TrackingResult& tracked, const std::shared_ptr<const TrackingSnapshot>& map) {
          std::uint64_t hash = hash_of(tracked) ^ static_cast<std::uint64_t>(frame.grey(7, 9)) ^ map->version;
          for (const TrackedPoint& p : tracked.points)
            hash = hash * 31 + static_cast<std::uint64_t>(p.pixel.x() * 1024);
          out->push_back(hash);
        };
  };
  replay(path, note(&drawn));
  replay(path, note(&drawn_again));
  EXPECT_EQ(drawn, drawn_again);
  EXPECT_EQ(drawn.size(), live.frames.size());
}

TEST(RealtimeReplay, ResetsEditsAndKeysAreReplayed) {
  const ScratchFolder folder;
  const std::string path = folder.file("session.plx");
  RunOptions options;
  options.manual_initialisation = true;
  std::future<EditReply> scaled, replaned, seeded;
  std::future<void> reset;
  int presses = 0;
  const RunResult live = run_live(recorder_to(path), options, [&](LiveSession* session, const LiveFrame& frame) {
    const int index = frame.frame.index;
    const auto once_at = [&](int at, bool done) { return index >= at && !done; };
    if (once_at(30, presses >= 1) || once_at(58, presses >= 2)) {
      session->press_initialise();
      ++presses;
    }
    if (frame.tracked.camera_from_world && !scaled.valid() && index >= 75) scaled = session->edit(ScaleEdit{2.5});
    if (once_at(85, replaned.valid())) replaned = session->edit(PlaneEdit{});
    if (once_at(90, seeded.valid()) && frame.map->size() > 0)
      seeded = session->edit(PlaneEdit{frame.map->position[frame.map->position.size() / 2]});
    if (once_at(115, reset.valid())) reset = session->reset();
    if (once_at(118, presses >= 3) || once_at(148, presses >= 4)) {
      session->press_initialise();
      ++presses;
    }
  });
  ASSERT_TRUE(scaled.valid() && replaned.valid() && seeded.valid() && reset.valid());
  EXPECT_TRUE(scaled.get().ok);
  EXPECT_TRUE(replaned.get().ok);
  seeded.get();
  reset.get();
  EXPECT_GT(live.frames_tracked, 30);
  EXPECT_GE(live.map_version, 2U) << "made, and forgotten";
  expect_same(live, replay(path));
}

// After a change of scale the world is larger and the camera has not jumped in it.
TEST(RealtimeLive, AScaleIsFollowedWithoutAJump) {
  std::future<EditReply> scaled;
  bool refused_before = false;
  const RunResult live = run_live(nullptr, RunOptions(), [&](LiveSession* session, const LiveFrame& frame) {
    if (frame.frame.index == 29) refused_before = !session->edit(ScaleEdit{2}).get().ok;
    if (frame.frame.index >= 100 && !scaled.valid()) scaled = session->edit(ScaleEdit{3});
  });
  EXPECT_TRUE(refused_before) << "without a map";
  ASSERT_TRUE(scaled.valid());
  EXPECT_TRUE(scaled.get().ok);
  int pairs = 0;
  for (std::size_t i = 1; i < live.frames.size(); ++i) {
    const TrackingResult &a = live.frames[i - 1], &b = live.frames[i];
    if (!a.camera_from_world || !b.camera_from_world || a.world_from_first.s == b.world_from_first.s) continue;
    ++pairs;
    EXPECT_NEAR(b.world_from_first.s, 3 * a.world_from_first.s, 1e-9);
    const SimilarityTransform now_from_then = b.world_from_first * a.world_from_first.inverse();
    const RigidTransform moved = *b.camera_from_world * now_from_then.rebase(*a.camera_from_world).inverse();
    EXPECT_LT(moved.t.norm(), 0.03 * b.camera_from_world->inverse().t.norm()) << "a frame's motion, in the new world";
    EXPECT_EQ(b.quality, TrackingQuality::good);
  }
  EXPECT_EQ(pairs, 1);
}

// One recording that the tests below damage.
const std::string& recorded_bytes() {
  static const std::string bytes = [] {
    const ScratchFolder folder;
    const std::string path = folder.file("session.plx");
    run_live(recorder_to(path), RunOptions(), {});
    return read_all(path);
  }();
  return bytes;
}

TEST(RealtimeReplay, ASessionThatWasCutOffIsReplayedAsFarAsItGoes) {
  const ScratchFolder folder;
  const std::string path = folder.file("cut.plx");
  write_bytes(path, recorded_bytes().substr(0, recorded_bytes().size() * 3 / 4 + 11));
  const Replayed replayed = replay(path);
  EXPECT_EQ(replayed.report.verdict, ReplayReport::Verdict::incomplete) << replayed.report.text;
  EXPECT_GT(replayed.report.frames_compared, static_cast<int>(kept_desk().frames->size()) / 2);
  ASSERT_EQ(replayed.result.warnings.size(), 1U);
  EXPECT_NE(replayed.result.warnings[0].text.find("cut off"), std::string::npos);
}

TEST(RealtimeReplay, WhatWasWrittenBeforeAKillIsThere) {
  const ScratchFolder folder;
  const std::string path = folder.file("killed.plx");
  kept_desk();
  int reached[2];
  ASSERT_EQ(pipe(reached), 0);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    run_live(recorder_to(path), RunOptions(), [&](LiveSession*, const LiveFrame& frame) {
      if (frame.frame.index < 130) return;
      const ssize_t written = write(reached[1], "x", 1);
      while (written == 1) pause();  // the session goes on, on its threads
    });
    _exit(3);
  }
  close(reached[1]);
  char byte = 0;
  EXPECT_EQ(read(reached[0], &byte, 1), 1);
  close(reached[0]);
  kill(child, SIGKILL);
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
  const Replayed replayed = replay(path);
  EXPECT_EQ(replayed.report.verdict, ReplayReport::Verdict::incomplete) << replayed.report.text;
  EXPECT_GT(replayed.report.frames_compared, 20)
      << "of about 100, less those that were dropped and the last fraction of a second";
}

TEST(RealtimeReplay, ADifferenceIsSaidWithItsFrame) {
  RecordingSource source(
      [] {
        static const ScratchFolder folder;
        write_bytes(folder.file("session.plx"), recorded_bytes());
        return folder.file("session.plx");
      }(),
      {});
  // The first tracked frame's image is another one: what follows cannot be the same.
  const ScratchFolder folder;
  RecordingWriter writer(folder.file("other.plx"));
  writer.write_header(source.contents().header);
  int n = 0;
  while (auto frame = source.next()) {
    if (n++ == 70) frame->grey = GreyImage(frame->grey.size(), 90);
    frame->colour = cv::Mat3b();
    writer.write_frame(*frame);
  }
  const auto& schedule = source.contents().schedule;
  writer.write_schedule(std::string(schedule.begin(), schedule.end()));
  writer.write_end(*source.contents().summary);
  const Replayed replayed = replay(folder.file("other.plx"));
  EXPECT_EQ(replayed.report.verdict, ReplayReport::Verdict::different);
  EXPECT_NE(replayed.report.text.find("frame 98"), std::string::npos) << replayed.report.text;
}

}  // namespace
}  // namespace parallax::testing
