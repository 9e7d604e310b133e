#include "app/sessions_export.h"

#include <cctype>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <iomanip>
#include <map>
#include <memory>
#include <sstream>

#include "app/png_bytes.h"
#include "app/progress_bar.h"
#include "core/error.h"
#include "core/file_io.h"
#include "mapper/textured_map.h"
#include "render/point_cloud_file.h"

namespace parallax {
namespace {

namespace fs = std::filesystem;

const Eigen::Vector3d kSessionUp(0, -1, 0);  // of a session that began with a level camera
// COLMAP's pixel coordinates of the centre of our pixel (0, 0).
constexpr double kColmapCentre = 0.5;

fs::path made_session_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw RunError(folder.string() + ": cannot be made: " + error.message());
  return folder;
}

std::string file_name_of(const std::string& name) {
  std::string out;
  for (const char c : name) {
    const bool kept = std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_' || c == '.';
    out += kept ? c : '-';
  }
  if (out.empty() || out.front() == '.') out.insert(0, "-");
  return out;
}

class SessionExporter {
 public:
  SessionExporter(SessionDatabase* database, const SessionDocument& document, const std::vector<int>& sessions)
      : database_(*database), document_(document), sessions_(sessions) {}

  void write_trajectories(const std::string& path, TrajectoryFormat format, SessionFrame frame) const;
  void write_cloud(const std::string& path) const;
  void write_model(const std::string& path) const;
  void write_textured(const std::string& path);
  void write_colmap(const std::string& folder) const;
  void write_images(const std::string& folder);

 private:
  std::vector<SessionPose> poses(int session) const {
    std::vector<SessionPose> out;
    for (const SessionPose& pose : document_.poses)
      if (pose.key.session == session) out.push_back(pose);
    return out;
  }
  std::string image_name(const PoseKey& key, const char* side) const {
    std::ostringstream out;
    out << session_file_name(document_, key.session) << "/keyframe_" << std::setw(5) << std::setfill('0')
        << key.keyframe << '_' << side << ".png";
    return out.str();
  }
  std::vector<SessionCloudPoint> cloud() const {
    std::vector<SessionCloudPoint> out;
    for (const int session : sessions_) {
      const auto of_session = session_cloud(document_, session, database_.points(session));
      out.insert(out.end(), of_session.begin(), of_session.end());
    }
    return out;
  }

  SessionDatabase& database_;
  const SessionDocument& document_;
  const std::vector<int>& sessions_;
};

void SessionExporter::write_trajectories(const std::string& path, TrajectoryFormat format, SessionFrame frame) const {
  std::error_code error;
  if (sessions_.size() == 1 && !fs::is_directory(path, error) && path.back() != '/') {
    write_trajectory(session_trajectory(document_, sessions_.front(), frame), format, path);
    return;
  }
  const char* ending = format == TrajectoryFormat::tum ? ".txt" : format == TrajectoryFormat::kitti ? ".kitti" : ".csv";
  const fs::path folder = made_session_folder(path);
  for (const int session : sessions_)
    write_trajectory(session_trajectory(document_, session, frame), format,
                     (folder / (session_file_name(document_, session) + ending)).string());
}

void SessionExporter::write_cloud(const std::string& path) const {
  const std::vector<SessionCloudPoint> points = cloud();
  std::string bytes;
  const auto append = [&](const auto& value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); };
  for (const SessionCloudPoint& p : points) {
    for (int i = 0; i < 3; ++i) append(static_cast<float>(p.global[i]));
    append(cloud_colour_of(p.session));
    append(static_cast<std::int32_t>(p.session));
    append(static_cast<std::int32_t>(p.poses));
  }
  write_file_atomically(path, [&](std::ostream& out) {
    out << "ply\nformat binary_little_endian 1.0\ncomment feature maps of Parallax sessions, metres, global frame\n"
           "element vertex "
        << points.size()
        << "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty "
           "uchar blue\nproperty int session\nproperty int observers\nend_header\n"
        << bytes;
  });
}

