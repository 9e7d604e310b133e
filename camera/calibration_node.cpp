#include "camera/calibration_node.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "core/error.h"
#include "core/parse_text.h"

namespace parallax {
namespace {

constexpr int largest_image_side = 65536;
constexpr std::size_t deepest_nesting = 60;
constexpr std::size_t longest_list = 64;

std::string described(const YAML::Node& node) {
  if (!node.IsDefined()) return "nothing";
  if (node.IsNull()) return "an empty value";
  if (node.IsScalar()) return in_quotes(node.Scalar());
  if (node.IsSequence()) return "a list of " + std::to_string(node.size()) + " values";
  return "a section";
}

bool scalar_number(const YAML::Node& node, double* value) {
  return node.IsDefined() && node.IsScalar() && parse_number(trimmed(node.Scalar()), value);
}

// An upper bound of how deep the YAML parser would recurse: brackets that stay open, and compact block entries
// ("- - - x", "? ? x") and indentation, which cannot nest deeper than the line's own columns.
void check_nesting(std::string_view text, const std::string& file) {
  std::size_t open = 0;
  LineReader lines(text);
  std::string_view line;
  while (lines.next(&line)) {
    std::size_t entries = 0;
    for (std::size_t i = 0; i < line.size(); ++i) {
      const char c = line[i];
      if (c == '#' && (i == 0 || line[i - 1] == ' ')) break;
      if (c == '[' || c == '{') ++open;
      if ((c == ']' || c == '}') && open > 0) --open;
      if ((c == '-' || c == '?' || c == ':') && (i + 1 == line.size() || line[i + 1] == ' ' || line[i + 1] == '\t'))
        ++entries;
      if (open + entries > deepest_nesting)
        throw InputError(file + ": line " + std::to_string(lines.number()) + ": found values nested more than " +
                         std::to_string(deepest_nesting) + " deep, expected a calibration");
    }
  }
}

// The text without its "%YAML:1.0" line, which stands before any content.
std::string without_directive(std::string_view text) {
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  std::string out(text);
  std::size_t start = 0;
  while (start < out.size()) {
    const std::size_t end = std::min(out.find('\n', start), out.size());
    const std::string_view line = trimmed(std::string_view(out).substr(start, end - start));
    if (line.starts_with("%YAML")) out.replace(start, end - start, end - start, ' ');
    if (!line.empty() && line.front() != '#' && !line.starts_with("%YAML")) break;
    start = end + 1;
  }
  return out;
}

std::string one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20; }, ' ');
  return text;
}

}  // namespace

CalibrationNode::CalibrationNode(const YAML::Node& map, std::string file, std::string prefix)
    : map_(map), file_(std::move(file)), prefix_(std::move(prefix)) {}

YAML::Node CalibrationNode::at(const std::string& key) const {
  // Comparing text keys one by one, not YAML::Node::operator[], which would add to the document.
  for (const auto& entry : map_)
    if (entry.first.IsScalar() && entry.first.Scalar() == key) return entry.second;
  return YAML::Node(YAML::NodeType::Undefined);
}

bool CalibrationNode::has(const std::string& key) const { return at(key).IsDefined(); }

double CalibrationNode::number(const std::string& key) const {
  double value = 0;
  if (!scalar_number(at(key), &value)) fail(key, "a finite number");
  return value;
}

double CalibrationNode::number_or(const std::string& key, double missing) const {
  return has(key) ? number(key) : missing;
}

double CalibrationNode::positive(const std::string& key) const {
  double value = 0;
  if (!scalar_number(at(key), &value) || value <= 0) fail(key, "a positive number");
  return value;
}

int CalibrationNode::image_side(const std::string& key) const {
  double value = 0;
  if (!scalar_number(at(key), &value) || value < 1 || value > largest_image_side || value != std::floor(value))
    fail(key, "a whole number of pixels from 1 to " + std::to_string(largest_image_side));
  return static_cast<int>(value);
}

int CalibrationNode::image_side_or(const std::string& key, int missing) const {
  if (!has(key) && missing > 0) return missing;
  return image_side(key);
}

std::string CalibrationNode::text(const std::string& key) const {
  const YAML::Node node = at(key);
  if (!node.IsDefined() || !node.IsScalar() || node.Scalar().empty()) fail(key, "a word");
  return node.Scalar();
}

