// `parallax vocabulary`: words are trained, written whole, and read again; what cannot be is one line.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "place/vocabulary.h"
#include "tests/support/process.h"

namespace parallax::testing {
namespace {

constexpr const char* kDesk = "synthetic:desk?frames=41&size=320x240";

ProcessResult vocabulary(std::vector<std::string> words) {
  words.insert(words.begin(), "vocabulary");
  return run_process(PARALLAX_BINARY, words);
}

TEST(VocabularyCommand, TrainsWordsThatAreReadAgain) {
  const ScratchFolder folder;
  const std::string file = folder.file("desk.plxvoc");
  const ProcessResult trained = vocabulary({"train", kDesk, "--levels", "2", "--branching", "8", "--output", file});
  ASSERT_EQ(trained.exit_code, 0) << trained.err;
  EXPECT_EQ(trained.out, file + ": 64 words, 2 levels of 8\n");
  const ProcessResult info = vocabulary({"info", file});
  EXPECT_EQ(info.exit_code, 0) << info.err;
  EXPECT_EQ(info.out, trained.out);
  EXPECT_EQ(Vocabulary::load(file).words(), 64);
  // The same images and seed give the same bytes, another seed others.
  const std::string again = folder.file("again.plxvoc"), other = folder.file("other.plxvoc");
  EXPECT_EQ(vocabulary({"train", kDesk, "--levels", "2", "--branching", "8", "--output", again}).exit_code, 0);
  EXPECT_EQ(
      vocabulary({"train", kDesk, "--levels", "2", "--branching", "8", "--seed", "2", "--output", other}).exit_code, 0);
  EXPECT_TRUE(read_all(file) == read_all(again));
  EXPECT_FALSE(read_all(file) == read_all(other));
}

TEST(VocabularyCommand, ImagesWithoutFeaturesGiveNoFile) {
  const ScratchFolder folder;
  const std::string file = folder.file("blank.plxvoc");
  expect_one_line_error(vocabulary({"train", "synthetic:blank?frames=11", "--output", file}), 2, "found 0 features");
  EXPECT_FALSE(std::filesystem::exists(file));
}

TEST(VocabularyCommand, WhatCannotBeIsOneLine) {
  const ScratchFolder folder;
  const std::string file = folder.write("kept.plxvoc", "kept");
  expect_one_line_error(vocabulary({"train", kDesk, "--branching", "1", "--output", file}), 2, "branching");
  expect_one_line_error(vocabulary({"train", folder.file("absent"), "--output", file}), 2, "cannot be read");
  EXPECT_EQ(read_all(file), "kept");
  // Told before the work: these images do not exist.
  expect_one_line_error(vocabulary({"train", folder.file("absent"), "--output", folder.file("no/where")}), 1,
                        "no/where: cannot be written");
  expect_one_line_error(vocabulary({"train", folder.file("absent"), "--output", folder.path().string()}), 1,
                        "it is a folder");
  expect_one_line_error(vocabulary({"info", file}), 2, "expected a vocabulary");
  expect_one_line_error(vocabulary({"info", folder.file("absent")}), 2, "cannot be read");
}

TEST(VocabularyCommand, ACutFileIsRefused) {
  const ScratchFolder folder;
  const std::string shipped = read_all(std::string(PARALLAX_SOURCE_DIR) + "/assets/vocabulary/places.plxvoc");
  ASSERT_GT(shipped.size(), 1000u);
  for (const std::size_t size : {std::size_t{5}, std::size_t{100}, shipped.size() / 2, shipped.size() - 1})
    expect_one_line_error(vocabulary({"info", folder.write("cut.plxvoc", shipped.substr(0, size))}), 2, "expected");
}

}  // namespace
}  // namespace parallax::testing
