// The models of assets/models: glTF files (binary, .glb), each of one or more rigid parts, as meshes for the draw list.
// Model frame: z up, standing on z = 0, centred on the z axis, about 1 m in its longest side; +x is forward.
//
// Immutable after loading: safe from any thread.
#pragma once

#include <Eigen/Geometry>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "render/draw_list.h"

namespace parallax {

struct ModelPart {
  std::string name;  // of the glTF node: "body", "leg_front_left"
  std::shared_ptr<const Mesh> mesh;
  Eigen::Affine3f model_from_part = Eigen::Affine3f::Identity();  // the part's own origin is the joint it turns about
};

struct Model {
  std::string name;  // of the file, without extension
  std::vector<ModelPart> parts;
  // Null when there is none of that name.
  const ModelPart* part(const std::string& part_name) const;
};

class ModelSet {
 public:
  // Every *.glb of the folder. Throws InputError when the folder is absent or a file cannot be used (one line: file,
  // what was found, what was expected).
  static ModelSet load(const std::string& folder);
  ModelSet() = default;

  // A model of that name; a plain box when there is none, so that something is seen.
  const Model& model(const std::string& name) const;
  bool contains(const std::string& name) const;
  std::vector<std::string> names() const;

 private:
  std::map<std::string, Model> models_;
};

// Appends the model's parts. `part_motion`, when given, turns parts about their joints: world_from_model *
// model_from_part * motion.
struct PartMotion {
  std::string part;
  Eigen::Affine3f motion = Eigen::Affine3f::Identity();
};
void draw_model(const Model& model, const Eigen::Affine3f& world_from_model, const DrawColour& tint, float emission,
                const std::vector<PartMotion>& part_motion, DrawList* out);

}  // namespace parallax
