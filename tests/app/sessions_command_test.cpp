// `parallax sessions` as a user meets it, on a small database made here: two walks along one wall that have met.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <random>

#include "core/graph_file.h"
#include "core/trajectory.h"
#include "sessions/session_database.h"
#include "tests/support/memory_folder.h"

namespace parallax::testing {
namespace {

namespace fs = std::filesystem;

ProcessResult sessions(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "sessions");
  return run_process(PARALLAX_BINARY, arguments);
}

void expect_refused(const std::vector<std::string>& arguments, int exit_code, const std::string& part) {
  const ProcessResult result = sessions(arguments);
  EXPECT_EQ(result.exit_code, exit_code) << result.out << result.err;
  EXPECT_EQ(count_lines(result.err), 1) << result.err;
  EXPECT_NE(result.err.find(part), std::string::npos) << result.err;
}

std::string done(const std::vector<std::string>& arguments) {
  const ProcessResult result = sessions(arguments);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  return result.out;
}

nlohmann::json json_of(const std::vector<std::string>& arguments) { return nlohmann::json::parse(done(arguments)); }

// A wall 2 m away, seen by a camera that goes 0.1 m to the right from keyframe to keyframe: 6 pixels, and a disparity
// of 12.
constexpr int kWallWidth = 160, kWallHeight = 120, kStep_px = 6, kDisparity_px = 12;
constexpr double kStep_m = 0.1, kWall_m = 2;

GreyImage wall_from(int offset_px) {
  static const GreyImage wall = [] {
    GreyImage out(kWallHeight, 400);
    std::mt19937 rng(5);
    for (int y = 0; y < out.rows; ++y)
      for (int x = 0; x < out.cols; ++x)
        out(y, x) = static_cast<std::uint8_t>(128 + 40 * std::sin(0.3 * x + 0.2 * y) + static_cast<int>(rng() % 70));
    return out;
  }();
  return wall(cv::Rect(offset_px, 0, kWallWidth, kWallHeight)).clone();
}

RigidTransform to_the_right(double metres) { return {Eigen::Matrix3d::Identity(), {metres, 0, 0}}; }

// "monday" of five keyframes, "tuesday" of four, which begins where monday's keyframe 1 is. Encounter 1 is right,
// encounter 2 is wrong by 0.3 m (and less sure), encounter 3 waits. Walks from another folder are other recordings.
void make_walks(const std::string& path, const std::string& first_name = "monday",
                const std::string& recordings = "walks") {
  SessionDatabase database(path, SqliteMode::write, "test");
  SessionStart start;
  start.camera.width = kWallWidth;
  start.camera.height = kWallHeight;
  start.camera.focal_px = {120, 120};
  start.camera.centre_px = {79.5, 59.5};
  start.camera.baseline_m = kDisparity_px * kWall_m / 120;
  start.frames_per_second = 20;
  for (const int walk : {0, 1}) {
    start.name = walk == 0 ? first_name : "tuesday";
    start.source = recordings + "/" + start.name;
    SessionState state = database.begin_session(start);
    SessionBatch batch;
    batch.session = state.id;
    SessionWindow window;
    const int keyframes = walk == 0 ? 5 : 4;
    for (int k = 0; k < keyframes; ++k) {
      SessionBatch::NewKeyframe added;
      added.keyframe.index = k;
      added.keyframe.frame = 10 * k;
      added.keyframe.time = from_seconds(1000 * walk + 0.5 * k);
      added.keyframe.session_from_camera = to_the_right(kStep_m * k);
      added.keyframe.left = wall_from(kStep_px * (k + walk));
      added.keyframe.right = wall_from(kStep_px * (k + walk) + kDisparity_px);
      batch.keyframes.push_back(added);
      for (int i = 0; i < 3; ++i) window.points.push_back({k, {0.1F * static_cast<float>(i), 0.2F, 2}, 3});
      if (k == 0) continue;
      StereoConstraint c;
      c.from = k - 1;
      c.to = k;
      c.from_from_to = to_the_right(kStep_m);
      c.covariance = 1e-6 * Matrix6d::Identity();
      window.constraints.push_back(c);
    }
    batch.windows = {window};
    if (walk == 1) {
      const auto meet = [&](int found, int query, double metres, double variance, EncounterState kind) {
        Encounter e;
        e.id = database.next_encounter() + static_cast<int>(batch.encounters.size());
        e.found = {1, found};
        e.query = {2, query};
        e.found_from_query = to_the_right(metres);
        e.covariance = variance * Matrix6d::Identity();
        e.bow = 0.25;
        e.matches = 50;
        e.inliers = 40;
        e.state = kind;
        batch.encounters.push_back(e);
      };
      meet(2, 1, 0, 1e-4, EncounterState::active);
      meet(3, 3, 0.4, 1e-4, EncounterState::active);
      meet(0, 0, 5, 1e-4, EncounterState::waiting);
      state.component = 1;
      state.global_from_session = to_the_right(0.15);
      state.anchor_covariance = 4e-4 * Matrix6d::Identity();
    }
    state.ended = true;
    batch.states = {state};
    database.save(batch);
  }
  AttachedMap map;
  map.name = "desk";
  map.path = "desk.plxmap";
  map.session = 1;
  map.keyframe_from_map.s = 3;
  database.add_map(&map);
}

class SessionsCommand : public ::testing::Test {
 protected:
  SessionsCommand() { make_walks(path_); }
  // How far tuesday's anchor is to the right.
  double anchor_m() const { return document().sessions[1].global_from_session.t.x(); }
  SessionDocument document() const { return SessionDatabase(path_, SqliteMode::read).read(); }
  const MemoryFolder folder_;
  const std::string path_ = folder_.file("walks.plxdb");
};

TEST_F(SessionsCommand, ListsAndShows) {
  const std::string list = done({"list", path_});
  EXPECT_EQ(count_lines(list), 3) << list;
  for (const char* part : {"monday", "tuesday", "walks/monday", "keyframes", "component"})
    EXPECT_NE(list.find(part), std::string::npos) << list;
  const nlohmann::json json = json_of({"list", path_, "--json"});
  ASSERT_EQ(json.size(), 2U);
  EXPECT_EQ(json[0]["keyframes"], 5);
  EXPECT_NEAR(json[0]["path_m"], 0.4, 1e-12);
  EXPECT_NEAR(json[1]["duration_s"], 1.5, 1e-12);
  EXPECT_EQ(json[1]["component"], 1);
  EXPECT_EQ(json[1]["ended"], true);

  const std::string shown = done({"show", path_, "tuesday"});
  for (const char* part :
       {"tuesday (session 2)", "0.150 0.000 0.000 m", "0.0200 0.0200 0.0200 m", "2 encounters active",
        "1 encounters waiting", "keyframe 1 of tuesday saw keyframe 2 of monday", "has met"})
    EXPECT_NE(shown.find(part), std::string::npos) << part << " in\n" << shown;
  EXPECT_NE(done({"show", path_, "1"}).find("desk (desk.plxmap), scale 3.0000"), std::string::npos);
  const nlohmann::json two = json_of({"show", path_, "2", "--json"});
  EXPECT_EQ(two["poses"].size(), 4U);
  EXPECT_EQ(two["constraints"], 3);
  EXPECT_EQ(two["encounters"]["waiting"][0]["id"], 3);
  EXPECT_NEAR(two["anchor"]["sigma_m"][1], 0.02, 1e-12);

  const std::string encounters = done({"encounters", path_});
  EXPECT_EQ(count_lines(encounters), 4) << encounters;
  const nlohmann::json provenance = json_of({"encounters", path_, "--json"});
  EXPECT_EQ(provenance[1]["found"]["keyframe"], 3);
  EXPECT_EQ(provenance[1]["eta"], 0.25);
  EXPECT_TRUE(provenance[1]["crf_near"].is_null());
  EXPECT_EQ(provenance[1]["inliers"], 40);
}

// An edge that is wrong is switched off, and the sessions lie where the other one says; switched on, it pulls again.
TEST_F(SessionsCommand, UndoesAndRedoes) {
  done({"undo", path_, "2"});
  EXPECT_NEAR(anchor_m(), 0.1, 1e-5);
  EXPECT_EQ(document().encounters[1].state, EncounterState::off);
  done({"undo", path_, "2"});  // it is off already
  done({"redo", path_, "2"});
  EXPECT_GT(anchor_m(), 0.11);
  done({"undo", path_, "1", "2"});
  EXPECT_EQ(document().sessions[1].component, 2) << "nothing ties them together now";
  done({"redo", path_, "1"});
  EXPECT_EQ(document().sessions[1].component, 1);
  EXPECT_NEAR(anchor_m(), 0.1, 1e-5);
  expect_refused({"undo", path_, "9"}, 2, "found no encounter 9");
  expect_refused({"undo", path_, "3"}, 2, "found it waiting");
  expect_refused({"redo", path_, "3"}, 2, "expected one that is switched off");
  EXPECT_EQ(done({"verify", path_}), path_ + ": whole\n");
}

// Bytes of a binary PLY after its header, and the number of vertices it tells.
std::string ply_body(const std::string& path, int* vertices) {
  const std::string text = read_all(path);
  const auto at = text.find("element vertex "), end = text.find("end_header\n");
  EXPECT_NE(at, std::string::npos) << path;
  *vertices = std::stoi(text.substr(at + 15));
  return text.substr(end + 11);
}

Eigen::Vector3f ply_place(const std::string& body, std::size_t row, std::size_t row_bytes) {
  Eigen::Vector3f out;
  std::memcpy(out.data(), body.data() + row * row_bytes, 12);
  return out;
}

TEST_F(SessionsCommand, ExportsWhatOthersRead) {
  const std::string to = folder_.path().string() + "/";
  done({"export",     path_,           "--tum",          to + "tum",    "--kitti",      to + "kitti", "--euroc",
        to + "euroc", "--g2o",         to + "graph.g2o", "--ply",       to + "all.ply", "--gltf",     to + "all.glb",
        "--textured", to + "wall.ply", "--colmap",       to + "colmap", "--images",     to + "images"});
  TrajectoryFormat format{};
  const Trajectory tum = read_trajectory(to + "tum/tuesday.txt", &format);
  EXPECT_EQ(format, TrajectoryFormat::tum);
  ASSERT_EQ(tum.size(), 4U);
  EXPECT_EQ(tum[2].time, from_seconds(1001));
  EXPECT_NEAR(tum[2].world_from_camera.t.x(), 0.35, 1e-9) << "in the frame of monday";
  EXPECT_EQ(read_trajectory(to + "tum/monday.txt").size(), 5U);
  const Trajectory kitti = read_trajectory(to + "kitti/tuesday.kitti", &format);
  EXPECT_EQ(format, TrajectoryFormat::kitti);
  ASSERT_EQ(kitti.size(), 4U);
  EXPECT_NEAR(kitti[3].world_from_camera.t.x(), 0.45, 1e-9);
  const Trajectory euroc = read_trajectory(to + "euroc/monday.csv", &format);
  EXPECT_EQ(format, TrajectoryFormat::euroc);
  ASSERT_EQ(euroc.size(), 5U);
  EXPECT_NEAR(euroc[4].world_from_camera.t.x(), 0.4, 1e-9);

  const GraphFile graph = read_graph_file(to + "graph.g2o");
  EXPECT_EQ(graph.vertices.size(), 9U);
  ASSERT_EQ(graph.edges.size(), 4U + 3U + 2U);
  EXPECT_EQ(graph.fixed, std::vector<std::int64_t>{0});
  EXPECT_EQ(graph.edges.back().from, 3);
  EXPECT_EQ(graph.edges.back().to, 8);
  EXPECT_NEAR(graph.edges.back().from_from_to.t.x(), 0.4, 1e-9);
  EXPECT_NEAR(graph.edges.back().information(0, 0), 1e4, 1e-3);
  EXPECT_NEAR(graph.edges.back().information(5, 5), 4 * 1e4 * (1 + 0.4 * 0.4), 1e-3) << "of half the angle";

  int vertices = 0;
  constexpr std::size_t kCloudRow = 23, kTexturedRow = 19;
  const std::string cloud = ply_body(to + "all.ply", &vertices);
  ASSERT_EQ(vertices, 27);
  ASSERT_EQ(cloud.size(), 27 * kCloudRow);
  EXPECT_LT((ply_place(cloud, 26, kCloudRow) - Eigen::Vector3f(0.2F + 0.45F, 0.2F, 2)).norm(), 1e-6);
  EXPECT_NE(cloud.substr(12, 3), cloud.substr(26 * kCloudRow + 12, 3)) << "sessions have colours of their own";
  EXPECT_EQ(read_all(to + "all.glb").substr(0, 4), "glTF");
  const std::string textured = ply_body(to + "wall.ply", &vertices);
  ASSERT_GT(vertices, 100);
  ASSERT_EQ(textured.size(), static_cast<std::size_t>(vertices) * kTexturedRow);
  double off = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(vertices); ++i)
    off += std::abs(ply_place(textured, i, kTexturedRow).z() - kWall_m) / vertices;
  EXPECT_LT(off, 0.02);

