// Reading numbers out of text, fast and without locale: the small pieces the parsers of data-set files share.
// Nothing here throws; views point into the caller's text.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/time.h"

namespace parallax {

// Walks through the lines of a text; "\n" and "\r\n" end a line, and a byte order mark at the start is passed over.
class LineReader {
 public:
  explicit LineReader(std::string_view text);
  // The next line, trimmed of blanks at both ends; false at the end. number() counts from 1.
  bool next(std::string_view* line);
  int number() const { return number_; }

 private:
  std::string_view rest_;
  int number_ = 0;
};

std::string_view trimmed(std::string_view text);

// The fields between blanks, or between commas (trimmed). `fields` is cleared first.
void split_blanks(std::string_view line, std::vector<std::string_view>* fields);
void split_commas(std::string_view line, std::vector<std::string_view>* fields);

// The whole of `text` as a number; false for anything else, and for values that are not finite or out of range.
bool parse_number(std::string_view text, double* value);
bool parse_number(std::string_view text, std::int64_t* value);

// Seconds as written (1311868163.8697, 1.0e-01) to nanoseconds, exact to the ninth decimal.
bool parse_seconds(std::string_view text, Timestamp* time);

// Seconds with nine decimals, exact.
std::string format_seconds(Timestamp time);

// Text from a file as it may stand in a one-line message: quoted, shortened, control characters replaced.
std::string in_quotes(std::string_view text);

}  // namespace parallax
