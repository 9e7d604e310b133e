#include "core/parse_text.h"

#include <charconv>
#include <cmath>
#include <cstdio>
#include <limits>

namespace parallax {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

}  // namespace

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

LineReader::LineReader(std::string_view text) : rest_(text) {
  if (rest_.starts_with("\xef\xbb\xbf")) rest_.remove_prefix(3);
}

bool LineReader::next(std::string_view* line) {
  if (rest_.empty()) return false;
  const std::size_t end = rest_.find('\n');
  *line = trimmed(rest_.substr(0, end));
  rest_ = end == std::string_view::npos ? std::string_view() : rest_.substr(end + 1);
  ++number_;
  return true;
}

void split_blanks(std::string_view line, std::vector<std::string_view>* fields) {
  fields->clear();
  std::size_t at = 0;
  while (at < line.size()) {
    while (at < line.size() && is_blank(line[at])) ++at;
    const std::size_t start = at;
    while (at < line.size() && !is_blank(line[at])) ++at;
    if (at > start) fields->push_back(line.substr(start, at - start));
  }
}

void split_commas(std::string_view line, std::vector<std::string_view>* fields) {
  fields->clear();
  for (;;) {
    const std::size_t comma = line.find(',');
    fields->push_back(trimmed(line.substr(0, comma)));
    if (comma == std::string_view::npos) return;
    line.remove_prefix(comma + 1);
  }
}

bool parse_number(std::string_view text, double* value) {
  if (text.starts_with('+')) text.remove_prefix(1);
  double read = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), read);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(read)) return false;
  *value = read;
  return true;
}

bool parse_number(std::string_view text, std::int64_t* value) {
  std::int64_t read = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), read);
  if (error != std::errc() || end != text.data() + text.size()) return false;
  *value = read;
  return true;
}

bool parse_seconds(std::string_view text, Timestamp* time) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  constexpr std::int64_t kMaxSeconds = std::numeric_limits<std::int64_t>::max() / kSecond - 1;
  std::string_view digits = text;
  bool negative = false;
  if (!digits.empty() && (digits.front() == '-' || digits.front() == '+')) {
    negative = digits.front() == '-';
    digits.remove_prefix(1);
  }
  const std::size_t point = digits.find('.');
  const std::string_view whole = digits.substr(0, point);
  const std::string_view fraction = point == std::string_view::npos ? std::string_view() : digits.substr(point + 1);
  bool plain = !whole.empty();
  for (const char c : whole) plain = plain && is_digit(c);
  for (const char c : fraction) plain = plain && is_digit(c);
  if (!plain) {
    double seconds = 0;
    if (!parse_number(text, &seconds) || std::abs(seconds) > static_cast<double>(kMaxSeconds)) return false;
    *time = from_seconds(seconds);
    return true;
  }
  std::int64_t seconds = 0;
  if (!parse_number(whole, &seconds) || seconds > kMaxSeconds) return false;
  std::int64_t nanoseconds = 0;
  for (std::size_t i = 0; i < 9; ++i) nanoseconds = nanoseconds * 10 + (i < fraction.size() ? fraction[i] - '0' : 0);
  if (fraction.size() > 9 && fraction[9] >= '5') ++nanoseconds;
  const std::int64_t total = seconds * kSecond + nanoseconds;
  *time = Timestamp(negative ? -total : total);
  return true;
}

std::string format_seconds(Timestamp time) {
  const auto ns = static_cast<std::int64_t>(time.count());
  const auto magnitude = ns < 0 ? ~static_cast<std::uint64_t>(ns) + 1 : static_cast<std::uint64_t>(ns);
  char buffer[40];
  const int n = std::snprintf(buffer, sizeof buffer, "%s%llu.%09llu", ns < 0 ? "-" : "",
                              static_cast<unsigned long long>(magnitude / 1'000'000'000ULL),
                              static_cast<unsigned long long>(magnitude % 1'000'000'000ULL));
  return {buffer, static_cast<std::size_t>(n)};
}

std::string in_quotes(std::string_view text) {
  constexpr std::size_t kLongest = 60;
  const bool cut = text.size() > kLongest;
  std::string out = "'";
  for (const char c : text.substr(0, kLongest)) {
    const auto byte = static_cast<unsigned char>(c);
    out += byte < 0x20 || byte == 0x7f ? '?' : c;
  }
  return out + (cut ? "...'" : "'");
}

}  // namespace parallax
