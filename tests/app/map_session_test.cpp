// Sessions that begin with a saved map, and the file that a session keeps its map in.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "app/map_saver.h"
#include "app/session_hash.h"
#include "camera/calibration_file.h"
#include "core/error.h"
#include "core/trajectory_error.h"
#include "map/map_file.h"
#include "tests/app/run_fixture.h"
#include "tests/map/fabricated_map.h"

namespace parallax {
namespace {

using testing::expect_one_line;
using testing::parallax_run;
using testing::ProcessResult;
using testing::read_all;
using testing::run_process;
using testing::ScratchFolder;

constexpr const char* kDesk = "synthetic:desk?size=320x240";
constexpr int kMapped = 150;  // frames

ProcessResult parallax_map(const std::vector<std::string>& arguments) {
  std::vector<std::string> words{"60", PARALLAX_BINARY, "map"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  return run_process("/usr/bin/timeout", words);
}

ProcessResult live_headless(const std::vector<std::string>& arguments, const std::string& home) {
  std::vector<std::string> words{"60", PARALLAX_BINARY, "live", "--headless"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  return run_process("/usr/bin/timeout", words, {"XDG_CONFIG_HOME=" + home, "XDG_DATA_HOME=" + home});
}

// One map for all tests here.
class SavedMap : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new_folder();
    const ProcessResult made = parallax_run({kDesk, "--frames-limit", std::to_string(kMapped), "--map", file("desk"),
                                             "--trajectory", file("first.txt"), "--truth", file("first_truth.txt"),
                                             "--points", file("points.ply"), "--keyframes", file("keyframes.txt")});
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
  static void TearDownTestSuite() { folder_.reset(); }
  static std::string file(const std::string& name) { return folder_->file(name); }

 private:
  static std::unique_ptr<ScratchFolder> new_folder() { return std::make_unique<ScratchFolder>(); }
  static inline std::unique_ptr<ScratchFolder> folder_;
};

// Thirty frames later, from where the first run never was: the camera is found on the map, and the world is the same.
TEST_F(SavedMap, TheNextRunFindsItselfOnIt) {
  const ProcessResult next = parallax_run({kDesk, "--start", "180", "--frames-limit", "60", "--from", file("desk"),
                                           "--trajectory", file("next.txt"), "--map", file("later"), "--truth",
                                           file("truth.txt"), "--report", file("r.json")});
  ASSERT_EQ(next.exit_code, 0) << next.err;
  const auto report = nlohmann::json::parse(read_all(file("r.json")));
  EXPECT_GE(report.at("frames").at("tracked").get<int>(), 55) << next.out;
  // Not aligned: the scale of a map that one moves on is the first's. Both against the truth, with the first's
  // transform.
  const Trajectory first = read_trajectory(file("first.txt")), later = read_trajectory(file("next.txt"));
  const ProcessResult whole = parallax_run({kDesk, "--frames-limit", "240", "--truth", file("all.txt")});
  ASSERT_EQ(whole.exit_code, 0);
  const Trajectory truth = read_trajectory(file("all.txt"));
  const auto first_matches = associate_by_time(first, truth, 0.001), matches = associate_by_time(later, truth, 0.001);
  const SimilarityTransform truth_from_map = find_alignment(first, truth, first_matches, Alignment::sim3);
  ASSERT_GE(matches.size(), 55U);
  const std::vector<double> errors = position_errors(transform_trajectory(later, truth_from_map), truth, matches);
  EXPECT_LT(summarise_errors(errors).rmse, 0.005);
  EXPECT_LT(summarise_errors(errors).max, 0.02);
  EXPECT_GE(read_map_file_info(file("later")).keyframes, read_map_file_info(file("desk")).keyframes);
  EXPECT_TRUE(verify_map_file(file("later")).empty());
}

// A third of the things stand elsewhere, there is 40 percent less light and the camera goes another way: the world is
// still the first day's.
TEST_F(SavedMap, TheNextDayFindsItselfOnItThoughThingsWereMoved) {
  const std::string tomorrow = std::string(kDesk) + "&day=1&light=0.6&walk=2";
  const ProcessResult next =
      parallax_run({tomorrow, "--frames-limit", "200", "--from", file("desk"), "--trajectory", file("tomorrow.txt"),
                    "--map", file("day1"), "--truth", file("tomorrow_truth.txt"), "--report", file("r.json")});
  ASSERT_EQ(next.exit_code, 0) << next.err;
  const auto report = nlohmann::json::parse(read_all(file("r.json")));
  EXPECT_GE(report.at("frames").at("tracked").get<int>(), 190) << next.out;
  const Trajectory first = read_trajectory(file("first.txt")), later = read_trajectory(file("tomorrow.txt"));
  const Trajectory first_truth = read_trajectory(file("first_truth.txt")),
                   later_truth = read_trajectory(file("tomorrow_truth.txt"));
  const SimilarityTransform truth_from_map =
      find_alignment(first, first_truth, associate_by_time(first, first_truth, 0.001), Alignment::sim3);
  const auto matches = associate_by_time(later, later_truth, 0.001);
  ASSERT_GE(matches.size(), 190U);
  // What was placed at the table's origin on the first day is where it was, in the second day's own truth.
  const SimilarityTransform later_from_map = find_alignment(later, later_truth, matches, Alignment::sim3);
  const Eigen::Vector3d placed = truth_from_map.inverse() * Eigen::Vector3d(0, 0, 0);
  EXPECT_LT((later_from_map * placed).norm(), 0.005);
  const std::vector<double> errors = position_errors(transform_trajectory(later, truth_from_map), later_truth, matches);
  EXPECT_LT(summarise_errors(errors).rmse, 0.005);
  // The map is today's: points that have gone were let go.
  const MapDocument before = read_map_file(file("desk")), after = read_map_file(file("day1"));
  int gone = 0;
  for (const MapPoint& p : before.map.points) gone += after.map.points.contains(p.id) ? 0 : 1;
  EXPECT_GT(gone, before.map.points.size() / 20);
  EXPECT_TRUE(verify_map_file(file("day1")).empty());
}

TEST_F(SavedMap, AnotherCameraIsRefused) {
  expect_one_line(parallax_run({"synthetic:desk?size=640x480", "--from", file("desk")}), 2, "320x240");
  CameraModel lens = parse_calibration(read_map_file(file("desk")).calibration, "lens");
  const std::string other =
      format_calibration(CameraModel(lens.kind(), lens.width(), lens.height(), 1.1 * lens.focal_px(), lens.centre_px(),
                                     lens.distortion(), lens.n_distortion()));
  const ScratchFolder folder;
  expect_one_line(parallax_run({kDesk, "--from", file("desk"), "--calibration", folder.write("c.yaml", other)}), 2,
                  "another lens");
  expect_one_line(parallax_run({kDesk, "--from", file("first_truth.txt")}), 2, "first_truth.txt");
  expect_one_line(parallax_run({kDesk, "--from", file("absent")}), 2, "absent");
  expect_one_line(parallax_run({kDesk, "--maps", file("desk")}), 2, "expected a folder of maps");
  expect_one_line(parallax_map({"list", "--maps", file("desk")}), 2, "expected a folder of maps");
}

TEST_F(SavedMap, IsNotWrittenOverWhatIsNoFile) {
  const ProcessResult result =
      parallax_run({kDesk, "--frames-limit", "80", "--map", "/dev/full", "--trajectory", file("t.txt")});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.err.find("/dev/full"), std::string::npos) << result.err;
  EXPECT_TRUE(std::filesystem::exists(file("t.txt"))) << "the other outputs are there";
  const ProcessResult nowhere = parallax_run({kDesk, "--frames-limit", "80", "--map", "/nonexistent/desk"});
  EXPECT_EQ(nowhere.exit_code, 1);
  EXPECT_NE(nowhere.err.find("/nonexistent/desk: cannot be written"), std::string::npos) << nowhere.err;
}

TEST_F(SavedMap, IsShownVerifiedAndExported) {
  const ProcessResult info = parallax_map({"info", file("desk")});
  ASSERT_EQ(info.exit_code, 0) << info.err;
  const MapDocument document = read_map_file(file("desk"));
  EXPECT_NE(info.out.find("keyframes  " + std::to_string(document.map.keyframes.size())), std::string::npos)
      << info.out;
  EXPECT_EQ(parallax_map({"verify", file("desk")}).out, file("desk") + ": whole\n");
  const ScratchFolder out;
  const ProcessResult exported =
      parallax_map({"export", file("desk"), "--points", out.file("p.ply"), "--keyframes", out.file("k.txt"), "--images",
                    out.file("images"), "--colmap", out.file("colmap"), "--calibration", out.file("c.yaml")});
  ASSERT_EQ(exported.exit_code, 0) << exported.err;
  // What the run wrote of its map is what the file gives.
  EXPECT_EQ(read_all(out.file("p.ply")), read_all(file("points.ply")));
  EXPECT_EQ(read_all(out.file("k.txt")), read_all(file("keyframes.txt")));
  EXPECT_NO_THROW(read_calibration(out.file("c.yaml")));
  EXPECT_EQ(testing::names_in(out.file("images")).size(), static_cast<std::size_t>(document.map.keyframes.size()));
  // A point of the COLMAP model projects to where its images say it is, by the model's own rules.
  std::istringstream cameras(read_all(out.file("colmap/cameras.txt")));
  std::string line, model;
  std::getline(cameras, line);
  int id = 0, width = 0, height = 0;
  double fx, fy, cx, cy, omega;
  cameras >> id >> model >> width >> height >> fx >> fy >> cx >> cy >> omega;
  ASSERT_EQ(model, "FOV");
  std::map<int, Eigen::Vector3d> points;
  std::istringstream points_text(read_all(out.file("colmap/points3D.txt")));
  std::getline(points_text, line);
  while (std::getline(points_text, line)) {
    std::istringstream row(line);
    Eigen::Vector3d p;
    row >> id >> p.x() >> p.y() >> p.z();
    points[id] = p;
  }
  ASSERT_EQ(points.size(), static_cast<std::size_t>(document.map.points.size()));
  std::istringstream images(read_all(out.file("colmap/images.txt")));
  std::getline(images, line);
  std::vector<double> errors;
  while (std::getline(images, line)) {
    std::istringstream head(line);
    Eigen::Quaterniond q;
    Eigen::Vector3d t;
    head >> id >> q.w() >> q.x() >> q.y() >> q.z() >> t.x() >> t.y() >> t.z();
    std::getline(images, line);
    std::istringstream row(line);
    double x, y;
    int point;
    while (row >> x >> y >> point) {
      const Eigen::Vector3d p = q * points.at(point) + t;
      const Eigen::Vector2d u = p.head<2>() / p.z();
      const double r = u.norm(), factor = r > 1e-9 ? std::atan(2 * r * std::tan(omega / 2)) / omega / r : 1;
      errors.push_back(std::hypot(fx * factor * u.x() + cx - x, fy * factor * u.y() + cy - y));
    }
  }
  ASSERT_GT(errors.size(), 500U);
  std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.5);
  expect_one_line(parallax_map({"export", file("desk")}), 2, "--points");
  expect_one_line(parallax_map({"info", file("absent")}), 2, "absent");
}

TEST_F(SavedMap, DamageIsSaidWithAnExitCode) {
  const ScratchFolder folder;
  std::string bytes = read_all(file("desk"));
  for (std::size_t at = bytes.size() / 2; at < bytes.size() / 2 + 64; ++at) bytes[at] = 'x';
  const std::string damaged = folder.write("damaged", bytes);
  const ProcessResult verify = parallax_map({"verify", file("desk"), damaged});
  EXPECT_EQ(verify.exit_code, 1);
  EXPECT_NE(verify.out.find(file("desk") + ": whole"), std::string::npos) << verify.out;
  EXPECT_NE(verify.out.find("damaged: "), std::string::npos) << verify.out;
  expect_one_line(parallax_run({kDesk, "--from", damaged}), 2, "damaged");
  expect_one_line(parallax_map({"verify", folder.file("absent")}), 2, "absent");
}

// The first session makes the file, the second goes on with it and replays from its own recording.
TEST(RealtimeMapFile, ALiveSessionKeepsItsMapAndTheNextGoesOn) {
  const ScratchFolder folder;
  const std::string map = folder.file("desk.plxmap");
  const ProcessResult first =
      live_headless({"--camera", std::string(kDesk) + "&frames=150", "--map", map}, folder.path().string());
  ASSERT_EQ(first.exit_code, 0) << first.err;
  const MapDocument made = read_map_file(map);
  const std::string before = read_all(map);
  const ProcessResult second = live_headless({"--camera", std::string(kDesk) + "&frames=150", "--map", map, "--record",
                                              folder.file("s.plx"), "--report", folder.file("r.json")},
                                             folder.path().string());
  ASSERT_EQ(second.exit_code, 0) << second.err;
  const auto report = nlohmann::json::parse(read_all(folder.file("r.json")));
  // It begins on the map: no frame before it.
  EXPECT_GT(report.at("frames").at("tracked").get<int>(), 120);
  const MapDocument later = read_map_file(map);
  EXPECT_GE(later.map.keyframes.capacity(), made.map.keyframes.capacity());
  EXPECT_EQ(cv::norm(later.map.keyframes.begin()->images->pyramid.level[0],
                     made.map.keyframes.begin()->images->pyramid.level[0], cv::NORM_INF),
            0);
  EXPECT_EQ(testing::count_of(second.err, "another map"), 0) << second.err;
  const ProcessResult replay = run_process(
      "/usr/bin/timeout", {"120", PARALLAX_BINARY, "run", folder.file("s.plx"), "--map", folder.file("replayed")});
  EXPECT_EQ(replay.exit_code, 0) << replay.err;
  EXPECT_NE(replay.out.find("identical"), std::string::npos) << replay.out;
  EXPECT_EQ(hash_of(read_map_file(folder.file("replayed")).map), hash_of(later.map));
}

class MapSaverTest : public ::testing::Test {
 protected:
  MapSaverTest() { shared_.replace_map(test::fabricate_map().map); }
  MapSaverOptions options(const std::string& path) const {
    MapSaverOptions out;
    out.path = path;
    out.program = "test";
    out.calibration = "lens";
    out.interval = std::chrono::milliseconds(1);
    return out;
  }
  static void wait_until(const std::function<bool()>& done) {
    for (int i = 0; i < 5000; ++i) {
      if (done()) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    ADD_FAILURE() << "it never came";
  }
  ScratchFolder folder_;
  SharedMap shared_;
};

TEST_F(MapSaverTest, ContentFollowsAWorldThatMovedMeanwhile) {
  MapExtras extras;
  extras.map_version = 1;
  ContentItem item;
  item.id = 1;
  item.text = "cup";
  item.world_from_item.t = {1, 2, 3};
  extras.content = {item};
  extras.games["swarm"] = "state";
  shared_.move_world(SimilarityTransform(2, Eigen::Matrix3d::Identity(), {0, 0, 1}));
  MapSaver saver(options(folder_.file("map")), [this] { return shared_.copy(); });
  saver.set_extras(extras);
  saver.finish();
  const MapDocument document = read_map_file(folder_.file("map"));
  ASSERT_EQ(document.content.size(), 1U);
  EXPECT_EQ(document.content[0].position(), Eigen::Vector3d(2, 4, 7));
  EXPECT_EQ(document.content[0].world_from_item.s, 2);
  EXPECT_EQ(document.games.at("swarm"), "state");
}

// The map rests; only what stands on it changes.
TEST_F(MapSaverTest, WhatTheUserMovesIsSavedThoughTheMapRests) {
  MapExtras extras;
  extras.map_version = 1;
  extras.content.resize(1);
  extras.content[0].id = 1;
  MapSaver saver(options(folder_.file("map")), [this] { return shared_.copy(); });
  saver.set_extras(extras);
  // The first save may have come before the extras.
  wait_until([&] { return saver.saves() > 0 && read_map_file(folder_.file("map")).content.size() == 1; });
  extras.content[0].world_from_item.t = {0.5, 0, 0};
  saver.set_extras(extras);
  wait_until([&] { return read_map_file(folder_.file("map")).content.at(0).position().x() == 0.5; });
  extras.scale_is_known = true;
  saver.set_extras(extras);
  saver.finish();
  EXPECT_TRUE(read_map_file(folder_.file("map")).scale_is_known);
}

TEST_F(MapSaverTest, SavesWhenSomethingChangedAndNotElse) {
  MapSaver saver(options(folder_.file("map")), [this] { return shared_.copy(); });
  wait_until([&] { return saver.saves() == 1; });
  for (int i = 0; i < 50; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_EQ(saver.saves(), 1);
  shared_.write([](Map& map) { map.erase_point({0, 3}); });
  wait_until([&] { return saver.saves() == 2; });
  saver.finish();
  EXPECT_EQ(read_map_file(folder_.file("map")).map.points.size(), 11);
}

// After a reset the saved map stays, and the new one goes beside it.
TEST_F(MapSaverTest, AnotherMapNeverTakesItsPlace) {
  folder_.write("given.plxmap", "notes of mine");
  MapSaver saver(options(folder_.file("given.plxmap")), [this] { return shared_.copy(); });
  wait_until([&] { return saver.saves() == 1; });
  EXPECT_EQ(read_all(folder_.file("given.plxmap")), "notes of mine");
  EXPECT_EQ(saver.path(), folder_.file("given-2.plxmap"));
  EXPECT_NE(saver.take_message().find("given-2.plxmap"), std::string::npos);
  shared_.replace_map({});
  for (int i = 0; i < 20; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_EQ(read_map_file(folder_.file("given-2.plxmap")).map.points.size(), 12);
  shared_.replace_map(test::fabricate_map(9).map);
  wait_until([&] { return saver.saves() == 2; });
  saver.finish();
  EXPECT_EQ(read_map_file(folder_.file("given-2.plxmap")).map.points.size(), 12);
  EXPECT_EQ(read_map_file(folder_.file("given-3.plxmap")).map.points.size(), 9);
}

TEST_F(MapSaverTest, AFailureIsSaidOnceAndItsEndToo) {
  MapSaver saver(options(folder_.file("missing/map")), [this] { return shared_.copy(); });
  std::string said;
  wait_until([&] { return !(said = saver.take_message()).empty(); });
  EXPECT_NE(said.find("missing/map: cannot be written"), std::string::npos) << said;
  for (int i = 0; i < 30; ++i) {
    EXPECT_EQ(saver.take_message(), "");
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  std::filesystem::create_directory(folder_.file("missing"));
  wait_until([&] { return saver.saves() == 1; });
  wait_until([&] { return saver.take_message() == "the map is saved again"; });
  saver.finish();
  EXPECT_TRUE(verify_map_file(folder_.file("missing/map")).empty());
}

}  // namespace
}  // namespace parallax