  EXPECT_EQ(count_lines(read_all(to + "colmap/cameras.txt")), 1 + 2);
  EXPECT_EQ(count_lines(read_all(to + "colmap/points3D.txt")), 1 + 27);
  std::istringstream images(read_all(to + "colmap/images.txt"));
  std::string line;
  std::getline(images, line);
  int id = 0;
  for (; std::getline(images, line); ++id) {
    std::istringstream words(line);
    int number = 0, camera = 0;
    double q[4], t[3];
    std::string name;
    words >> number >> q[0] >> q[1] >> q[2] >> q[3] >> t[0] >> t[1] >> t[2] >> camera >> name;
    EXPECT_EQ(number, id + 1);
    EXPECT_EQ(camera, id < 5 ? 1 : 2);
    EXPECT_NEAR(t[0], id < 5 ? -0.1 * id : -0.15 - 0.1 * (id - 5), 1e-9) << "camera from global";
    const cv::Mat1b left = cv::imread(to + "images/" + name, cv::IMREAD_GRAYSCALE);
    ASSERT_EQ(left.size(), cv::Size(kWallWidth, kWallHeight)) << name;
    EXPECT_EQ(cv::norm(left, wall_from(kStep_px * (id < 5 ? id : id - 4)), cv::NORM_INF), 0) << name;
    std::getline(images, line);
    EXPECT_EQ(std::count(line.begin(), line.end(), ' '), 9) << "three points: x, y, number";
  }
  EXPECT_EQ(id, 9);
}

