// `parallax map`: what is in a saved map, whether it is whole, and its parts for other programs.
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "app/command.h"
#include "app/map_export.h"
#include "app/run_outputs.h"
#include "core/error.h"
#include "core/file_io.h"
#include "map/map_file.h"

namespace parallax {
namespace {

void expect_file(const std::string& path) {
  if (!std::filesystem::exists(path)) throw InputError(path + ": found no such file, expected a map file");
}

void print_info(const std::string& path) {
  expect_file(path);
  const MapFileInfo info = read_map_file_info(path);
  std::cout << path << ":\n";
  if (!info.name.empty()) std::cout << "  name       " << info.name << '\n';
  std::cout << "  keyframes  " << info.keyframes << "\n  points     " << info.points << "\n  scale      "
            << (info.scale_is_known ? "set" : "a guess: 10 cm between the first two views") << "\n  content    "
            << info.content << "\n  games      " << info.games << "\n  created    " << info.created << "\n  saved      "
            << info.saved << " by " << info.program << "\n  file       " << info.bytes << " bytes, version "
            << info.version << '\n';
  for (const std::string& line : info.merged_from) std::cout << "  merged     " << line << '\n';
}

int verify(const std::vector<std::string>& paths) {
  int exit_code = kExitDone;
  for (const std::string& path : paths) {
    expect_file(path);
    const std::vector<std::string> problems = verify_map_file(path);
    for (const std::string& line : problems) std::cout << path << ": " << line << '\n';
    if (problems.empty())
      std::cout << path << ": whole\n";
    else
      exit_code = kExitFailed;
  }
  return exit_code;
}

struct ExportArguments {
  std::string map, points, keyframes, images, colmap, calibration;
};

void export_map(const ExportArguments& args) {
  if (args.points.empty() && args.keyframes.empty() && args.images.empty() && args.colmap.empty() &&
      args.calibration.empty())
    throw InputError(
        "map export: found nothing to write, expected --points, --keyframes, --images, --colmap or "
        "--calibration");
  expect_file(args.map);
  RunResult parts;
  const MapDocument document = read_map_file(args.map);
  parts.map = document.map;
  if (!args.points.empty()) write_points_ply(document.map, args.points);
  if (!args.keyframes.empty()) write_trajectory_tum(keyframe_trajectory(parts), args.keyframes);
  if (!args.images.empty()) write_keyframe_images(document.map, args.images);
  if (!args.colmap.empty()) write_colmap_model(document, args.map, args.colmap);
  if (!args.calibration.empty())
    write_file_atomically(args.calibration, [&](std::ostream& out) { out << document.calibration; });
}

}  // namespace

void add_map_command(CLI::App& app, int* exit_code) {
  CLI::App* command = app.add_subcommand("map", "Saved maps: info, verify, export, merge");
  command->require_subcommand(1);
  add_map_library_commands(command);
  const auto add_files = [](CLI::App* sub, std::vector<std::string>* paths) {
    sub->add_option("map", *paths, "Map files")->required();
  };
  {
    auto paths = std::make_shared<std::vector<std::string>>();
    CLI::App* sub = command->add_subcommand("info", "Say what is in the files");
    add_files(sub, paths.get());
    sub->callback([paths] {
      for (const std::string& path : *paths) print_info(path);
    });
  }
  {
    auto paths = std::make_shared<std::vector<std::string>>();
    CLI::App* sub = command->add_subcommand("verify", "Read all of the files and name what is damaged (exit code 1)");
    add_files(sub, paths.get());
    sub->callback([paths, exit_code] { *exit_code = verify(*paths); });
  }
  auto args = std::make_shared<ExportArguments>();
  CLI::App* sub = command->add_subcommand("export", "Write parts of a map for other programs");
  sub->add_option("map", args->map, "Map file")->required();
  sub->add_option("--points", args->points, "Points (PLY)");
  sub->add_option("--keyframes", args->keyframes, "Keyframes' poses (TUM form)");
  sub->add_option("--images", args->images, "Keyframes' images, into this folder (PNG)");
  sub->add_option("--colmap", args->colmap, "A COLMAP text model, into this folder");
  sub->add_option("--calibration", args->calibration, "The lens, as a calibration file");
  sub->callback([args] { export_map(*args); });
  add_map_merge_command(command, exit_code);
}

}  // namespace parallax
