#include "render/synthetic_source.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <utility>

#include "core/error.h"
#include "render/synthetic_board.h"
#include "render/synthetic_building.h"
#include "render/synthetic_raycaster.h"
#include "render/synthetic_scenes.h"
#include "render/synthetic_sensor.h"

namespace parallax {

namespace {

constexpr int kMaxFrames = 100'000'000;

// Lenses of about the same width; pixel values are for 640x480.
CameraModel lens(CameraModelKind kind) {
  switch (kind) {
    case CameraModelKind::fov:
      return {kind, 640, 480, {375.0, 376.0}, {321.4, 238.2}, {0.9}, 1};
    case CameraModelKind::pinhole:
      return {kind, 640, 480, {330.0, 330.5}, {320.7, 238.9}};
    case CameraModelKind::radtan:
      return {kind, 640, 480, {390.0, 391.0}, {318.2, 241.3}, {-0.26, 0.07, 0.0004, -0.0003}, 4};
    case CameraModelKind::kannala_brandt:
      return {kind, 640, 480, {370.0, 370.4}, {322.1, 240.8}, {-0.012, 0.004, -0.001, 0.0001}, 4};
  }
  return {};
}

struct Preset {
  const char* name;
  const char* scene;
  int frames;
  double exposure_s, noise, vignetting;
};
constexpr Preset kPresets[] = {
    {"desk", "desk", 400, 0.010, 2.0, 0.15},       {"walls", "walls", 600, 0.0, 1.0, 0.0},
    {"shakes", "desk", 900, 0.014, 2.0, 0.15},     {"repeat", "repeat", 400, 0.008, 2.0, 0.1},
    {"rotation", "desk", 300, 0.008, 2.0, 0.15},   {"blank", "blank", 150, 0.008, 1.0, 0.0},
    {"room", "room", 1800, 0.008, 1.5, 0.1},       {"board", "board", 480, 0.008, 2.0, 0.15},
    {"building", "building", 0, 0.008, 1.5, 0.12},
};

// What only `building` has.
struct BuildingKeys {
  int walk = 0, start = 0;
};

SyntheticMotion delayed(SyntheticMotion motion, int start) {
  if (start == 0) return motion;
  SyntheticMotion out;
  out.world_from_camera = [motion, start](int frame, double offset_s) {
    return motion.world_from_camera(frame + start, offset_s);
  };
  out.label = [motion, start](int frame) { return motion.label(frame + start); };
  out.gain = [motion, start](int frame) { return motion.gain(frame + start); };
  out.cover = [motion, start](int frame) { return motion.cover(frame + start); };
  return out;
}

SyntheticMotion motion_of(const std::string& name, const SyntheticOptions& options) {
  if (name == "walls") return walls_motion(options.frames);
  if (name == "shakes") return shakes_motion(options.motion_seed());
  if (name == "rotation") return rotation_motion(options.motion_seed());
  if (name == "room") return room_motion(options.motion_seed());
  if (name == "board") return board_motion(options.camera, options.motion_seed());
  return desk_motion(options.motion_seed());
}

[[noreturn]] void bad_value(const std::string& name, const std::string& key, const std::string& value,
                            const std::string& expected) {
  throw InputError("synthetic:" + name + ": key " + key + ": found '" + value + "', expected " + expected);
}

template <typename Number>
Number parse_number(const std::string& name, const std::string& key, const std::string& value, Number low, Number high,
                    const std::string& expected) {
  Number number{};
  const char* end = value.data() + value.size();
  const auto [stop, error] = std::from_chars(value.data(), end, number);
  if (error != std::errc() || stop != end || !(number >= low && number <= high)) bad_value(name, key, value, expected);
  return number;
}

void set_key(const std::string& name, const std::string& key, const std::string& value, SyntheticOptions* o,
             BuildingKeys* building) {
  const bool in_building = name == "building";
  if (in_building && key == "walk") {
    building->walk = value == "stairs" ? kBuildingStairs
                                       : parse_number(name, key, value, 0, kBuildingStairs - 1,
                                                      "a whole number from 0 to 4, or stairs");
  } else if (in_building && key == "start") {
    building->start = parse_number(name, key, value, 0, kMaxFrames, "a whole number from 0 to 100000000");
  } else if (key == "seed") {
    o->seed = parse_number<std::uint64_t>(name, key, value, 0, UINT32_MAX, "a whole number from 0 to 4294967295");
  } else if (key == "walk") {
    o->walk = parse_number<std::uint64_t>(name, key, value, 0, UINT32_MAX, "a whole number from 0 to 4294967295");
  } else if (key == "baseline") {
    o->baseline_m = parse_number(name, key, value, 0.001, 10.0, "metres from 0.001 to 10");
  } else if (key == "day" && (o->scene == "desk" || in_building)) {
    o->day = parse_number(name, key, value, 0, kLastSyntheticDay, "a whole number from 0 to 1000");
  } else if (key == "light") {
    o->light = parse_number(name, key, value, 0.05, 4.0, "a factor from 0.05 to 4");
  } else if (key == "frames") {
    o->frames = parse_number(name, key, value, 1, kMaxFrames, "a whole number from 1 to 100000000");
  } else if (key == "noise") {
    o->noise = parse_number(name, key, value, 0.0, 100.0, "grey levels from 0 to 100");
  } else if (key == "blur") {
    o->exposure_s = 1e-3 * parse_number(name, key, value, 0.0, 33.0, "an exposure from 0 to 33 ms");
  } else if (key == "threads") {
    o->threads = parse_number(name, key, value, 1, 64, "a whole number from 1 to 64");
  } else if (key == "lens" && !in_building) {
    for (const auto kind :
         {CameraModelKind::pinhole, CameraModelKind::radtan, CameraModelKind::kannala_brandt, CameraModelKind::fov}) {
      if (value != to_string(kind)) continue;
      const CameraModel standard = lens(kind);
      const int w = o->camera.width(), h = o->camera.height();
      o->camera = w == standard.width() && h == standard.height() ? standard : standard.scaled(w, h);
      return;
    }
    bad_value(name, key, value, "pinhole, radtan, kannala_brandt or fov");
  } else if (key == "size") {
    const auto x = value.find('x');
    const std::string expected = "WIDTHxHEIGHT from 64x48 to 4096x3072";
    if (x == std::string::npos) bad_value(name, key, value, expected);
    const int w = parse_number(name, key, value.substr(0, x), 64, 4096, expected);
    const int h = parse_number(name, key, value.substr(x + 1), 48, 3072, expected);
    o->camera = o->camera.scaled(w, h);
  } else if (key == "target" && name == "board") {
    if (value != "chessboard" && value != "circles") bad_value(name, key, value, "chessboard or circles");
    o->scene = value == "chessboard" ? "board" : "circle board";
  } else {
    throw InputError("synthetic:" + name + ": unknown key '" + key + "', expected one of seed, walk, light, frames, " +
                     (in_building ? "" : "lens, ") + "size, noise, blur, baseline, threads" +
                     (name == "board" ? ", target" : "") + (o->scene == "desk" ? ", day" : "") +
                     (in_building ? ", day, start" : ""));
  }
}

}  // namespace

SyntheticSource::SyntheticSource(const std::string& description, const SyntheticOptions& options,
                                 SyntheticMotion motion, const SourceOptions& source_options)
    : description_(description), options_(options), motion_(std::move(motion)), source_options_(source_options) {
  if (options.frames < 1)
    throw InputError(description + ": frames: found " + std::to_string(options.frames) + ", expected 1 or more");
  if (options.camera.width() <= 0) throw InputError(description + ": camera: found none, expected a calibrated lens");
  if (!(options.exposure_s >= 0 && options.exposure_s <= 1 / options.fps))
    throw InputError(description + ": exposure: found " + std::to_string(options.exposure_s) +
                     " s, expected 0 to one frame");
  scene_ = synthetic_scene(options.scene, options.seed, options.day);
  caster_ = std::make_unique<RayCaster>(scene_, options.camera, options.threads);
  next_ = std::max(0, source_options.start_frame);
}

SyntheticSource::~SyntheticSource() = default;

Timestamp SyntheticSource::time(int index) const { return from_seconds(1000.0 + index / options_.fps); }

int SyntheticSource::frame_count() const {
  const int left = std::max(0, options_.frames - std::max(0, source_options_.start_frame));
  return source_options_.max_frames < 0 ? left : std::min(left, source_options_.max_frames);
}

std::optional<Frame> SyntheticSource::next() {
  if (next_ >= options_.frames || delivered_ >= frame_count()) return std::nullopt;
  ++delivered_;
  return frame(next_++);
}

std::vector<StampedPose> SyntheticSource::ground_truth() const {
  std::vector<StampedPose> poses;
  poses.reserve(static_cast<std::size_t>(options_.frames));
  for (int i = 0; i < options_.frames; ++i) poses.push_back({time(i), world_from_camera(i)});
  return poses;
}

int SyntheticSource::samples(int index) const {
  // How far the picture moves while the shutter is open, for the nearest things; at most 1.5 px between samples.
  const double half = 0.5 * options_.exposure_s;
  const RigidTransform a = motion_.world_from_camera(index, -half), b = motion_.world_from_camera(index, half);
  const RigidTransform moved = a.inverse() * b;
  const double px = (moved.angle() + moved.t.norm() / options_.nearest_m) * options_.camera.mean_focal_px();
  int n = RayCaster::kMinSamples;
  while (n < RayCaster::kMaxSamples && px / n > 1.5) n *= 2;
  return n;
}

Frame SyntheticSource::frame(int index) { return draw(index, RigidTransform(), 1, options_.motion_seed()); }

Frame SyntheticSource::frame_beside(int index, const RigidTransform& other_from_camera, double gain, int camera) {
  return draw(index, other_from_camera, gain,
              options_.motion_seed() ^ (static_cast<std::uint64_t>(camera) * 0x9e3779b97f4a7c15u));
}

Frame SyntheticSource::draw(int index, const RigidTransform& other_from_camera, double gain, std::uint64_t noise_seed) {
  if (index < 0 || index >= options_.frames)
    throw InputError(description_ + ": frame " + std::to_string(index) + " asked for, expected 0 to " +
                     std::to_string(options_.frames - 1));
  const int n = samples(index);
  std::vector<RigidTransform> poses;
  for (int i = 0; i < n; ++i) {
    // Offsets within the pixel repeat every 4 or 8 samples; the order in time is shuffled against them.
    const int slot = (i * 5 + 2) % n;
    const double offset = ((slot + 0.5) / n - 0.5) * options_.exposure_s;
    poses.push_back(other_from_camera * motion_.world_from_camera(index, offset).inverse());
  }
  cv::Mat1f grey;
  cv::Mat3f colour;
  caster_->render(poses, &grey, source_options_.colour ? &colour : nullptr);
  SensorSettings sensor;
  sensor.gain = motion_.gain(index) * options_.light * gain;
  sensor.vignetting = options_.vignetting;
  sensor.cover = motion_.cover(index);
  sensor.noise = options_.noise;
  sensor.seed = noise_seed * 0x100000000u + static_cast<std::uint64_t>(index);
  Frame frame;
  frame.index = index;
  frame.time = time(index);
  expose(grey, colour, sensor, &frame.grey, &frame.colour);
  return frame;
}

cv::Mat1f SyntheticSource::depth(int index) { return caster_->depth(world_from_camera(index).inverse()); }

std::unique_ptr<SyntheticSource> open_synthetic_source(const std::string& name, const SourceOptions& source_options,
                                                       int threads) {
  static const std::string kPrefix = "synthetic:";
  const std::string text = name.starts_with(kPrefix) ? name.substr(kPrefix.size()) : name;
  const auto question = text.find('?');
  const std::string base = text.substr(0, question);
  const auto* preset =
      std::find_if(std::begin(kPresets), std::end(kPresets), [&](const Preset& p) { return base == p.name; });
  if (preset == std::end(kPresets))
    throw InputError(kPrefix + base + ": unknown sequence '" + base + "', expected one of " + synthetic_names());
  SyntheticOptions options;
  options.scene = preset->scene;
  options.frames = preset->frames;
  options.exposure_s = preset->exposure_s;
  options.noise = preset->noise;
  options.vignetting = preset->vignetting;
  options.threads = threads;
  options.camera = lens(CameraModelKind::fov);
  BuildingKeys building;
  if (base == "building") {
    options.camera = CameraModel(CameraModelKind::pinhole, 512, 384, {380.0, 380.0}, {256.8, 190.6});
    options.fps = kBuildingFps;
    options.nearest_m = 1;
  }
  if (base == "walls") options.camera = CameraModel(CameraModelKind::pinhole, 600, 480, {420.0, 420.0}, {299.5, 239.5});
  if (question != std::string::npos) {
    const std::string keys = text.substr(question + 1);
    std::vector<std::string> seen;
    for (std::size_t at = 0; at <= keys.size();) {
      const auto end = std::min(keys.find('&', at), keys.size());
      const std::string item = keys.substr(at, end - at);
      const auto equals = item.find('=');
      if (equals == std::string::npos || equals == 0)
        throw InputError(kPrefix + base + ": found '" + item + "', expected key=value");
      const std::string key = item.substr(0, equals);
      if (std::find(seen.begin(), seen.end(), key) != seen.end())
        throw InputError(kPrefix + base + ": key " + key + " found twice, expected once");
      seen.push_back(key);
      set_key(base, key, item.substr(equals + 1), &options, &building);
      at = end + 1;
    }
  }
  SyntheticMotion motion;
  if (base == "building") {
    if (options.frames == 0) options.frames = std::max(1, building_walk_frames(building.walk) - building.start);
    options.walk = options.seed * kBuildingWalks + static_cast<std::uint64_t>(building.walk);
    motion = delayed(building_motion(building.walk, *options.walk), building.start);
  } else {
    motion = motion_of(base, options);
  }
  return std::make_unique<SyntheticSource>(kPrefix + text, options, std::move(motion), source_options);
}

std::string synthetic_names() {
  std::string names;
  for (const Preset& p : kPresets) names += (names.empty() ? "" : ", ") + std::string(p.name);
  return names;
}

}  // namespace parallax
