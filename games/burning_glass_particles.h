// Smoke and sparks of the burning glass: for the eye only, nothing comes back to the sheet. Plane frame; lengths in
// field radii inside, metres when drawn. A value; bounded; one thread at a time.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "games/burning_glass_noise.h"
#include "games/burning_glass_sheet.h"
#include "render/draw_list.h"

namespace parallax::burning {

class Particles {
 public:
  void clear(std::uint64_t seed);

  // New ones where the sheet charred in its last step, and one tick of motion for all. Returns the new sparks.
  int advance(const Sheet& sheet, const Material& material, double dt_s);
  void draw(const Eigen::Affine3f& world_from_plane, double radius_m, DrawList* out) const;

  std::size_t count() const { return smoke_.size() + sparks_.size(); }

 private:
  struct Particle {
    Eigen::Vector3f position = Eigen::Vector3f::Zero(), velocity = Eigen::Vector3f::Zero();
    float age_s = 0, life_s = 1, size = 0.01f, shade = 0.5f;
  };

  std::vector<Particle> smoke_, sparks_;
  double smoke_due_ = 0, sparks_due_ = 0;
  Generator generator_;
};

}  // namespace parallax::burning
