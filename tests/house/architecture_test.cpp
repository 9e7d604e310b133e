// Holds the tree to docs/architecture.md and docs/conventions.md.
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/house/layer_table.h"
#include "tests/support/process.h"

namespace parallax::house {
namespace {

namespace fs = std::filesystem;

const fs::path kRoot = PARALLAX_SOURCE_DIR;

// Every file of the tree, relative to its root; build folders and what begins with a dot are left out.
std::vector<fs::path> files_of_the_tree() {
  std::vector<fs::path> files;
  for (auto it = fs::recursive_directory_iterator(kRoot); it != fs::recursive_directory_iterator(); ++it) {
    const std::string name = it->path().filename().string();
    if (it->is_directory() && ((it.depth() == 0 && (name == "build" || name == "out")) || name == ".git")) {
      it.disable_recursion_pending();
    } else if (it->is_regular_file()) {
      files.push_back(fs::relative(it->path(), kRoot));
    }
  }
  return files;
}

bool is_source(const fs::path& path) {
  return path.extension() == ".h" || path.extension() == ".cpp" || path.extension() == ".inl";
}

Architecture the_architecture() {
  return parse_architecture(::parallax::testing::read_all(kRoot / "docs/architecture.md"));
}

TEST(Architecture, NoIncludeBreaksTheTable) {
  const Architecture architecture = the_architecture();
  int sources = 0;
  for (const auto& path : files_of_the_tree()) {
    if (!is_source(path)) continue;
    ++sources;
    for (const auto& violation :
         find_violations(architecture, path.generic_string(), ::parallax::testing::read_all(kRoot / path))) {
      ADD_FAILURE() << violation;
    }
  }
  EXPECT_GT(sources, 50) << "the tree was not found";
}

TEST(Architecture, TrackerAndMapperAreStrangers) {
  const Architecture architecture = the_architecture();
  EXPECT_EQ(architecture.layers.at("tracker").count("mapper"), 0u);
  EXPECT_EQ(architecture.layers.at("mapper").count("tracker"), 0u);
  EXPECT_TRUE(architecture.layers.at("core").empty());
}

// The check itself: it must find what it is there to find.
class ArchitectureCheck : public ::testing::Test {
 protected:
  const Architecture architecture_ = parse_architecture(
      "## Layers\ntext\n\n| folder | what | may use |\n|---|---|---|\n| `core/` | a | |\n| `map/` | b | core |\n"
      "| `app/` | c | everything |\n| `tests/` | d | everything |\n\n## Packages\n\n| package | headers | used by "
      "|\n|---|---|---|\n"
      "| Eigen | `Eigen/` | everything |\n| OpenCV | `opencv2/core` `opencv2/imgproc` | core |\n"
      "| heavy | `opencv2/core/heavy` | app |\n\n## Other\n| a | b | c |\n");

  size_t violations(const std::string& path, const std::string& text) const {
    return find_violations(architecture_, path, text).size();
  }
};

TEST_F(ArchitectureCheck, AcceptsWhatTheTableAllows) {
  EXPECT_EQ(violations("core/a.cpp", "#include \"core/a.h\"\n#include <vector>\n#include <sys/stat.h>\n"), 0u);
  EXPECT_EQ(violations("map/a.h", "#include \"core/a.h\"\n#include \"map/b.h\"\n#include <Eigen/Core>\n"), 0u);
  EXPECT_EQ(violations("app/a.cpp", "#include \"map/a.h\"\n#include <opencv2/core/heavy.hpp>\n"), 0u);
  EXPECT_EQ(violations("core/a.cpp", "#include <opencv2/core/mat.hpp>\n// #include \"map/a.h\" in a remark\n"), 0u);
}

TEST_F(ArchitectureCheck, FindsAFabricatedViolation) {
  EXPECT_EQ(violations("core/a.cpp", "#include \"map/a.h\"\n"), 1u);
  EXPECT_EQ(violations("core/a.cpp", "  #  include   \"map/a.h\"\n#include \"app/b.h\"\n"), 2u);
  EXPECT_EQ(violations("map/a.cpp", "#include \"app/a.h\"\n"), 1u);
  EXPECT_EQ(violations("map/a.cpp", "#include <opencv2/imgproc.hpp>\n"), 1u);
  EXPECT_EQ(violations("core/a.cpp", "#include <opencv2/core/heavy.hpp>\n"), 1u);
  EXPECT_EQ(violations("core/a.cpp", "#include <boost/any.hpp>\n"), 1u);
  EXPECT_EQ(violations("core/a.cpp", "#include \"a.h\"\n"), 1u);
  EXPECT_EQ(violations("core/a.cpp", "#include \"attic/a.h\"\n"), 1u);
  EXPECT_EQ(violations("tests/core/a.cpp", "#include \"a.h\"\n"), 0u);
  EXPECT_EQ(violations("attic/a.cpp", ""), 1u);
}

TEST_F(ArchitectureCheck, RefusesATableItCannotRead) {
  EXPECT_THROW(parse_architecture(""), std::runtime_error);
  EXPECT_THROW(parse_architecture("## Layers\n|a|b|c|\n|---|---|---|\n| `core/` | a | nowhere |\n## Packages\n"
                                  "|a|b|c|\n|---|---|---|\n| E | `E/` | core |\n"),
               std::runtime_error);
  EXPECT_THROW(parse_architecture("## Layers\n|a|b|c|\n|---|---|---|\n| `core/` | a |\n"), std::runtime_error);
}

// Files that hold text, told by their extension, or by having none.
bool is_text(const fs::path& path) {
  static const std::set<std::string> extensions{".h",    ".cpp", ".md", ".txt", ".cmake",   ".json",
                                                ".yaml", ".yml", ".sh", ".1",   ".desktop", ""};
  return extensions.count(path.extension().string()) > 0;
}

TEST(Tree, NamesNoPathOfOneMachine) {
  // Put together here so that this file does not find itself.
  const std::string slash = "/";
  const std::vector<std::string> folders{slash + "root/", slash + "home/", slash + "work/", slash + "Users/"};
  for (const auto& path : files_of_the_tree()) {
    if (!is_text(path) || path.generic_string().rfind("tests/fuzz/corpus/", 0) == 0) continue;
    std::istringstream lines(::parallax::testing::read_all(kRoot / path));
    int number = 0;
    for (std::string line; std::getline(lines, line);) {
      ++number;
      for (const auto& folder : folders) {
        EXPECT_EQ(line.find(folder), std::string::npos) << path.generic_string() << ":" << number << ": " << line;
      }
    }
  }
}

TEST(Tree, EveryHeaderSaysWhatItIs) {
  for (const auto& path : files_of_the_tree()) {
    if (path.extension() != ".h") continue;
    const std::string text = ::parallax::testing::read_all(kRoot / path);
    EXPECT_EQ(text.rfind("//", 0), 0u) << path << " does not begin with a comment";
    EXPECT_NE(text.find("#pragma once"), std::string::npos) << path << " has no #pragma once";
  }
}

}  // namespace
}  // namespace parallax::house
