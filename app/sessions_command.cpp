// `parallax sessions`: what a session database holds: listed, shown, verified, merged, undone, exported.
#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "app/command.h"
#include "app/output_steps.h"
#include "app/sessions_export.h"
#include "app/sessions_maps_command.h"
#include "app/sessions_text.h"
#include "core/error.h"
#include "map/map_file.h"
#include "sessions/session_optimiser.h"

namespace parallax {
namespace {

namespace fs = std::filesystem;

constexpr const char* kProgram = "parallax " PARALLAX_VERSION;

void expect_database(const std::string& path) {
  std::error_code error;
  if (!fs::exists(path, error)) throw InputError(path + ": found no such file, expected a session database");
  if (!fs::is_regular_file(path, error))
    throw InputError(path + ": found something else than a file, expected a session database");
}

std::unique_ptr<SessionDatabase> open_to_read(const std::string& path) {
  expect_database(path);
  return std::make_unique<SessionDatabase>(path, SqliteMode::read);
}

// Only one that is whole is changed.
std::unique_ptr<SessionDatabase> open_to_change(const std::string& path, SessionDocument* document) {
  expect_database(path);
  auto database = std::make_unique<SessionDatabase>(path, SqliteMode::write, kProgram);
  *document = database->read();
  return database;
}

SessionBeginnings beginnings(SessionDatabase* database, const SessionDocument& document) {
  SessionBeginnings out;
  for (const SessionState& state : document.sessions) out[state.id] = database->began(state.id);
  return out;
}

// By name, else by number.
int find_session(const std::string& path, const SessionDocument& document, const std::string& wanted) {
  for (const SessionState& state : document.sessions)
    if (state.start.name == wanted) return state.id;
  int number = 0;
  const auto parsed = std::from_chars(wanted.data(), wanted.data() + wanted.size(), number);
  if (parsed.ec == std::errc() && parsed.ptr == wanted.data() + wanted.size())
    for (const SessionState& state : document.sessions)
      if (state.id == number) return state.id;
  std::string known;
  constexpr std::size_t kMostNamed = 8;
  for (std::size_t i = 0; i < std::min(kMostNamed, document.sessions.size()); ++i)
    known += (i > 0 ? ", " : "") + document.sessions[i].start.name;
  if (document.sessions.size() > kMostNamed) known += "...";
  throw InputError(path + ": found no session '" + wanted + "', expected " +
                   (known.empty() ? "one of none: it holds no sessions" : "one of " + known));
}

void print_json(const nlohmann::json& json) {
  std::cout << json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
}

void list_sessions(const std::string& path, bool json) {
  const auto database = open_to_read(path);
  const SessionDocument document = database->read();
  const SessionBeginnings began = beginnings(database.get(), document);
  if (json)
    print_json(session_list_json(document, began));
  else
    std::cout << session_list_text(document, began);
}

void show_session(const std::string& path, const std::string& name, bool json) {
  const auto database = open_to_read(path);
  const SessionDocument document = database->read();
  const int session = find_session(path, document, name);
  const SessionBeginnings began = beginnings(database.get(), document);
  if (json)
    print_json(session_json(document, session, began));
  else
    std::cout << session_text(document, session, began);
}

void list_encounters(const std::string& path, bool json) {
  const SessionDocument document = open_to_read(path)->read();
  if (json)
    print_json(encounter_list_json(document));
  else
    std::cout << encounter_list_text(document);
}

int verify_sessions(const std::vector<std::string>& paths) {
  int exit_code = kExitDone;
  for (const std::string& path : paths) {
    expect_database(path);
    // Damage is told by its name; something else is not a damaged database.
    std::string start(100, '\0');
    std::ifstream(path, std::ios::binary).read(start.data(), static_cast<std::streamsize>(start.size()));
    if (is_map_file(start)) throw InputError(path + ": found a map file, expected a session database");
    const std::vector<std::string> problems = verify_session_database(path);
    for (const std::string& line : problems) std::cout << path << ": " << line << '\n';
    if (problems.empty())
      std::cout << path << ": whole\n";
    else
      exit_code = kExitFailed;
  }
  return exit_code;
}

void merge_databases(const std::string& path, const std::vector<std::string>& others) {
  // All are looked at before anything is written.
  std::vector<std::unique_ptr<SessionDatabase>> from;
  for (std::size_t i = 0; i < others.size(); ++i) {
    std::error_code error;
    const auto refuse_same = [&](const std::string& other) {
      if (fs::equivalent(others[i], other, error) && !error)
        throw InputError(others[i] + ": found the same file as " + other + ", expected another database");
    };
    refuse_same(path);
    for (std::size_t j = 0; j < i; ++j) refuse_same(others[j]);
    from.push_back(open_to_read(others[i]));
    from[i]->read();
    for (std::size_t j = 0; j < i; ++j) from[j]->expect_new_sessions(from[i].get());
  }
  SessionDatabase database(path, SqliteMode::write, kProgram);
  database.read();
  for (const auto& other : from) database.expect_new_sessions(other.get());
  for (const auto& other : from) {
    const auto taken = database.take(other.get());
    const SessionDocument document = database.read();
    for (const auto& [before, now] : taken)
      std::cout << other->path() << ": session " << before << " is session " << now << " ("
                << session_state(document, now).start.name << ")\n";
    if (taken.empty()) std::cout << other->path() << ": no sessions\n";
  }
}

void rename_session(const std::string& path, const std::string& name, const std::string& wanted) {
  SessionDocument document;
  const auto database = open_to_change(path, &document);
  database->rename_session(find_session(path, document, name), wanted);
}

void delete_session(const std::string& path, const std::string& name, bool yes) {
  SessionDocument document;
  const auto database = open_to_change(path, &document);
  const int session = find_session(path, document, name);
  const SessionState& state = session_state(document, session);
  if (!yes)
    throw InputError("sessions delete: found no --yes, expected it: session '" + state.start.name + "' of " + path +
                     " would be gone for good");
  const bool had_met = std::any_of(document.sessions.begin(), document.sessions.end(), [&](const SessionState& other) {
    return other.id != session && other.component == state.component;
  });
  database->erase_session(session);
  if (had_met) reoptimise_sessions(database.get());
  std::cout << path << ": session '" << state.start.name
            << "' is gone; `parallax sessions compact` gives its space back\n";
}

void compact_database(const std::string& path) {
  const auto before = [&] {
    SessionDocument document;
    const auto database = open_to_change(path, &document);
    const auto bytes = fs::file_size(path);
    database->compact();
    return bytes;
  }();
  std::cout << path << ": " << before << " bytes before, " << fs::file_size(path) << " now\n";
}

void switch_encounters(const std::string& path, const std::vector<std::int64_t>& ids, bool on) {
  SessionDocument document;
  const auto database = open_to_change(path, &document);
  const EncounterState from = on ? EncounterState::off : EncounterState::active;
  const EncounterState to = on ? EncounterState::active : EncounterState::off;
  const auto text = [](EncounterState state) {
    return state == EncounterState::off       ? "switched off"
           : state == EncounterState::active  ? "active"
           : state == EncounterState::waiting ? "waiting"
                                              : "refused";
  };
  std::vector<Encounter> switched;
  for (const std::int64_t id : ids) {
    const auto found = std::find_if(document.encounters.begin(), document.encounters.end(),
                                    [&](const Encounter& e) { return e.id == id; });
    if (found == document.encounters.end())
      throw InputError(path + ": found no encounter " + std::to_string(id) +
                       ", expected one that `parallax sessions encounters` lists");
    if (found->state == to) continue;
    if (found->state != from)
      throw InputError(path + ": encounter " + std::to_string(id) + ": found it " + text(found->state) +
                       ", expected one that is " + text(from));
    found->state = to;
    switched.push_back(*found);
  }
  if (!switched.empty()) reoptimise_sessions(database.get(), switched);
  std::cout << path << ": " << switched.size() << " encounters " << text(to) << ", the graph solved anew\n";
}

struct SessionExportArguments {
  std::string database;
  std::vector<std::string> sessions;
  SessionExport what;
  bool global = false, own = false;
};

void export_database(SessionExportArguments args) {
  if (!args.what.any())
    throw InputError(
        "sessions export: found nothing to write, expected --tum, --kitti, --euroc, --g2o, --ply, --gltf, --textured, "
        "--colmap or --images");
  const auto database = open_to_read(args.database);
  const SessionDocument document = database->read();
  std::vector<int> sessions;
  for (const std::string& name : args.sessions) {
    const int session = find_session(args.database, document, name);
    if (std::find(sessions.begin(), sessions.end(), session) == sessions.end()) sessions.push_back(session);
  }
  if (args.sessions.empty())
    for (const SessionState& state : document.sessions) sessions.push_back(state.id);
  std::sort(sessions.begin(), sessions.end());
  if (sessions.empty()) throw InputError(args.database + ": found no sessions, expected one to export");
  const auto apart = std::find_if(sessions.begin(), sessions.end(), [&](int session) {
    return session_state(document, session).component != session_state(document, sessions.front()).component;
  });
  if (apart != sessions.end()) {
    const std::string names = "'" + session_state(document, sessions.front()).start.name + "' and '" +
                              session_state(document, *apart).start.name + "'";
    if (args.global)
      throw InputError("--global: found " + names + ", which have not met, expected sessions of one frame");
    if (args.what.joins())
      std::cerr << "parallax: warning: " << names << " have not met: each has a frame of its own in what is written\n";
  }
  args.what.frame = args.own ? SessionFrame::own : SessionFrame::global;
  OutputSteps steps;
  export_sessions(database.get(), document, sessions, args.what,
                  [&](const std::function<void()>& write) { steps(write); });
  steps.finish();
}

void add_export_command(CLI::App* command) {
  auto args = std::make_shared<SessionExportArguments>();
  SessionExport& what = args->what;
  CLI::App* sub = command->add_subcommand("export", "Write what the sessions hold for other programs");
  sub->add_option("database", args->database, "Session database")->required();
  sub->add_option("--session", args->sessions, "Name or number of a session (may be repeated); default: all")
      ->allow_extra_args(false);
  sub->add_option("--tum", what.tum, "Poses of the keyframes (TUM form): a file, or a folder for several sessions");
  sub->add_option("--kitti", what.kitti, "The same in KITTI form, files .kitti in a folder");
  sub->add_option("--euroc", what.euroc, "The same in EuRoC form, files .csv in a folder");
  auto* global =
      sub->add_flag("--global", args->global,
                    "Sessions must have met, so that all is in one frame; default: those that have met share "
                    "one, others have their own");
  sub->add_flag("--own-frame", args->own, "Trajectories each in their session's own frame")->excludes(global);
  sub->add_option("--g2o", what.graph, "The pose graph of all (g2o)");
  sub->add_option("--ply", what.cloud, "The feature maps of all, coloured by session (PLY)");
  sub->add_option("--gltf", what.cloud_model, "The same (glTF, .glb)");
  sub->add_option("--textured", what.textured, "The textured map, from the stored images (PLY)");
  sub->add_option("--colmap", what.colmap, "A COLMAP text model, into this folder");
  sub->add_option("--images", what.images, "The keyframes' rectified images, into this folder (PNG)");
  sub->callback([args] { export_database(*args); });
}

// What most of the subcommands take.
struct SessionsArguments {
  std::string database, name, wanted;
  std::vector<std::string> others;
  std::vector<std::int64_t> ids;
  bool json = false, yes = false;
};

}  // namespace

void add_sessions_command(CLI::App& app, int* exit_code) {
  CLI::App* command =
      app.add_subcommand("sessions", "Session databases of `slam`: list, show, verify, merge, undo, export");
  command->require_subcommand(1);
  add_sessions_maps_commands(command, exit_code);
  const auto add = [&](const std::string& name, const std::string& help) {
    auto args = std::make_shared<SessionsArguments>();
    CLI::App* sub = command->add_subcommand(name, help);
    sub->add_option("database", args->database, "Session database")->required();
    return std::make_pair(sub, args);
  };
  const auto add_json = [](CLI::App* sub, SessionsArguments* args) {
    sub->add_flag("--json", args->json, "For programs");
  };
  const auto add_session = [](CLI::App* sub, SessionsArguments* args) {
    sub->add_option("session", args->name, "Name or number of a session")->required();
  };
  {
    const auto [sub, args] = add("list", "List the sessions");
    add_json(sub, args.get());
    sub->callback([args = args] { list_sessions(args->database, args->json); });
  }
  {
    const auto [sub, args] = add("show", "Say all about a session");
    add_session(sub, args.get());
    add_json(sub, args.get());
    sub->callback([args = args] { show_session(args->database, args->name, args->json); });
  }
  {
    auto args = std::make_shared<SessionsArguments>();
    CLI::App* sub = command->add_subcommand("verify", "Read all of the files and name what is damaged (exit code 1)");
    sub->add_option("database", args->others, "Session databases")->required();
    sub->callback([args, exit_code] { *exit_code = verify_sessions(args->others); });
  }
  {
    const auto [sub, args] = add("merge", "Take the sessions of other databases in, which stay as they are");
    sub->add_option("other", args->others, "The other databases")->required();
    sub->callback([args = args] { merge_databases(args->database, args->others); });
  }
  {
    const auto [sub, args] = add("rename", "Give a session another name");
    add_session(sub, args.get());
    sub->add_option("name", args->wanted, "The new name")->required();
    sub->callback([args = args] { rename_session(args->database, args->name, args->wanted); });
  }
  {
    const auto [sub, args] = add("delete", "Take a session out, for good");
    add_session(sub, args.get());
    sub->add_flag("--yes", args->yes, "It is meant");
    sub->callback([args = args] { delete_session(args->database, args->name, args->yes); });
  }
  {
    const auto [sub, args] = add("compact", "Give space that is not used back");
    sub->callback([args = args] { compact_database(args->database); });
  }
  {
    const auto [sub, args] = add("encounters", "List loops and meetings, with what they rest on");
    add_json(sub, args.get());
    sub->callback([args = args] { list_encounters(args->database, args->json); });
  }
  for (const bool on : {false, true}) {
    const auto [sub, args] = add(on ? "redo" : "undo", on ? "Switch encounters on again, and solve the graph anew"
                                                          : "Switch encounters off, and solve the graph anew");
    sub->add_option("encounter", args->ids, "Numbers of encounters")->required();
    sub->callback([args = args, on] { switch_encounters(args->database, args->ids, on); });
  }
  add_export_command(command);
}

}  // namespace parallax
