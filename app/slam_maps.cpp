#include "app/slam_maps.h"

#include "core/error.h"
#include "render/point_cloud_file.h"

namespace parallax {
namespace {

const Eigen::Vector3d kUp(0, -1, 0);  // of a world that began as a level camera

}  // namespace

SlamMaps::SlamMaps(const SlamMapPaths& paths, const TexturedMapOptions& options) : paths_(paths), options_(options) {
  options_.validate();
  for (const std::string& picture : {paths.from_above, paths.side})
    if (!picture.empty()) check_canvas_path(picture);
  if (!paths.floor_plan.empty()) {
    if (paths.from_above.empty())
      throw InputError(paths.floor_plan + ": a floor plan lies under the picture from above, and none was asked for");
    floor_plan_ = read_floor_plan(paths.floor_plan);
  }
}

void SlamMaps::add(const StereoKeyframe& keyframe, const StereoWindow& window, const StereoCamera& camera) {
  if (!map_) map_ = std::make_unique<TexturedMap>(camera, options_);
  const auto& poses = window.poses();
  map_->add({keyframe.index,
             poses.at(static_cast<std::size_t>(keyframe.index)).world_from_camera,
             keyframe.left,
             keyframe.right,
             {}});
}

void SlamMaps::finish(const std::vector<StereoSessionPose>& keyframes) {
  way_.clear();
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    way_.push_back(keyframes[i].world_from_camera.t);
    if (map_) map_->move(static_cast<int>(i), keyframes[i].world_from_camera);
  }
  points_ = map_ ? map_->points() : std::vector<ColouredPoint>();
}

void SlamMaps::write(const std::string& title, const std::function<void(const std::function<void()>&)>& step) const {
  if (!paths_.ply.empty()) step([&] { write_cloud_ply(points_, paths_.ply); });
  if (!paths_.glb.empty()) step([&] { write_cloud_glb(points_, kUp, paths_.glb); });
  MapPictureOptions options;
  options.up = kUp;
  options.title = title;
  options.floor_plan = floor_plan_;
  const std::vector<MapPath> ways{{way_, {20, 90, 200}, "keyframes"}};
  if (!paths_.from_above.empty()) step([&] { draw_map_picture(points_, ways, options, paths_.from_above); });
  options.view = MapPictureView::from_the_side;
  if (!paths_.side.empty()) step([&] { draw_map_picture(points_, ways, options, paths_.side); });
}

}  // namespace parallax
