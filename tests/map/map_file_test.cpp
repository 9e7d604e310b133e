#include "map/map_file.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sqlite3.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <random>

#include "core/error.h"
#include "tests/map/fabricated_map.h"
#include "tests/map/unreliable_disk.h"
#include "tests/support/process.h"

namespace parallax {
namespace {

using test::fabricate_map;
using test::UnreliableDisk;
using testing::ScratchFolder;

MapDocument document_named(const std::string& name, int n_points = 12) {
  MapDocument out;
  out.map = fabricate_map(n_points).map;
  out.map.planes = {*out.map.plane};
  out.map.keyframes.begin()->time = Timestamp(123456789);
  out.map.mark_failed({0, 2}, [&] {
    out.map.remove_measurement({0, 2}, {0, 3});
    return PointId{0, 3};
  }());
  out.map.points.at({0, 4}).searched = 77;
  out.map.points.at({0, 4}).normal_estimated = true;
  for (int level = 0; level < kPyramidLevels; ++level) {
    // Corners come from another thread's images in the program; here they are put in by hand.
    for (Keyframe& kf : out.map.keyframes) {
      auto images = std::make_shared<FrameImages>(*kf.images);
      fast_corners(images->pyramid.level[static_cast<std::size_t>(level)], 20,
                   &images->corners[static_cast<std::size_t>(level)]);
      kf.images = std::move(images);
    }
  }
  out.calibration = "the lens";
  out.name = name;
  out.scale_is_known = true;
  ContentItem item;
  item.id = 4;
  item.kind = ContentKind::line;
  item.text = "an \"edge\", \xc3\xa4";
  item.world_from_item = SimilarityTransform(1.5, exp_so3({0.1, 0.2, -0.3}), {1, 2, 3});
  item.end_in_item = {0.1, 0, -0.0};
  out.content = {item};
  out.games = {{"marbles", "{\"level\":3}"}, {"swarm", ""}};
  return out;
}

void expect_same(const MapDocument& a, const MapDocument& b) {
  EXPECT_EQ(a.calibration, b.calibration);
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.scale_is_known, b.scale_is_known);
  EXPECT_EQ(a.games, b.games);
  ASSERT_EQ(a.content.size(), b.content.size());
  for (std::size_t i = 0; i < a.content.size(); ++i) {
    EXPECT_EQ(a.content[i].id, b.content[i].id);
    EXPECT_EQ(a.content[i].kind, b.content[i].kind);
    EXPECT_EQ(a.content[i].text, b.content[i].text);
    EXPECT_EQ(a.content[i].world_from_item.s, b.content[i].world_from_item.s);
    EXPECT_EQ(a.content[i].world_from_item.R, b.content[i].world_from_item.R);
    EXPECT_EQ(a.content[i].end_in_item, b.content[i].end_in_item);
  }
  ASSERT_EQ(a.map.keyframes.size(), b.map.keyframes.size());
  for (const Keyframe& k : a.map.keyframes) {
    const Keyframe* other = b.map.keyframes.find(k.id);
    ASSERT_NE(other, nullptr);
    EXPECT_EQ(k.frame, other->frame);
    EXPECT_EQ(k.time, other->time);
    EXPECT_EQ(k.camera_from_world.R, other->camera_from_world.R);
    EXPECT_EQ(k.camera_from_world.t, other->camera_from_world.t);
    EXPECT_EQ(k.mean_depth, other->mean_depth);
    EXPECT_EQ(k.fixed, other->fixed);
    for (std::size_t level = 0; level < kPyramidLevels; ++level) {
      EXPECT_EQ(cv::norm(k.images->pyramid.level[level], other->images->pyramid.level[level], cv::NORM_INF), 0);
      EXPECT_EQ(k.images->corners[level].corners, other->images->corners[level].corners);
      EXPECT_EQ(k.images->corners[level].rows, other->images->corners[level].rows);
    }
    EXPECT_EQ(cv::norm(k.images->small.image, other->images->small.image, cv::NORM_INF), 0);
    ASSERT_EQ(k.measurements.size(), other->measurements.size());
    for (std::size_t i = 0; i < k.measurements.size(); ++i) {
      EXPECT_EQ(k.measurements[i].point, other->measurements[i].point);
      EXPECT_EQ(k.measurements[i].pixel, other->measurements[i].pixel);
      EXPECT_EQ(k.measurements[i].sigma_px, other->measurements[i].sigma_px);
      EXPECT_EQ(k.measurements[i].level, other->measurements[i].level);
      EXPECT_EQ(k.measurements[i].source, other->measurements[i].source);
    }
  }
  ASSERT_EQ(a.map.points.size(), b.map.points.size());
  for (const MapPoint& p : a.map.points) {
    const MapPoint* other = b.map.points.find(p.id);
    ASSERT_NE(other, nullptr);
    EXPECT_EQ(p.position, other->position);
    EXPECT_EQ(p.normal, other->normal);
    EXPECT_EQ(p.source, other->source);
    EXPECT_EQ(p.source_pixel, other->source_pixel);
    EXPECT_EQ(p.source_rays, other->source_rays);
    EXPECT_EQ(p.searched, other->searched);
    EXPECT_EQ(p.normal_estimated, other->normal_estimated);
    EXPECT_EQ(p.observers, other->observers);
    EXPECT_EQ(p.failed, other->failed);
  }
  ASSERT_EQ(a.map.plane.has_value(), b.map.plane.has_value());
  EXPECT_EQ(a.map.plane->world_from_plane.R, b.map.plane->world_from_plane.R);
  ASSERT_EQ(a.map.planes.size(), b.map.planes.size());
}

std::string saved(const ScratchFolder& folder, const MapDocument& document) {
  const std::string path = folder.file("map.plxmap");
  MapFile(path, "parallax test").save(document);
  return path;
}

void run_sql(const std::string& path, const std::string& sql) {
  sqlite3* handle = nullptr;
  ASSERT_EQ(sqlite3_open(path.c_str(), &handle), SQLITE_OK);
  char* why = nullptr;
  EXPECT_EQ(sqlite3_exec(handle, sql.c_str(), nullptr, nullptr, &why), SQLITE_OK) << (why ? why : "");
  sqlite3_free(why);
  sqlite3_close(handle);
}

std::string reading_fails_of(const std::string& path) {
  try {
    read_map_file(path);
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST(MapFile, HoldsAllOfTheMap) {
  const ScratchFolder folder;
  const MapDocument document = document_named("kitchen table");
  const std::string path = saved(folder, document);
  expect_same(document, read_map_file(path));
  EXPECT_TRUE(verify_map_file(path).empty());
  const MapFileInfo info = read_map_file_info(path);
  EXPECT_EQ(info.keyframes, 3);
  EXPECT_EQ(info.points, 12);
  EXPECT_EQ(info.games, 2);
  EXPECT_EQ(info.name, "kitchen table");
  EXPECT_EQ(info.program, "parallax test");
  EXPECT_EQ(info.created.size(), 20U) << info.created;
  EXPECT_GT(info.bytes, 3 * 320 * 240 / 2);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), std::filesystem::directory_iterator()), 1)
      << "nothing is left beside the file";
}

