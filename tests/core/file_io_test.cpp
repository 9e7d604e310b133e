#include "core/file_io.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <vector>

#include "core/error.h"

namespace parallax {
namespace {
namespace fs = std::filesystem;

class FileIo : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "parallax_file_io_XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  std::size_t entries() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }
  fs::path folder_;
};

void write_text(const std::string& path, const std::string& text) {
  write_file_atomically(path, [&](std::ostream& out) { out << text; });
}

template <typename Error, typename Call>
std::string message_of(Call&& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "(nothing was thrown)";
}

TEST_F(FileIo, RoundTripOfEverySizeAroundTheBuffer) {
  for (const std::size_t size : {0u, 1u, 4095u, 65535u, 65536u, 65537u, 300000u}) {
    std::string text(size, 'x');
    for (std::size_t i = 0; i < size; ++i) text[i] = static_cast<char>(i * 7 % 256);
    write_text(path("a"), text);
    EXPECT_EQ(read_text_file(path("a")), text) << size;
  }
  EXPECT_EQ(entries(), 1u);
}

TEST_F(FileIo, BytesAreWrittenAsTheyAre) {
  const std::vector<std::uint8_t> bytes = {0, 255, 10, 13, 0, 7};
  write_file_atomically(path("a"), bytes);
  EXPECT_EQ(read_text_file(path("a")), std::string(bytes.begin(), bytes.end()));
  write_file_atomically(path("a"), std::span<const std::uint8_t>());
  EXPECT_EQ(fs::file_size(path("a")), 0u);
}

TEST_F(FileIo, WhatCannotBeWrittenIsToldBefore) {
  check_can_be_written(path("new"));
  EXPECT_EQ(entries(), 0u) << "nothing is left behind";
  write_text(path("old"), "kept");
  check_can_be_written(path("old"));
  check_can_be_written("/dev/null");
  EXPECT_EQ(read_text_file(path("old")), "kept");
  EXPECT_EQ(entries(), 1u);
  EXPECT_EQ(message_of<RunError>([&] { check_can_be_written(path("no/new")); }),
            path("no/new") + ": cannot be written: No such file or directory");
  EXPECT_EQ(message_of<RunError>([&] { check_can_be_written(folder_.string()); }),
            folder_.string() + ": cannot be written: it is a folder, expected a file");
  EXPECT_EQ(message_of<RunError>([&] { check_can_be_written(""); }), "'': cannot be written: the name is empty");
}

TEST_F(FileIo, ReadErrorsNameTheFileAndTheReason) {
  EXPECT_EQ(message_of<InputError>([&] { read_text_file(path("none")); }),
            path("none") + ": cannot be read: No such file or directory");
  EXPECT_EQ(message_of<InputError>([&] { read_text_file(folder_.string()); }),
            folder_.string() + ": cannot be read: it is a folder, expected a file");
}

TEST_F(FileIo, ReadsFilesWithoutAStatedSize) { EXPECT_FALSE(read_text_file("/proc/self/status").empty()); }

TEST_F(FileIo, AnExceptionLeavesTheEarlierFileAndNothingElse) {
  write_text(path("a"), "old");
  EXPECT_THROW(write_file_atomically(path("a"),
                                     [](std::ostream& out) {
                                       out << std::string(200000, 'n');
                                       throw std::runtime_error("half way");
                                     }),
               std::runtime_error);
  EXPECT_EQ(read_text_file(path("a")), "old");
  EXPECT_EQ(entries(), 1u);
}

TEST_F(FileIo, AFullDiskIsARunError) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  EXPECT_EQ(message_of<RunError>([&] { write_text("/dev/full", "x"); }),
            "/dev/full: cannot be written: No space left on device");
  EXPECT_EQ(message_of<RunError>([&] { write_text("/dev/full", std::string(1 << 20, 'x')); }),
            "/dev/full: cannot be written: No space left on device");
  EXPECT_TRUE(fs::is_character_file("/dev/full"));
}

TEST_F(FileIo, DevicesAndPipesAreWrittenInPlace) {
  write_text("/dev/null", "x");
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  std::string got;
  // Opened for both, so that neither side waits for the other.
  std::fstream reader(path("pipe"), std::ios::in | std::ios::out);
  write_text(path("pipe"), "through\n");
  std::getline(reader, got);
  EXPECT_EQ(got, "through");
  EXPECT_TRUE(fs::is_fifo(path("pipe")));
}

TEST_F(FileIo, UnwritablePathsAreRunErrors) {
  EXPECT_EQ(message_of<RunError>([&] { write_text(path("none/a"), "x"); }),
            path("none/a") + ": cannot be written: No such file or directory");
  EXPECT_EQ(message_of<RunError>([&] { write_text(folder_.string(), "x"); }),
            folder_.string() + ": cannot be written: it is a folder, expected a file");
  EXPECT_THROW(write_text("", "x"), RunError);
  EXPECT_THROW(write_text(path(std::string(300, 'n')), "x"), RunError);
}

TEST_F(FileIo, LinksAndPermissionsStay) {
  write_text(path("a"), "old");
  ASSERT_EQ(::chmod(path("a").c_str(), 0640), 0);
  fs::create_symlink("a", path("link"));
  write_text(path("link"), "new");
  EXPECT_TRUE(fs::is_symlink(path("link")));
  EXPECT_EQ(read_text_file(path("a")), "new");
  EXPECT_EQ(fs::status(path("a")).permissions(), fs::perms(0640));
}

TEST_F(FileIo, LongNamesHaveRoomForTheOneBeside) {
  const std::string name(255, 'n');
  write_text(path(name), "x");
  EXPECT_EQ(read_text_file(path(name)), "x");
}

TEST_F(FileIo, NumbersAreWrittenWithoutLocale) {
  write_file_atomically(path("a"), [](std::ostream& out) { out << 1234567.5; });
  EXPECT_EQ(read_text_file(path("a")), "1.23457e+06");
}

}  // namespace
}  // namespace parallax
