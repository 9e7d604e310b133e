// Recordings: what goes in comes out, and damage is found.
#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/core.hpp>
#include <random>
#include <sstream>

#include "camera/recording_source.h"
#include "core/error.h"
#include "tests/support/process.h"

namespace parallax::testing {
namespace {

Frame made_frame(int index, int width, int height, bool colour, int kind) {
  std::mt19937 rng(static_cast<unsigned>(100 * index + kind));
  Frame frame;
  frame.index = index;
  frame.time = Timestamp(1'000'000'007LL * (index + 1));
  frame.grey.create(height, width);
  if (colour) frame.colour.create(height, width);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int smooth = 128 + static_cast<int>(90 * std::sin(0.05 * x) * std::cos(0.04 * y));
      const int noise = static_cast<int>(rng() % 7) - 3;
      const int value = kind == 0 ? static_cast<int>(rng() % 256) : kind == 1 ? (x + y) % 2 * 255 : smooth + noise;
      frame.grey(y, x) = static_cast<std::uint8_t>(value);
      if (!colour) continue;
      for (int c = 0; c < 3; ++c)
        frame.colour(y, x)[c] =
            static_cast<std::uint8_t>(kind == 2 ? smooth + 10 * c + noise : static_cast<int>(rng()));
    }
  }
  return frame;
}

bool same(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && (a.empty() || cv::norm(a, b, cv::NORM_INF) == 0);
}

TEST(ImageCodec, IsLossless) {
  ImageCodec codec;
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(1, 9), cv::Size(9, 1), cv::Size(33, 17), cv::Size(320, 240)}) {
    for (int kind = 0; kind < 3; ++kind) {
      const Frame frame = made_frame(3, size.width, size.height, true, kind);
      std::string grey, colour;
      codec.pack_grey(frame.grey, &grey);
      codec.pack_colour(frame.colour, frame.grey, &colour);
      GreyImage grey_again;
      cv::Mat3b colour_again;
      const auto bytes = [](const std::string& text) {
        return std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
      };
      ASSERT_TRUE(codec.unpack_grey(bytes(grey), size, &grey_again));
      ASSERT_TRUE(codec.unpack_colour(bytes(colour), grey_again, &colour_again));
      EXPECT_TRUE(same(frame.grey, grey_again)) << size.width << "x" << size.height << " kind " << kind;
      EXPECT_TRUE(same(frame.colour, colour_again)) << size.width << "x" << size.height << " kind " << kind;
      EXPECT_FALSE(codec.unpack_grey(bytes(grey), size + cv::Size(1, 0), &grey_again));
      if (size.width == 320 && kind == 2) {
        EXPECT_LT(grey.size() + colour.size(), 4 * frame.grey.total() / 2) << "an image of a scene";
      }
    }
  }
}

