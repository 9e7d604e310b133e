// Reading models: what glTF says about axes, colours, transforms and kinds of numbers, and files that are not right.
#include "render/model_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <vector>

#include "core/error.h"
#include "render/model_set.h"
#include "tests/support/process.h"

namespace parallax {
namespace {

using Eigen::Vector3f;

template <typename Number>
std::string raw(std::initializer_list<Number> numbers) {
  std::string out;
  for (const Number n : numbers) out.append(reinterpret_cast<const char*>(&n), sizeof n);
  return out;
}

std::string word(std::size_t value) { return raw({static_cast<std::uint32_t>(value)}); }

std::string glb(std::string json, std::string data) {
  json.resize((json.size() + 3) / 4 * 4, ' ');
  data.resize((data.size() + 3) / 4 * 4, '\0');
  return "glTF" + word(2) + word(28 + json.size() + data.size()) + word(json.size()) + "JSON" + json +
         word(data.size()) + std::string("BIN\0", 4) + data;
}

Model read(const std::string& bytes) {
  return read_model({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, "file.glb");
}

// One triangle: positions, three 32-bit indices, colours of two bytes, a picture of one green pixel.
const std::string kPng = raw<std::uint8_t>(
    {0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00, 0x00,
     0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x08, 0x02, 0x00, 0x00, 0x00, 0x90, 0x77, 0x53, 0xde, 0x00, 0x00, 0x00,
     0x0c, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0xe0, 0x3a, 0x21, 0x07, 0x00, 0x01, 0xd0, 0x00, 0xf1, 0x24,
     0x5c, 0x91, 0xf4, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82});

std::string triangle_data() {
  return raw<float>({0, 0, 0, 1, 0, 0, 0, 2, 0}) + raw<std::uint32_t>({0, 1, 2}) +
         raw<std::uint16_t>({65535, 0, 0, 65535, 0, 65535, 0, 65535, 0, 0, 14028, 32768}) +
         raw<float>({0, 0, 1, 0, 0, 1}) + kPng;
}

// The document, with a place of it exchanged.
std::string triangle_json(const std::string& from = "", const std::string& to = "") {
  std::string json = R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
    "nodes":[{"children":[1],"translation":[10,20,30],"rotation":[0,0.7071067811865476,0,0.7071067811865476]},
             {"name":"arm","mesh":0,"scale":[2,2,2]}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0,"COLOR_0":2},"indices":1,"material":0}]}],
    "materials":[{"doubleSided":true,"pbrMetallicRoughness":{"baseColorFactor":[1,1,0.5,1]}}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
                 {"bufferView":1,"componentType":5125,"count":3,"type":"SCALAR"},
                 {"bufferView":2,"componentType":5123,"count":3,"type":"VEC4","normalized":true},
                 {"bufferView":3,"componentType":5126,"count":3,"type":"VEC2"}],
    "textures":[{"source":0}],"images":[{"bufferView":4,"mimeType":"image/png"}],
    "bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":12},
                   {"buffer":0,"byteOffset":48,"byteLength":24},{"buffer":0,"byteOffset":72,"byteLength":24},
                   {"buffer":0,"byteOffset":96,"byteLength":69}],
    "buffers":[{"byteLength":165}]})";
  if (!from.empty()) {
    const std::size_t at = json.find(from);
    if (at == std::string::npos) throw std::logic_error("not in the document: " + from);
    json.replace(at, from.size(), to);
  }
  return json;
}

// The message; empty when the file is taken.
std::string refused(const std::string& bytes) {
  try {
    read(bytes);
    return "";
  } catch (const InputError& error) {
    return error.what();
  }
}

TEST(ModelFile, TurnsTheAxesAndFlattensTheTree) {
  const Model model = read(glb(triangle_json(), triangle_data()));
  ASSERT_EQ(model.parts.size(), 1u);
  const ModelPart& arm = model.parts[0];
  EXPECT_EQ(arm.name, "arm");
  ASSERT_EQ(arm.mesh->vertices.size(), 3u);
  EXPECT_TRUE(arm.mesh->two_sided);
  // glTF's (x, y, z) is y, z and x here.
  EXPECT_EQ(arm.mesh->vertices[1].position, Vector3f(0, 1, 0));
  EXPECT_EQ(arm.mesh->vertices[2].position, Vector3f(0, 0, 2));
  // A quarter turn about glTF's y takes its x to -z; then the move.
  EXPECT_LT((arm.model_from_part * Vector3f(0, 0, 0) - Vector3f(30, 10, 20)).norm(), 1e-4f);
  EXPECT_LT((arm.model_from_part * arm.mesh->vertices[1].position - Vector3f(28, 10, 20)).norm(), 1e-4f);
  EXPECT_LT((arm.model_from_part * arm.mesh->vertices[2].position - Vector3f(30, 10, 24)).norm(), 1e-4f);
  // No normals in the file: flat ones, outwards for who sees the corners counter-clockwise.
  for (const MeshVertex& v : arm.mesh->vertices) EXPECT_LT((v.normal - Vector3f(1, 0, 0)).norm(), 1e-6f);
}

TEST(ModelFile, ColoursAreLinearInTheFileAndEncodedHere) {
  const Model model = read(glb(triangle_json(), triangle_data()));
  const auto& v = model.parts[0].mesh->vertices;
  EXPECT_FLOAT_EQ(v[0].colour.r, 1);
  EXPECT_FLOAT_EQ(v[0].colour.b, 0);
  EXPECT_FLOAT_EQ(v[1].colour.g, 1);
  // 14028 / 65535 is the light of the level 0.5; the material halves it.
  const double linear = 0.5 * 14028 / 65535;
  EXPECT_NEAR(v[2].colour.b, 1.055 * std::pow(linear, 1 / 2.4) - 0.055, 1e-5);
  EXPECT_NEAR(v[2].colour.a, 0.5, 1e-4);
}

