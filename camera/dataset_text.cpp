#include "camera/dataset_text.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>

#include "core/error.h"
#include "core/parse_text.h"
#include "core/trajectory.h"

namespace parallax {
namespace {

// So many warnings of one file are told one by one; the rest are counted.
constexpr std::size_t kMaxWarnings = 20;

class WarningList {
 public:
  explicit WarningList(std::vector<std::string>* warnings) : warnings_(warnings) {}
  void add(std::string text) {
    if (++count_ <= kMaxWarnings) warnings_->push_back(std::move(text));
  }
  void finish(const std::string& name) {
    if (count_ > kMaxWarnings) {
      warnings_->push_back(name + ": and " + std::to_string(count_ - kMaxWarnings) + " more such lines");
    }
  }

 private:
  std::vector<std::string>* warnings_;
  std::size_t count_ = 0;
};

// `parse_line` fills time and name, or says what is wrong.
ImageList parse_list(const std::string& text, const std::string& name, const std::string& expected,
                     const std::function<bool(std::string_view, ListedImage*)>& parse_line) {
  ImageList list;
  WarningList warnings(&list.warnings);
  LineReader lines(text);
  std::string_view line;
  while (lines.next(&line)) {
    if (line.empty() || line.front() == '#') continue;
    ListedImage image;
    image.index = list.positions++;
    image.line = lines.number();
    if (parse_line(line, &image)) {
      list.images.push_back(std::move(image));
    } else {
      warnings.add(name + ":" + std::to_string(lines.number()) + ": found " + in_quotes(line) + ", expected " +
                   expected);
    }
  }
  warnings.finish(name);
  if (list.images.empty()) throw InputError(name + ": found no usable line, expected " + expected);
  drop_unordered_times(name, &list);
  return list;
}

bool is_plain_name(std::string_view name) {
  return !name.empty() &&
         std::none_of(name.begin(), name.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20; });
}

// The value of a key that stands at the start of a line of a YAML text: up to the next such key.
std::optional<std::string_view> yaml_value(std::string_view text, std::string_view key) {
  const std::string start = std::string(key) + ":";
  std::size_t at = 0;
  while (at < text.size() && !text.substr(at).starts_with(start)) {
    const std::size_t end = text.find('\n', at);
    if (end == std::string_view::npos) return std::nullopt;
    at = end + 1;
  }
  if (at >= text.size()) return std::nullopt;
  at += start.size();
  std::size_t end = at;
  for (;;) {
    end = text.find('\n', end);
    if (end == std::string_view::npos) break;
    ++end;
    if (end < text.size() && text[end] != ' ' && text[end] != '\t' && text[end] != '\n' && text[end] != '\r') break;
  }
  return text.substr(at, end == std::string_view::npos ? end : end - at);
}

std::vector<double> yaml_numbers(std::string_view text, const std::string& key, const std::string& name,
                                 std::size_t expected) {
  const auto fail = [&](const std::string& found) {
    return InputError(name + ": key " + key + ": found " + found + ", expected a list of " + std::to_string(expected) +
                      " numbers");
  };
  const auto value = yaml_value(text, key);
  if (!value) throw fail("nothing");
  const std::size_t open = value->find('['), close = value->find(']');
  if (open == std::string_view::npos || close == std::string_view::npos || close < open) throw fail("no list");
  std::string list(value->substr(open + 1, close - open - 1));
  std::replace(list.begin(), list.end(), '\n', ' ');
  std::vector<std::string_view> fields;
  split_commas(list, &fields);
  std::vector<double> numbers;
  for (const auto field : fields) {
    double number = 0;
    if (!parse_number(field, &number)) throw fail(in_quotes(field));
    numbers.push_back(number);
  }
  if (numbers.size() != expected) throw fail(std::to_string(numbers.size()) + " values");
  return numbers;
}

// A scalar, without a comment behind it.
std::string yaml_word(std::string_view text, const std::string& key) {
  const auto value = yaml_value(text, key);
  if (!value) return "";
  return std::string(trimmed(value->substr(0, value->find_first_of("#\n"))));
}

}  // namespace

