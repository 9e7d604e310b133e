// The textured map of a stereo session, gathered keyframe by keyframe, and the files and pictures made of it.
//
// World: that of the session (its first keyframe's left camera; y down). Not thread-safe: one thread adds keyframes;
// when it has ended, another may finish and write.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/map_picture.h"
#include "mapper/stereo_window.h"
#include "mapper/textured_map.h"

namespace parallax {

struct SlamMapPaths {
  std::string ply, glb;          // the textured map
  std::string from_above, side;  // pictures, PNG or SVG
  std::string floor_plan;        // read: under the picture from above
  bool any() const { return !(ply.empty() && glb.empty() && from_above.empty() && side.empty()); }
};

class SlamMaps {
 public:
  // Reads the floor plan and looks at the names: throws InputError before a long run, not after it.
  explicit SlamMaps(const SlamMapPaths& paths, const TexturedMapOptions& options = {});

  // A keyframe has been smoothed: some 60 ms for 512x384. `camera` is the same each time.
  void add(const StereoKeyframe& keyframe, const StereoWindow& window, const StereoCamera& camera);
  // The session's last word on the keyframes' poses: points go along.
  void finish(const std::vector<StereoSessionPose>& keyframes);

  // Each file that was asked for by one call of `step`, so that one that cannot be written keeps none of the others
  // back. `title` stands on the pictures. Throws what writing throws; RunError when there is no keyframe.
  void write(const std::string& title, const std::function<void(const std::function<void()>&)>& step) const;

 private:
  SlamMapPaths paths_;
  TexturedMapOptions options_;
  std::optional<FloorPlan> floor_plan_;
  std::unique_ptr<TexturedMap> map_;
  std::vector<Eigen::Vector3d> way_;
  std::vector<ColouredPoint> points_;
};

}  // namespace parallax
