// The tables of docs/architecture.md, and a check of #include lines against them.
#pragma once

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace parallax::house {

struct Architecture {
  // Folder -> folders it may use. A folder that may use everything has "everything" in its set.
  std::map<std::string, std::set<std::string>> layers;
  // Start of a header's path ("opencv2/core") -> folders that may include it.
  std::map<std::string, std::set<std::string>> packages;
};

// Reads the tables under "## Layers" and "## Packages". A cell that names an unknown folder, or a table that is
// not there, throws std::runtime_error.
Architecture parse_architecture(const std::string& markdown);

// What is wrong with the includes of one file; empty when nothing is. `path` is relative to the root of the tree.
std::vector<std::string> find_violations(const Architecture& architecture, const std::string& path,
                                         const std::string& text);

}  // namespace parallax::house
