// The critters' bodies as they are drawn in hundreds: one mesh each, in a few poses of a stride, and coarser the
// smaller they are seen. Made when they are first needed.
//
// One thread at a time.
#pragma once

#include <map>
#include <memory>
#include <tuple>
#include <vector>

#include "render/mesh_merge.h"
#include "render/model_set.h"

namespace parallax::swarm {

struct CritterPose {
  double walked = 0;  // along its way so far, units of the game
  bool leaping = false, open = false;
};

// How a model's legs and jaw are turned in a pose; also for models that are drawn part by part.
std::vector<PartMotion> critter_motion(const Model& model, const CritterPose& pose);

class CritterPoses {
 public:
  struct Body {
    std::shared_ptr<const Mesh> trunk;  // null: the model cannot be merged
    std::shared_ptr<const Mesh> limbs;  // too thin for shadows
  };
  // `size_px`: how long it is seen to be.
  Body body(const Model& model, const CritterPose& pose, double size_px);

 private:
  // Model and level of detail; phase of the stride and jaw.
  std::map<std::tuple<const Model*, int>, std::shared_ptr<const Mesh>> trunks_;
  std::map<std::tuple<const Model*, int, int, bool>, std::shared_ptr<const Mesh>> limbs_;
};

}  // namespace parallax::swarm
