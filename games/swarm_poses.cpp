#include "games/swarm_poses.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace parallax::swarm {
namespace {

using Eigen::Affine3f;
using Eigen::AngleAxisf;
using Eigen::Vector3f;

constexpr double kStride = 0.07;  // a cycle of the legs takes so much way
constexpr float kSwing = 0.45f;   // of a leg, radians
constexpr int kPhases = 16;       // poses of a cycle; the next one is the leap
// Cells of the coarser bodies, in lengths of the body, coarsest first; none is seen larger than kCell_px.
constexpr std::array<float, 4> kCells{1.0f / 7, 1.0f / 12, 1.0f / 20, 1.0f / 40};
constexpr double kCell_px = 2;

constexpr int kLevels = static_cast<int>(kCells.size());

bool is_limb(const ModelPart& part) { return part.name.rfind("leg", 0) == 0 || part.name == "jaw"; }

// The limbs or the rest of a model, as fine as the level says.
std::shared_ptr<const Mesh> merged_part(const Model& model, bool limbs, const std::vector<PartMotion>& motion,
                                        int level) {
  Model chosen = model;
  std::erase_if(chosen.parts, [&](const ModelPart& part) { return is_limb(part) != limbs; });
  auto mesh = merged_model(chosen, motion);
  if (!mesh || level == kLevels) return mesh;
  return std::make_shared<const Mesh>(clustered_mesh(*mesh, kCells[static_cast<std::size_t>(level)]));
}

}  // namespace

// Opposite legs of a pair, and neighbours on a side, swing against each other; a leg that goes forward is lifted.
std::vector<PartMotion> critter_motion(const Model& model, const CritterPose& pose) {
  std::vector<PartMotion> motion;
  const float lively = pose.leaping ? 0.2f : 1.0f;
  int legs = 0;
  for (const ModelPart& part : model.parts) {
    if (part.name.rfind("leg", 0) != 0) continue;
    const Vector3f joint = part.model_from_part.translation();
    const float side = joint.y() >= 0 ? 1.0f : -1.0f;
    const double cycle = 2 * std::numbers::pi * pose.walked / kStride + 2.1 * legs + (side > 0 ? 0 : std::numbers::pi);
    const auto swing = static_cast<float>(std::sin(cycle)) * kSwing * lively;
    const float lift = std::max(static_cast<float>(std::cos(cycle)), 0.0f) * 0.35f * lively;
    Affine3f turn = Affine3f::Identity();
    turn.rotate(AngleAxisf(side * -swing, Vector3f::UnitZ()) * AngleAxisf(side * lift, Vector3f::UnitX()));
    motion.push_back({part.name, turn});
    if (side < 0) ++legs;
  }
  Affine3f jaw = Affine3f::Identity();
  jaw.rotate(AngleAxisf(pose.open ? 0.4f : 0.08f, Vector3f::UnitY()));
  motion.push_back({"jaw", jaw});
  return motion;
}

CritterPoses::Body CritterPoses::body(const Model& model, const CritterPose& pose, double size_px) {
  const double cycles = pose.walked / kStride;
  const int phase =
      pose.leaping ? kPhases : std::clamp(static_cast<int>((cycles - std::floor(cycles)) * kPhases), 0, kPhases - 1);
  int level = 0;
  while (level < kLevels && kCells[static_cast<std::size_t>(level)] * size_px > kCell_px) ++level;
  auto& trunk = trunks_[{&model, level}];
  if (!trunk) trunk = merged_part(model, false, {}, level);
  auto& limbs = limbs_[{&model, level, phase, pose.open}];
  if (!limbs) {
    const CritterPose posed{phase == kPhases ? 0 : phase * kStride / kPhases, pose.leaping, pose.open};
    limbs = merged_part(model, true, critter_motion(model, posed), level);
  }
  return {limbs ? trunk : nullptr, limbs};
}

}  // namespace parallax::swarm