void SessionExporter::write_model(const std::string& path) const {
  std::vector<ColouredPoint> points;
  for (const SessionCloudPoint& p : cloud()) points.push_back({p.global.cast<float>(), cloud_colour_of(p.session), 0});
  write_cloud_glb(points, kSessionUp, path);
}

void SessionExporter::write_textured(const std::string& path) {
  std::vector<ColouredPoint> points;
  int total = 0, done = 0, added = 0;
  for (const int session : sessions_) total += static_cast<int>(poses(session).size());
  ProgressBar progress("textured map", total);
  // Sessions of one component and one camera see the same places: one map for them.
  std::vector<std::pair<const SessionState*, std::unique_ptr<TexturedMap>>> maps;
  for (const int session : sessions_) {
    const SessionState& state = session_state(document_, session);
    auto map = std::find_if(maps.begin(), maps.end(), [&](const auto& there) {
      return there.first->component == state.component && there.first->start.camera == state.start.camera;
    });
    if (map == maps.end()) {
      maps.emplace_back(&state, std::make_unique<TexturedMap>(state.start.camera));
      map = std::prev(maps.end());
    }
    for (const SessionPose& pose : poses(session)) {
      TexturedKeyframe keyframe;
      if (database_.images(pose.key, &keyframe.left, &keyframe.right)) {
        keyframe.keyframe = added++;
        keyframe.world_from_camera = state.global_from_session * pose.session_from_camera;
        map->second->add(keyframe);
      }
      progress.update(++done);
    }
  }
  if (added == 0) throw RunError(path + ": cannot be written: no images were kept of these sessions");
  for (const auto& [state, map] : maps) {
    const std::vector<ColouredPoint> seen = map->points();
    points.insert(points.end(), seen.begin(), seen.end());
  }
  write_cloud_ply(points, path);
}

// Each point with the keyframe that it follows as its one observation.
void SessionExporter::write_colmap(const std::string& folder) const {
  struct Observation {
    Eigen::Vector2d pixel;
    std::int64_t point;
  };
  std::map<PoseKey, std::vector<Observation>> observations;
  std::map<PoseKey, int> image;
  for (const int session : sessions_)
    for (const SessionPose& pose : poses(session)) image.emplace(pose.key, static_cast<int>(image.size()) + 1);
  std::ostringstream cameras, images, points;
  for (std::ostringstream* out : {&cameras, &images, &points}) *out << std::setprecision(17);
  cameras << "# CAMERA_ID MODEL WIDTH HEIGHT PARAMETERS\n";
  images << "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then X Y POINT3D_ID\n";
  points << "# POINT3D_ID X Y Z R G B ERROR, then IMAGE_ID POINT2D_INDEX\n";
  std::int64_t next_point = 1;
  for (const int session : sessions_) {
    const SessionState& state = session_state(document_, session);
    const StereoCamera& camera = state.start.camera;
    cameras << session << " PINHOLE " << camera.width << ' ' << camera.height << ' ' << camera.focal_px.x() << ' '
            << camera.focal_px.y() << ' ' << camera.centre_px.x() + kColmapCentre << ' '
            << camera.centre_px.y() + kColmapCentre << '\n';
    const std::vector<SessionPose> of_session = poses(session);
    std::map<int, RigidTransform> camera_from_global;
    for (const SessionPose& pose : of_session)
      camera_from_global[pose.key.keyframe] = (state.global_from_session * pose.session_from_camera).inverse();
    const auto rgb = cloud_colour_of(session);
    for (const SessionCloudPoint& p : session_cloud(document_, session, database_.points(session))) {
      Eigen::Vector3d pixel;
      if (!camera.project(camera_from_global.at(p.keyframe) * p.global, &pixel)) continue;
      const PoseKey key{session, p.keyframe};
      std::vector<Observation>& in_image = observations[key];
      points << next_point << ' ' << p.global.x() << ' ' << p.global.y() << ' ' << p.global.z() << ' '
             << static_cast<int>(rgb[0]) << ' ' << static_cast<int>(rgb[1]) << ' ' << static_cast<int>(rgb[2]) << " 0 "
             << image.at(key) << ' ' << in_image.size() << '\n';
      in_image.push_back({{pixel.x() + kColmapCentre, pixel.z() + kColmapCentre}, next_point++});
    }
    for (const SessionPose& pose : of_session) {
      const RigidTransform& T = camera_from_global.at(pose.key.keyframe);
      const Eigen::Quaterniond q = T.quaternion();
      images << image.at(pose.key) << ' ' << q.w() << ' ' << q.x() << ' ' << q.y() << ' ' << q.z() << ' ' << T.t.x()
             << ' ' << T.t.y() << ' ' << T.t.z() << ' ' << session << ' ' << image_name(pose.key, "left") << '\n';
      for (const Observation& seen : observations[pose.key])
        images << seen.pixel.x() << ' ' << seen.pixel.y() << ' ' << seen.point << ' ';
      images << '\n';
    }
  }
  const fs::path to = made_session_folder(folder);
  const auto write = [&](const char* name, const std::ostringstream& text) {
    write_file_atomically((to / name).string(), [&](std::ostream& out) { out << text.str(); });
  };
  write("cameras.txt", cameras);
  write("images.txt", images);
  write("points3D.txt", points);
}