TEST(ModelFile, APictureIsReadAsItIs) {
  std::string json = triangle_json(R"("COLOR_0":2)", R"("TEXCOORD_0":3)");
  const std::string base = R"("pbrMetallicRoughness":{)";
  json.insert(json.find(base) + base.size(), R"("baseColorTexture":{"index":0},)");
  const Model model = read(glb(json, triangle_data()));
  const Mesh& mesh = *model.parts.at(0).mesh;
  ASSERT_EQ(mesh.texture.size(), cv::Size(1, 1));
  EXPECT_EQ(mesh.texture(0, 0), cv::Vec4b(10, 200, 30, 255));
  EXPECT_EQ(mesh.vertices[1].uv, Eigen::Vector2f(1, 0));
  EXPECT_EQ(mesh.vertices[2].uv, Eigen::Vector2f(0, 1));
}

TEST(ModelFile, WhatIsWrongIsNamedInOneLine) {
  const struct {
    const char *from, *to, *found;
  } cases[] = {
      {R"("count":3,"type":"VEC3")", R"("count":4,"type":"VEC3")", "POSITION with 4 rows"},
      {R"("count":3,"type":"VEC3")", R"("count":4294967296,"type":"VEC3")", "POSITION with 4294967296 rows"},
      {R"("count":3,"type":"VEC3")", R"("count":0,"type":"VEC3")", "POSITION with 0 rows"},
      {R"("POSITION":0)", R"("POSITION":9)", "POSITION of accessor 9"},
      {R"("POSITION":0,)", "", "without positions"},
      {R"("indices":1)", R"("indices":0)", "indices of several numbers"},
      {R"("indices":1)", R"("indices":7)", "accessor out of bounds"},
      {R"(5125,"count":3)", R"(5125,"count":2)", "2 indices"},
      {R"(5125,"count":3)", R"(5126,"count":3)", "indices of type 5126"},
      {R"("byteOffset":36,"byteLength":12)", R"("byteOffset":84,"byteLength":12)", "index "},
      {R"("byteOffset":36,"byteLength":12)", R"("byteOffset":160,"byteLength":12)", "buffer view 1 beyond"},
      {R"({"buffer":0,"byteOffset":0)", R"({"buffer":5,"byteOffset":0)", "buffer view 0"},
      {R"("children":[1])", R"("children":[0])", "node 0 in several places"},
      {R"("children":[1])", R"("children":[8])", "node 8"},
      {R"("scenes":[{"nodes":[0]}],)", "", "no scene"},
      {R"("mesh":0,)", "", "no triangles"},
      {R"("mesh":0,)", R"("mesh":3,)", "mesh 3"},
      {R"("material":0)", R"("material":4)", "material 4"},
      {R"("scale":[2,2,2])", R"("scale":[2,0,2])", "flattens"},
      {R"("scale":[2,2,2])", R"("scale":[2,-2,2])", "mirrors"},
      {R"("translation":[10,20,30])", R"("translation":[1e9,0,0])", "node"},
      {R"("rotation":[0,0.7071067811865476,)", R"("rotation":[0,9,)", "rotation"},
      {R"([1,1,0.5,1])", R"([1,7,0.5,1])", "base colour"},
      {R"("indices":1)", R"("indices":1,"mode":1)", "mode 1"},
      {R"("asset":{"version":"2.0"},)", R"("extensionsRequired":["KHR_draco_mesh_compression"],)", "extensions"},
      {R"("byteLength":165)", R"("byteLength":165,"uri":"/etc/passwd")", "outside the file"},
      {R"("bufferView":4,"mimeType")", R"("uri":"file.png","mimeType")", "outside the file"},
      {R"({"byteLength":165})", R"({"byteLength":165},{"byteLength":165})", "2 buffers"},
      {R"("byteLength":165)", R"("byteLength":9999)", "byteLength"},
      {R"("normalized":true)", R"("normalized":false)", "COLOR_0 of type"},
      {R"("scene":0,)", R"("scene":0)", "parse error"},
  };
  for (const auto& c : cases) {
    const std::string message = refused(glb(triangle_json(c.from, c.to), triangle_data()));
    EXPECT_EQ(message.rfind("file.glb: found ", 0), 0u) << c.to << ": '" << message << "'";
    EXPECT_NE(message.find(c.found), std::string::npos) << c.to << ": '" << message << "'";
    EXPECT_NE(message.find(", expected "), std::string::npos) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }
  const std::string deep = R"("extras":)" + std::string(100, '[') + std::string(100, ']') + R"(,"scene":0)";
  EXPECT_NE(refused(glb(triangle_json(R"("scene":0)", deep), triangle_data())).find("lists within"), std::string::npos);
  std::string place = triangle_data();
  const float nowhere = std::nanf("");
  std::memcpy(place.data() + 4, &nowhere, sizeof nowhere);
  EXPECT_NE(refused(glb(triangle_json(), place)).find("no place"), std::string::npos);
}

TEST(ModelFile, APieceOfAFileIsNoFile) {
  const std::string whole = testing::read_all(std::string(PARALLAX_SOURCE_DIR) + "/assets/models/bolt.glb");
  ASSERT_GT(whole.size(), 1000u);
  EXPECT_EQ(refused(whole), "");
  for (std::size_t length = 0; length < whole.size(); length += length < 64 ? 1 : 293) {
    const std::string message = refused(whole.substr(0, length));
    EXPECT_EQ(message.rfind("file.glb: found ", 0), 0u) << length;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }
}

}  // namespace
}  // namespace parallax
