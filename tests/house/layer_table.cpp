#include "tests/house/layer_table.h"

#include <sstream>
#include <stdexcept>

namespace parallax::house {
namespace {

std::string trimmed(const std::string& text) {
  const auto first = text.find_first_not_of(" \t");
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

// Words between back quotes; a folder loses its closing slash only where the caller wants it.
std::vector<std::string> quoted(const std::string& cell) {
  std::vector<std::string> words;
  for (size_t open = cell.find('`'); open != std::string::npos;) {
    const size_t close = cell.find('`', open + 1);
    if (close == std::string::npos) break;
    words.push_back(cell.substr(open + 1, close - open - 1));
    open = cell.find('`', close + 1);
  }
  return words;
}

std::set<std::string> comma_separated(const std::string& cell) {
  std::set<std::string> words;
  std::istringstream stream(cell);
  for (std::string word; std::getline(stream, word, ',');) {
    if (!trimmed(word).empty()) words.insert(trimmed(word));
  }
  return words;
}

// The rows of the first table below a heading, without its two header lines.
std::vector<std::vector<std::string>> rows_below(const std::string& markdown, const std::string& heading) {
  std::istringstream lines(markdown);
  std::vector<std::vector<std::string>> rows;
  bool inside = false;
  int table_lines = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind("## ", 0) == 0) inside = line == "## " + heading;
    if (!inside || line.rfind('|', 0) != 0) continue;
    if (++table_lines <= 2) continue;
    std::vector<std::string> cells;
    std::istringstream stream(line.substr(1));
    for (std::string cell; std::getline(stream, cell, '|');) cells.push_back(trimmed(cell));
    if (cells.size() != 3) throw std::runtime_error("expected three cells: " + line);
    rows.push_back(cells);
  }
  if (rows.empty()) throw std::runtime_error("no table below '## " + heading + "'");
  return rows;
}

bool allows(const std::set<std::string>& folders, const std::string& folder) {
  return folders.count("everything") > 0 || folders.count(folder) > 0;
}

// The folder of "core/se3.h"; empty without a slash.
std::string first_folder(const std::string& path) {
  const size_t slash = path.find('/');
  return slash == std::string::npos ? "" : path.substr(0, slash);
}

bool is_part_of_the_system(const std::string& header) {
  static const std::set<std::string> folders{"sys", "linux", "arpa", "netinet", "asm"};
  return header.find('/') == std::string::npos || folders.count(first_folder(header)) > 0;
}

void check_own_include(const Architecture& architecture, const std::string& folder, const std::string& header,
                       std::vector<std::string>* violations) {
  const std::string target = first_folder(header);
  if (target.empty()) {
    if (folder == "tests") return;  // a fixture that lies beside the test
    violations->push_back("includes \"" + header + "\", which is not named from the root of the tree");
  } else if (architecture.layers.count(target) == 0) {
    violations->push_back("includes \"" + header + "\" of a folder that is not in the table");
  } else if (target != folder && !allows(architecture.layers.at(folder), target)) {
    violations->push_back("includes \"" + header + "\", and " + folder + "/ may not use " + target + "/");
  }
}

void check_package_include(const Architecture& architecture, const std::string& folder, const std::string& header,
                           std::vector<std::string>* violations) {
  if (is_part_of_the_system(header)) return;
  // The longest entry counts.
  const std::pair<const std::string, std::set<std::string>>* best = nullptr;
  for (const auto& entry : architecture.packages) {
    if (header.rfind(entry.first, 0) == 0 && (best == nullptr || entry.first.size() > best->first.size())) {
      best = &entry;
    }
  }
  if (best == nullptr) {
    violations->push_back("includes <" + header + "> of a package that is not in the table");
  } else if (!allows(best->second, folder)) {
    violations->push_back("includes <" + header + ">, which " + folder + "/ may not use");
  }
}

}  // namespace

Architecture parse_architecture(const std::string& markdown) {
  Architecture out;
  for (const auto& row : rows_below(markdown, "Layers")) {
    const auto names = quoted(row[0]);
    if (names.size() != 1 || names[0].size() < 2 || names[0].back() != '/') {
      throw std::runtime_error("expected a folder such as `core/`: " + row[0]);
    }
    out.layers[names[0].substr(0, names[0].size() - 1)] = comma_separated(row[2]);
  }
  for (const auto& row : rows_below(markdown, "Packages")) {
    for (const auto& prefix : quoted(row[1])) out.packages[prefix] = comma_separated(row[2]);
  }
  for (const auto* table : {&out.layers, &out.packages}) {
    for (const auto& [name, folders] : *table) {
      for (const auto& folder : folders) {
        if (folder != "everything" && out.layers.count(folder) == 0) {
          throw std::runtime_error(name + " may be used with '" + folder + "', which is no folder of the table");
        }
      }
    }
  }
  return out;
}

std::vector<std::string> find_violations(const Architecture& architecture, const std::string& path,
                                         const std::string& text) {
  std::vector<std::string> violations;
  const std::string folder = first_folder(path);
  if (architecture.layers.count(folder) == 0) {
    return {path + ": lies in a folder that is not in the table"};
  }
  std::istringstream lines(text);
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    std::string rest = trimmed(line);
    if (rest.rfind('#', 0) != 0) continue;
    rest = trimmed(rest.substr(1));
    if (rest.rfind("include", 0) != 0) continue;
    rest = trimmed(rest.substr(7));
    std::vector<std::string> found;
    if (rest.rfind('"', 0) == 0) {
      check_own_include(architecture, folder, rest.substr(1, rest.find('"', 1) - 1), &found);
    } else if (rest.rfind('<', 0) == 0) {
      check_package_include(architecture, folder, rest.substr(1, rest.find('>') - 1), &found);
    }
    for (const auto& what : found) violations.push_back(path + ":" + std::to_string(number) + ": " + what);
  }
  return violations;
}

}  // namespace parallax::house