void SessionExporter::write_images(const std::string& folder) {
  const fs::path to = made_session_folder(folder);
  int written = 0;
  for (const int session : sessions_)
    for (const SessionPose& pose : poses(session)) {
      GreyImage left, right;
      if (!database_.images(pose.key, &left, &right)) continue;
      if (written++ == 0 || !fs::exists(to / session_file_name(document_, session)))
        made_session_folder(to / session_file_name(document_, session));
      for (const bool is_left : {true, false}) {
        const std::string file = (to / image_name(pose.key, is_left ? "left" : "right")).string();
        write_file_atomically(file, png_bytes(is_left ? left : right, file));
      }
    }
  if (written == 0) throw RunError(folder + ": cannot be written: no images were kept of these sessions");
}

}  // namespace

bool SessionExport::joins() const {
  return !(graph.empty() && cloud.empty() && cloud_model.empty() && textured.empty() && colmap.empty());
}

bool SessionExport::any() const {
  return joins() || !(tum.empty() && kitti.empty() && euroc.empty() && images.empty());
}

std::string session_file_name(const SessionDocument& document, int session) {
  const std::string own = file_name_of(session_state(document, session).start.name);
  for (const SessionState& other : document.sessions)
    if (other.id != session && file_name_of(other.start.name) == own) return own + "-" + std::to_string(session);
  return own;
}

void export_sessions(SessionDatabase* database, const SessionDocument& document, const std::vector<int>& sessions,
                     const SessionExport& what, const std::function<void(const std::function<void()>&)>& step) {
  SessionExporter exporter(database, document, sessions);
  const auto write = [&](const std::string& path, const std::function<void()>& writer) {
    if (!path.empty()) step(writer);
  };
  write(what.tum, [&] { exporter.write_trajectories(what.tum, TrajectoryFormat::tum, what.frame); });
  write(what.kitti, [&] { exporter.write_trajectories(what.kitti, TrajectoryFormat::kitti, what.frame); });
  write(what.euroc, [&] { exporter.write_trajectories(what.euroc, TrajectoryFormat::euroc, what.frame); });
  write(what.graph, [&] { write_graph_file(what.graph, session_graph_file(document, sessions)); });
  write(what.cloud, [&] { exporter.write_cloud(what.cloud); });
  write(what.cloud_model, [&] { exporter.write_model(what.cloud_model); });
  write(what.textured, [&] { exporter.write_textured(what.textured); });
  write(what.colmap, [&] { exporter.write_colmap(what.colmap); });
  write(what.images, [&] { exporter.write_images(what.images); });
}

}  // namespace parallax