ImageList parse_tum_image_list(const std::string& text, const std::string& name) {
  std::vector<std::string_view> fields;
  return parse_list(text, name, "'TIME_IN_SECONDS IMAGE_FILE'", [&](std::string_view line, ListedImage* image) {
    split_blanks(line, &fields);
    if (fields.size() < 2 || !parse_seconds(fields[0], &image->time)) return false;
    // The rest of the line: a name may hold blanks.
    const auto offset = static_cast<std::size_t>(fields[1].data() - line.data());
    image->name = std::string(line.substr(offset));
    return is_plain_name(image->name);
  });
}

ImageList parse_euroc_image_list(const std::string& text, const std::string& name) {
  std::vector<std::string_view> fields;
  return parse_list(text, name, "'TIME_IN_NANOSECONDS,IMAGE_FILE'", [&](std::string_view line, ListedImage* image) {
    split_commas(line, &fields);
    std::int64_t nanoseconds = 0;
    if (fields.size() != 2 || !parse_number(fields[0], &nanoseconds)) return false;
    image->time = Timestamp(nanoseconds);
    image->name = std::string(fields[1]);
    return is_plain_name(image->name);
  });
}

ImageList parse_kitti_times(const std::string& text, const std::string& name) {
  return parse_list(text, name, "a time in seconds",
                    [](std::string_view line, ListedImage* image) { return parse_seconds(line, &image->time); });
}

void drop_unordered_times(const std::string& name, ImageList* list) {
  auto& images = list->images;
  const auto unordered =
      std::adjacent_find(images.begin(), images.end(), [](const auto& a, const auto& b) { return a.time >= b.time; });
  if (unordered == images.end()) return;
  // Longest strictly increasing subsequence: ends[k] is the image with the smallest time that ends one of length k + 1.
  std::vector<std::size_t> ends, before(images.size(), images.size());
  for (std::size_t i = 0; i < images.size(); ++i) {
    const auto at = std::lower_bound(ends.begin(), ends.end(), images[i].time,
                                     [&](std::size_t end, Timestamp time) { return images[end].time < time; });
    if (at != ends.begin()) before[i] = *(at - 1);
    if (at == ends.end()) {
      ends.push_back(i);
    } else if (images[*at].time > images[i].time) {
      *at = i;
    }
  }
  std::vector<char> keep(images.size(), 0);
  for (std::size_t i = ends.back(); i < images.size(); i = before[i]) keep[i] = 1;
  WarningList warnings(&list->warnings);
  std::vector<ListedImage> kept;
  for (std::size_t i = 0; i < images.size(); ++i) {
    if (keep[i] != 0) {
      kept.push_back(std::move(images[i]));
    } else {
      warnings.add(name + ":" + std::to_string(images[i].line) + ": found time " + format_seconds(images[i].time) +
                   " s, expected one between those of the lines around it; the image is skipped");
    }
  }
  warnings.finish(name);
  images = std::move(kept);
}

bool stays_inside(const std::string& folder, const std::string& name) {
  namespace fs = std::filesystem;
  fs::path path(name);
  if (path.is_absolute()) {
    std::error_code error;
    const fs::path base = fs::absolute(folder, error).lexically_normal();
    if (error) return false;
    path = path.lexically_normal().lexically_relative(base);
    return !path.empty() && *path.begin() != "..";
  }
  path = path.lexically_normal();
  return !path.empty() && *path.begin() != "..";
}

ProjectionMatrix parse_kitti_projection(const std::string& text, const std::string& name, int camera) {
  const std::string key = "P" + std::to_string(camera);
  const auto fail = [&](const std::string& found) {
    return InputError(name + ": key " + key + ": found " + found + ", expected the 12 numbers of a projection matrix");
  };
  std::vector<std::string_view> fields;
  LineReader lines(text);
  std::string_view line;
  while (lines.next(&line)) {
    split_blanks(line, &fields);
    if (fields.empty() || (fields[0] != key + ":" && fields[0] != key)) continue;
    if (fields.size() != 13) throw fail(std::to_string(fields.size() - 1) + " values");
    ProjectionMatrix P;
    for (int i = 0; i < 12; ++i) {
      double value = 0;
      const auto field = fields[static_cast<std::size_t>(i) + 1];
      if (!parse_number(field, &value)) throw fail(in_quotes(field));
      P(i / 4, i % 4) = value;
    }
    if (!(P(0, 0) > 0 && P(1, 1) > 0)) throw fail("a focal length that is not positive");
    return P;
  }
  throw fail("nothing");
}

