// The mapper's inbox: what interrupts a solve, and what does not.
#include "map/messages.h"

#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <thread>
#include <utility>
#include <variant>

namespace parallax {
namespace {

MapperMessage counts() { return PointCounts(); }
MapperMessage keyframe(int frame) {
  KeyframeProposal p;
  p.frame = frame;
  return p;
}

bool push(MapperInbox* inbox, MapperMessage message) { return inbox->try_push(message); }

TEST(MapperInbox, OnlyUrgentMessagesInterrupt) {
  {
    MapperInbox inbox(8);
    const std::stop_token token = inbox.interrupt_token();
    EXPECT_FALSE(token.stop_requested());
    ASSERT_TRUE(push(&inbox, counts()));
    EXPECT_FALSE(token.stop_requested());
    ASSERT_TRUE(push(&inbox, keyframe(1)));
    EXPECT_TRUE(token.stop_requested());
  }
  {
    MapperInbox inbox(8);
    const std::stop_token token = inbox.interrupt_token();
    ASSERT_TRUE(push(&inbox, ResetRequest()));
    EXPECT_TRUE(token.stop_requested());
  }
  {
    MapperInbox inbox(8);
    const std::stop_token token = inbox.interrupt_token();
    ASSERT_TRUE(push(&inbox, InitialisationRequest()));
    EXPECT_TRUE(token.stop_requested());
  }
}

TEST(MapperInbox, ATokenIsStoppedAtOnceWhileSomethingUrgentWaits) {
  MapperInbox inbox(8);
  push(&inbox, counts());
  push(&inbox, keyframe(1));
  push(&inbox, keyframe(2));
  EXPECT_TRUE(inbox.interrupt_token().stop_requested());
  ASSERT_TRUE(inbox.try_pop());  // the counts
  ASSERT_TRUE(inbox.try_pop());  // the first keyframe
  EXPECT_TRUE(inbox.interrupt_token().stop_requested()) << "the second still waits";
  const auto last = inbox.try_pop();
  ASSERT_TRUE(last);
  EXPECT_EQ(std::get<KeyframeProposal>(*last).frame, 2);
  EXPECT_FALSE(inbox.interrupt_token().stop_requested());
  EXPECT_FALSE(inbox.try_pop());
}

TEST(MapperInbox, ARefusedMessageStaysWithTheCallerAndInterruptsNothing) {
  MapperInbox inbox(2);
  push(&inbox, counts());
  push(&inbox, counts());
  const std::stop_token token = inbox.interrupt_token();
  KeyframeProposal proposal;
  proposal.frame = 17;
  proposal.measurements.resize(3);
  MapperMessage message = std::move(proposal);
  EXPECT_FALSE(inbox.try_push(message));
  EXPECT_FALSE(token.stop_requested());
  EXPECT_EQ(std::get<KeyframeProposal>(message).frame, 17);
  EXPECT_EQ(std::get<KeyframeProposal>(message).measurements.size(), 3U);
  EXPECT_EQ(inbox.size(), 2U);
  while (inbox.try_pop()) {
  }
  EXPECT_FALSE(inbox.interrupt_token().stop_requested()) << "nothing urgent is counted as waiting";
}

TEST(MapperInbox, InterruptStopsTheSolveInProgressAlone) {
  MapperInbox inbox(2);
  const std::stop_token token = inbox.interrupt_token();
  inbox.interrupt();
  EXPECT_TRUE(token.stop_requested());
  EXPECT_FALSE(inbox.interrupt_token().stop_requested());
}

TEST(MapperInbox, PopWaitsForAMessageAStopOrTheEnd) {
  MapperInbox inbox(4);
  {
    std::jthread sender([&] { push(&inbox, keyframe(5)); });
    const auto got = inbox.pop({});
    ASSERT_TRUE(got);
    EXPECT_EQ(std::get<KeyframeProposal>(*got).frame, 5);
  }
  {
    std::stop_source stop;
    std::jthread stopper([&] { stop.request_stop(); });
    EXPECT_FALSE(inbox.pop(stop.get_token()));
  }
  inbox.close();
  EXPECT_FALSE(inbox.pop({}));
  EXPECT_FALSE(push(&inbox, keyframe(6)));
}

TEST(MapperInbox, ADroppedRequestBreaksItsPromise) {
  std::future<void> done;
  {
    MapperInbox inbox(1);
    ResetRequest reset;
    done = reset.done.get_future();
    push(&inbox, std::move(reset));
  }
  EXPECT_THROW(done.get(), std::future_error);
}

// Every message arrives once, and at the end nothing urgent is thought to wait, however pushes and pops meet.
TEST(MapperInbox, TwoThreads) {
  MapperInbox inbox(3);
  constexpr int kMessages = 3000;
  std::atomic<int> refused = 0;
  std::jthread sender([&] {
    for (int i = 0; i < kMessages; ++i) {
      MapperMessage m = i % 3 == 0 ? counts() : keyframe(i);
      while (!inbox.try_push(m)) {
        ++refused;
        std::this_thread::yield();
      }
    }
  });
  int last_frame = -1;
  for (int received = 0; received < kMessages; ++received) {
    inbox.interrupt_token();
    const auto m = inbox.pop({});
    ASSERT_TRUE(m);
    if (const auto* k = std::get_if<KeyframeProposal>(&*m)) {
      ASSERT_GT(k->frame, last_frame);
      last_frame = k->frame;
    }
  }
  sender.join();
  EXPECT_FALSE(inbox.interrupt_token().stop_requested());
}

}  // namespace
}  // namespace parallax