TEST_F(SessionsCommand, ExportsSomeInTheFrameThatIsAskedFor) {
  const std::string file = folder_.file("one.txt");
  done({"export", path_, "--session", "tuesday", "--own-frame", "--tum", file});
  EXPECT_NEAR(read_trajectory(file).front().world_from_camera.t.x(), 0, 1e-9);
  done({"export", path_, "--session", "2", "--global", "--tum", file});
  EXPECT_NEAR(read_trajectory(file).front().world_from_camera.t.x(), 0.15, 1e-9);
  done({"export", path_, "--session", "monday", "--session", "tuesday", "--global", "--kitti", folder_.file("k")});
  EXPECT_TRUE(fs::exists(folder_.file("k/monday.kitti")));
  done({"undo", path_, "1", "2"});
  expect_refused({"export", path_, "--global", "--tum", folder_.file("t")}, 2, "have not met");
  const ProcessResult apart = sessions({"export", path_, "--g2o", folder_.file("apart.g2o")});
  EXPECT_EQ(apart.exit_code, 0);
  EXPECT_NE(apart.err.find("have not met"), std::string::npos) << apart.err;
  EXPECT_EQ(read_graph_file(folder_.file("apart.g2o")).fixed, (std::vector<std::int64_t>{0, 5}));
  expect_refused({"export", path_}, 2, "found nothing to write");
  expect_refused({"export", path_, "--session", "sunday", "--tum", file}, 2, "expected one of monday, tuesday");
  expect_refused({"export", path_, "--session", "monday", "--ply", folder_.file("no/folder/all.ply")}, 1, "all.ply");
}