TEST(MapFile, IsToldFromOtherFiles) {
  const ScratchFolder folder;
  std::ifstream file(saved(folder, document_named("a")), std::ios::binary);
  std::string start(100, '\0');
  file.read(start.data(), 100);
  EXPECT_TRUE(is_map_file(start));
  EXPECT_FALSE(is_map_file(start.substr(0, 40)));
  EXPECT_FALSE(is_map_file(std::string(100, 'x')));
}

// Later states replace earlier ones, what is gone goes, and images that are there are not written again.
TEST(MapFile, FollowsTheMap) {
  const ScratchFolder folder;
  const std::string path = folder.file("map.plxmap");
  MapFile file(path, "test");
  MapDocument document = document_named("a");
  file.save(document);
  document.map.erase_point({0, 0});
  document.map.erase_point({0, 11});  // its source is the second keyframe
  document.map.erase_keyframe({0, 1});
  document.map.transform_world(SimilarityTransform(2, exp_so3({0, 0.1, 0}), {0, 0, 1}));
  document.content.clear();
  document.games.erase("swarm");
  file.save(document);
  expect_same(document, read_map_file(path));
  // The same identifiers with other images are the same keyframes, unless it is said that they are not.
  MapDocument other = document_named("b");
  std::swap(other.map.keyframes.at({0, 0}).images, other.map.keyframes.at({0, 2}).images);
  file.save(other, true);
  expect_same(other, read_map_file(path));
}

TEST(MapFile, IsContinuedByTheNextProgram) {
  const ScratchFolder folder;
  const std::string path = saved(folder, document_named("a"));
  const std::string created = read_map_file_info(path).created;
  run_sql(path, "UPDATE meta SET value = '2001-02-03T04:05:06Z' WHERE key = 'created'");
  const MapDocument b = document_named("b");
  MapFile(path, "later").save(b);
  expect_same(b, read_map_file(path));
  EXPECT_EQ(read_map_file_info(path).created, "2001-02-03T04:05:06Z");
}

