#include "app/sessions_maps_command.h"

#include <algorithm>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "app/command.h"
#include "app/place_vocabulary.h"
#include "app/session_report.h"
#include "app/slam_sessions.h"
#include "core/error.h"
#include "map/map_file.h"
#include "sessions/map_attachment.h"
#include "sessions/session_export.h"

namespace parallax {
namespace {

namespace fs = std::filesystem;

constexpr const char* kWriter = "parallax " PARALLAX_VERSION;
constexpr double kNearestFeature_px = 25;  // from a pixel that is pointed at
constexpr double kTrueDisparity_px = 1.5;  // less says too little of the distance

std::unique_ptr<SessionDatabase> open_existing(const std::string& path, SqliteMode mode) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) throw InputError(path + ": found no such file, expected a session database");
  return std::make_unique<SessionDatabase>(path, mode, mode == SqliteMode::write ? kWriter : "");
}

RigidTransform global_from_camera(const SessionDocument& document, int session, int keyframe) {
  for (const SessionPose& pose : document.poses)
    if (pose.key == PoseKey{session, keyframe})
      return session_state(document, session).global_from_session * pose.session_from_camera;
  throw InputError("keyframe: found no keyframe " + std::to_string(keyframe) + " of session '" +
                   session_state(document, session).start.name + "', expected one that it has");
}

SimilarityTransform global_from_map(const SessionDocument& document, const AttachedMap& map) {
  return SimilarityTransform(global_from_camera(document, map.session, map.keyframe)) * map.keyframe_from_map;
}

const AttachedMap& find_map(const std::string& path, const SessionDocument& document, const std::string& name) {
  for (const AttachedMap& map : document.maps)
    if (map.name == name) return map;
  throw InputError(path + ": found no attached map '" + name + "', expected one of " +
                   std::to_string(document.maps.size()) + " that `parallax sessions content` lists");
}

std::string place_text(const Eigen::Vector3d& p) {
  std::ostringstream out;
  out << std::fixed << std::setprecision(3) << '(' << p.x() << ", " << p.y() << ", " << p.z() << ')';
  return out.str();
}

int attach(const std::string& path, const std::string& map_path, std::string name) {
  const auto database = open_existing(path, SqliteMode::write);
  const MapDocument map = read_map_file(map_path);
  if (name.empty()) name = map.name.empty() ? fs::path(map_path).stem().string() : map.name;
  const SessionDocument before = database->read();
  for (const AttachedMap& other : before.maps)
    if (other.name == name)
      throw InputError(path + ": found a map attached as '" + name + "' already, expected another --name");
  const MapAttachment found = attach_map(map.map, database.get(), *place_vocabulary());
  if (!found.ok) {
    std::cerr << "parallax: " << map_path << ": not attached: " << found.reason << '\n';
    return kExitFailed;
  }
  AttachedMap attached = found.map;
  attached.name = name;
  attached.path = fs::absolute(map_path).lexically_normal().string();
  database->add_map(&attached);
  std::cout << name << ": attached to session '" << session_state(before, attached.session).start.name
            << "' at keyframe " << attached.keyframe << "; a unit of the map is " << std::setprecision(4)
            << attached.keyframe_from_map.s << " m; " << found.agreeing << " of " << found.asked << " keyframes agree, "
            << found.inliers << " points, " << std::setprecision(2) << found.rms_px << " px\n";
  return kExitDone;
}

int detach(const std::string& path, const std::string& name) {
  const auto database = open_existing(path, SqliteMode::write);
  database->remove_map(find_map(path, database->read(), name).id);
  return kExitDone;
}

// What stands on the attached maps, where the sessions have it. A map file that is gone is told, the others are listed.
int list_content(const std::string& path, bool json) {
  const auto database = open_existing(path, SqliteMode::read);
  const SessionDocument document = database->read();
  nlohmann::json list = nlohmann::json::array();
  int exit_code = kExitDone;
  for (const AttachedMap& map : document.maps) {
    const SimilarityTransform to_global = global_from_map(document, map);
    std::optional<MapDocument> held;
    try {
      held = read_map_file(map.path);
    } catch (const InputError& e) {
      std::cerr << "parallax: warning: " << e.what() << '\n';
      exit_code = kExitFailed;
    }
    const int component = session_state(document, map.session).component;
    const std::string frame = session_state(document, component).start.name;
    if (!json)
      std::cout << map.name << " (" << map.path << "): scale " << std::setprecision(4) << map.keyframe_from_map.s
                << ", in the frame of '" << frame << "'\n";
    for (const ContentItem& item : held ? held->content : std::vector<ContentItem>()) {
      const Eigen::Vector3d at = to_global * item.position();
      const char* kind = item.kind == ContentKind::label ? "label" : item.kind == ContentKind::model ? "model" : "line";
      if (json)
        list.push_back({{"map", map.name},
                        {"frame", frame},
                        {"kind", kind},
                        {"text", item.text},
                        {"global_m", {at.x(), at.y(), at.z()}}});
      else
        std::cout << "  " << kind << " '" << item.text << "' at " << place_text(at) << " m\n";
    }
  }
  if (json)
    std::cout << list.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
  else if (document.maps.empty())
    std::cout << "no maps are attached\n";
  return exit_code;
}

struct PlaceArguments {
  std::string database, map, label, session;
  int keyframe = 0;
  std::vector<double> pixel;
};