TEST_F(SessionsCommand, MergesRenamesAndDeletes) {
  const std::string other = folder_.file("other.plxdb");
  make_walks(other, "wednesday", "later walks");
  const std::string said = done({"merge", path_, other});
  EXPECT_NE(said.find("session 2 is session 4 (tuesday-2)"), std::string::npos) << said;
  ASSERT_EQ(document().sessions.size(), 4U);
  EXPECT_EQ(document().sessions[3].component, 3);
  EXPECT_EQ(SessionDatabase(other, SqliteMode::read).read().sessions.size(), 2U) << "the other stays as it is";
  EXPECT_EQ(document().encounters[3].query.session, 4);
  done({"rename", path_, "tuesday-2", "thursday"});
  EXPECT_EQ(document().sessions[3].start.name, "thursday");
  expect_refused({"rename", path_, "thursday", "monday"}, 2, "found a session 'monday' already");
  expect_refused({"delete", path_, "monday"}, 2, "--yes");
  EXPECT_EQ(document().sessions.size(), 4U);
  done({"delete", path_, "monday", "--yes"});
  EXPECT_EQ(document().sessions[0].component, 2);
  const auto bytes = fs::file_size(path_);
  done({"compact", path_});
  EXPECT_LT(fs::file_size(path_), bytes);
  EXPECT_EQ(done({"verify", path_, other}), path_ + ": whole\n" + other + ": whole\n");
  expect_refused({"merge", path_, path_}, 2, "the same file");
  expect_refused({"merge", path_, other, folder_.file("absent")}, 2, "absent");
  EXPECT_EQ(document().sessions.size(), 3U) << "nothing was taken";
}

