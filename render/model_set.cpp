#include "render/model_set.h"

#include <algorithm>
#include <filesystem>
#include <span>
#include <system_error>

#include "core/error.h"
#include "core/file_io.h"
#include "render/mesh_shapes.h"
#include "render/model_file.h"

namespace parallax {
namespace {

const Model& plain_box() {
  static const Model box = [] {
    ModelPart part{"body", box_mesh({1, 0.6f, 0.6f})};
    part.model_from_part.translation() = Eigen::Vector3f(0, 0, 0.3f);
    return Model{"box", {part}};
  }();
  return box;
}

}  // namespace

const ModelPart* Model::part(const std::string& part_name) const {
  const auto found = std::find_if(parts.begin(), parts.end(), [&](const ModelPart& p) { return p.name == part_name; });
  return found == parts.end() ? nullptr : &*found;
}

ModelSet ModelSet::load(const std::string& folder) {
  namespace fs = std::filesystem;
  std::error_code error;
  ModelSet out;
  fs::directory_iterator files(folder, error);
  if (error) throw InputError(folder + ": found no folder that can be read, expected one with models (*.glb)");
  for (; files != fs::directory_iterator(); files.increment(error)) {
    const fs::path& path = files->path();
    if (path.extension() != ".glb") continue;
    const std::string bytes = read_text_file(path.string());
    Model model = read_model({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, path.string());
    model.name = path.stem().string();
    out.models_[model.name] = std::move(model);
  }
  if (error) throw InputError(folder + ": found a folder that cannot be read to its end, expected models (*.glb)");
  return out;
}

const Model& ModelSet::model(const std::string& name) const {
  const auto found = models_.find(name);
  return found == models_.end() ? plain_box() : found->second;
}

bool ModelSet::contains(const std::string& name) const { return models_.contains(name); }

std::vector<std::string> ModelSet::names() const {
  std::vector<std::string> out;
  for (const auto& [name, model] : models_) out.push_back(name);
  return out;
}

void draw_model(const Model& model, const Eigen::Affine3f& world_from_model, const DrawColour& tint, float emission,
                const std::vector<PartMotion>& part_motion, DrawList* out) {
  for (const ModelPart& part : model.parts) {
    MeshInstance instance;
    instance.mesh = part.mesh;
    instance.world_from_model = world_from_model * part.model_from_part;
    for (const PartMotion& motion : part_motion) {
      if (motion.part == part.name) instance.world_from_model = instance.world_from_model * motion.motion;
    }
    instance.tint = tint;
    instance.emission = emission;
    out->meshes.push_back(std::move(instance));
  }
}

}  // namespace parallax
