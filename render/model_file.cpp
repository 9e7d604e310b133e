#include "render/model_file.h"

#include <tiny_gltf.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <optional>
#include <utility>

#include "render/model_json.h"

namespace parallax {
namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::size_t kMostVertices = 200'000;  // of a file; indices: three times as many
constexpr int kDeepestNode = 32;
constexpr std::uint32_t kLargestPicture = 2048;  // pixels along a side
constexpr double kFarthest = 1e6;                // largest number that is a place, metres

// x forward, z up from glTF's z forward, y up: the axes change places.
Eigen::Vector3f model_axes(const Eigen::Vector3f& gltf) { return {gltf.z(), gltf.x(), gltf.y()}; }

Eigen::Affine3d model_from_gltf() {
  Eigen::Affine3d out = Eigen::Affine3d::Identity();
  out.linear() << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  return out;
}

float srgb_from_linear(float c) {
  c = std::clamp(c, 0.0f, 1.0f);
  return c <= 0.0031308f ? 12.92f * c : 1.055f * std::pow(c, 1 / 2.4f) - 0.055f;
}

// What the file promises about an entry of a list, as a pointer to it; null when there is no such entry.
template <typename Entry>
const Entry* entry_of(const std::vector<Entry>& list, int index) {
  return index >= 0 && static_cast<std::size_t>(index) < list.size() ? &list[static_cast<std::size_t>(index)] : nullptr;
}

// The library asks for files only when a model refers to some, which check_model_json() refuses.
bool no_file(const std::string&, void*) { return false; }
std::string no_path(const std::string&, void*) { return {}; }
bool no_bytes(std::vector<unsigned char>*, std::string*, const std::string&, void*) { return false; }
bool no_writing(std::string*, const std::string&, const std::vector<unsigned char>&, void*) { return false; }
// Pictures are looked at once their range has been checked.
bool picture_later(tinygltf::Image*, const int, std::string*, std::string*, int, int, const unsigned char*, int,
                   void*) {
  return true;
}

class ModelReader {
 public:
  ModelReader(Bytes bytes, const std::string& file) : file_(file) {
    check_model_json(bytes, file);
    tinygltf::TinyGLTF library;
    library.SetFsCallbacks({no_file, no_path, no_bytes, no_writing, nullptr});
    library.SetImageLoader(picture_later, nullptr);
    std::string error, warning;
    bool done = false;
    try {
      done =
          library.LoadBinaryFromMemory(&gltf_, &error, &warning, bytes.data(), static_cast<unsigned>(bytes.size()), "");
    } catch (const std::exception& thrown) {
      error = thrown.what();
    }
    if (!done) refuse_model(file, quoted_from_model(error), "a whole binary glTF 2.0 file");
  }

  Model read() {
    const tinygltf::Scene* scene = entry_of(gltf_.scenes, std::max(gltf_.defaultScene, 0));
    if (scene == nullptr) refuse_model(file_, "no scene", "one");
    visited_.assign(gltf_.nodes.size(), false);
    for (const int node : scene->nodes) add_node(node, Eigen::Affine3d::Identity(), 0);
    if (model_.parts.empty()) refuse_model(file_, "no triangles", "at least one");
    return std::move(model_);
  }

 private:
  // Numbers of an accessor, checked to lie within the file: `components` a row.
  struct Rows {
    Bytes bytes;
    std::size_t count = 0, stride = 0;
    int component_type = 0;
    int components = 0;
    bool normalised = false;
  };

  [[noreturn]] void refuse(const std::string& found, const std::string& expected) const {
    refuse_model(file_, found, expected);
  }

  Bytes view_bytes(int index) const {
    const tinygltf::BufferView* view = entry_of(gltf_.bufferViews, index);
    const tinygltf::Buffer* buffer = view == nullptr ? nullptr : entry_of(gltf_.buffers, view->buffer);
    if (buffer == nullptr) refuse("buffer view " + std::to_string(index), "one that is in the file");
    const Bytes all(buffer->data.data(), buffer->data.size());
    if (view->byteOffset > all.size() || view->byteLength > all.size() - view->byteOffset) {
      refuse("buffer view " + std::to_string(index) + " beyond the end",
             "one within the file's " + std::to_string(all.size()) + " bytes");
    }
    return all.subspan(view->byteOffset, view->byteLength);
  }