TEST(MapFile, AnInconsistentMapIsNotWritten) {
  const ScratchFolder folder;
  const MapDocument good = document_named("good");
  const std::string path = folder.file("map.plxmap");
  MapFile file(path, "test");
  file.save(good);
  MapDocument bad = document_named("bad");
  bad.map.points.at({0, 2}).position.x() = std::nan("");
  EXPECT_THROW(file.save(bad), RunError);
  expect_same(good, read_map_file(path));
}

TEST(MapFile, OtherFilesAreRefusedInOneLine) {
  const ScratchFolder folder;
  const std::string text =
      folder.write("notes.txt", "these are notes, not a map; they are long enough to be one, though");
  EXPECT_NE(reading_fails_of(text).find("notes.txt"), std::string::npos);
  EXPECT_NE(reading_fails_of(folder.file("absent")).find("absent"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder.file("absent"))) << "reading makes no file";
  EXPECT_THROW(MapFile(text, "test"), RunError);
  const std::string other = folder.file("other.db");
  run_sql(other, "CREATE TABLE recipes(name TEXT)");
  EXPECT_NE(reading_fails_of(other).find("another program's database"), std::string::npos);
  EXPECT_THROW(MapFile(other, "test"), InputError);
  const std::string later = saved(folder, document_named("a"));
  run_sql(later, "PRAGMA user_version = 9");
  EXPECT_NE(reading_fails_of(later).find("version 9"), std::string::npos) << reading_fails_of(later);
  EXPECT_THROW(MapFile(later, "test"), InputError);
}

// Each kind of damage is named, by reading and by verifying.
TEST(MapFile, DamageIsNamed) {
  const ScratchFolder folder;
  const struct {
    const char *sql, *named;
  } damages[] = {
      {"UPDATE point SET x = x + 1e-9 WHERE id = 5", "point 5"},
      {"UPDATE keyframe SET mean_depth = 2 WHERE id = 1", "keyframe 1"},
      {"UPDATE image SET grey = zeroblob(length(grey)) WHERE keyframe = 2", "image of keyframe 2"},
      {"UPDATE image SET width = 'wide' WHERE keyframe = 0", "image of keyframe 0"},
      {"DELETE FROM point WHERE id = 7", "point 7"},
      {"DELETE FROM keyframe WHERE id = 1", "keyframe"},
      {"DELETE FROM image WHERE keyframe = 1", "keyframe 1"},
      {"UPDATE meta SET value = 'other' WHERE key = 'calibration'", "calibration"},
      {"DELETE FROM meta WHERE key = 'calibration'", "calibration"},
      {"UPDATE plane SET extent = -1", "plane"},
      {"UPDATE content SET kind = 'hole'", "content 4"},
      {"UPDATE game SET state = 'won' WHERE name = 'marbles'", "marbles"},
      {"DROP TABLE game", "game"},
      {"CREATE VIEW extra AS SELECT * FROM point", "extra"},
  };
  for (const auto& damage : damages) {
    SCOPED_TRACE(damage.sql);
    std::filesystem::remove(folder.file("map.plxmap"));
    const std::string path = saved(folder, document_named("a"));
    run_sql(path, damage.sql);
    const std::string said = reading_fails_of(path);
    EXPECT_NE(said.find(damage.named), std::string::npos) << said;
    EXPECT_EQ(said.rfind(path + ": ", 0), 0U) << said;
    const std::vector<std::string> lines = verify_map_file(path);
    ASSERT_FALSE(lines.empty());
    bool named = false;
    for (const std::string& line : lines) named = named || line.find(damage.named) != std::string::npos;
    EXPECT_TRUE(named) << lines.front();
  }
}