// A part of a larger image: rows are not one after the other in memory.
TEST(ImageCodec, TakesImagesThatAreParts) {
  ImageCodec codec;
  const Frame whole = made_frame(0, 64, 48, false, 2);
  const GreyImage part = whole.grey(cv::Rect(5, 7, 31, 22));
  std::string bytes;
  codec.pack_grey(part, &bytes);
  GreyImage again;
  ASSERT_TRUE(
      codec.unpack_grey({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, part.size(), &again));
  EXPECT_TRUE(same(part.clone(), again));
}

class RecordingTest : public ::testing::Test {
 protected:
  static constexpr int kFrames = 12, kWidth = 96, kHeight = 64;

  static CameraModel camera() {
    return CameraModel(CameraModelKind::fov, kWidth, kHeight, {60.1, 1.0 / 3.0 + 60}, {48.25, 31.75}, {0.9}, 1);
  }
  static Frame frame(int i) { return made_frame(3 * i, kWidth, kHeight, i % 2 == 0, 2); }

  RecordingTest() : path_(folder_.file("session.plx")) {
    RecordingWriter writer(path_);
    writer.write_header({{"calibration", exact_text(camera())}, {"frames_per_second", "25"}, {"note", "a\nb"}});
    for (int i = 0; i < kFrames; ++i) {
      writer.write_frame(frame(i));
      writer.write_schedule("schedule" + std::to_string(i));
    }
    writer.write_end({{"map_hash", "17"}});
    bytes_ = read_all(path_);
  }
  std::string with(const std::string& bytes) {
    const std::string path = folder_.file("other.plx");
    std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return path;
  }

  ScratchFolder folder_;
  std::string path_, bytes_;
};

TEST_F(RecordingTest, EverythingComesBack) {
  SourceOptions options;
  options.colour = true;
  const auto source = open_frame_source(path_, options);
  EXPECT_EQ(source->frame_count(), kFrames);
  EXPECT_EQ(source->frames_per_second(), 25);
  ASSERT_TRUE(source->calibration());
  EXPECT_TRUE(*source->calibration() == camera()) << "to the last bit";
  for (int i = 0; i < kFrames; ++i) {
    const auto got = source->next();
    ASSERT_TRUE(got);
    const Frame expected = frame(i);
    EXPECT_EQ(got->index, expected.index);
    EXPECT_EQ(got->time, expected.time);
    EXPECT_TRUE(same(got->grey, expected.grey));
    EXPECT_TRUE(same(got->colour, expected.colour));
  }
  EXPECT_FALSE(source->next());
  EXPECT_TRUE(source->take_warnings().empty());
  const auto* recording = dynamic_cast<const RecordingSource*>(source.get());
  ASSERT_NE(recording, nullptr);
  EXPECT_EQ(recording->contents().header.at("note"), "a\nb");
  const auto& schedule = recording->contents().schedule;
  EXPECT_EQ(std::string(schedule.begin(), schedule.begin() + 18), "schedule0schedule1");
  EXPECT_EQ(recording->contents().summary->at("map_hash"), "17");
}

TEST_F(RecordingTest, StartAndLimitAreThoseOfEverySource) {
  SourceOptions options;
  options.start_frame = 7;
  options.max_frames = 2;
  const auto source = open_frame_source(path_, options);
  EXPECT_EQ(source->next()->index, 9);
  const auto second = source->next();
  EXPECT_EQ(second->index, 12);
  EXPECT_TRUE(second->colour.empty()) << "not asked for";
  EXPECT_FALSE(source->next());
}

// Cut off anywhere: what was written whole is there, and nothing else.
TEST_F(RecordingTest, AFileCutOffAnywhereIsReadUpToThere) {
  std::size_t last = 0;
  int readable = 0;
  std::vector<std::size_t> sizes;
  for (std::size_t size = 0; size < bytes_.size(); size += size < 700 ? 7 : 331) sizes.push_back(size);
  sizes.push_back(bytes_.size() - 1);
  for (const std::size_t size : sizes) {
    try {
      RecordingSource source(with(bytes_.substr(0, size)), {});
      ++readable;
      std::size_t n = 0;
      while (const auto got = source.next()) {
        EXPECT_TRUE(same(got->grey, frame(static_cast<int>(n)).grey));
        ++n;
      }
      EXPECT_GE(n, last) << size;
      EXPECT_FALSE(source.contents().summary);
      last = n;
    } catch (const InputError& error) {
      EXPECT_EQ(last, 0U) << error.what();
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    }
  }
  EXPECT_EQ(last, static_cast<std::size_t>(kFrames));
  EXPECT_GT(readable, 50);
}

TEST_F(RecordingTest, AChangedByteNeverPassesForTheTruth) {
  std::mt19937 rng(11);
  int skipped = 0, refused = 0;
  for (int round = 0; round < 400; ++round) {
    std::string damaged = bytes_;
    const std::size_t at = rng() % damaged.size();
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << rng() % 8));
    try {
      RecordingSource source(with(damaged), {});
      int n = 0;
      while (const auto got = source.next()) {
        ++n;
        ASSERT_TRUE(same(got->grey, frame(got->index / 3).grey)) << "byte " << at;
      }
      const auto warnings = source.take_warnings();
      if (n < kFrames) {
        ++skipped;
        EXPECT_FALSE(warnings.empty()) << "byte " << at;
      }
      for (const SourceWarning& w : warnings) EXPECT_EQ(w.text.find('\n'), std::string::npos);
    } catch (const InputError& error) {
      ++refused;
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
    }
  }
  EXPECT_GT(skipped, 100);
  EXPECT_GT(refused, 0) << "the header";
}

TEST_F(RecordingTest, OtherFilesAreNotTakenForOne) {
  EXPECT_TRUE(is_recording_file(path_));
  EXPECT_FALSE(is_recording_file(with("PLXREC")));
  EXPECT_FALSE(is_recording_file(with("RIFF....AVI LIST")));
  EXPECT_FALSE(is_recording_file(folder_.file("absent")));
  EXPECT_THROW(RecordingSource(with("something else entirely"), {}), InputError);
  EXPECT_THROW(RecordingSource(with(bytes_.substr(0, 8)), {}), InputError);
}

TEST(RecordedCamera, IsExactForEveryModel) {
  const std::vector<CameraModel> cameras{
      CameraModel(CameraModelKind::pinhole, 640, 480, {500.1, 500.2}, {320.3, 240.4}),
      CameraModel(CameraModelKind::radtan, 640, 480, {500.1, 500.2}, {320.3, 240.4}, {0.1, -0.01, 1e-4, 2e-4, 0.003},
                  5),
      CameraModel(CameraModelKind::kannala_brandt, 640, 480, {300.1, 300.2}, {320.3, 240.4}, {0.01, 0.001, 0, 0}, 4),
      CameraModel(CameraModelKind::fov, 640, 480, {400.1, 400.2}, {320.3, 240.4}, {1.0 / 3.0}, 1)};
  for (const CameraModel& camera : cameras) {
    EXPECT_TRUE(parse_exact_camera(exact_text(camera), "file") == camera) << exact_text(camera);
  }
  for (const char* text :
       {"", "pinhole", "pinhole 640 480 1 2 3", "square 640 480 1 2 3 4", "pinhole 640 480 1 2 3 x",
        "pinhole 640 480 1 2 3 nan", "two\nlines", "pinhole -1 480 1 2 3 4", "fov 640 480 1 2 3 4 5 6 7 8 9 9 9 9"}) {
    try {
      (void)parse_exact_camera(text, "file");
      ADD_FAILURE() << text;
    } catch (const InputError& error) {
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    }
  }
}

}  // namespace
}  // namespace parallax::testing
