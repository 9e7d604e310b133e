// `parallax backend`: the back end of multi-session SLAM as a process of its own, for front ends that come over LCM.
#include <iostream>
#include <memory>
#include <string>

#include "app/command.h"
#include "app/live_options.h"
#include "app/slam_sessions.h"
#include "core/error.h"
#include "sessions/lcm_server.h"

namespace parallax {
namespace {

struct BackEndArguments {
  std::string url = kDefaultLcmUrl, database;
  int once = 0;
  bool no_loops = false, no_meetings = false, no_images = false;
};

void back_end(const BackEndArguments& args) {
  catch_end_signals();
  BackEndOptions options;
  options.loops = !args.no_loops;
  options.meetings = !args.no_meetings;
  options.keep_images = !args.no_images;
  LcmServerOptions server_options;
  server_options.url = args.url;
  server_options.once = args.once;
  server_options.notice = [](const std::string& line) { std::cerr << "parallax: " << line << std::endl; };
  LcmServer server(server_options, random_identity());
  if (!server.listen(end_requested)) return;
  SessionDatabase database(args.database, SqliteMode::write, "parallax " PARALLAX_VERSION);
  const std::unique_ptr<BackEnd> sessions = make_back_end(&database, options);
  const BackEndView before = sessions->view();
  std::cout << "back end on " << args.url << ", " << before.sessions.size() << " sessions in " << args.database
            << std::endl;
  const std::unique_ptr<DeskBackEnd> desk = make_desk_back_end(sessions.get());
  server.run(desk.get(), end_requested);
  sessions->finish();
  const BackEndView after = sessions->view();
  std::size_t active = 0;
  for (const Encounter& encounter : after.encounters) active += encounter.state == EncounterState::active;
  std::cout << after.sessions.size() << " sessions, " << after.poses.size() << " keyframes, " << active
            << " encounters are in " << args.database << std::endl;
}

}  // namespace

void add_backend_command(CLI::App& app, int*) {
  auto args = std::make_shared<BackEndArguments>();
  CLI::App* command = app.add_subcommand("backend", "Back end of multi-session SLAM for `parallax slam --lcm`");
  command->add_option("--lcm", args->url, "Address that front ends come to; within this machine unless it has a ttl")
      ->capture_default_str();
  command->add_option("--database", args->database, "Keep the sessions in FILE, and go on with those that it holds")
      ->required();
  command->add_option("--once", args->once, "End when so many sessions have ended; default: on Ctrl+C")
      ->check(CLI::Range(1, 1000000));
  command->add_flag("--no-loops", args->no_loops, "Do not close loops within a session");
  command->add_flag("--no-meetings", args->no_meetings, "Do not look for places of other sessions");
  command->add_flag("--no-images", args->no_images, "Do not keep images in the database");
  command->callback([args] { back_end(*args); });
}

}  // namespace parallax
