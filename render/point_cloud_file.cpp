#include "render/point_cloud_file.h"

#include <tiny_gltf.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <ostream>

#include "core/error.h"
#include "core/file_io.h"

namespace parallax {
namespace {

static_assert(std::endian::native == std::endian::little, "both files are little-endian");

template <typename Value>
void append_bytes(const Value& value, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof value);
}
template <typename Value>
void append_bytes(const Value& value, std::vector<unsigned char>* bytes) {
  const auto* begin = reinterpret_cast<const unsigned char*>(&value);
  bytes->insert(bytes->end(), begin, begin + sizeof value);
}

// 16 bits, linear, of every 8-bit value of an image.
std::array<std::uint16_t, 256> linear_colours() {
  std::array<std::uint16_t, 256> table{};
  for (std::size_t i = 0; i < table.size(); ++i) {
    const double c = static_cast<double>(i) / 255;
    const double linear = c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
    table[i] = static_cast<std::uint16_t>(std::lround(65535 * linear));
  }
  return table;
}

int add_view(std::size_t offset, std::size_t length, tinygltf::Model* model) {
  tinygltf::BufferView view;
  view.buffer = 0;
  view.byteOffset = offset;
  view.byteLength = length;
  view.target = TINYGLTF_TARGET_ARRAY_BUFFER;
  model->bufferViews.push_back(view);
  return static_cast<int>(model->bufferViews.size()) - 1;
}

int add_accessor(int view, std::size_t count, int component, int type, tinygltf::Model* model) {
  tinygltf::Accessor accessor;
  accessor.bufferView = view;
  accessor.count = count;
  accessor.componentType = component;
  accessor.type = type;
  model->accessors.push_back(accessor);
  return static_cast<int>(model->accessors.size()) - 1;
}

}  // namespace

void write_cloud_ply(const std::vector<ColouredPoint>& points, const std::string& path) {
  std::string bytes;
  bytes.reserve(points.size() * 19);
  for (const ColouredPoint& point : points) {
    for (int i = 0; i < 3; ++i) append_bytes(point.position[i], &bytes);
    append_bytes(point.rgb, &bytes);
    append_bytes(point.sigma_m, &bytes);
  }
  write_file_atomically(path, [&](std::ostream& out) {
    out << "ply\nformat binary_little_endian 1.0\ncomment textured map of Parallax, metres, world frame; sigma: metres "
           "along the ray\nelement vertex "
        << points.size()
        << "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty "
           "uchar blue\nproperty float sigma\nend_header\n"
        << bytes;
  });
}

void write_cloud_glb(const std::vector<ColouredPoint>& points, const Eigen::Vector3d& up, const std::string& path) {
  if (points.empty()) throw RunError(path + ": cannot be written: the map has no points");
  Eigen::Matrix3f gltf_from_upright;
  gltf_from_upright << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  const Eigen::Matrix3f gltf_from_world = gltf_from_upright * upright_from_world(up).cast<float>();
  const auto colours = linear_colours();

  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = "Parallax";
  std::vector<unsigned char>& data = model.buffers.emplace_back().data;
  data.reserve(points.size() * 20);
  Eigen::Vector3f low = Eigen::Vector3f::Constant(std::numeric_limits<float>::max()), high = -low;
  for (const ColouredPoint& point : points) {
    const Eigen::Vector3f place = gltf_from_world * point.position;
    low = low.cwiseMin(place);
    high = high.cwiseMax(place);
    for (int i = 0; i < 3; ++i) append_bytes(place[i], &data);
  }
  const std::size_t place_bytes = data.size();
  for (const ColouredPoint& point : points) {
    for (const std::uint8_t c : point.rgb) append_bytes(colours[c], &data);
    append_bytes(std::uint16_t{65535}, &data);
  }
  tinygltf::Primitive primitive;
  primitive.mode = TINYGLTF_MODE_POINTS;
  primitive.material = 0;
  const int position = add_accessor(add_view(0, place_bytes, &model), points.size(), TINYGLTF_COMPONENT_TYPE_FLOAT,
                                    TINYGLTF_TYPE_VEC3, &model);
  for (int i = 0; i < 3; ++i) {
    model.accessors.back().minValues.push_back(low[i]);
    model.accessors.back().maxValues.push_back(high[i]);
  }
  const int colour = add_accessor(add_view(place_bytes, data.size() - place_bytes, &model), points.size(),
                                  TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, TINYGLTF_TYPE_VEC4, &model);
  model.accessors.back().normalized = true;
  primitive.attributes = {{"POSITION", position}, {"COLOR_0", colour}};
  model.meshes.emplace_back().primitives.push_back(primitive);
  model.materials.emplace_back().extensions["KHR_materials_unlit"] = tinygltf::Value(tinygltf::Value::Object());
  model.extensionsUsed.push_back("KHR_materials_unlit");
  model.nodes.emplace_back().mesh = 0;
  model.scenes.emplace_back().nodes.push_back(0);
  model.defaultScene = 0;
  write_file_atomically(path, [&](std::ostream& out) {
    tinygltf::TinyGLTF library;
    if (!library.WriteGltfSceneToStream(&model, out, false, true)) out.setstate(std::ios::failbit);
  });
}

}  // namespace parallax
