#include "camera/frame_source.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include "camera/image_file.h"
#include "source_fixture.h"

namespace parallax {
namespace {
namespace fs = std::filesystem;

using FrameSourceTest = SourceTest;

TEST_F(FrameSourceTest, TumFolder) {
  put_tum("tum");
  const auto source = open_frame_source(path("tum"));
  EXPECT_EQ(source->frame_count(), 10);
  EXPECT_NEAR(source->frames_per_second(), 20, 1e-9);
  ASSERT_TRUE(source->calibration());
  EXPECT_EQ(source->calibration()->width(), 320);
  EXPECT_EQ(source->calibration()->focal_px().y(), 301);
  const auto truth = source->ground_truth();
  ASSERT_EQ(truth.size(), 10u);
  const Played played = play(*source);
  EXPECT_TRUE(played.warnings.empty());
  ASSERT_EQ(played.frames.size(), 10u);
  for (int i = 0; i < 10; ++i) {
    const Frame& frame = played.frames[static_cast<std::size_t>(i)];
    EXPECT_EQ(frame.index, i);
    EXPECT_EQ(frame.time, std::chrono::milliseconds(100000 + 50 * i));
    EXPECT_EQ(truth[static_cast<std::size_t>(i)].time, frame.time);
    EXPECT_EQ(truth[static_cast<std::size_t>(i)].world_from_camera.t.x(), i);
    EXPECT_TRUE(frame.colour.empty());
    EXPECT_TRUE(
        same_pixels(frame.grey, cv::imread(path("tum/rgb/" + std::to_string(i) + ".jpg"), cv::IMREAD_GRAYSCALE)));
  }
}

TEST_F(FrameSourceTest, EurocFolderWithTheBodyToCameraTransformApplied) {
  put_euroc("euroc");
  for (const char* name : {"euroc", "euroc/mav0"}) {
    const auto source = open_frame_source(path(name));
    EXPECT_EQ(source->frame_count(), 6);
    ASSERT_TRUE(source->calibration());
    EXPECT_EQ(source->calibration()->kind(), CameraModelKind::radtan);
    EXPECT_EQ(source->calibration()->distortion()[0], -0.1);
    const auto truth = source->ground_truth();
    ASSERT_EQ(truth.size(), 6u);
    EXPECT_EQ(truth[2].world_from_camera.t, Eigen::Vector3d(2, 0, 0.5));
    const Played played = play(*source);
    ASSERT_EQ(played.frames.size(), 6u);
    EXPECT_EQ(played.frames[3].time.count(), 1400000000150000000);
    EXPECT_TRUE(same_pixels(played.frames[3].grey, grey_picture(3)));
    EXPECT_TRUE(played.warnings.empty());
  }
}

TEST_F(FrameSourceTest, KittiFolder) {
  put_kitti("kitti");
  const auto source = open_frame_source(path("kitti"));
  EXPECT_EQ(source->frame_count(), 5);
  EXPECT_NEAR(source->frames_per_second(), 10, 1e-9);
  ASSERT_TRUE(source->calibration());
  EXPECT_EQ(source->calibration()->focal_px().x(), 300);
  EXPECT_EQ(source->ground_truth().at(4).world_from_camera.t.x(), 4);
  EXPECT_EQ(source->ground_truth().at(4).time, from_seconds(0.4));
  const Played played = play(*source);
  ASSERT_EQ(played.frames.size(), 5u);
  EXPECT_TRUE(same_pixels(played.frames[4].grey, grey_picture(4)));
}

TEST_F(FrameSourceTest, PlainImagesInNaturalOrder) {
  for (const int i : {1, 2, 9, 10, 11, 100}) put_image("im/img" + std::to_string(i) + ".png", grey_picture(i));
  put("im/notes.md", "not an image");
  put("im/.img3.png", "not looked at");
  SourceOptions options;
  options.fallback_fps = 10;
  const auto source = open_frame_source(path("im"), options);
  EXPECT_FALSE(source->calibration());
  EXPECT_TRUE(source->ground_truth().empty());
  const Played played = play(*source);
  ASSERT_EQ(played.frames.size(), 6u);
  int at = 0;
  for (const int i : {1, 2, 9, 10, 11, 100}) {
    EXPECT_EQ(played.frames[static_cast<std::size_t>(at)].index, at);
    EXPECT_EQ(played.frames[static_cast<std::size_t>(at)].time, from_seconds(at / 10.0));
    EXPECT_TRUE(same_pixels(played.frames[static_cast<std::size_t>(at)].grey, grey_picture(i)));
    ++at;
  }
}

TEST_F(FrameSourceTest, StartAndMaximum) {
  put_tum("tum");
  SourceOptions options;
  options.start_frame = 4;
  options.max_frames = 3;
  const auto source = open_frame_source(path("tum"), options);
  EXPECT_EQ(source->frame_count(), 3);
  const Played played = play(*source);
  ASSERT_EQ(played.frames.size(), 3u);
  EXPECT_EQ(played.frames[0].index, 4);
  EXPECT_EQ(played.frames[2].time, std::chrono::milliseconds(100300));
  options.start_frame = 10;
  EXPECT_TRUE(contains(input_error([&] { open_frame_source(path("tum"), options); }), "found 10 frames"));
}

TEST_F(FrameSourceTest, GreyIsTheSameWhetherColourIsWantedOrNot) {
  put_tum("tum", 3);
  put_image("png/0.png", picture(4));
  put_image("png/1.png", grey_picture(4));
  for (const char* name : {"tum", "png"}) {
    SourceOptions colour;
    colour.colour = true;
    const auto without = open_frame_source(path(name)), with = open_frame_source(path(name), colour);
    const Played a = play(*without), b = play(*with);
    ASSERT_EQ(a.frames.size(), b.frames.size());
    for (std::size_t i = 0; i < a.frames.size(); ++i) {
      EXPECT_TRUE(same_pixels(a.frames[i].grey, b.frames[i].grey)) << name << i;
      EXPECT_TRUE(a.frames[i].colour.empty());
      const bool grey_file = std::string(name) == "png" && i == 1;
      EXPECT_EQ(b.frames[i].colour.empty(), grey_file);
      if (!grey_file) {
        EXPECT_EQ(b.frames[i].colour.size(), b.frames[i].grey.size());
      }
    }
  }
}

TEST_F(FrameSourceTest, MissingAndDamagedImagesAreSkippedAndKeepTheirNumber) {
  put_tum("tum");
  fs::remove(path("tum/rgb/2.jpg"));
  cut_in_half("tum/rgb/4.jpg");
  put("tum/rgb/6.jpg", "no image at all");
  put("tum/rgb/7.jpg", "");
  put_image("tum/rgb/8.jpg", picture(8, 160, 120));
  const Played played = play(*open_frame_source(path("tum")));
  ASSERT_EQ(played.frames.size(), 5u);
  EXPECT_EQ(played.frames[2].index, 3);
  EXPECT_EQ(played.frames[4].index, 9);
  ASSERT_EQ(played.warnings.size(), 5u);
  const int expected[] = {2, 4, 6, 7, 8};
  const char* reasons[] = {"No such file", "cut short", "not an image", "empty",
                           "found size 160x120, expected 320x240"};
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(played.warnings[i].frame, expected[i]);
    EXPECT_TRUE(contains(played.warnings[i].text, "rgb/" + std::to_string(expected[i]) + ".jpg: skipped: "));
    EXPECT_TRUE(contains(played.warnings[i].text, reasons[i])) << played.warnings[i].text;
    EXPECT_FALSE(contains(played.warnings[i].text, "\n"));
  }
}

TEST_F(FrameSourceTest, DamageOfEveryLengthIsSeen) {
  put_image("a.jpg", picture(1));
  put_image("a.png", picture(1));
  for (const char* name : {"a.jpg", "a.png"}) {
    const std::string whole = get(name);
    EXPECT_EQ(image_damage(whole), "");
    DecodedImage image;
    for (std::size_t size = 0; size < whole.size(); size += 1 + whole.size() / 97) {
      EXPECT_NE(decode_image(std::string_view(whole).substr(0, size), {}, &image), "") << name << " " << size;
    }
    EXPECT_NE(decode_image(std::string_view(whole).substr(0, whole.size() - 1), {}, &image), "");
    EXPECT_EQ(decode_image(whole + "trailing", {}, &image), "");
  }
  std::string flipped = get("a.png");
  flipped[flipped.size() / 2] = static_cast<char>(flipped[flipped.size() / 2] ^ 1);
  EXPECT_TRUE(contains(image_damage(flipped), "check sum"));
}

TEST_F(FrameSourceTest, BadLinesAreReportedAndUseUpANumber) {
  put_tum("tum", 6);
  put("tum/rgb.txt",
      "# list\n100.0 rgb/0.jpg\nnonsense\n\n100.1 rgb/2.jpg\nnan rgb/3.jpg\n100.15\n100.3 /etc/passwd\n"
      "100.35 rgb/../../outside.jpg\n100.05 rgb/1.jpg\n100.4 rgb/4.jpg\n" +
          std::string("100.5 ") + path("tum") + "/rgb/5.jpg\n");
  const Played played = play(*open_frame_source(path("tum")));
  ASSERT_EQ(played.frames.size(), 4u);
  EXPECT_EQ(played.frames[1].index, 2);
  EXPECT_EQ(played.frames[2].index, 8);
  EXPECT_EQ(played.frames[3].index, 9);
  ASSERT_EQ(played.warnings.size(), 6u);
  std::string all;
  for (const auto& warning : played.warnings) all += warning.text + "\n";
  for (const char* part : {"rgb.txt:3: found 'nonsense'", "rgb.txt:6: found 'nan rgb/3.jpg'",
                           "rgb.txt:7: found '100.15'", "rgb.txt:8: found '/etc/passwd', expected an image inside",
                           "rgb.txt:9: found 'rgb/../../outside.jpg'", "rgb.txt:10: found time 100.050000000 s"}) {
    EXPECT_TRUE(contains(all, part)) << part << " in\n" << all;
  }
}

TEST_F(FrameSourceTest, KittiWithAMissingImageAndABadTime) {
  put_kitti("kitti");
  fs::remove(path("kitti/image_0/000001.png"));
  put("kitti/times.txt", "0.0\n0.1\nx\n0.3\n0.4\n");
  const Played played = play(*open_frame_source(path("kitti")));
  ASSERT_EQ(played.frames.size(), 3u);
  EXPECT_EQ(played.frames[1].index, 3);
  EXPECT_TRUE(same_pixels(played.frames[1].grey, grey_picture(3)));
  ASSERT_EQ(played.warnings.size(), 2u);
  EXPECT_TRUE(contains(played.warnings[0].text, "times.txt:3: found 'x'"));
  EXPECT_TRUE(contains(played.warnings[1].text, "000001.png: skipped: "));
}

TEST_F(FrameSourceTest, BadGroundTruthIsAWarning) {
  put_tum("tum", 2);
  put("tum/groundtruth.txt", "100 0 0 0\n");
  const auto source = open_frame_source(path("tum"));
  EXPECT_TRUE(source->ground_truth().empty());
  const auto warnings = source->take_warnings();
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_TRUE(contains(warnings[0].text, "groundtruth.txt:1: found 4 values"));
}

TEST_F(FrameSourceTest, ACalibrationOfAnotherSizeIsRefusedAtOnce) {
  put_tum("tum", 2);
  put("tum/calibration.yaml", calibration_text(640, 480));
  const std::string tum = input_error([&] { open_frame_source(path("tum")); });
  EXPECT_TRUE(contains(tum, "640x480") && contains(tum, "320x240") && contains(tum, "calibration.yaml")) << tum;
  put_euroc("euroc", 2);
  put("euroc/mav0/cam0/sensor.yaml", sensor_text(0, 752));
  const std::string euroc = input_error([&] { open_frame_source(path("euroc")); });
  EXPECT_TRUE(contains(euroc, "752x240") && contains(euroc, "320x240") && contains(euroc, "sensor.yaml")) << euroc;
}

TEST_F(FrameSourceTest, SizesThatAreNotWorkedWith) {
  put_image("small/0.png", grey_picture(0, 159, 120));
  put_image("large/0.png", grey_picture(0, 1921, 1080));
  put_image("least/0.png", grey_picture(0, 160, 120));
  put_image("most/0.jpg", picture(0, 1920, 1080));
  EXPECT_TRUE(contains(input_error([&] { open_frame_source(path("small")); }),
                       "found size 159x120, expected 160x120 to 1920x1080"));
  EXPECT_TRUE(contains(input_error([&] { open_frame_source(path("large")); }), "found size 1921x1080"));
  EXPECT_EQ(play(*open_frame_source(path("least"))).frames.size(), 1u);
  EXPECT_EQ(play(*open_frame_source(path("most"))).frames.size(), 1u);
}

TEST_F(FrameSourceTest, SixteenBitsByTheFirstImagesDepth) {
  // Sixteen bits used to the full: the upper byte. Twelve bits in sixteen: the upper eight of the twelve.
  for (const int bits : {16, 12, 10}) {
    cv::Mat1w deep(240, 320);
    for (int y = 0; y < 240; ++y) {
      for (int x = 0; x < 320; ++x)
        deep(y, x) = static_cast<std::uint16_t>(std::int64_t{y * 320 + x} * ((1 << bits) - 1) / (240 * 320 - 1));
    }
    const std::string name = "deep" + std::to_string(bits);
    put_image(name + "/0.png", deep);
    cv::Mat1w brighter = deep.clone();
    brighter(0, 0) = 65535;
    put_image(name + "/1.png", brighter);
    const Played played = play(*open_frame_source(path(name)));
    ASSERT_EQ(played.frames.size(), 2u);
    for (int y = 0; y < 240; y += 7) {
      for (int x = 0; x < 320; x += 3) {
        ASSERT_EQ(played.frames[0].grey(y, x), deep(y, x) >> (bits - 8)) << bits << " " << x << " " << y;
      }
    }
    EXPECT_EQ(played.frames[1].grey(0, 0), 255);  // saturated, the scale stays
    EXPECT_EQ(played.frames[1].grey(200, 100), played.frames[0].grey(200, 100));
  }
}

TEST_F(FrameSourceTest, RefusalsAreOneClearLine) {
  fs::create_directories(path("empty"));
  put("text/readme.txt", "x");
  put_image("one.png", picture(0));
  put("empty.mp4", "");
  put("notes.txt", "some text");
  put("junk.mp4", std::string(5000, 'j'));
  put("disguised.mp4", get("one.png"));
  put("badtum/rgb.txt", "a\nb\n");
  put("unreadable/rgb.txt", "1 rgb/1.png\n2 rgb/2.png\n");
  fs::create_directories(path("kitti/image_0"));
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  const std::pair<std::string, std::string> cases[] = {
      {"empty", "found an empty folder"},
      {"text", "found no images"},
      {"one.png", "found a single image"},
      {"empty.mp4", "found an empty file"},
      {"notes.txt", "found a text file"},
      {"junk.mp4", "cannot be opened as a video"},
      {"disguised.mp4", "found a single image"},
      {"badtum", "rgb.txt: found no usable line"},
      {"unreadable", "rgb/1.png: cannot be read: No such file"},
      {"kitti", "image_0: found no image"},
      {"pipe", "found a device or pipe"},
      {"none", "cannot be read: No such file or directory"},
      {"none/below", "cannot be read"},
  };
  for (const auto& [name, part] : cases) {
    ::testing::internal::CaptureStderr();
    const std::string line = input_error([&, name = name] { open_frame_source(path(name)); });
    EXPECT_EQ(::testing::internal::GetCapturedStderr(), "") << name;
    EXPECT_TRUE(contains(line, part)) << name << ": " << line;
    EXPECT_TRUE(contains(line, path(name))) << line;
    EXPECT_FALSE(contains(line, "\n")) << line;
  }
  EXPECT_NE(input_error([] { open_frame_source(""); }), "");
}

}  // namespace
}  // namespace parallax
