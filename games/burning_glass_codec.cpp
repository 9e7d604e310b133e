#include "games/burning_glass_codec.h"

#include <array>
#include <bit>
#include <cstring>

namespace parallax::burning {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr char kAlphabet[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
constexpr std::size_t kShortestRun = 4;  // shorter ones cost more than they save

void put_number(std::uint64_t value, Bytes* out) {
  while (value >= 0x80) {
    out->push_back(static_cast<std::uint8_t>(value | 0x80));
    value >>= 7;
  }
  out->push_back(static_cast<std::uint8_t>(value));
}

bool get_number(const Bytes& in, std::size_t* at, std::uint64_t* value) {
  *value = 0;
  for (int shift = 0; shift < 35; shift += 7) {
    if (*at >= in.size()) return false;
    const std::uint8_t byte = in[(*at)++];
    *value |= static_cast<std::uint64_t>(byte & 0x7f) << shift;
    if (byte < 0x80) return true;
  }
  return false;
}

template <typename Word>
void put_word(Word word, Bytes* out) {
  for (std::size_t i = 0; i < sizeof(Word); ++i) out->push_back(static_cast<std::uint8_t>(word >> (8 * i)));
}

template <typename Word>
bool get_word(const Bytes& in, std::size_t* at, Word* word) {
  if (in.size() - *at < sizeof(Word)) return false;
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < sizeof(Word); ++i) value |= static_cast<std::uint32_t>(in[(*at)++]) << (8 * i);
  *word = static_cast<Word>(value);
  return true;
}

template <typename Word>
std::string encode_words(const std::vector<Word>& words) {
  Bytes out;
  std::size_t literal_begin = 0;
  const auto flush = [&](std::size_t end) {
    if (end == literal_begin) return;
    put_number(2 * (end - literal_begin) + 1, &out);
    for (std::size_t i = literal_begin; i < end; ++i) put_word(words[i], &out);
  };
  for (std::size_t i = 0; i < words.size();) {
    std::size_t run = 1;
    while (i + run < words.size() && words[i + run] == words[i]) ++run;
    if (run >= kShortestRun) {
      flush(i);
      put_number(2 * run, &out);
      put_word(words[i], &out);
      literal_begin = i + run;
    }
    i += run;
  }
  flush(words.size());
  return base64(out);
}

template <typename Word>
bool decode_words(const std::string& text, std::size_t count, std::vector<Word>* words) {
  Bytes in;
  if (!from_base64(text, &in)) return false;
  words->clear();
  std::size_t at = 0;
  while (at < in.size()) {
    std::uint64_t head = 0;
    if (!get_number(in, &at, &head)) return false;
    const std::uint64_t length = head / 2;
    if (length == 0 || length > count - words->size()) return false;
    Word word = 0;
    for (std::uint64_t i = 0; i < length; ++i) {
      if ((i == 0 || head % 2 == 1) && !get_word(in, &at, &word)) return false;
      words->push_back(word);
    }
  }
  return words->size() == count;
}

}  // namespace

std::string base64(const std::vector<std::uint8_t>& bytes) {
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t there = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (k < there ? bytes[i + k] : 0u);
    for (std::size_t k = 0; k < 4; ++k) out.push_back(k <= there ? kAlphabet[group >> (18 - 6 * k) & 63] : '=');
  }
  return out;
}

bool from_base64(const std::string& text, std::vector<std::uint8_t>* bytes) {
  static const std::array<std::int8_t, 256> values = [] {
    std::array<std::int8_t, 256> out{};
    out.fill(-1);
    for (int i = 0; i < 64; ++i) out[static_cast<std::uint8_t>(kAlphabet[i])] = static_cast<std::int8_t>(i);
    return out;
  }();
  bytes->clear();
  if (text.size() % 4 != 0) return false;
  bytes->reserve(text.size() / 4 * 3);
  for (std::size_t i = 0; i < text.size(); i += 4) {
    std::size_t padding = 0;
    if (i + 4 == text.size()) padding = text[i + 3] != '=' ? 0 : text[i + 2] != '=' ? 1 : 2;
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const int value = k >= 4 - padding ? 0 : values[static_cast<std::uint8_t>(text[i + k])];
      if (value < 0) return false;
      group = group << 6 | static_cast<std::uint32_t>(value);
    }
    for (std::size_t k = 0; k < 3 - padding; ++k) bytes->push_back(static_cast<std::uint8_t>(group >> (16 - 8 * k)));
  }
  return true;
}

std::string encode_layer(const std::vector<std::uint16_t>& values) { return encode_words(values); }

std::string encode_layer(const std::vector<float>& values) {
  std::vector<std::uint32_t> words(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) words[i] = std::bit_cast<std::uint32_t>(values[i]);
  return encode_words(words);
}

bool decode_layer(const std::string& text, std::size_t count, std::vector<std::uint16_t>* values) {
  return decode_words(text, count, values);
}

bool decode_layer(const std::string& text, std::size_t count, std::vector<float>* values) {
  std::vector<std::uint32_t> words;
  if (!decode_words(text, count, &words)) return false;
  values->resize(count);
  for (std::size_t i = 0; i < count; ++i) (*values)[i] = std::bit_cast<float>(words[i]);
  return true;
}

std::string encode_cells(const std::vector<CellValue>& cells) {
  Bytes out;
  std::uint32_t next = 0;
  for (const CellValue& cell : cells) {
    put_number(cell.cell - next, &out);
    put_word(cell.value, &out);
    next = cell.cell + 1;
  }
  return base64(out);
}

bool decode_cells(const std::string& text, std::size_t cell_count, std::vector<CellValue>* cells) {
  Bytes in;
  if (!from_base64(text, &in)) return false;
  cells->clear();
  std::uint64_t next = 0;
  for (std::size_t at = 0; at < in.size();) {
    std::uint64_t skipped = 0;
    CellValue cell;
    if (!get_number(in, &at, &skipped) || next + skipped >= cell_count || !get_word(in, &at, &cell.value)) return false;
    cell.cell = static_cast<std::uint32_t>(next + skipped);
    next = cell.cell + std::uint64_t{1};
    cells->push_back(cell);
  }
  return true;
}

}  // namespace parallax::burning
