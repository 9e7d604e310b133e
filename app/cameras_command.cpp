// `parallax cameras`: what cameras there are, and what each can do.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "app/command.h"
#include "camera/live_camera.h"
#include "core/error.h"

namespace parallax {
namespace {

using Json = nlohmann::ordered_json;

Json to_json(const CameraInfo& camera) {
  Json formats = Json::array(), controls = Json::array();
  for (const auto& format : camera.formats) {
    formats.push_back({{"pixel_format", format.pixel_format},
                       {"width", format.width},
                       {"height", format.height},
                       {"rates", format.rates},
                       {"usable", format.usable}});
  }
  for (const auto& control : camera.controls) {
    Json menu = Json::object();
    for (const auto& [value, text] : control.menu) menu[std::to_string(value)] = text;
    Json out = {{"name", control.name},           {"minimum", control.minimum},       {"maximum", control.maximum},
                {"step", control.step},           {"default", control.default_value}, {"value", control.value},
                {"read_only", control.read_only}, {"inactive", control.inactive}};
    if (!menu.empty()) out["menu"] = menu;
    controls.push_back(std::move(out));
  }
  return {{"source", camera.source},   {"name", camera.name}, {"bus", camera.bus},
          {"problem", camera.problem}, {"formats", formats},  {"controls", controls}};
}

std::string rate_text(double rate) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", rate);
  return text;
}

// Formats of the same kind on one line: "  YUYV  640x480 at 30, 15; 1280x720 at 10".
void print_formats(const std::vector<CameraFormat>& formats) {
  std::string last;
  for (const auto& format : formats) {
    const std::string kind = format.pixel_format;
    if (kind != last) {
      std::cout << (last.empty() ? "" : "\n") << "  " << kind << "  ";
      last = kind;
    } else {
      std::cout << "; ";
    }
    std::cout << format.width << "x" << format.height;
    for (std::size_t i = 0; i < format.rates.size(); ++i) {
      std::cout << (i == 0 ? " at " : ", ") << rate_text(format.rates[i]);
    }
    if (!format.usable) std::cout << " (not usable)";
  }
  if (!last.empty()) std::cout << "\n";
}

void print_control(const CameraControl& control) {
  std::cout << "  " << control.name << " = " << control.value << "  (" << control.minimum << " to " << control.maximum
            << ", default " << control.default_value << ")";
  if (control.read_only) std::cout << " read only";
  if (control.inactive) std::cout << " inactive";
  for (const auto& [value, text] : control.menu) std::cout << "\n      " << value << ": " << text;
  std::cout << "\n";
}

void print_camera(const CameraInfo& camera) {
  std::cout << camera.source << "  " << camera.name;
  if (!camera.bus.empty() && camera.bus != camera.name) std::cout << "  (" << camera.bus << ")";
  std::cout << "\n";
  if (!camera.problem.empty()) std::cout << "  cannot be used now: " << camera.problem << "\n";
  print_formats(camera.formats);
  for (const auto& control : camera.controls) print_control(control);
}

bool is_asked_for(const CameraInfo& camera, const std::string& source) {
  if (camera.source == source || "v4l2:" + source == camera.source) return true;
  // A part of a name of libcamera's, or the first camera of a kind.
  const auto colon = source.find(':');
  if (colon == std::string::npos || camera.source.compare(0, colon + 1, source, 0, colon + 1) != 0) return false;
  const std::string name = source.substr(colon + 1);
  return name.empty() || (source.rfind("libcamera:", 0) == 0 && (camera.source.find(name) != std::string::npos ||
                                                                 camera.name.find(name) != std::string::npos));
}

void list(const std::string& source, bool json) {
  auto cameras = list_cameras();
  if (!source.empty()) {
    const auto found =
        std::find_if(cameras.begin(), cameras.end(), [&](const auto& camera) { return is_asked_for(camera, source); });
    if (found == cameras.end()) {
      throw InputError(source + ": no such camera; `parallax cameras` lists what is there");
    }
    cameras = {*found};
  }
  if (json) {
    Json out = Json::array();
    for (const auto& camera : cameras) out.push_back(to_json(camera));
    std::cout << out.dump(2, ' ', false, Json::error_handler_t::replace) << "\n";
    return;
  }
  if (cameras.empty()) {
    std::cout << "no camera found: plug one in, or try the built-in one: parallax live --camera synthetic:desk\n";
  }
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (i > 0) std::cout << "\n";
    print_camera(cameras[i]);
  }
}

}  // namespace

void add_cameras_command(CLI::App& app, int* exit_code) {
  struct Options {
    std::string source;
    bool json = false;
  };
  const auto options = std::make_shared<Options>();
  auto* command = app.add_subcommand("cameras", "Lists cameras with their formats, rates and controls");
  command->add_option("SOURCE", options->source, "Only this one: v4l2:/dev/video0, libcamera:NAME");
  command->add_flag("--json", options->json, "As JSON");
  command->callback([options, exit_code] {
    list(options->source, options->json);
    *exit_code = kExitDone;
  });
}

}  // namespace parallax
