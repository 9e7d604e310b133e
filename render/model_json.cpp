#include "render/model_json.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/error.h"

namespace parallax {
namespace {

using nlohmann::json;

constexpr std::size_t kHeader = 20;               // of the file and of its first chunk
constexpr std::size_t kLargestFile = 8u << 20;    // bytes; the models here have less than 100 kB
constexpr std::size_t kLargestJson = 512u << 10;  // bytes
constexpr std::size_t kMostEntries = 4096;        // of one list
constexpr int kDeepest = 24;                      // glTF itself needs about eight levels
constexpr std::uint32_t kMagic = 0x46546C67;      // "glTF"
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;  // "JSON"
constexpr std::uint32_t kVersion = 2;

std::uint32_t word(std::span<const std::uint8_t> bytes, std::size_t at) {
  return std::uint32_t{bytes[at]} | std::uint32_t{bytes[at + 1]} << 8 | std::uint32_t{bytes[at + 2]} << 16 |
         std::uint32_t{bytes[at + 3]} << 24;
}

json parse(std::span<const std::uint8_t> text, const std::string& file) {
  const auto shallow = [&](int depth, json::parse_event_t, json&) {
    if (depth > kDeepest) refuse_model(file, "lists within lists", "at most " + std::to_string(kDeepest) + " levels");
    return true;
  };
  try {
    return json::parse(text.begin(), text.end(), shallow);
  } catch (const json::exception& error) {
    refuse_model(file, quoted_from_model(error.what()), "JSON in its first chunk");
  }
}

void check_inside(const json& root, const char* list, const std::string& file) {
  const auto found = root.find(list);
  if (found == root.end() || !found->is_array()) return;
  for (const json& entry : *found) {
    if (entry.is_object() && entry.contains("uri")) {
      refuse_model(file, std::string("something outside the file in ") + list, "all data in the file itself");
    }
  }
}

}  // namespace

void refuse_model(const std::string& file, const std::string& found, const std::string& expected) {
  throw InputError(file + ": found " + found + ", expected " + expected);
}

std::string quoted_from_model(const std::string& text) {
  constexpr std::size_t kLongest = 120;
  std::string out = "'" + text.substr(0, kLongest) + (text.size() > kLongest ? "..." : "") + "'";
  std::replace_if(
      out.begin(), out.end(),
      [](char c) { return static_cast<unsigned char>(c) < 0x20 || static_cast<unsigned char>(c) >= 0x7f; }, ' ');
  return out;
}

void check_model_json(std::span<const std::uint8_t> bytes, const std::string& file) {
  if (bytes.size() < kHeader || word(bytes, 0) != kMagic) {
    refuse_model(file, std::to_string(bytes.size()) + " bytes of something else", "a binary glTF file (.glb)");
  }
  if (bytes.size() > kLargestFile) {
    refuse_model(file, std::to_string(bytes.size()) + " bytes", "at most " + std::to_string(kLargestFile));
  }
  if (word(bytes, 4) != kVersion) refuse_model(file, "glTF version " + std::to_string(word(bytes, 4)), "version 2");
  const std::size_t length = word(bytes, 12);
  if (word(bytes, 16) != kJsonChunk || length > bytes.size() - kHeader) {
    refuse_model(file, "a first chunk of " + std::to_string(length) + " bytes", "JSON that is all in the file");
  }
  if (length > kLargestJson) {
    refuse_model(file, std::to_string(length) + " bytes of JSON", "at most " + std::to_string(kLargestJson));
  }
  const json root = parse(bytes.subspan(kHeader, length), file);
  if (!root.is_object()) refuse_model(file, "JSON that is no object", "a glTF object");
  for (const auto& [key, value] : root.items()) {
    if (value.is_structured() && value.size() > kMostEntries) {
      refuse_model(file, std::to_string(value.size()) + " entries in " + quoted_from_model(key),
                   "at most " + std::to_string(kMostEntries));
    }
  }
  if (const auto found = root.find("buffers"); found != root.end() && found->size() > 1) {
    refuse_model(file, std::to_string(found->size()) + " buffers", "one");
  }
  if (const auto found = root.find("extensionsRequired"); found != root.end() && !found->empty()) {
    refuse_model(file, "a need for extensions", "plain glTF 2.0");
  }
  check_inside(root, "buffers", file);
  check_inside(root, "images", file);
}

}  // namespace parallax
