#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <memory>
#include <stdexcept>

#include "camera/frame_source.h"
#include "core/mutex.h"
#include "source_fixture.h"

namespace parallax {
namespace {

// Counts what is asked of it; frame 3 is skipped with a warning.
class CountingSource : public FrameSource {
 public:
  explicit CountingSource(int frames, int fail_at = -1) : frames_(frames), fail_at_(fail_at) {}

  std::optional<Frame> next() override {
    if (index_ == fail_at_) throw std::runtime_error("the disk went away");
    if (index_ == 3) warnings_.push_back({index_++, "frame 3 was skipped"});
    if (index_ >= frames_) return std::nullopt;
    Frame frame;
    frame.index = index_++;
    {
      MutexLock lock(mutex_);
      ++read_;
    }
    changed_.notify_all();
    return frame;
  }
  std::vector<SourceWarning> take_warnings() override { return std::exchange(warnings_, {}); }
  int frame_count() const override { return frames_; }
  double frames_per_second() const override { return 12; }
  std::string description() const override { return "counting"; }
  std::vector<StampedPose> ground_truth() const override { return {StampedPose{}}; }

  void wait_for(int read) {
    MutexLock lock(mutex_);
    changed_.wait(mutex_, [this, read]() PARALLAX_REQUIRES(mutex_) { return read_ >= read; });
  }
  int read() {
    MutexLock lock(mutex_);
    return read_;
  }

 private:
  const int frames_, fail_at_;
  int index_ = 0;
  std::vector<SourceWarning> warnings_{{-1, "at the start"}};
  Mutex mutex_;
  std::condition_variable_any changed_;
  int read_ PARALLAX_GUARDED_BY(mutex_) = 0;
};

TEST(ReadAhead, TheSameFramesAndWarningsInOrder) {
  const auto source = make_read_ahead(std::make_unique<CountingSource>(20), 3);
  EXPECT_EQ(source->frame_count(), 20);
  EXPECT_EQ(source->frames_per_second(), 12);
  EXPECT_EQ(source->description(), "counting");
  EXPECT_EQ(source->ground_truth().size(), 1u);
  auto warnings = source->take_warnings();
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].text, "at the start");
  for (int i = 0; i < 20; ++i) {
    if (i == 3) continue;
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->index, i);
    // A warning comes with the frame after it, not when the thread happened to meet it.
    warnings = source->take_warnings();
    EXPECT_EQ(warnings.size(), i == 4 ? 1u : 0u);
  }
  EXPECT_FALSE(source->next());
  EXPECT_FALSE(source->next());
}

TEST(ReadAhead, ReadsAheadButNoFurtherThanAsked) {
  auto counting = std::make_unique<CountingSource>(100);
  CountingSource& inside = *counting;
  const auto source = make_read_ahead(std::move(counting), 4);
  // Four in the queue and one in the thread's hands.
  inside.wait_for(5);
  EXPECT_EQ(inside.read(), 5);
  ASSERT_TRUE(source->next());
  inside.wait_for(6);
  EXPECT_EQ(inside.read(), 6);
}

TEST(ReadAhead, ItsEndStopsAThreadThatWaits) {
  auto counting = std::make_unique<CountingSource>(1000000);
  CountingSource& inside = *counting;
  auto source = make_read_ahead(std::move(counting), 2);
  inside.wait_for(3);
  source.reset();  // must come back
  SUCCEED();
}

TEST(ReadAhead, AnExceptionReachesTheConsumerInItsTurn) {
  const auto source = make_read_ahead(std::make_unique<CountingSource>(20, 2), 8);
  EXPECT_TRUE(source->next());
  EXPECT_TRUE(source->next());
  EXPECT_THROW(source->next(), std::runtime_error);
  EXPECT_FALSE(source->next());
}

using ReadAheadFiles = SourceTest;

TEST_F(ReadAheadFiles, TheSameAsWithout) {
  put_tum("tum");
  std::filesystem::remove(path("tum/rgb/5.jpg"));
  const Played direct = play(*open_frame_source(path("tum")));
  const Played ahead = play(*make_read_ahead(open_frame_source(path("tum"))));
  ASSERT_EQ(direct.frames.size(), 9u);
  ASSERT_EQ(ahead.frames.size(), direct.frames.size());
  for (std::size_t i = 0; i < direct.frames.size(); ++i) {
    EXPECT_EQ(ahead.frames[i].index, direct.frames[i].index);
    EXPECT_EQ(ahead.frames[i].time, direct.frames[i].time);
    EXPECT_TRUE(same_pixels(ahead.frames[i].grey, direct.frames[i].grey));
  }
  ASSERT_EQ(ahead.warnings.size(), 1u);
  EXPECT_EQ(ahead.warnings[0].text, direct.warnings[0].text);
}

}  // namespace
}  // namespace parallax
