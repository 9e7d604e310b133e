// Several maps: the library's promises, the finder's answers, and sessions that walk from one place to another.
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <thread>

#include "app/map_finder.h"
#include "app/map_library.h"
#include "app/map_lock.h"
#include "app/map_merge_record.h"
#include "app/maps_panel.h"
#include "app/place_vocabulary.h"
#include "app/session_maps.h"
#include "app/user_settings.h"
#include "camera/calibration_file.h"
#include "core/error.h"
#include "map/map_file.h"
#include "map/sqlite.h"
#include "render/synthetic_source.h"
#include "tests/map/fabricated_map.h"
#include "tests/support/file_size_limit.h"
#include "tests/support/process.h"

namespace parallax {
namespace {

namespace fs = std::filesystem;
using testing::read_all;
using testing::ScratchFolder;

MapDocument made_document(const std::string& name = "") {
  MapDocument document;
  document.map = test::fabricate_map().map;
  document.calibration = format_calibration(test::flat_camera());
  document.name = name;
  return document;
}

std::string put_map(const ScratchFolder& folder, const std::string& file, const std::string& name = "") {
  write_map_file(made_document(name), folder.file(file), "test");
  return folder.file(file);
}

TEST(MapLibrary, ListsWhatItHasAndChangesIt) {
  const ScratchFolder folder;
  const MapLibrary library(folder.path().string());
  EXPECT_TRUE(library.list().empty());
  EXPECT_TRUE(MapLibrary(folder.file("not there")).list().empty());
  const std::string kitchen = put_map(folder, "a.plxmap", "kitchen"), other = put_map(folder, "b.plxmap");
  std::vector<LibraryMap> maps = library.list();
  ASSERT_EQ(maps.size(), 2U);
  const LibraryMap described = library.describe(kitchen);
  EXPECT_EQ(described.title, "kitchen");
  EXPECT_EQ(described.problem, "");
  EXPECT_EQ(described.info.keyframes, 3);
  EXPECT_TRUE(described.fits(test::flat_camera()));
  EXPECT_FALSE(described.fits(CameraModel(CameraModelKind::pinhole, 320, 240, {301, 310}, {159.5, 119.5})));
  EXPECT_NE(library.describe(other).title, "") << "one without a name is called by its time";
  // Its picture is that of the middle keyframe, smaller.
  const GreyImage picture = read_map_picture(kitchen, 80);
  EXPECT_EQ(picture.size(), cv::Size(80, 60));
  EXPECT_EQ(cv::norm(read_map_picture(kitchen, 1000), test::noise_images(320, 240, 2)->pyramid.level[0]), 0);

  library.rename(other, "  garden\ntable \t");
  EXPECT_EQ(library.describe(other).title, "garden table");
  EXPECT_TRUE(verify_map_file(other).empty()) << "the name has its checksum";
  EXPECT_EQ(read_map_file(other).map.points.size(), made_document().map.points.size());
  EXPECT_EQ(clean_map_name(std::string(59, 'x') + "\xc3\xa4z").size(), 59U) << "no half letters";

  MapLibrary::set_locked(kitchen, true);
  EXPECT_TRUE(library.describe(kitchen).locked);
  const std::string before = read_all(kitchen);
  EXPECT_THROW(library.rename(kitchen, "x"), InputError);
  EXPECT_THROW(library.remove(kitchen), InputError);
  EXPECT_EQ(read_all(kitchen), before);
  MapLibrary::set_locked(kitchen, false);

  const std::string trashed = library.remove(kitchen);
  EXPECT_FALSE(fs::exists(kitchen));
  EXPECT_EQ(library.list().size(), 1U);
  put_map(folder, "a.plxmap", "newer");
  library.empty_old_trash();
  const std::string back = library.restore(trashed);
  EXPECT_NE(back, kitchen) << "its name was taken meanwhile";
  EXPECT_EQ(library.describe(back).title, "kitchen");
  EXPECT_EQ(read_all(back), before);
  // What lies in the trash for too long goes; what is no map there stays.
  const std::string old = library.remove(back);
  folder.write(".trash/notes.txt", "mine");
  const auto long_ago = fs::file_time_type::clock::now() - std::chrono::hours(24 * (MapLibrary::kTrashDays + 1));
  fs::last_write_time(old, long_ago);
  fs::last_write_time(folder.file(".trash/notes.txt"), long_ago);
  library.empty_old_trash();
  EXPECT_FALSE(fs::exists(old));
  EXPECT_TRUE(fs::exists(folder.file(".trash/notes.txt")));
}

// The program ended when one of the two had been moved, and when neither had.
TEST(MapLibrary, AMergeThatWasCutShortIsUndone) {
  for (const bool other_moved : {true, false}) {
    const ScratchFolder folder;
    const MapLibrary library(folder.path().string());
    const MergedPair pair{put_map(folder, "base.plxmap", "base"), put_map(folder, "other.plxmap", "other")};
    const std::string merged = put_map(folder, "merged.plxmap", "merged");
    const std::string base = read_all(pair.base), other = read_all(pair.other);
    note_merge(library, merged, pair);
    ASSERT_FALSE(fs::exists(pair.base) || fs::exists(pair.other));
    const auto moved = merged_pair(merged);
    ASSERT_TRUE(moved);
    fs::rename(moved->base, pair.base);
    if (!other_moved) fs::rename(moved->other, pair.other);

    ASSERT_TRUE(merged_pair(merged));
    EXPECT_EQ(merged_pair(merged)->base, pair.base);
    const UndoneMerge undone = undo_merge(library, merged);
    EXPECT_EQ(undone.pair.base, pair.base);
    EXPECT_EQ(undone.pair.other, pair.other);
    EXPECT_EQ(read_all(pair.base), base);
    EXPECT_EQ(read_all(pair.other), other);
    EXPECT_EQ(library.paths().size(), 2U);
    EXPECT_FALSE(merged_pair(merged));
  }
}

// Looking whether a map is in use does not keep anybody from taking it.
TEST(MapLock, IsAskedWithoutBeingTaken) {
  const ScratchFolder folder;
  const std::string path = folder.file("a.plxmap");
  EXPECT_FALSE(MapLock::is_taken(path));
  // Its folder is there from now on, and the file of the lock as after a kill.
  MapLock::try_take(path).reset();
  folder.write(".locks/a.plxmap.lock", "");
  EXPECT_FALSE(MapLock::is_taken(path));
  std::atomic<bool> stop{false};
  std::thread asking([&] {
    while (!stop) MapLock::is_taken(path);
  });
  int refused = 0;
  for (int i = 0; i < 2000; ++i) refused += MapLock::try_take(path) ? 0 : 1;
  stop = true;
  asking.join();
  EXPECT_EQ(refused, 0);
  const auto lock = MapLock::try_take(path);
  ASSERT_TRUE(lock);
  EXPECT_TRUE(MapLock::is_taken(path));
  EXPECT_FALSE(MapLock::try_take(path));
}

TEST(MapLibrary, LeavesWhatIsNotItsOwn) {
  const ScratchFolder folder;
  const MapLibrary library(folder.path().string());
  const std::string good = put_map(folder, "good.plxmap", "good");
  const std::string whole = read_all(good);
  std::string damaged = whole;
  for (std::size_t i = 4096; i < damaged.size(); i += 97) damaged[i] = static_cast<char>(damaged[i] ^ 0x5a);
  const std::vector<std::string> files{folder.write("notes.txt", "not a map"), folder.write("empty.plxmap", ""),
                                       folder.write("cut.plxmap", whole.substr(0, whole.size() / 3)),
                                       folder.write("damaged.plxmap", damaged)};
  fs::create_directory(folder.file("folder.plxmap"));
  fs::create_symlink(folder.file("nowhere"), folder.file("link.plxmap"));
  ASSERT_EQ(mkfifo(folder.file("pipe.plxmap").c_str(), 0600), 0);
  folder.write("good.plxmap.new-17", whole);  // half written by somebody
  std::vector<std::string> contents;
  for (const std::string& file : files) contents.push_back(read_all(file));

  const std::vector<LibraryMap> maps = library.list();
  ASSERT_EQ(maps.size(), 8U);
  EXPECT_EQ(maps.front().title, "good");
  for (std::size_t i = 1; i < maps.size(); ++i) {
    EXPECT_NE(maps[i].problem, "") << maps[i].file;
    EXPECT_FALSE(maps[i].fits(test::flat_camera()));
    EXPECT_EQ(maps[i].title, maps[i].name.empty() ? maps[i].title : maps[i].name);
  }
  for (const char* foreign : {"notes.txt", "empty.plxmap", "folder.plxmap", "link.plxmap", "pipe.plxmap"}) {
    EXPECT_THROW(library.rename(folder.file(foreign), "x"), InputError) << foreign;
    EXPECT_THROW(library.remove(folder.file(foreign)), InputError) << foreign;
    EXPECT_THROW(MapLibrary::set_locked(folder.file(foreign), true), InputError) << foreign;
  }
  EXPECT_TRUE(library.keep_newest_unnamed(0, "").empty()) << "what cannot be read is not cleared away";
  MapFinder finder(test::flat_camera(), TrackerOptions{}, place_vocabulary());
  finder.set_files(library.paths());
  while (finder.learn_one()) {
  }
  EXPECT_EQ(finder.maps(), 1);
  for (std::size_t i = 0; i < files.size(); ++i) EXPECT_EQ(read_all(files[i]), contents[i]) << files[i];
}

TEST(MapLibrary, TwoProgramsDoNotTakeTheSameMap) {
  const ScratchFolder folder;
  const MapLibrary library(folder.path().string());
  MapLibrary::NewMap first = library.new_map(), second = library.new_map();
  EXPECT_NE(first.path, second.path);
  write_map_file(made_document(), first.path, "test");
  EXPECT_TRUE(library.describe(first.path).in_use);
  EXPECT_EQ(MapLock::try_take(first.path), nullptr);
  EXPECT_THROW(library.remove(first.path), InputError);
  EXPECT_THROW(library.rename(first.path, "x"), InputError);
  first.lock.reset();
  EXPECT_FALSE(library.describe(first.path).in_use);
  EXPECT_NE(MapLock::try_take(first.path), nullptr);
  // A program that ends however it ends leaves no lock behind.
  const pid_t child = fork();
  if (child == 0) {
    const auto held = MapLock::try_take(first.path);
    _exit(held ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(WEXITSTATUS(status), 0);
  EXPECT_NE(MapLock::try_take(first.path), nullptr);
}

TEST(MapLibrary, KeepsTheNewestOfThoseWithoutAName) {
  const ScratchFolder folder;
  const MapLibrary library(folder.path().string());
  std::vector<std::string> paths;
  for (int i = 0; i < 5; ++i) {
    paths.push_back(put_map(folder, "m" + std::to_string(i) + ".plxmap", i == 0 ? "named" : ""));
    // Saved a second apart, as the clock of the file says.
    const std::string when = "2026-01-01T00:00:0" + std::to_string(i) + "Z";
    SqliteDatabase database(paths.back(), SqliteMode::write);
    SqliteStatement put(&database, "INSERT OR REPLACE INTO meta VALUES(?, ?, ?)");
    put.put(std::string_view("saved")).put(std::string_view(when)).put_checksum().execute();
  }
  MapLibrary::set_locked(paths[1], true);
  EXPECT_EQ(library.keep_newest_unnamed(1, paths[4]).size(), 2U);
  EXPECT_TRUE(fs::exists(paths[0]) && fs::exists(paths[1]) && fs::exists(paths[4]));
  EXPECT_FALSE(fs::exists(paths[2]) || fs::exists(paths[3]));
}

TEST(MapSaver, KeepsAMapOfSomeWeightOnly) {
  MapDocument document = made_document();
  EXPECT_FALSE(is_worth_keeping(document)) << "three views of the first second";
  document.name = "desk";
  EXPECT_TRUE(is_worth_keeping(document));
  document.name.clear();
  document.games["swarm"] = "{}";
  EXPECT_TRUE(is_worth_keeping(document));
}

// Waits for what a thread does; false when it does not come.
template <class Condition>
bool comes(const Condition& condition) {
  for (int i = 0; i < 1000; ++i) {
    if (condition()) return true;
    poll(nullptr, 0, 10);
  }
  return false;
}

TEST(MapSaver, SaysOnceThatTheDiskIsFull) {
  const ScratchFolder folder;
  MapSaverOptions options;
  options.library = std::make_shared<const MapLibrary>(folder.path().string());
  options.calibration = format_calibration(test::flat_camera());
  options.name = "desk";
  options.interval = std::chrono::milliseconds(5);
  std::atomic<int> copies{0};
  MapSaver saver(options, [&] {
    ++copies;
    MapCopy copy;
    copy.map = test::fabricate_map().map;
    copy.map_version = 1;
    return copy;
  });
  ASSERT_TRUE(comes([&] { return saver.saves() > 0; }));
  const std::string first = saver.path();
  {
    const testing::FileSizeLimit full(4096);
    saver.set_name("another");
    std::string message;
    EXPECT_TRUE(comes([&] { return !(message = saver.take_message()).empty(); }));
    EXPECT_NE(message.find("the map is not saved: " + first), std::string::npos) << message;
    const int before = copies;
    EXPECT_TRUE(comes([&] { return copies > before + 5; })) << "it goes on trying";
    EXPECT_EQ(saver.take_message(), "");
  }
  std::string again;
  EXPECT_TRUE(comes([&] { return !(again = saver.take_message()).empty(); }));
  EXPECT_EQ(again, "the map is saved again");
  EXPECT_EQ(options.library->describe(first).title, "another");
  // A map that cannot even be begun leaves no file.
  const testing::FileSizeLimit full(4096);
  const ScratchFolder other;
  options.library = std::make_shared<const MapLibrary>(other.path().string());
  MapSaver late(options, [] {
    MapCopy copy;
    copy.map = test::fabricate_map().map;
    copy.map_version = 1;
    return copy;
  });
  EXPECT_TRUE(comes([&] { return !late.take_message().empty(); }));
  EXPECT_THROW(late.finish(), RunError);
  EXPECT_TRUE(options.library->list().empty());
}

TEST(MapSaver, IsSwitchedOffInTheSettings) {
  EXPECT_TRUE(parse_user_settings("", "s").keep_maps);
  EXPECT_FALSE(parse_user_settings("keep_maps: false", "s").keep_maps);
  EXPECT_THROW(parse_user_settings("keep_maps: some", "s"), InputError);
  EXPECT_TRUE(parse_user_settings("", "s").merge_maps);
  EXPECT_FALSE(parse_user_settings("merge_maps: false", "s").merge_maps);
}

TEST(MapsPanel, IsGoneThroughWithKeys) {
  MapsPanel panel;
  EXPECT_EQ(panel.press(MapsKey::go).kind, MapsChoice::Kind::none) << "closed";
  panel.open();
  EXPECT_EQ(panel.press(MapsKey::go).kind, MapsChoice::Kind::none) << "nothing in it";
  EXPECT_EQ(panel.press(MapsKey::down).kind, MapsChoice::Kind::none);
  std::vector<MapCard> cards(7);
  for (std::size_t i = 0; i < cards.size(); ++i) {
    cards[i].map.path = std::to_string(i);
    cards[i].fits = i != 2;
    cards[i].current = i == 0;
    cards[i].map.locked = i == 3;
    cards[i].merged = i == 1 || i == 3;
  }
  cards[4].map.problem = "not a map file";
  cards[5].map.in_use = true;
  panel.set_cards(cards);
  panel.set_columns(3);
  const auto possible = [&](std::size_t card, MapsKey key) {
    while (panel.selected() > 0) panel.press(MapsKey::left);
    while (panel.selected() < card) panel.press(MapsKey::right);
    return panel.is_possible(key);
  };
  EXPECT_FALSE(possible(0, MapsKey::go)) << "one is there";
  EXPECT_TRUE(possible(1, MapsKey::go));
  EXPECT_TRUE(possible(1, MapsKey::separate));
  EXPECT_EQ(panel.press(MapsKey::separate).kind, MapsChoice::Kind::separate);
  EXPECT_FALSE(possible(0, MapsKey::separate) || possible(3, MapsKey::separate)) << "of one map, and a locked one";
  EXPECT_FALSE(possible(2, MapsKey::go)) << "another lens";
  EXPECT_TRUE(possible(3, MapsKey::go) && !possible(3, MapsKey::remove) && !possible(3, MapsKey::rename));
  EXPECT_EQ(panel.press(MapsKey::lock).kind, MapsChoice::Kind::unlock);
  EXPECT_FALSE(possible(4, MapsKey::go) || possible(4, MapsKey::remove) || possible(4, MapsKey::lock));
  EXPECT_FALSE(possible(5, MapsKey::go) || possible(5, MapsKey::remove));
  EXPECT_FALSE(panel.is_possible(MapsKey::undo));
  panel.set_undos(1);
  EXPECT_EQ(panel.press(MapsKey::undo).kind, MapsChoice::Kind::undo);
  // Rows of three: 0 1 2 / 3 4 5 / 6.
  EXPECT_TRUE(possible(1, MapsKey::go));
  panel.press(MapsKey::down);
  EXPECT_EQ(panel.selected(), 4U);
  panel.press(MapsKey::down);
  EXPECT_EQ(panel.selected(), 6U) << "the last one where the row is short";
  panel.press(MapsKey::down);
  panel.press(MapsKey::right);
  EXPECT_EQ(panel.selected(), 6U);
  EXPECT_EQ(panel.click_card(1).kind, MapsChoice::Kind::none) << "the first click chooses";
  EXPECT_EQ(panel.click_card(1).kind, MapsChoice::Kind::go);
  // What was looked at stays so when another map goes.
  cards.erase(cards.begin());
  panel.set_cards(cards);
  EXPECT_EQ(panel.cards()[panel.selected()].map.path, "1");
  EXPECT_EQ(panel.press(MapsKey::close).kind, MapsChoice::Kind::close);
  EXPECT_FALSE(panel.is_open());
}

// Pieces of synthetic sequences one after the other, as one recording.
class JoinedSource final : public FrameSource {
 public:
  struct Piece {
    std::string name;
    int from = 0, count = 0;
  };
  explicit JoinedSource(std::vector<Piece> pieces) : pieces_(std::move(pieces)) {
    for (const Piece& piece : pieces_) total_ += piece.count;
  }
  std::optional<Frame> next() override {
    if (piece_ == pieces_.size()) return std::nullopt;
    if (!source_) source_ = open_synthetic_source(pieces_[piece_].name);
    Frame frame = source_->frame(pieces_[piece_].from + done_);
    frame.index = index_;
    frame.time = Timestamp(index_ * 1'000'000'000LL / 30);
    ++index_;
    if (++done_ == pieces_[piece_].count) {
      ++piece_;
      done_ = 0;
      source_.reset();
    }
    return frame;
  }
  std::vector<SourceWarning> take_warnings() override { return {}; }
  int frame_count() const override { return total_; }
  double frames_per_second() const override { return 30; }
  std::string description() const override { return "joined"; }

 private:
  std::vector<Piece> pieces_;
  std::unique_ptr<SyntheticSource> source_;
  std::size_t piece_ = 0;
  int done_ = 0, index_ = 0, total_ = 0;
};

std::string desk(int seed) { return "synthetic:desk?size=320x240&seed=" + std::to_string(seed); }
CameraModel desk_camera() { return *open_synthetic_source(desk(1))->calibration(); }

struct Walk {
  RunResult result;
  std::vector<MapNews> news;
  int switches = 0, merges = 0;
};

Walk walk(const std::vector<JoinedSource::Piece>& pieces, const std::shared_ptr<const MapLibrary>& library) {
  JoinedSource source(pieces);
  RunOptions options;
  options.pace = Pace::lockstep;
  SessionMapsOptions wanted;
  wanted.new_map_after = std::chrono::milliseconds(800);
  RunMaps maps(desk_camera(), options, library, wanted);
  Walk out;
  out.result = run_session(&source, desk_camera(), options, {}, &maps);
  out.news = maps.news();
  out.switches = maps.switches();
  out.merges = maps.merges();
  return out;
}

std::string news_text(const Walk& walked) {
  std::string text;
  for (const MapNews& news : walked.news) text += std::to_string(news.frame) + ": " + news.text + "\n";
  return text;
}

// One session over two desks that were never seen: a map each, in files of their own.
class TwoDesks : public ::testing::Test {
 protected:
  static constexpr int kFirst = 150, kSecond = 180;

  static void SetUpTestSuite() {
    folder_ = std::make_unique<ScratchFolder>();
    library_ = std::make_shared<const MapLibrary>(folder_->file("maps"));
    made_ = std::make_unique<Walk>(walk({{desk(1), 0, kFirst}, {desk(2), 0, kSecond}}, library_));
    for (const LibraryMap& map : library_->list()) (desk_of(map.path) == 1 ? first_ : second_) = map.path;
  }
  static void TearDownTestSuite() {
    made_.reset();
    library_.reset();
    folder_.reset();
  }

  // By the frames of its keyframes in the joined source.
  static int desk_of(const std::string& path) {
    return read_map_file(path).map.keyframes.begin()->frame < kFirst ? 1 : 2;
  }

  static inline std::unique_ptr<ScratchFolder> folder_;
  static inline std::shared_ptr<const MapLibrary> library_;
  static inline std::unique_ptr<Walk> made_;
  static inline std::string first_, second_;
};

TEST_F(TwoDesks, AreKeptAsTwoMapsAndToldApart) {
  ASSERT_EQ(library_->list().size(), 2U) << news_text(*made_);
  ASSERT_FALSE(first_.empty() || second_.empty());
  EXPECT_EQ(made_->switches, 0) << news_text(*made_);
  EXPECT_EQ(made_->merges, 0) << "two desks are two";
  for (const std::string& path : {first_, second_}) {
    EXPECT_TRUE(verify_map_file(path).empty());
    // No map has views of both.
    for (const Keyframe& keyframe : read_map_file(path).map.keyframes)
      EXPECT_EQ(keyframe.frame < kFirst, path == first_) << keyframe.frame;
  }

  MapFinder finder(desk_camera(), TrackerOptions{}, place_vocabulary());
  finder.set_files(library_->paths());
  while (finder.learn_one()) {
  }
  ASSERT_EQ(finder.maps(), 2);
  // Every second pair of frames of views that the maps were not made of.
  int right = 0, wrong = 0, asked = 0;
  for (const int seed : {1, 2, 3, 4}) {
    const auto source = open_synthetic_source(desk(seed));
    for (int pair = 0; pair < 8; ++pair) {
      finder.forget_candidate();
      finder.look(source->frame(61 + 11 * pair), "");
      const auto found = finder.look(source->frame(62 + 11 * pair), "");
      if (seed <= 2) ++asked;
      if (!found) continue;
      (seed <= 2 && found->path == (seed == 1 ? first_ : second_) ? right : wrong) += 1;
    }
  }
  const auto blank = open_synthetic_source("synthetic:blank?size=320x240");
  for (int i = 0; i < 10; ++i) wrong += finder.look(blank->frame(i), "").has_value();
  EXPECT_EQ(wrong, 0);
  EXPECT_GE(right, asked * 3 / 4) << "of " << asked;
  RecordProperty("right", std::to_string(right) + " of " + std::to_string(asked));
  // Without the map that it is on it finds nothing.
  const auto source = open_synthetic_source(desk(1));
  for (int i = 70; i < 76; ++i) EXPECT_FALSE(finder.look(source->frame(i), first_).has_value());
}

// Another day: the first desk, the second, and the first again; what was put on the first is there, and each keeps its
// own file.
TEST_F(TwoDesks, AreKnownAgainByThemselves) {
  const ScratchFolder folder;
  for (const std::string& path : {first_, second_}) fs::copy_file(path, folder.path() / fs::path(path).filename());
  const auto library = std::make_shared<const MapLibrary>(folder.path().string());
  const std::string first = folder.file(fs::path(first_).filename()),
                    second = folder.file(fs::path(second_).filename());
  MapDocument document = read_map_file(first);
  ContentItem label;
  label.id = 7;
  label.text = "tea";
  label.world_from_item.t = document.map.points.begin()->position;
  document.content.push_back(label);
  document.name = "kitchen";
  write_map_file(document, first, "test");
  MapLibrary::set_locked(second, true);
  const std::string second_before = read_all(second);

  const std::vector<JoinedSource::Piece> pieces{{desk(1), 80, 40}, {desk(2), 80, 50}, {desk(1), 100, 40}};
  const Walk walked = walk(pieces, library);
  EXPECT_EQ(walked.switches, 3) << news_text(walked);
  EXPECT_EQ(walked.merges, 0) << news_text(walked);
  ASSERT_GE(walked.news.size(), 3U) << news_text(walked);
  EXPECT_EQ(walked.news[0].text, "this is kitchen");
  EXPECT_NE(walked.news[1].text.find("locked"), std::string::npos);
  EXPECT_EQ(walked.news[2].text, "this is kitchen");
  ASSERT_TRUE(walked.news[2].document);
  ASSERT_EQ(walked.news[2].document->content.size(), 1U);
  EXPECT_EQ(walked.news[2].document->content.front().text, "tea");
  EXPECT_EQ(library->list().size(), 2U) << "no third map";
  EXPECT_EQ(read_all(second), second_before) << "a locked map is not written";
  // The label has stayed where it was; the map has been gone on with.
  const MapDocument after = read_map_file(first);
  EXPECT_EQ(after.name, "kitchen");
  ASSERT_EQ(after.content.size(), 1U);
  EXPECT_LT((after.content.front().world_from_item.t - label.world_from_item.t).norm(), 1e-9);
  // How many frames a change of place costs, and that the camera is tracked at each.
  int tracked[3] = {}, begin = 0;
  for (std::size_t piece = 0; piece < 3; ++piece) {
    int first_tracked = -1;
    for (int i = begin; i < begin + pieces[piece].count; ++i) {
      const TrackingResult& frame = walked.result.frames[static_cast<std::size_t>(i)];
      const bool on_this = frame.camera_from_world && frame.map_version == piece + 1;
      tracked[piece] += on_this;
      if (on_this && first_tracked < 0) first_tracked = i - begin;
    }
    RecordProperty("frames_to_switch_" + std::to_string(piece), first_tracked);
    EXPECT_GE(tracked[piece], 20) << "place " << piece << "\n" << news_text(walked);
    begin += pieces[piece].count;
  }
}

}  // namespace
}  // namespace parallax
