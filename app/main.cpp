// The `parallax` program: parses the command line, runs one subcommand, and turns whatever goes wrong into one line on
// stderr and an exit code.
#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <new>
#include <opencv2/core/utils/logger.hpp>
#include <string>

#include "app/command.h"
#include "app/live_options.h"
#include "core/check.h"
#include "core/error.h"
#include "core/log.h"

namespace parallax {

namespace {

// Errors are one line whatever their text holds.
void print_error(std::string text) {
  while (!text.empty() && text.back() == '\n') text.pop_back();
  std::replace(text.begin(), text.end(), '\n', ' ');
  std::cerr << "parallax: " << text << std::endl;
}

// An exception that leaves a thread ends here: still one line, still exit code 1.
[[noreturn]] void on_terminate() {
  try {
    if (const auto exception = std::current_exception()) std::rethrow_exception(exception);
    print_error("internal error: terminated");
  } catch (const std::exception& e) {
    print_error(e.what());
  } catch (...) {
    print_error("internal error: unknown exception");
  }
  std::_Exit(kExitFailed);
}

// Started with a standard stream closed, the next file opened would become that stream: keep the three taken.
void keep_standard_streams() {
  for (int fd = 0; fd <= 2; ++fd) {
    if (fcntl(fd, F_GETFD) == -1 && errno == EBADF && open("/dev/null", fd == 0 ? O_RDONLY : O_WRONLY) != fd) {
      std::_Exit(kExitFailed);
    }
  }
}

void set_up_logging(const std::string& level) {
  log::set_up(level);
  using namespace cv::utils::logging;
  setLogLevel(level == "trace" || level == "debug" ? LOG_LEVEL_WARNING : LOG_LEVEL_SILENT);
}

// What was written to stdout must have arrived, unless its reader left (`parallax ... | head -1`).
int check_standard_output(int exit_code) {
  std::cout.flush();
  pollfd output{STDOUT_FILENO, POLLOUT, 0};
  const bool reader_left = poll(&output, 1, 0) == 1 && (output.revents & POLLERR) != 0;
  if (std::cout.good() || reader_left) return exit_code;
  print_error("standard output: cannot be written");
  return exit_code == kExitDone ? kExitFailed : exit_code;
}

int parse_and_run(int argc, char** argv) {
  CLI::App app("Parallax: tracks a hand-held camera and maps what it sees, and measures how well", "parallax");
  app.set_version_flag("--version", std::string("parallax ") + PARALLAX_VERSION);
  app.fallthrough();
  app.get_formatter()->column_width(34);
  std::string level = "warning";
  app.add_option("--log-level", level, "trace, debug, info, warning, error or off, on stderr")
      ->envname("PARALLAX_LOG")
      ->check(CLI::IsMember({"trace", "debug", "info", "warning", "error", "off"}))
      ->capture_default_str();
  app.parse_complete_callback([&] { set_up_logging(level); });
  set_up_logging(level);

  int exit_code = kExitDone;
  add_live_command(app, &exit_code);
  add_run_command(app, &exit_code);
  add_slam_command(app, &exit_code);
  add_backend_command(app, &exit_code);
  add_sessions_command(app, &exit_code);
  add_map_command(app, &exit_code);
  add_vocabulary_command(app, &exit_code);
  add_cameras_command(app, &exit_code);
  add_calibrate_command(app, &exit_code);
  add_eval_command(app, &exit_code);
  app.require_subcommand(0, 1);

  const auto is_named = [&](const CLI::App* command) { return argc > 1 && command->get_name() == argv[1]; };
  if (argc > 1 && argv[1][0] != '-' && app.get_subcommands([&](CLI::App* c) { return is_named(c); }).empty()) {
    throw InputError("unknown command '" + std::string(argv[1]) + "': `parallax --help` lists the commands");
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& request) {  // --help, --version
    app.exit(request);
    return kExitDone;
  } catch (const CLI::ParseError& e) {
    throw InputError(std::string(e.what()) + " (`parallax --help` shows the usage)");
  }
  return app.get_subcommands().empty() ? run_live({}) : exit_code;
}

int run_program(int argc, char** argv) {
  try {
    return parse_and_run(argc, argv);
  } catch (const InputError& e) {
    print_error(e.what());
    return kExitBadInput;
  } catch (const CheckFailure& e) {
    print_error(e.what());
  } catch (const std::bad_alloc&) {
    print_error("out of memory");
  } catch (const std::exception& e) {
    print_error(e.what());
  } catch (...) {
    print_error("internal error: unknown exception");
  }
  return kExitFailed;
}

}  // namespace
}  // namespace parallax

int main(int argc, char** argv) {
  using namespace parallax;
  keep_standard_streams();
  std::signal(SIGPIPE, SIG_IGN);
  std::set_terminate(on_terminate);
  setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);  // its complaints about broken videos come back as our own lines
  return check_standard_output(run_program(argc, argv));
}
