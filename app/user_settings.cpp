#include "app/user_settings.h"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <utility>

#include "camera/calibration_file.h"
#include "core/error.h"
#include "core/file_io.h"
#include "core/parse_text.h"

namespace parallax {

namespace fs = std::filesystem;

namespace {

[[noreturn]] void bad(const std::string& file, const std::string& key, const std::string& found,
                      const std::string& expected) {
  throw InputError(file + ": key " + key + ": found " + found + ", expected " + expected);
}

std::string found_in(const YAML::Node& node) {
  if (node.IsScalar()) return in_quotes(node.Scalar());
  return node.IsSequence() ? "a list" : node.IsMap() ? "a group of keys" : "nothing";
}

std::string text_of(const YAML::Node& node, const std::string& file, const std::string& key) {
  if (!node.IsScalar()) bad(file, key, found_in(node), "a text");
  return node.Scalar();
}

double number_of(const YAML::Node& node, const std::string& file, const std::string& key, double low, double high) {
  double value = 0;
  if (!node.IsScalar() || !parse_number(node.Scalar(), &value) || value < low || value > high) {
    char expected[64];
    std::snprintf(expected, sizeof expected, "a number from %g to %g", low, high);
    bad(file, key, found_in(node), expected);
  }
  return value;
}

bool truth_of(const YAML::Node& node, const std::string& file, const std::string& key) {
  if (node.IsScalar() && node.Scalar() == "true") return true;
  if (node.IsScalar() && node.Scalar() == "false") return false;
  bad(file, key, found_in(node), "true or false");
}

void parse_size(const YAML::Node& node, const std::string& file, UserSettings* settings) {
  const std::string text = node.IsScalar() ? node.Scalar() : "";
  const auto x = text.find('x');
  std::int64_t width = 0, height = 0;
  if (x == std::string::npos || !parse_number(text.substr(0, x), &width) ||
      !parse_number(text.substr(x + 1), &height) || width < 64 || width > 8192 || height < 48 || height > 8192)
    bad(file, "size", found_in(node), "WIDTHxHEIGHT, like 640x480");
  settings->width = static_cast<int>(width);
  settings->height = static_cast<int>(height);
}

KeyChord chord_of(const YAML::Node& node, const std::string& file, const std::string& key) {
  const auto chord = node.IsScalar() ? parse_key_chord(node.Scalar()) : std::nullopt;
  if (!chord) bad(file, key, found_in(node), "a key like Space, F5 or Ctrl+M");
  return *chord;
}

void parse_keys(const YAML::Node& node, const std::string& file, UserSettings* settings) {
  if (!node.IsMap()) bad(file, "keys", found_in(node), "actions with their keys");
  std::vector<std::pair<Action, std::vector<KeyChord>>> wanted;
  for (const auto& entry : node) {
    const std::string name = entry.first.IsScalar() ? entry.first.Scalar() : "";
    const auto action = parse_action(name);
    if (!action) {
      std::string known;
      for (int i = 0; i < kActions; ++i)
        known += (i > 0 ? ", " : "") + std::string(action_name(static_cast<Action>(i)));
      bad(file, "keys", in_quotes(name), "one of " + known);
    }
    std::vector<KeyChord> chords;
    if (entry.second.IsSequence()) {
      for (const auto& item : entry.second) chords.push_back(chord_of(item, file, "keys." + name));
    } else {
      chords.push_back(chord_of(entry.second, file, "keys." + name));
    }
    wanted.emplace_back(*action, std::move(chords));
  }
  try {
    const std::vector<YieldedKey> yielded = set_keys(wanted, &settings->keys);
    settings->key_remarks = yielded_text(yielded, settings->keys);
  } catch (const InputError& e) {
    throw InputError(file + ": " + e.what());
  }
}

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

// The XDG directory `variable`, else `fallback` in the home; empty without a home. Relative values do not count.
std::string xdg_directory(const char* variable, const char* fallback) {
  const std::string value = environment(variable);
  if (!value.empty() && fs::path(value).is_absolute()) return value;
  const std::string home = environment("HOME");
  return home.empty() ? "" : (fs::path(home) / fallback).string();
}

std::string in_parallax(const std::string& folder, const std::string& name) {
  return folder.empty() ? "" : (fs::path(folder) / "parallax" / name).string();
}

// XDG_PICTURES_DIR="$HOME/Pictures" in user-dirs.dirs.
std::string from_user_dirs(const std::string& variable) {
  const std::string config = xdg_directory("XDG_CONFIG_HOME", ".config");
  if (config.empty()) return "";
  std::ifstream file(fs::path(config) / "user-dirs.dirs");
  for (std::string line; std::getline(file, line);) {
    if (line.rfind(variable + "=\"", 0) != 0 || line.back() != '"') continue;
    std::string value = line.substr(variable.size() + 2, line.size() - variable.size() - 3);
    if (value.rfind("$HOME", 0) == 0) value = environment("HOME") + value.substr(5);
    return fs::path(value).is_absolute() ? value : "";
  }
  return "";
}

std::string media_folder(const std::string& variable, const char* fallback) {
  std::string folder = environment(variable.c_str());
  if (folder.empty()) folder = from_user_dirs(variable);
  const std::string home = environment("HOME");
  if (folder.empty() && !home.empty()) folder = (fs::path(home) / fallback).string();
  return folder.empty() ? fs::current_path().string() : folder;
}

}  // namespace

UserSettings parse_user_settings(const std::string& text, const std::string& name) {
  UserSettings settings;
  YAML::Node root;
  try {
    root = YAML::Load(text);
  } catch (const YAML::Exception& e) {
    throw InputError(name + ": line " + std::to_string(e.mark.line + 1) + ": found no YAML (" + e.msg +
                     "), expected settings");
  }
  if (root.IsNull()) return settings;
  if (!root.IsMap()) throw InputError(name + ": found " + found_in(root) + ", expected settings as KEY: VALUE");
  try {
    for (const auto& entry : root) {
      const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "";
      const YAML::Node& value = entry.second;
      if (key == "keys") {
        parse_keys(value, name, &settings);
      } else if (key == "camera") {
        settings.camera = text_of(value, name, key);
      } else if (key == "size") {
        parse_size(value, name, &settings);
      } else if (key == "pictures") {
        settings.pictures = text_of(value, name, key);
      } else if (key == "videos") {
        settings.videos = text_of(value, name, key);
      } else if (key == "interface_scale") {
        settings.interface_scale = number_of(value, name, key, 0.5, 4);
      } else if (key == "keep_maps") {
        settings.keep_maps = truth_of(value, name, key);
      } else if (key == "merge_maps") {
        settings.merge_maps = truth_of(value, name, key);
      } else if (key == "tracking_profile") {
        settings.tracking_profile = truth_of(value, name, key);
      }  // others belong to a later version
    }
  } catch (const YAML::Exception& e) {
    throw InputError(name + ": line " + std::to_string(e.mark.line + 1) + ": found " + e.msg + ", expected settings");
  }
  return settings;
}

UserSettings read_user_settings(const std::string& path) {
  std::error_code error;
  if (path.empty() || !fs::exists(path, error)) return {};
  return parse_user_settings(read_text_file(path), path);
}

ProgramState read_program_state(const std::string& path) {
  ProgramState state;
  std::error_code error;
  if (path.empty() || !fs::is_regular_file(path, error)) return state;
  try {
    const YAML::Node root = YAML::Load(read_text_file(path));
    if (const YAML::Node window = root["window"]) {
      state.window_x = window["x"].as<int>(-1);
      state.window_y = window["y"].as<int>(-1);
      state.window_width = window["width"].as<int>(0);
      state.window_height = window["height"].as<int>(0);
      state.full_screen = window["full_screen"].as<bool>(false);
    }
    state.camera = root["camera"].as<std::string>("");
    state.key_remarks = root["key_remarks"].as<std::string>("");
  } catch (const std::exception&) {
    return {};
  }
  if (state.window_width < 160 || state.window_height < 120 || state.window_width > 16384 ||
      state.window_height > 16384)
    state.window_x = state.window_y = -1, state.window_width = state.window_height = 0;
  return state;
}

void write_program_state(const ProgramState& state, const std::string& path) {
  YAML::Node root;
  std::error_code error;
  if (fs::is_regular_file(path, error)) {
    try {
      root = YAML::Load(read_text_file(path));
    } catch (const std::exception&) {
    }
  }
  if (!root.IsMap()) root = YAML::Node(YAML::NodeType::Map);
  YAML::Node window = root["window"];
  if (!window.IsMap()) root["window"] = window = YAML::Node(YAML::NodeType::Map);
  window["x"] = state.window_x;
  window["y"] = state.window_y;
  window["width"] = state.window_width;
  window["height"] = state.window_height;
  window["full_screen"] = state.full_screen;
  root["camera"] = state.camera;
  root["key_remarks"] = state.key_remarks;
  fs::create_directories(fs::path(path).parent_path(), error);
  write_file_atomically(path, [&](std::ostream& out) { out << root << '\n'; });
}

std::string settings_path() {
  const std::string named = environment("PARALLAX_SETTINGS");
  return named.empty() ? in_parallax(xdg_directory("XDG_CONFIG_HOME", ".config"), "settings.yaml") : named;
}

std::string state_path() { return in_parallax(xdg_directory("XDG_DATA_HOME", ".local/share"), "state.yaml"); }

std::string pictures_folder() { return media_folder("XDG_PICTURES_DIR", "Pictures"); }
std::string videos_folder() { return media_folder("XDG_VIDEOS_DIR", "Videos"); }

std::string calibration_path(const std::string& identity, int width, int height) {
  std::string name;
  for (const char c : identity) name += std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '.' ? c : '_';
  name = name.substr(0, 150) + "-" + std::to_string(width) + "x" + std::to_string(height) + ".yaml";
  return in_parallax(xdg_directory("XDG_DATA_HOME", ".local/share"), "calibrations/" + name);
}

std::optional<CameraModel> remembered_calibration(const std::string& identity, int width, int height) {
  const std::string path = calibration_path(identity, width, height);
  std::error_code error;
  if (path.empty() || !fs::is_regular_file(path, error)) return std::nullopt;
  return read_calibration(path, 0, width, height);
}

void remember_calibration(const CameraModel& camera, const std::string& identity) {
  const std::string path = calibration_path(identity, camera.width(), camera.height());
  if (path.empty()) throw RunError("the calibration cannot be kept: there is no home folder");
  std::error_code error;
  fs::create_directories(fs::path(path).parent_path(), error);
  write_calibration(camera, path);
}

CameraModel estimated_lens(int width, int height) {
  // FOV model (PTAM Eq. 3): r' = atan(2 r tan(w/2)) / w. The right edge of the image is 37.5 degrees off the axis.
  constexpr double kOmega = 0.6;
  const double edge = std::tan(37.5 * std::numbers::pi / 180);
  const double distorted = std::atan(2 * edge * std::tan(kOmega / 2)) / kOmega;
  const double focal = 0.5 * width / distorted;
  return {CameraModelKind::fov, width, height, {focal, focal}, {0.5 * (width - 1), 0.5 * (height - 1)}, {kOmega}, 1};
}

}  // namespace parallax
