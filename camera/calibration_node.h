// A calibration document as the readers of the single formats see it: typed look-ups by key, where everything that can
// be wrong is an InputError of one line ("FILE: key K: found X, expected Y").
#pragma once

#include <yaml-cpp/yaml.h>

#include <string>
#include <string_view>
#include <vector>

#include "core/se3.h"

namespace parallax {

class CalibrationNode {
 public:
  // `file` and `prefix` ("cam0.") are for messages only. `map` must be a map.
  CalibrationNode(const YAML::Node& map, std::string file, std::string prefix = "");

  bool has(const std::string& key) const;

  // Each refuses a missing key, a wrong type, and numbers that are not finite or out of range.
  double number(const std::string& key) const;
  double number_or(const std::string& key, double missing) const;
  double positive(const std::string& key) const;
  int image_side(const std::string& key) const;
  // As image_side; a file that does not say falls back to `missing`, which the caller knows, if positive.
  int image_side_or(const std::string& key, int missing) const;
  std::string text(const std::string& key) const;
  // A list of numbers: a plain sequence, or an OpenCV or ROS matrix with its numbers under "data".
  std::vector<double> numbers(const std::string& key) const;
  std::vector<double> numbers(const std::string& key, std::size_t count, const std::string& expected) const;
  CalibrationNode section(const std::string& key) const;
  // A rigid transform as the upper three or all four rows of its matrix: one list of numbers, OpenCV's matrix, or a
  // list of rows. What is not a rotation to 1e-4 is refused; the nearest one is returned.
  RigidTransform rigid(const std::string& key) const;

  // The first key given that is there, or the first of all when none is.
  std::string either(const std::string& key, const std::string& other) const {
    return has(key) || !has(other) ? key : other;
  }

  [[noreturn]] void fail(const std::string& key, const std::string& expected) const;
  [[noreturn]] void fail(const std::string& key, const std::string& found, const std::string& expected) const;

  const std::string& file() const { return file_; }

 private:
  YAML::Node at(const std::string& key) const;

  YAML::Node map_;
  std::string file_, prefix_;
};

// Loads one YAML document whose root is a map. OpenCV's "%YAML:1.0" line is passed over; documents that are nested
// absurdly deep, name a key twice or are no YAML at all are refused.
CalibrationNode load_calibration_yaml(std::string_view text, const std::string& file);

}  // namespace parallax
