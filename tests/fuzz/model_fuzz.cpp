// libFuzzer target: models (binary glTF). Inputs that begin with `{` are put into the frame of a file: the JSON up to
// the first NUL, then the data, so that the fuzzer need not guess lengths.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>
#include <vector>

#include "core/error.h"
#include "render/model_file.h"

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

void append_word(std::size_t value, std::vector<std::uint8_t>* out) {
  for (int shift = 0; shift < 32; shift += 8) out->push_back(static_cast<std::uint8_t>(value >> shift & 0xff));
}

std::vector<std::uint8_t> framed(std::span<const std::uint8_t> text) {
  const auto end = std::find(text.begin(), text.end(), 0);
  std::vector<std::uint8_t> json(text.begin(), end), data;
  if (end != text.end()) data.assign(end + 1, text.end());
  json.resize((json.size() + 3) / 4 * 4, ' ');
  data.resize(std::max<std::size_t>(4, (data.size() + 3) / 4 * 4));
  std::vector<std::uint8_t> out{'g', 'l', 'T', 'F'};
  append_word(2, &out);
  append_word(28 + json.size() + data.size(), &out);
  append_word(json.size(), &out);
  out.insert(out.end(), {'J', 'S', 'O', 'N'});
  out.insert(out.end(), json.begin(), json.end());
  append_word(data.size(), &out);
  out.insert(out.end(), {'B', 'I', 'N', 0});
  out.insert(out.end(), data.begin(), data.end());
  return out;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::vector<std::uint8_t> bytes(data, data + size);
  if (size > 0 && data[0] == '{') bytes = framed(bytes);
  try {
    const parallax::Model model = parallax::read_model(bytes, "file");
    require(!model.parts.empty());
    for (const parallax::ModelPart& part : model.parts) {
      require(part.mesh != nullptr && !part.mesh->indices.empty() && part.mesh->indices.size() % 3 == 0);
      for (const std::uint32_t index : part.mesh->indices) require(index < part.mesh->vertices.size());
      for (const parallax::MeshVertex& v : part.mesh->vertices) {
        require(v.position.allFinite() && v.normal.allFinite() && v.uv.allFinite());
        for (const float c : {v.colour.r, v.colour.g, v.colour.b, v.colour.a}) require(c >= 0 && c <= 1);
      }
      require(part.model_from_part.matrix().allFinite());
    }
  } catch (const parallax::InputError& error) {
    require(std::string(error.what()).find('\n') == std::string::npos);
  }
  return 0;
}
