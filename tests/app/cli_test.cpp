// The command line as a user meets it: exit codes, one-line errors, help.
#include <gtest/gtest.h>

#include "tests/app/run_fixture.h"
#include "tests/support/process.h"

namespace parallax::testing {
namespace {

ProcessResult parallax(const std::vector<std::string>& arguments, const std::vector<std::string>& environment = {}) {
  return run_process(PARALLAX_BINARY, arguments, environment);
}

TEST(CommandLine, HelpOfEveryCommand) {
  const auto main_help = parallax({"--help"});
  EXPECT_EQ(main_help.exit_code, 0);
  EXPECT_TRUE(main_help.err.empty()) << main_help.err;
  for (const std::string command : {"live", "run", "cameras", "calibrate", "eval"}) {
    EXPECT_NE(main_help.out.find("\n  " + command + " "), std::string::npos) << main_help.out;
    const auto help = parallax({command, "--help"});
    EXPECT_EQ(help.exit_code, 0) << command;
    EXPECT_NE(help.out.find("Usage: parallax " + command), std::string::npos) << help.out;
    EXPECT_NE(help.out.find("--help"), std::string::npos) << help.out;
  }
}

TEST(CommandLine, Version) {
  const auto result = parallax({"--version"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(result.out, "parallax " PARALLAX_PROJECT_VERSION "\n");
}

TEST(CommandLine, BadUsageIsOneLineAndTwo) {
  expect_one_line(parallax({"frobnicate"}), 2, "frobnicate");
  expect_one_line(parallax({"--frobnicate"}), 2, "--frobnicate");
  expect_one_line(parallax({"eval"}), 2, "ESTIMATE");
  expect_one_line(parallax({"eval", "a", "b", "c"}), 2, "c");
  expect_one_line(parallax({"eval", "a\nb", "c"}), 2, "cannot be read");
  expect_one_line(parallax({"run"}), 2, "required");
  expect_one_line(parallax({"live", "--size", "big"}), 2, "WIDTHxHEIGHT");
  expect_one_line(parallax({"live", "--init", "never"}), 2, "--init");
  expect_one_line(parallax({"run", "/nonexistent/recording"}), 2, "/nonexistent/recording");
}

TEST(CommandLine, LogLevel) {
  expect_one_line(parallax({"--log-level", "loud", "eval", "a", "b"}), 2, "--log-level");
  expect_one_line(parallax({"eval", "a", "b"}, {"PARALLAX_LOG=loud"}), 2, "--log-level");
  expect_one_line(parallax({"eval", "a", "b", "--log-level", "off"}), 2, "cannot be read");
  expect_one_line(parallax({"eval", "a", "b"}, {"PARALLAX_LOG=error"}), 2, "cannot be read");
}

TEST(CommandLine, StandardOutputThatCannotBeWritten) {
  const std::string binary = PARALLAX_BINARY;
  expect_one_line(run_process("/bin/sh", {"-c", "'" + binary + "' --help >/dev/full"}), 1, "standard output");
  // Closed, or with a reader that has left: no reason to complain.
  for (const std::string redirection : {">&-", "| true"}) {
    const auto result = run_process("/bin/sh", {"-c", "'" + binary + "' --help " + redirection});
    EXPECT_EQ(result.exit_code, 0) << redirection;
    EXPECT_TRUE(result.err.empty()) << result.err;
  }
}

}  // namespace
}  // namespace parallax::testing