// What a session's camera sees at a pixel, in its frame: the nearest feature with a distance, on the ray of the pixel.
Eigen::Vector3d point_at(SessionDatabase* database, const SessionState& state, const PoseKey& key,
                         const Eigen::Vector2d& pixel) {
  const SessionFeatures features = database->features(key);
  const StereoCamera& camera = state.start.camera;
  double nearest = kNearestFeature_px, disparity = 0;
  for (std::size_t i = 0; i < features.features.size(); ++i) {
    const Eigen::Vector2d at = features.features[i].pixel.cast<double>();
    const double d = at.x() - features.right_px[i];
    if (!(d >= kTrueDisparity_px) || (at - pixel).norm() >= nearest) continue;
    nearest = (at - pixel).norm();
    disparity = d;
  }
  if (disparity <= 0)
    throw InputError("--pixel: found nothing whose distance is known within " +
                     std::to_string(static_cast<int>(kNearestFeature_px)) + " px, expected a pixel on something");
  return camera.ray(pixel) * camera.depth_m(disparity);
}

int place_label(const PlaceArguments& args) {
  const auto database = open_existing(args.database, SqliteMode::read);
  const SessionDocument document = database->read();
  const AttachedMap& map = find_map(args.database, document, args.map);
  const SessionState* state = nullptr;
  for (const SessionState& s : document.sessions)
    if (s.start.name == args.session) state = &s;
  if (!state) throw InputError(args.database + ": found no session '" + args.session + "'");
  if (state->component != session_state(document, map.session).component)
    throw InputError(args.database + ": session '" + args.session + "' and the map '" + args.map +
                     "' have not met, expected a session of its component");
  const PoseKey key{state->id, args.keyframe};
  const RigidTransform camera = global_from_camera(document, state->id, args.keyframe);
  const Eigen::Vector3d seen = point_at(database.get(), *state, key, {args.pixel[0], args.pixel[1]});
  const SimilarityTransform map_from_global = global_from_map(document, map).inverse();
  MapDocument held = read_map_file(map.path);
  ContentItem item;
  item.kind = ContentKind::label;
  item.text = args.label;
  for (const ContentItem& other : held.content) item.id = std::max(item.id, other.id + 1);
  const Eigen::Vector3d position = map_from_global * (camera * seen);
  item.world_from_item =
      SimilarityTransform(frame_on_surface(position, map_from_global.R * (camera.R * -seen.normalized())));
  held.content.push_back(item);
  MapFile(map.path, kWriter).save(held);
  std::cout << map.path << ": '" << args.label << "' put at " << place_text(camera * seen) << " m, "
            << place_text(position) << " of the map\n";
  return kExitDone;
}

int recognise(const std::string& path) {
  const auto database = open_existing(path, SqliteMode::write);
  BackEndOptions options;
  const auto back_end = make_back_end(database.get(), options);
  const int added = back_end->recognise_again();
  int components = 0;
  for (const SessionState& state : back_end->view().sessions) components += state.component == state.id;
  std::cout << path << ": " << added << " encounters that were not known; " << back_end->view().sessions.size()
            << " sessions, " << components << " that have not met another\n";
  return kExitDone;
}

}  // namespace

void add_sessions_maps_commands(CLI::App* sessions, int* exit_code) {
  struct Arguments {
    std::string database, map, name;
    bool json = false;
    PlaceArguments place;
  };
  auto args = std::make_shared<Arguments>();
  const auto database = [&](CLI::App* command, std::string* path) {
    command->add_option("database", *path, "Session database")->required();
  };
  CLI::App* command = sessions->add_subcommand("recognise", "Look for places that merged sessions have in common");
  database(command, &args->database);
  command->callback([args, exit_code] { *exit_code = recognise(args->database); });

  command = sessions->add_subcommand("report", "Write all about the sessions as one HTML file");
  database(command, &args->database);
  command->add_option("file", args->map, "Where the report goes (.html)")->required();
  command->callback([args, exit_code] {
    open_existing(args->database, SqliteMode::read);
    write_session_report(args->database, args->map);
    *exit_code = kExitDone;
  });

  command = sessions->add_subcommand("attach", "Hang a map of one camera on the sessions, with its own scale");
  database(command, &args->database);
  command->add_option("map", args->map, "Map file (parallax run --map, live --map)")->required();
  command->add_option("--name", args->name, "What it is called; default: the map's name, or the file's");
  command->callback([args, exit_code] { *exit_code = attach(args->database, args->map, args->name); });

  command = sessions->add_subcommand("detach", "Take an attached map off again");
  database(command, &args->database);
  command->add_option("name", args->name, "What it is called")->required();
  command->callback([args, exit_code] { *exit_code = detach(args->database, args->name); });

  command = sessions->add_subcommand("content", "List what stands on the attached maps, in metres of the sessions");
  database(command, &args->database);
  command->add_flag("--json", args->json, "As JSON");
  command->callback([args, exit_code] { *exit_code = list_content(args->database, args->json); });

  command = sessions->add_subcommand("place", "Put a label on an attached map where a session's camera sees it");
  database(command, &args->place.database);
  command->add_option("--map", args->place.map, "The attached map")->required();
  command->add_option("--label", args->place.label, "What it says")->required();
  command->add_option("--session", args->place.session, "The session that sees it")->required();
  command->add_option("--keyframe", args->place.keyframe, "Its keyframe")->required();
  command->add_option("--pixel", args->place.pixel, "Where in its rectified left image: U V")->required()->expected(2);
  command->callback([args, exit_code] { *exit_code = place_label(args->place); });
}

}  // namespace parallax