// The same recording would meet itself everywhere.
TEST_F(SessionsCommand, MergesNoSessionTwice) {
  const std::string other = folder_.file("other.plxdb"), third = folder_.file("third.plxdb"),
                    copy = folder_.file("copy.plxdb"), fresh = folder_.file("fresh.plxdb");
  make_walks(other, "wednesday", "later walks");
  make_walks(third, "friday", "last walks");
  fs::copy_file(third, copy);
  done({"merge", path_, other});
  done({"rename", path_, "tuesday-2", "thursday"});
  done({"delete", path_, "wednesday", "--yes"});
  const auto already = [](const std::string& in, const std::string& session, const std::string& known) {
    return ": session '" + session + "' is in " + in + " already, as " + known +
           ": found the same recording begun at the same time, expected sessions that " + in + " has not";
  };
  const std::size_t before = document().sessions.size();
  expect_refused({"merge", path_, third, other}, 2, other + already(path_, "tuesday", "'thursday' (number 4)"));
  EXPECT_EQ(document().sessions.size(), before) << "the third was not taken either";
  expect_refused({"merge", path_, third, copy}, 2, copy + already(third, "friday", "'friday' (number 1)"));
  EXPECT_EQ(document().sessions.size(), before);
  expect_refused({"merge", fresh, third, copy}, 2, copy);
  EXPECT_FALSE(fs::exists(fresh)) << "nothing is written";
  done({"merge", path_, third});
  EXPECT_EQ(document().sessions.size(), before + 2);
  EXPECT_EQ(done({"verify", path_}), path_ + ": whole\n");
}

TEST_F(SessionsCommand, BadInputIsOneLine) {
  const std::string absent = folder_.file("absent");
  for (const char* command : {"list", "verify", "compact", "encounters"})
    expect_refused({command, absent}, 2, "found no such file");
  expect_refused({"show", absent, "monday"}, 2, "found no such file");
  EXPECT_FALSE(fs::exists(absent));
  expect_refused({"show", path_, "sunday"}, 2, "found no session 'sunday'");
  expect_refused({"list", folder_.path().string()}, 2, "something else than a file");
  const std::string notes = folder_.write("notes", "these are notes of a walk, and not a database of any kind at all");
  expect_refused({"list", notes}, 2, "notes");
  expect_refused({"rename", notes, "a", "b"}, 2, "notes");
  std::string map(4096, '\0');
  map.replace(0, 15, "SQLite format 3");
  map.replace(68, 4, "PLXM");
  expect_refused({"verify", folder_.write("map", map)}, 2, "found a map file");
  expect_refused({"frobnicate", path_}, 2, "subcommand is required");
  {
    const SessionDatabase writer(path_, SqliteMode::write);
    expect_refused({"rename", path_, "monday", "friday"}, 2, "another program that writes");
    EXPECT_EQ(count_lines(done({"list", path_})), 3) << "reading goes on";
  }
  std::string damaged = read_all(path_);
  damaged[damaged.size() / 2] ^= 4;  // in the images
  const ProcessResult verified = sessions({"verify", folder_.write("damaged", damaged)});
  EXPECT_EQ(verified.exit_code, 1);
  EXPECT_NE(verified.out.find("damaged: image: session"), std::string::npos) << verified.out;
}

}  // namespace
}  // namespace parallax::testing