std::vector<double> CalibrationNode::numbers(const std::string& key) const {
  YAML::Node node = at(key);
  std::string path = key;
  if (node.IsDefined() && node.IsMap()) return section(key).numbers("data");
  if (!node.IsDefined() || !node.IsSequence()) fail(key, "a list of numbers");
  if (node.size() > longest_list) fail(key, "at most " + std::to_string(longest_list));
  std::vector<double> values;
  for (const auto& item : node) {
    double value = 0;
    if (!scalar_number(item, &value))
      fail(key, described(item) + " at place " + std::to_string(values.size() + 1), "a finite number");
    values.push_back(value);
  }
  return values;
}

std::vector<double> CalibrationNode::numbers(const std::string& key, std::size_t count,
                                             const std::string& expected) const {
  std::vector<double> values = numbers(key);
  if (values.size() != count) fail(key, std::to_string(values.size()) + " numbers", expected);
  return values;
}

RigidTransform CalibrationNode::rigid(const std::string& key) const {
  const YAML::Node node = at(key);
  const char* expected = "three or four rows of four numbers";
  std::vector<double> rows;
  if (node.IsDefined() && node.IsSequence() && node.size() > 0 && node[0].IsSequence()) {
    if (node.size() > 4) fail(key, expected);
    for (const auto& row : node) {
      if (!row.IsSequence() || row.size() != 4) fail(key, described(row) + " for a row", "rows of four numbers");
      for (const auto& item : row) {
        rows.emplace_back();
        if (!scalar_number(item, &rows.back())) fail(key, described(item), "a finite number");
      }
    }
  } else {
    rows = numbers(key);
  }
  if (rows.size() != 12 && rows.size() != 16) fail(key, std::to_string(rows.size()) + " numbers", expected);
  if (rows.size() == 16 && (rows[12] != 0 || rows[13] != 0 || rows[14] != 0 || rows[15] != 1))
    fail(key, "a last row that is not 0 0 0 1", "a rigid transform");
  RigidTransform transform;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      transform.R(row, column) = rows[static_cast<std::size_t>(4 * row + column)];
    transform.t(row) = rows[static_cast<std::size_t>(4 * row + 3)];
  }
  const double off = (transform.R * transform.R.transpose() - Eigen::Matrix3d::Identity()).norm();
  if (!(off < 1e-4) || transform.R.determinant() < 0)
    fail(key, "a matrix that is no rotation", "a rotation in the first three columns");
  if (off > 1e-12) transform.orthonormalise();  // printed with few digits
  return transform;
}

CalibrationNode CalibrationNode::section(const std::string& key) const {
  const YAML::Node node = at(key);
  if (!node.IsDefined() || !node.IsMap()) fail(key, "a section");
  return CalibrationNode(node, file_, prefix_ + key + ".");
}

void CalibrationNode::fail(const std::string& key, const std::string& expected) const {
  fail(key, described(at(key)), expected);
}

void CalibrationNode::fail(const std::string& key, const std::string& found, const std::string& expected) const {
  throw InputError(file_ + ": key " + prefix_ + key + ": found " + found + ", expected " + expected);
}

CalibrationNode load_calibration_yaml(std::string_view text, const std::string& file) {
  check_nesting(text, file);
  YAML::Node root;
  try {
    root = YAML::Load(without_directive(text));
  } catch (const YAML::Exception& error) {
    const std::string line = error.mark.is_null() ? "" : "line " + std::to_string(error.mark.line + 1) + ": ";
    throw InputError(file + ": " + line + "found unreadable YAML (" + one_line(error.msg) +
                     "), expected a calibration");
  }
  if (!root.IsDefined() || !root.IsMap())
    throw InputError(file + ": found " + described(root) + ", expected a calibration (keys and values)");
  std::set<std::string> keys;
  for (const auto& entry : root)
    if (entry.first.IsScalar() && !keys.insert(entry.first.Scalar()).second)
      throw InputError(file + ": key " + in_quotes(entry.first.Scalar()) + ": found twice, expected once");
  return CalibrationNode(root, file);
}

}  // namespace parallax
