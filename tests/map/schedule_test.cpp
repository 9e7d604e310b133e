// The schedule of two threads: noted, written, read and given again.
#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "core/error.h"
#include "map/replay_schedule.h"

namespace parallax {
namespace {

std::span<const std::uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

StepEntry step(StepEntry::Kind kind, std::int64_t stopped_at = 0) {
  StepEntry e;
  e.kind = kind;
  e.stopped_at = stopped_at;
  return e;
}

FrameEntry frame(int index, std::uint64_t snapshot, std::vector<std::uint8_t> pushed = {},
                 std::vector<std::uint8_t> replied = {}) {
  FrameEntry e;
  e.frame = index;
  e.snapshot = snapshot;
  e.pushed = std::move(pushed);
  e.replied = std::move(replied);
  return e;
}

TEST(ScheduleLog, ComesBackAsItWasWritten) {
  std::string text;
  FrameEntry first = frame(3, 17, {1, 0, 1}, {0});
  first.key = true;
  first.result_hash = 0xfedcba9876543210ULL;
  StepEntry scale = step(StepEntry::Kind::scale);
  scale.factor = 1.0 / 3.0;
  StepEntry plane = step(StepEntry::Kind::plane);
  plane.seed = Eigen::Vector3d(0.1, -std::numeric_limits<double>::denorm_min(), 1e300);
  const std::vector<StepEntry> steps{step(StepEntry::Kind::work, 1'000'000'007),
                                     scale,
                                     step(StepEntry::Kind::message),
                                     plane,
                                     step(StepEntry::Kind::plane),
                                     step(StepEntry::Kind::reset)};
  write_entry(first, &text);
  for (const StepEntry& s : steps) write_entry(s, &text);
  write_entry(frame(5, 18), &text);
  const ScheduleLog log = parse_schedule(bytes_of(text), "file");
  ASSERT_EQ(log.frames.size(), 2U);
  EXPECT_EQ(log.frames[0].frame, 3);
  EXPECT_TRUE(log.frames[0].key);
  EXPECT_EQ(log.frames[0].snapshot, 17U);
  EXPECT_EQ(log.frames[0].pushed, (std::vector<std::uint8_t>{1, 0, 1}));
  EXPECT_EQ(log.frames[0].replied, std::vector<std::uint8_t>{0});
  EXPECT_EQ(log.frames[0].result_hash, 0xfedcba9876543210ULL);
  EXPECT_EQ(log.frames[1].frame, 5);
  EXPECT_EQ(log.steps, steps);
}

TEST(ScheduleLog, DamageIsSaidInOneLine) {
  std::string text;
  write_entry(frame(3, 17, {1, 0}), &text);
  write_entry(step(StepEntry::Kind::work, 5), &text);
  for (std::size_t size = 1; size < text.size(); ++size) {
    const std::string cut = text.substr(0, size);
    if (size == 1 + 4 + 1 + 8 + 3 + 1 + 8) continue;  // after the first entry
    EXPECT_THROW(parse_schedule(bytes_of(cut), "file"), InputError) << size;
  }
  std::string back = text;
  write_entry(frame(3, 18), &back);
  try {
    parse_schedule(bytes_of(back), "file");
    FAIL() << "a frame twice";
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()).rfind("file: schedule, byte ", 0), 0U) << error.what();
  }
}

TEST(RecordingSchedule, NotesWhatTheTrackerWasTold) {
  SharedMap map;
  MapperInbox inbox(1);
  RecordingTrackerSchedule schedule(&map, &inbox);
  map.publish();
  EXPECT_EQ(schedule.snapshot()->version, 1U);
  MapperMessage counts = PointCounts();
  EXPECT_TRUE(schedule.try_push(counts));
  EXPECT_FALSE(schedule.try_push(counts));
  std::promise<InitialisationReply> reply;
  const auto future = reply.get_future();
  EXPECT_FALSE(schedule.is_ready(future));
  reply.set_value({});
  EXPECT_TRUE(schedule.is_ready(future));
  const FrameEntry entry = schedule.take_entry();
  EXPECT_EQ(entry.snapshot, 1U);
  EXPECT_EQ(entry.pushed, (std::vector<std::uint8_t>{1, 0}));
  EXPECT_EQ(entry.replied, (std::vector<std::uint8_t>{0, 1}));
  EXPECT_TRUE(schedule.take_entry().pushed.empty());
}

TEST(RecordingSchedule, NotesWhatTheMapperDid) {
  MapperInbox inbox(8);
  std::vector<StepEntry> noted;
  RecordingMapperSchedule schedule(&inbox, [&](const StepEntry& e) { noted.push_back(e); });
  EXPECT_FALSE(schedule.try_pop());
  const auto push = [&](MapperMessage message) { ASSERT_TRUE(inbox.try_push(message)); };
  push(PointCounts());
  ScaleRequest scale;
  scale.factor = 2.5;
  push(std::move(scale));
  PlaneRequest plane;
  plane.seed = Eigen::Vector3d(1, 2, 3);
  push(std::move(plane));
  push(ResetRequest());
  while (schedule.try_pop()) {
  }
  {
    const Interruption interruption = schedule.interruption();
    EXPECT_FALSE(interruption.requested());
    EXPECT_FALSE(interruption.requested());
    schedule.interrupt();
    EXPECT_TRUE(interruption.requested());
    EXPECT_TRUE(interruption.requested());
    schedule.worked(interruption);
  }
  ASSERT_EQ(noted.size(), 5U);
  EXPECT_EQ(noted[0].kind, StepEntry::Kind::message);
  EXPECT_EQ(noted[1].kind, StepEntry::Kind::scale);
  EXPECT_EQ(noted[1].factor, 2.5);
  EXPECT_EQ(noted[2].seed, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(noted[3].kind, StepEntry::Kind::reset);
  EXPECT_EQ(noted[4], step(StepEntry::Kind::work, 3)) << "stopped at the third question";
}

TEST(Interruption, StopsAtTheQuestionItIsToldTo) {
  const Interruption at_three = Interruption::at_poll(3);
  EXPECT_FALSE(at_three.requested());
  EXPECT_FALSE(at_three.requested());
  EXPECT_EQ(at_three.stopped_at(), 0);
  EXPECT_TRUE(at_three.requested());
  EXPECT_TRUE(at_three.requested());
  EXPECT_EQ(at_three.stopped_at(), 3);
  const Interruption never = Interruption::at_poll(0);
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(never.requested());
}

// A mapper that publishes once a step, and takes a message where the log says so.
class ReplayTest : public ::testing::Test {
 protected:
  void start(ScheduleLog log) {
    replay_ = std::make_unique<ReplaySchedule>(std::move(log), &map_);
    replay_->set_mapper_step([this] {
      if (replay_->mapper()->try_pop()) {
        ++messages_;
      } else {
        const Interruption interruption = replay_->mapper()->interruption();
        for (int i = 0; i < polls_ && !interruption.requested(); ++i) {
        }
        replay_->mapper()->worked(interruption);
      }
      map_.publish();
      return true;
    });
  }

  SharedMap map_;
  std::unique_ptr<ReplaySchedule> replay_;
  int messages_ = 0, polls_ = 100;
};

TEST_F(ReplayTest, TheMapperRunsAsFarAsTheFrameSaw) {
  start({{frame(0, 0), frame(2, 2, {1, 0}), frame(3, 2)},
         {step(StepEntry::Kind::work), step(StepEntry::Kind::work, 2), step(StepEntry::Kind::message)}});
  bool ended = false;
  ASSERT_NE(replay_->begin_frame(0, &ended), nullptr);
  EXPECT_EQ(replay_->tracker()->snapshot()->version, 0U);
  replay_->end_frame();
  EXPECT_EQ(replay_->begin_frame(1, &ended), nullptr) << "not tracked then";
  EXPECT_FALSE(ended);
  polls_ = 0;
  ASSERT_THROW(replay_->begin_frame(2, &ended), ReplayDifference) << "stopped at its second question, not before";
}

TEST_F(ReplayTest, MessagesGoTheirLoggedWay) {
  start({{frame(0, 0), frame(2, 2, {1, 0}), frame(3, 3)},
         {step(StepEntry::Kind::work), step(StepEntry::Kind::work, 2), step(StepEntry::Kind::message)}});
  bool ended = false;
  for (int index : {0, 2}) {
    ASSERT_NE(replay_->begin_frame(index, &ended), nullptr);
    EXPECT_EQ(replay_->tracker()->snapshot()->version, static_cast<std::uint64_t>(index));
    if (index == 2) {
      MapperMessage message = PointCounts();
      EXPECT_TRUE(replay_->tracker()->try_push(message));
      EXPECT_FALSE(replay_->tracker()->try_push(message)) << "there was no room then";
    }
    replay_->end_frame();
  }
  EXPECT_EQ(messages_, 0);
  ASSERT_NE(replay_->begin_frame(3, &ended), nullptr);
  EXPECT_EQ(messages_, 1);
  EXPECT_EQ(replay_->tracker()->snapshot()->version, 3U);
  EXPECT_TRUE(replay_->at_end());
  EXPECT_EQ(replay_->begin_frame(4, &ended), nullptr);
  EXPECT_TRUE(ended);
  replay_->finish();
}

TEST_F(ReplayTest, WhatIsNotAsItWasIsSaid) {
  start({{frame(0, 0, {1}), frame(1, 1)}, {step(StepEntry::Kind::message)}});
  bool ended = false;
  ASSERT_NE(replay_->begin_frame(0, &ended), nullptr);
  replay_->tracker()->snapshot();
  EXPECT_THROW(replay_->end_frame(), ReplayDifference) << "the message was not sent";
  EXPECT_THROW(replay_->begin_frame(1, &ended), ReplayDifference) << "so there is none to take";
}

TEST_F(ReplayTest, ALogThatEndsEndsTheReplay) {
  start({{frame(0, 0), frame(1, 5)}, {step(StepEntry::Kind::work)}});
  bool ended = false;
  ASSERT_NE(replay_->begin_frame(0, &ended), nullptr);
  replay_->tracker()->snapshot();
  replay_->end_frame();
  EXPECT_EQ(replay_->begin_frame(1, &ended), nullptr);
  EXPECT_TRUE(ended);
  start({{frame(4, 0)}, {}});
  EXPECT_EQ(replay_->begin_frame(5, &ended), nullptr) << "the images of a tracked frame were lost";
  EXPECT_TRUE(ended);
}

}  // namespace
}  // namespace parallax