  Rows rows_of(int index, const std::string& what) const {
    const tinygltf::Accessor* accessor = entry_of(gltf_.accessors, index);
    if (accessor == nullptr) refuse(what + " of accessor " + std::to_string(index), "one that is in the file");
    if (accessor->sparse.isSparse) refuse(what + " with gaps (a sparse accessor)", "all of its rows");
    Rows rows;
    rows.component_type = accessor->componentType;
    rows.components = tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(accessor->type));
    rows.normalised = accessor->normalized;
    rows.count = accessor->count;
    const int component = tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(accessor->componentType));
    if (rows.components < 1 || rows.components > 4 || component < 1) refuse(what + " of unknown type", "numbers");
    rows.bytes = view_bytes(accessor->bufferView);
    const std::size_t row = static_cast<std::size_t>(rows.components) * static_cast<std::size_t>(component);
    const std::size_t stride = gltf_.bufferViews[static_cast<std::size_t>(accessor->bufferView)].byteStride;
    rows.stride = stride == 0 ? row : stride;
    const bool fits = rows.stride >= row && rows.stride <= 256 && rows.count >= 1 && rows.count <= 3 * kMostVertices &&
                      accessor->byteOffset <= rows.bytes.size() &&
                      (rows.count - 1) * rows.stride + row <= rows.bytes.size() - accessor->byteOffset;
    if (!fits) {
      refuse(what + " with " + std::to_string(rows.count) + " rows of " + std::to_string(rows.stride) + " bytes",
             "what lies within its " + std::to_string(rows.bytes.size()) + " bytes");
    }
    rows.bytes = rows.bytes.subspan(accessor->byteOffset);
    return rows;
  }

  template <typename Number>
  static Number number_at(const Rows& rows, std::size_t row, int component) {
    Number out;
    std::memcpy(&out, rows.bytes.data() + row * rows.stride + static_cast<std::size_t>(component) * sizeof(Number),
                sizeof(Number));
    return out;
  }

  float value(const Rows& rows, std::size_t row, int component, const std::string& what) const {
    switch (rows.component_type) {
      case TINYGLTF_COMPONENT_TYPE_FLOAT: {
        const float out = number_at<float>(rows, row, component);
        if (!(std::abs(out) <= kFarthest)) refuse(what + " that is no place or colour", "finite numbers");
        return out;
      }
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
        if (rows.normalised) return static_cast<float>(number_at<std::uint8_t>(rows, row, component)) / 255.0f;
        break;
      case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
        if (rows.normalised) return static_cast<float>(number_at<std::uint16_t>(rows, row, component)) / 65535.0f;
        break;
      default:
        break;
    }
    refuse(what + " of type " + std::to_string(rows.component_type), "floats, or normalised unsigned numbers");
  }

  std::optional<Rows> attribute(const tinygltf::Primitive& primitive, const std::string& name, int least, int most,
                                std::size_t count) const {
    const auto found = primitive.attributes.find(name);
    if (found == primitive.attributes.end()) return std::nullopt;
    Rows rows = rows_of(found->second, name);
    if (rows.components < least || rows.components > most || (count != 0 && rows.count != count)) {
      refuse(name + " with " + std::to_string(rows.count) + " rows of " + std::to_string(rows.components),
             "as many as positions, of " + std::to_string(most));
    }
    return rows;
  }

  std::vector<std::uint32_t> indices_of(const tinygltf::Primitive& primitive, std::size_t vertices) const {
    std::vector<std::uint32_t> out;
    if (primitive.indices < 0) {
      for (std::size_t i = 0; i < vertices; ++i) out.push_back(static_cast<std::uint32_t>(i));
    } else {
      const Rows rows = rows_of(primitive.indices, "indices");
      if (rows.components != 1) refuse("indices of several numbers each", "single numbers");
      out.reserve(rows.count);
      for (std::size_t i = 0; i < rows.count; ++i) {
        switch (rows.component_type) {
          case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
            out.push_back(number_at<std::uint8_t>(rows, i, 0));
            break;
          case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
            out.push_back(number_at<std::uint16_t>(rows, i, 0));
            break;
          case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
            out.push_back(number_at<std::uint32_t>(rows, i, 0));
            break;
          default:
            refuse("indices of type " + std::to_string(rows.component_type), "unsigned numbers");
        }
        if (out.back() >= vertices) {
          refuse("index " + std::to_string(out.back()), "less than " + std::to_string(vertices) + " vertices");
        }
      }
    }
    if (out.empty() || out.size() % 3 != 0) refuse(std::to_string(out.size()) + " indices", "three a triangle");
    return out;
  }

  cv::Mat4b picture_of(int texture_index) const {
    const tinygltf::Texture* texture = entry_of(gltf_.textures, texture_index);
    const tinygltf::Image* image = texture == nullptr ? nullptr : entry_of(gltf_.images, texture->source);
    if (image == nullptr) refuse("texture " + std::to_string(texture_index), "one that is in the file");
    const Bytes png = view_bytes(image->bufferView);
    static constexpr std::uint8_t kSignature[] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
    const auto big_endian = [&](std::size_t at) {
      return std::uint32_t{png[at]} << 24 | std::uint32_t{png[at + 1]} << 16 | std::uint32_t{png[at + 2]} << 8 |
             std::uint32_t{png[at + 3]};
    };
    constexpr std::size_t kWidthAt = 16, kHeightAt = 20, kDepthAt = 24, kHeader = 33;
    if (png.size() < kHeader || !std::equal(std::begin(kSignature), std::end(kSignature), png.begin()) ||
        big_endian(kWidthAt) - 1 >= kLargestPicture || big_endian(kHeightAt) - 1 >= kLargestPicture ||
        png[kDepthAt] > 8) {
      refuse("a picture of another kind",
             "PNG, 8 bits a channel, at most " + std::to_string(kLargestPicture) + " pixels along a side");
    }
    tinygltf::Image decoded;
    std::string error, warning;
    if (!tinygltf::LoadImageData(&decoded, 0, &error, &warning, 0, 0, png.data(), static_cast<int>(png.size()),
                                 nullptr) ||
        decoded.component != 4 || decoded.bits != 8 || decoded.width < 1 || decoded.height < 1 ||
        decoded.image.size() !=
            4u * static_cast<std::size_t>(decoded.width) * static_cast<std::size_t>(decoded.height)) {
      refuse("a damaged picture", "a whole PNG");
    }
    return cv::Mat4b(decoded.height, decoded.width, reinterpret_cast<cv::Vec4b*>(decoded.image.data())).clone();
  }

  struct Surface {
    Eigen::Vector4f base = Eigen::Vector4f::Ones();
    int texture = -1;
    bool two_sided = false;
  };

  Surface surface_of(int index) const {
    Surface out;
    if (index < 0) return out;
    const tinygltf::Material* material = entry_of(gltf_.materials, index);
    if (material == nullptr) refuse("material " + std::to_string(index), "one that is in the file");
    const auto& base = material->pbrMetallicRoughness;
    for (std::size_t i = 0; i < 4 && i < base.baseColorFactor.size(); ++i) {
      const double factor = base.baseColorFactor[i];
      if (!(factor >= 0 && factor <= 1)) refuse("a base colour outside 0 to 1", "a colour");
      out.base[static_cast<Eigen::Index>(i)] = static_cast<float>(factor);
    }
    out.texture = base.baseColorTexture.index;
    out.two_sided = material->doubleSided;
    return out;
  }

  void add_primitive(const tinygltf::Primitive& primitive, const Surface& surface, Mesh* mesh) {
    if (primitive.mode != TINYGLTF_MODE_TRIANGLES && primitive.mode != -1) {
      refuse("primitives of mode " + std::to_string(primitive.mode), "triangles");
    }
    const auto positions = attribute(primitive, "POSITION", 3, 3, 0);
    if (!positions) refuse("triangles without positions", "positions");
    const std::size_t count = positions->count;
    const auto normals = attribute(primitive, "NORMAL", 3, 3, count);
    const auto uv = attribute(primitive, "TEXCOORD_0", 2, 2, count);
    const auto colours = attribute(primitive, "COLOR_0", 3, 4, count);
    std::vector<std::uint32_t> indices = indices_of(primitive, count);

    vertices_ += normals ? count : indices.size();
    indices_ += indices.size();
    if (vertices_ > kMostVertices || indices_ > 3 * kMostVertices) {
      refuse("more than " + std::to_string(kMostVertices) + " vertices", "fewer");
    }
    std::vector<MeshVertex> vertices(count);
    for (std::size_t i = 0; i < count; ++i) {
      MeshVertex& v = vertices[i];
      const auto triple = [&](const Rows& rows, const char* what) {
        return Eigen::Vector3f(value(rows, i, 0, what), value(rows, i, 1, what), value(rows, i, 2, what));
      };
      v.position = model_axes(triple(*positions, "POSITION"));
      if (normals) v.normal = model_axes(triple(*normals, "NORMAL")).stableNormalized();
      if (uv) v.uv = {value(*uv, i, 0, "TEXCOORD_0"), value(*uv, i, 1, "TEXCOORD_0")};
      Eigen::Vector4f colour = surface.base;
      for (int c = 0; colours && c < colours->components; ++c) colour[c] *= value(*colours, i, c, "COLOR_0");
      v.colour = {srgb_from_linear(colour[0]), srgb_from_linear(colour[1]), srgb_from_linear(colour[2]),
                  std::clamp(colour[3], 0.0f, 1.0f)};
    }
    if (!normals) make_flat(&vertices, &indices);
    const auto first = static_cast<std::uint32_t>(mesh->vertices.size());
    mesh->vertices.insert(mesh->vertices.end(), vertices.begin(), vertices.end());
    for (const std::uint32_t index : indices) mesh->indices.push_back(first + index);
  }

  static void make_flat(std::vector<MeshVertex>* vertices, std::vector<std::uint32_t>* indices) {
    std::vector<MeshVertex> flat;
    flat.reserve(indices->size());
    for (const std::uint32_t index : *indices) flat.push_back((*vertices)[index]);
    for (std::size_t i = 0; i + 2 < flat.size(); i += 3) {
      const Eigen::Vector3f normal =
          (flat[i + 1].position - flat[i].position).cross(Eigen::Vector3f(flat[i + 2].position - flat[i].position));
      for (std::size_t k = 0; k < 3; ++k) {
        flat[i + k].normal = normal.norm() > 0 ? normal.stableNormalized() : Eigen::Vector3f::UnitZ();
        (*indices)[i + k] = static_cast<std::uint32_t>(i + k);
      }
    }
    *vertices = std::move(flat);
  }

  // One mesh a picture: what shares a picture is drawn at once.
  const std::vector<std::shared_ptr<const Mesh>>& meshes_of(int index) {
    const auto [found, fresh] = meshes_.try_emplace(index);
    if (!fresh) return found->second;
    const tinygltf::Mesh* mesh = entry_of(gltf_.meshes, index);
    if (mesh == nullptr) refuse("mesh " + std::to_string(index), "one that is in the file");
    std::map<std::pair<int, bool>, std::shared_ptr<Mesh>> by_surface;
    for (const tinygltf::Primitive& primitive : mesh->primitives) {
      const Surface surface = surface_of(primitive.material);
      auto& into = by_surface[{surface.texture, surface.two_sided}];
      if (into == nullptr) {
        into = std::make_shared<Mesh>();
        into->two_sided = surface.two_sided;
        if (surface.texture >= 0) into->texture = picture(surface.texture);
      }
      add_primitive(primitive, surface, into.get());
    }
    for (auto& [surface, made] : by_surface) found->second.push_back(std::move(made));
    return found->second;
  }

  cv::Mat4b picture(int texture) {
    const auto [found, fresh] = pictures_.try_emplace(texture);
    if (fresh) {
      found->second = picture_of(texture);
      texels_ += found->second.total();
      if (texels_ > std::size_t{kLargestPicture} * kLargestPicture) refuse("many large pictures", "fewer");
    }
    return found->second;
  }

  Eigen::Affine3d parent_from_node(const tinygltf::Node& node) const {
    Eigen::Affine3d out = Eigen::Affine3d::Identity();
    const auto list = [&](const std::vector<double>& values, std::size_t wanted, const char* what) {
      if (values.empty()) return false;
      if (values.size() != wanted) {
        refuse(std::string(what) + " of " + std::to_string(values.size()) + " numbers", std::to_string(wanted));
      }
      return true;
    };
    if (list(node.matrix, 16, "a node's matrix")) {
      out.matrix() = Eigen::Map<const Eigen::Matrix4d>(node.matrix.data());
    } else {
      if (list(node.translation, 3, "a node's translation"))
        out.translate(Eigen::Vector3d(node.translation[0], node.translation[1], node.translation[2]));
      if (list(node.rotation, 4, "a node's rotation")) {
        const Eigen::Quaterniond q(node.rotation[3], node.rotation[0], node.rotation[1], node.rotation[2]);
        if (!(std::abs(q.norm() - 1) < 1e-3)) refuse("a node's rotation that is none", "a unit quaternion");
        out.rotate(q.normalized());
      }
      if (list(node.scale, 3, "a node's scale"))
        out.scale(Eigen::Vector3d(node.scale[0], node.scale[1], node.scale[2]));
    }
    const double volume = out.linear().determinant();
    if (!(out.matrix().cwiseAbs().maxCoeff() <= kFarthest) || !(volume > 1e-12) ||
        !out.matrix().row(3).isApprox(Eigen::RowVector4d(0, 0, 0, 1))) {
      refuse("a node whose transform flattens or mirrors", "one that turns, moves or stretches");
    }
    return out;
  }

  void add_node(int index, const Eigen::Affine3d& scene_from_parent, int depth) {
    const tinygltf::Node* node = entry_of(gltf_.nodes, index);
    if (node == nullptr) refuse("node " + std::to_string(index), "one that is in the file");
    if (depth > kDeepestNode || visited_[static_cast<std::size_t>(index)]) {
      refuse("node " + std::to_string(index) + " in several places",
             "a tree at most " + std::to_string(kDeepestNode) + " deep");
    }
    visited_[static_cast<std::size_t>(index)] = true;
    const Eigen::Affine3d scene_from_node = scene_from_parent * parent_from_node(*node);
    if (!(scene_from_node.matrix().cwiseAbs().maxCoeff() <= kFarthest)) refuse("a node far away", "one near the model");
    if (node->mesh >= 0) {
      const Eigen::Affine3d axes = model_from_gltf();
      for (const auto& mesh : meshes_of(node->mesh)) {
        model_.parts.push_back({node->name, mesh, (axes * scene_from_node * axes.inverse()).cast<float>()});
      }
    }
    for (const int child : node->children) add_node(child, scene_from_node, depth + 1);
  }

  const std::string& file_;
  tinygltf::Model gltf_;
  Model model_;
  std::vector<bool> visited_;
  std::map<int, std::vector<std::shared_ptr<const Mesh>>> meshes_;
  std::map<int, cv::Mat4b> pictures_;
  std::size_t vertices_ = 0, indices_ = 0, texels_ = 0;
};

}  // namespace

Model read_model(std::span<const std::uint8_t> bytes, const std::string& file) {
  return ModelReader(bytes, file).read();
}

}  // namespace parallax
