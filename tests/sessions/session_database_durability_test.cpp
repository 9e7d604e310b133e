// What a session database holds after a full disk, a loss of power and a kill.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "core/error.h"
#include "sessions/session_database.h"
#include "sessions/session_optimiser.h"
#include "tests/map/unreliable_disk.h"
#include "tests/sessions/fabricated_sessions.h"
#include "tests/support/memory_folder.h"

namespace parallax {
namespace {

using test::fabricated_start;
using test::SessionFabricator;
using test::UnreliableDisk;
using testing::MemoryFolder;

// Puts what is on the disk into a folder and reads it there.
SessionDocument sessions_on(const UnreliableDisk& disk, const MemoryFolder& folder) {
  for (const char* name : {"db", "db-journal", "db-wal"}) {
    const auto bytes = disk.bytes(name);
    std::filesystem::remove(folder.file(name));
    if (!bytes.empty()) folder.write(name, std::string(bytes.begin(), bytes.end()));
  }
  const std::vector<std::string> problems = verify_session_database(folder.file("db"));
  EXPECT_TRUE(problems.empty()) << problems.front();
  return SessionDatabase(folder.file("db"), SqliteMode::read).read();
}

TEST(SessionDatabaseDurability, AFullDiskLeavesWhatWasSaved) {
  const MemoryFolder folder;
  SessionFabricator make(2);
  const SessionBatch first = make.batch(1, 4);
  SessionBatch second;
  second.session = 1;
  second.keyframes = {make.keyframe(4), make.keyframe(5)};
  second.windows = {make.window(3, 5)};
  int failures = 0;
  for (int after = 1;; after += 2) {
    ASSERT_LT(after, 1000);
    UnreliableDisk disk;
    SessionDatabase database("db", SqliteMode::write, "test", disk.name());
    database.begin_session(fabricated_start("a"));
    database.save(first);
    disk.full_from(disk.operations() + after);
    try {
      database.save(second);
      EXPECT_EQ(sessions_on(disk, folder).poses.size(), 6U);
      break;
    } catch (const RunError& e) {
      EXPECT_NE(std::string(e.what()).find("full"), std::string::npos) << e.what();
    }
    ++failures;
    disk.full_from(-1);
    EXPECT_EQ(database.read().poses.size(), 4U) << "full after " << after;
    // Whoever comes after a crash finds one of the two states, and not the parts of one.
    const SessionDocument found = sessions_on(disk, folder);
    EXPECT_EQ(found.constraints.size(), found.poses.size() - 1);
    EXPECT_TRUE(found.poses.size() == 4 || found.poses.size() == 6) << found.poses.size();
    database.save(second);  // there is room again
    EXPECT_EQ(sessions_on(disk, folder).poses.size(), 6U);
  }
  EXPECT_GT(failures, 10);
}

// Power is lost at every operation of `change` in turn, twice, until one returns; `check` is told what the disk holds
// then.
void lose_power_at_every_operation(std::uint64_t seed, const std::function<void(SessionDatabase*)>& fill,
                                   const std::function<void(SessionDatabase*)>& change,
                                   const std::function<void(const SessionDocument& found, bool returned)>& check) {
  const MemoryFolder folder;
  std::mt19937_64 rng(seed);
  bool returned = false;
  for (int operation = 1; !returned; ++operation) {
    ASSERT_LT(operation, 1000);
    for (int way = 0; way < 2; ++way) {
      UnreliableDisk disk;
      {
        SessionDatabase database("db", SqliteMode::write, "test", disk.name());
        fill(&database);
        disk.power_lost_at(disk.operations() + operation);
        try {
          change(&database);
          returned = true;
        } catch (const RunError&) {
        }
      }
      disk.restore_power(&rng);
      SCOPED_TRACE("operation " + std::to_string(operation));
      check(sessions_on(disk, folder), returned);
    }
  }
}

TEST(SessionDatabaseDurability, LossOfPowerLeavesOneOfTheTwoStates) {
  SessionFabricator make(2);
  const SessionBatch first = make.batch(1, 4);
  SessionBatch second;
  second.session = 1;
  second.keyframes = {make.keyframe(4), make.keyframe(5)};
  second.windows = {make.window(3, 5)};
  int firsts = 0, seconds = 0;
  const auto fill = [&](SessionDatabase* database) {
    database->begin_session(fabricated_start("a"));
    database->save(first);
  };
  lose_power_at_every_operation(
      11, fill, [&](SessionDatabase* database) { database->save(second); },
      [&](const SessionDocument& found, bool returned) {
        if (returned) {
          EXPECT_EQ(found.poses.size(), 6U) << "a save that returned is durable";
        }
        EXPECT_TRUE(found.poses.size() == 4 || found.poses.size() == 6) << found.poses.size();
        EXPECT_EQ(found.constraints.size(), found.poses.size() - 1);
        ++(found.poses.size() == 4 ? firsts : seconds);
      });
  EXPECT_GT(firsts, 10);
  EXPECT_GT(seconds, 0);
}

// An encounter is switched off together with the estimates that follow from it, or neither is.
TEST(SessionDatabaseDurability, LossOfPowerLeavesEncountersWithTheirEstimates) {
  const auto along = [](double metres) { return RigidTransform(Eigen::Matrix3d::Identity(), {metres, 0, 0}); };
  Encounter wrong;
  // Two walks along a line, which met at one place, or 0.3 m from it: they agree on the middle.
  const auto fill = [&](SessionDatabase* database) {
    SessionFabricator make(14);
    for (const char* name : {"monday", "tuesday"}) {
      SessionState state = database->begin_session(fabricated_start(name));
      SessionBatch batch = make.batch(state.id, 3, false);
      for (auto& added : batch.keyframes) added.keyframe.session_from_camera = along(0.1 * added.keyframe.index);
      for (StereoConstraint& c : batch.windows[0].constraints) {
        c.from_from_to = along(0.1);
        c.covariance = 1e-6 * Matrix6d::Identity();
      }
      if (state.id == 2) {
        for (const double metres : {0.0, 0.3}) {
          batch.encounters.push_back(make.encounter(metres > 0 ? 2 : 1, {1, 1}, {2, 1}, EncounterState::active));
          batch.encounters.back().found_from_query = along(metres);
          batch.encounters.back().covariance = 0.09 * Matrix6d::Identity();
        }
        state.component = 1;
        batch.states = {state};
      }
      database->save(batch);
    }
    reoptimise_sessions(database);
    wrong = database->read().encounters[1];
    wrong.state = EncounterState::off;
  };
  int before = 0, after = 0;
  lose_power_at_every_operation(
      17, fill, [&](SessionDatabase* database) { reoptimise_sessions(database, {wrong}); },
      [&](const SessionDocument& found, bool) {
        const bool off = found.encounters[1].state == EncounterState::off;
        EXPECT_NEAR(found.sessions[1].global_from_session.t.x(), off ? 0 : 0.15, 1e-3);
        ++(off ? after : before);
      });
  EXPECT_GT(before, 3);
  EXPECT_GT(after, 0);
}

// A process that does nothing but save is killed at 200 moments: what it said was saved is there, and nothing half.
// Every tenth time it is killed after a save and before its word of it, where by chance it is hardly ever met.
TEST(SessionDatabaseDurability, AKillAtAnyMomentLosesNothingThatWasSaved) {
  // A kill loses nothing of what was written, in memory or on a disk; more saves fit between two.
  const MemoryFolder folder;
  const std::string path = folder.file("sessions.plx");
  SessionFabricator make(12);
  const int session = SessionDatabase(path, SqliteMode::write).begin_session(fabricated_start("a")).id;
  int last = -1;  // the last keyframe that was said to be saved
  std::mt19937_64 rng(3);
  int untold = 0;
  for (int kill_number = 0; kill_number < 200; ++kill_number) {
    const bool before_its_word = kill_number % 10 == 9;
    int channel[2];
    ASSERT_EQ(pipe(channel), 0);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      close(channel[0]);
      try {
        SessionDatabase database(path, SqliteMode::write);
        for (int index = last + 1;; ++index) {
          SessionBatch batch;
          batch.session = session;
          batch.keyframes = {make.keyframe(index)};
          if (index > 0) batch.windows = {make.window(index - 1, index)};
          database.save(batch);
          if (before_its_word && index == last + 3) raise(SIGSTOP);
          if (write(channel[1], &index, sizeof index) != sizeof index) _exit(1);
        }
      } catch (...) {
        _exit(2);
      }
    }
    close(channel[1]);
    int index = 0;
    if (read(channel[0], &index, sizeof index) == sizeof index) last = index;
    int status = 0;
    if (before_its_word) {
      ASSERT_EQ(waitpid(child, &status, WUNTRACED), child);
      ASSERT_TRUE(WIFSTOPPED(status)) << "it ended by itself: " << WEXITSTATUS(status);
    } else {
      usleep(static_cast<useconds_t>(rng() % 6000));
    }
    kill(child, SIGKILL);
    waitpid(child, &status, 0);
    ASSERT_TRUE(WIFSIGNALED(status)) << "it ended by itself: " << WEXITSTATUS(status);
    while (read(channel[0], &index, sizeof index) == sizeof index) last = index;
    close(channel[0]);
    SessionDatabase reader(path, SqliteMode::read);
    const SessionDocument found = reader.read();
    const int found_last = static_cast<int>(found.poses.size()) - 1;
    EXPECT_GE(found_last, last);
    EXPECT_LE(found_last, last + 1);
    EXPECT_EQ(found.constraints.size(), static_cast<std::size_t>(std::max(found_last, 0)));
    untold += found_last > last ? 1 : 0;
    last = found_last;
  }
  EXPECT_GT(last, 250) << "saves between the kills";
  EXPECT_GE(untold, 20) << "kills between a save and its word";
  EXPECT_TRUE(verify_session_database(path).empty());
}

}  // namespace
}  // namespace parallax