CameraModel kitti_camera(const ProjectionMatrix& projection, ImageSize size, const std::string& name) {
  try {
    return CameraModel(CameraModelKind::pinhole, size.width, size.height, {projection(0, 0), projection(1, 1)},
                       {projection(0, 2), projection(1, 2)});
  } catch (const InputError& error) {
    throw InputError(name + ": " + error.what());
  }
}

RigidTransform kitti_camera0_from_camera(const ProjectionMatrix& projection) {
  // P = K [I | t] with t = camera_from_camera0 (KITTI odometry: all cameras are rectified to one orientation).
  const double fx = projection(0, 0), fy = projection(1, 1);
  const double z = projection(2, 3);
  const Eigen::Vector3d t((projection(0, 3) - projection(0, 2) * z) / fx,
                          (projection(1, 3) - projection(1, 2) * z) / fy, z);
  return {Eigen::Matrix3d::Identity(), -t};
}

EurocSensor parse_euroc_sensor(const std::string& text, const std::string& name) {
  const auto fail = [&](const std::string& key, const std::string& found, const std::string& expected) {
    return InputError(name + ": key " + key + ": found " + found + ", expected " + expected);
  };
  EurocSensor sensor;
  sensor.body_from_camera = parse_euroc_body_from_sensor(text, name);
  const std::string model = yaml_word(text, "camera_model");
  if (model != "pinhole") throw fail("camera_model", in_quotes(model), "pinhole");
  const auto size = yaml_numbers(text, "resolution", name, 2);
  const auto focal = yaml_numbers(text, "intrinsics", name, 4);
  for (const double side : size) {
    if (!(side >= 1 && side <= 100000 && side == std::floor(side))) {
      throw fail("resolution", std::to_string(side), "a width and a height in pixels");
    }
  }
  const std::string distortion = yaml_word(text, "distortion_model");
  CameraModelKind kind = CameraModelKind::pinhole;
  std::array<double, 8> coefficients{};
  int n = 0;
  if (distortion == "radial-tangential" || distortion == "radtan" || distortion == "plumb_bob" ||
      distortion == "equidistant") {
    const auto read = yaml_numbers(text, "distortion_coefficients", name, 4);
    const bool none = std::all_of(read.begin(), read.end(), [](double k) { return k == 0; });
    if (distortion == "equidistant" || !none) {
      kind = distortion == "equidistant" ? CameraModelKind::kannala_brandt : CameraModelKind::radtan;
      std::copy(read.begin(), read.end(), coefficients.begin());
      n = 4;
    }
  } else if (!distortion.empty() && distortion != "none") {
    throw fail("distortion_model", in_quotes(distortion), "radial-tangential, equidistant or none");
  }
  try {
    sensor.camera = CameraModel(kind, static_cast<int>(size[0]), static_cast<int>(size[1]), {focal[0], focal[1]},
                                {focal[2], focal[3]}, coefficients, n);
  } catch (const InputError& error) {
    throw InputError(name + ": " + error.what());
  }
  double rate = 0;
  if (parse_number(yaml_word(text, "rate_hz"), &rate) && rate > 0) sensor.rate_hz = rate;
  return sensor;
}

bool natural_less(std::string_view a, std::string_view b) {
  const auto digit = [](char c) { return c >= '0' && c <= '9'; };
  const std::string_view whole_a = a, whole_b = b;
  while (!a.empty() && !b.empty()) {
    if (digit(a.front()) && digit(b.front())) {
      const auto run = [&](std::string_view* s) {
        std::size_t n = 0;
        while (n < s->size() && digit((*s)[n])) ++n;
        std::string_view number = s->substr(0, n);
        s->remove_prefix(n);
        while (number.size() > 1 && number.front() == '0') number.remove_prefix(1);
        return number;
      };
      const std::string_view x = run(&a), y = run(&b);
      if (x.size() != y.size()) return x.size() < y.size();
      if (x != y) return x < y;
    } else {
      if (a.front() != b.front()) return a.front() < b.front();
      a.remove_prefix(1);
      b.remove_prefix(1);
    }
  }
  if (a.empty() != b.empty()) return a.empty();
  return whole_a < whole_b;  // "01" and "1": any order that is one
}

}  // namespace parallax