// Whatever byte is damaged, reading gives the very map that was saved or says what is wrong.
TEST(MapFile, NoDamagedByteGivesAnotherMap) {
  const ScratchFolder folder;
  const MapDocument document = document_named("a");
  const std::string path = saved(folder, document);
  std::ifstream in(path, std::ios::binary);
  const std::string whole((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  std::mt19937_64 rng(5);
  int named = 0, unharmed = 0;
  for (int round = 0; round < 150; ++round) {
    std::string damaged = whole;
    // The first pages hold the schema and the small tables: half of the damage goes there.
    const std::size_t range = round % 2 ? damaged.size() : std::min<std::size_t>(damaged.size(), 16384);
    for (int i = 0; i <= round % 3; ++i) damaged[rng() % range] ^= static_cast<char>(1U << (rng() % 8));
    if (round % 10 == 9) damaged.resize(rng() % damaged.size());
    const std::string name = folder.write("damaged.plxmap", damaged);
    const std::string said = reading_fails_of(name);
    if (!said.empty()) {
      ++named;
      EXPECT_FALSE(verify_map_file(name).empty()) << said;
      EXPECT_EQ(said.find('\n'), std::string::npos) << said;
      continue;
    }
    ++unharmed;
    expect_same(document, read_map_file(name));
  }
  EXPECT_GT(named, 60);
  EXPECT_GT(unharmed, 0) << "space that is not used";
}

// Puts what is on the disk into a folder and reads it there.
MapDocument read_from(const UnreliableDisk& disk, const ScratchFolder& folder) {
  for (const char* name : {"map", "map-journal"}) {
    const auto bytes = disk.bytes(name);
    std::filesystem::remove(folder.file(name));
    if (!bytes.empty()) folder.write(name, std::string(bytes.begin(), bytes.end()));
  }
  return read_map_file(folder.file("map"));
}

TEST(MapFile, AFullDiskLeavesWhatWasSaved) {
  const ScratchFolder folder;
  const MapDocument first = document_named("first"), second = document_named("second", 36);
  int failures = 0;
  for (int after = 1;; after += 2) {
    ASSERT_LT(after, 1000);
    UnreliableDisk disk;
    MapFile file("map", "test", disk.name());
    file.save(first);
    disk.full_from(disk.operations() + after);
    try {
      file.save(second, true);
      EXPECT_EQ(read_from(disk, folder).name, "second");
      break;
    } catch (const RunError& e) {
      EXPECT_NE(std::string(e.what()).find("full"), std::string::npos) << e.what();
    }
    ++failures;
    disk.full_from(-1);
    EXPECT_EQ(read_from(disk, folder).name, "first") << "full after " << after;
    file.save(second, true);  // there is room again
    EXPECT_EQ(read_from(disk, folder).name, "second");
  }
  EXPECT_GT(failures, 20);
}

TEST(MapFile, LossOfPowerLeavesOneOfTheTwoStates) {
  const ScratchFolder folder;
  const MapDocument first = document_named("first"), second = document_named("second", 36);
  std::mt19937_64 rng(11);
  int firsts = 0, seconds = 0;
  bool saved_whole = false;
  for (int after = 1; !saved_whole; ++after) {
    ASSERT_LT(after, 1000);
    for (int way = 0; way < (after % 10 == 0 ? 3 : 1); ++way) {
      UnreliableDisk disk;
      {
        MapFile file("map", "test", disk.name());
        file.save(first);
        disk.power_lost_at(disk.operations() + after);
        try {
          file.save(second, true);
          saved_whole = true;
        } catch (const RunError&) {
        }
      }
      disk.restore_power(&rng);
      const MapDocument found = read_from(disk, folder);
      if (saved_whole) {
        EXPECT_EQ(found.name, "second") << "a save that returned is durable";
      }
      ++(found.name == "first" ? firsts : seconds);
      EXPECT_EQ(found.map.points.size(), found.name == "first" ? 12 : 36);
    }
  }
  EXPECT_GT(firsts, 30);
  EXPECT_GT(seconds, 0);
}

// A process that does nothing but save is killed at 200 moments: what it said was saved is there.
TEST(MapFile, AKillAtAnyMomentLosesNothingThatWasSaved) {
  const ScratchFolder folder;
  const std::string path = folder.file("map.plxmap");
  MapDocument document = document_named("0");
  int last = 0;
  MapFile(path, "test").save(document);
  std::mt19937_64 rng(3);
  int in_the_middle = 0;
  for (int kill_number = 0; kill_number < 200; ++kill_number) {
    int channel[2];
    ASSERT_EQ(pipe(channel), 0);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      close(channel[0]);
      try {
        MapFile file(path, "test");
        for (int version = last + 1;; ++version) {
          document.name = std::to_string(version);
          file.save(document, version % 2 == 0);
          if (write(channel[1], &version, sizeof version) != sizeof version) _exit(1);
        }
      } catch (...) {
        _exit(2);
      }
    }
    close(channel[1]);
    int version = 0;
    // From its first word on it is at it.
    if (read(channel[0], &version, sizeof version) == sizeof version) last = version;
    usleep(static_cast<useconds_t>(rng() % 6000));
    kill(child, SIGKILL);
    int status = 0;
    waitpid(child, &status, 0);
    ASSERT_TRUE(WIFSIGNALED(status)) << "it ended by itself: " << WEXITSTATUS(status);
    while (read(channel[0], &version, sizeof version) == sizeof version) last = version;
    close(channel[0]);
    in_the_middle += std::filesystem::exists(path + "-journal") ? 1 : 0;
    const MapDocument found = read_map_file(path);
    const int found_version = std::stoi(found.name);
    EXPECT_GE(found_version, last);
    EXPECT_LE(found_version, last + 1);
    EXPECT_EQ(found.map.points.size(), 12);
    last = found_version;
  }
  EXPECT_GT(in_the_middle, 10) << "kills in the middle of a save";
}

}  // namespace
}  // namespace parallax
