#include "games/burning_glass.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "games/burning_glass_info.h"

namespace parallax {

using namespace burning;

namespace {

constexpr int kUndoCoverTicks = kGameTicksPerSecond * 3 / 4;  // time to take the lens elsewhere
constexpr double kAzimuthRate = 50 * std::numbers::pi / 180, kElevationRate = 35 * std::numbers::pi / 180;  // rad/s
constexpr double kDialRate = 0.6;     // of the focal length's logarithm, a second
constexpr double kAutofocusRate = 2;  // seated: the same, of itself
constexpr std::size_t kMostSounds = 32;
constexpr double kLeastPartOfField = 0.5;  // that a sheet which comes from another field covers, of the radius

double radians(double degrees) { return degrees * std::numbers::pi / 180; }
double clean(double value) { return std::isfinite(value) ? std::clamp(value, -1.0, 1.0) : 0.0; }

// Where the axis meets the table, as a distance along it; 0 when it does not.
double distance_along_axis(const Lens& lens) { return lens.axis.z() < -1e-6 ? lens.centre_m.z() / -lens.axis.z() : 0; }

bool usable(const RigidTransform& pose) {
  return pose.R.allFinite() && pose.t.allFinite() && std::abs(pose.R.determinant() - 1) < 0.1;
}

}  // namespace

std::unique_ptr<Game> make_burning_glass() { return std::make_unique<BurningGlass>(); }

BurningGlass::BurningGlass() : bundle_(kRaysPerTick, 1), gathered_(kSheetSize, 0.0f), shown_(kSheetSize, 0.0f) {
  start(empty_field(0.2), GameOptions());
}

const GameInfo& BurningGlass::info() const { return burning_glass_info(); }

const Material& BurningGlass::material() const { return materials()[static_cast<std::size_t>(controls_.material)]; }

void BurningGlass::start(const PlayingField& field, const GameOptions& options) {
  field_ = field;
  grid_.half_extent_m = field.radius_m > 0 && std::isfinite(field.radius_m) ? field.radius_m : 0.2;
  seed_ = options.seed;
  seated_ = options.seated;
  difficulty_ = options.difficulty;
  colour_blind_safe_ = options.colour_blind_safe;
  controls_ = Controls();
  for (const GameSetting& setting : info().settings) set(setting.name, setting.initial);
  controls_.sun_placed = false;
  for (const auto& [name, value] : options.settings) set(name, value);
  sheet_.clear(seed_);
  strokes_ = Strokes();
  tick_ = 0;
  covered_ticks_ = 0;
  act_held_ = false;
  bundle_ = RayBundle(kRaysPerTick, seed_);
  forget_moment();
}

void BurningGlass::forget_moment() {
  light_ = LightOnSheet();
  particles_.clear(seed_);
  sounds_.clear();
  camera_from_plane_.reset();
  covered_ = false;
  first_burn_ = -1;
  forget_light();
  forget_pictures();
}

cv::Mat4b BurningGlass::picture() const { return strokes_.count() > 0 ? export_picture() : cv::Mat4b(); }

void BurningGlass::forget_light() {
  std::fill(gathered_.begin(), gathered_.end(), 0.0f);
  std::fill(shown_.begin(), shown_.end(), 0.0f);
  gathered_box_ = shown_box_ = SheetBox();
  ++shown_version_;
}

void BurningGlass::change_field(const PlayingField& field) {
  const bool another = field.number != field_.number;
  rescale(length_factor(field_, field));
  // The field before may have grown round the sheet; on the next it is not to shrink with every one.
  if (another && field.radius_m > 0 && std::isfinite(field.radius_m))
    rescale(std::clamp(grid_.half_extent_m, kLeastPartOfField * field.radius_m, field.radius_m) / grid_.half_extent_m);
  field_ = field;
  const bool blank = strokes_.count() == 0 && sheet_.warm().empty() &&
                     std::all_of(sheet_.charred().begin(), sheet_.charred().end(), [](auto c) { return c == 0; });
  if (blank && field.radius_m > 0 && std::isfinite(field.radius_m)) {
    grid_.half_extent_m = field.radius_m;
    forget_pictures();
  }
}

void BurningGlass::rescale(double new_per_old) {
  if (!(new_per_old > 0) || !std::isfinite(new_per_old) || new_per_old == 1) return;
  grid_.half_extent_m *= new_per_old;
  forget_pictures();
}

void BurningGlass::set(const std::string& name, double value) {
  const GameSetting* setting = nullptr;
  for (const GameSetting& candidate : info().settings) {
    if (candidate.name == name) setting = &candidate;
  }
  if (setting == nullptr || std::isnan(value)) return;
  const double most = setting->choices.empty() ? setting->most : static_cast<double>(setting->choices.size() - 1);
  value = std::clamp(value, setting->choices.empty() ? setting->least : 0.0, most);
  if (name == "focal_length") controls_.focal_length = value;
  if (name == "lens_diameter") controls_.lens_diameter = value;
  if (name == "sun_elevation" || name == "sun_azimuth") {
    (name == "sun_elevation" ? controls_.elevation_rad : controls_.azimuth_rad) = radians(value);
    controls_.sun_placed = true;
  }
  if (name == "lens_shape") controls_.lens_shape = static_cast<int>(std::lround(value));
  if (name == "material" && controls_.material != std::lround(value)) {
    controls_.material = static_cast<int>(std::lround(value));
    forget_pictures();
  }
}

Lens BurningGlass::lens_of(const RigidTransform& camera_from_plane) const {
  const RigidTransform plane_from_camera = camera_from_plane.inverse();
  Lens lens;
  lens.centre_m = plane_from_camera.t;
  lens.axis = plane_from_camera.R.col(2).normalized();
  lens.focal_length_m = focal_length_m();
  lens.diameter_m = controls_.lens_diameter * grid_.half_extent_m;
  lens.shape = controls_.lens_shape == 0 ? LensShape::corrected : LensShape::simple_glass;
  return lens;
}

void BurningGlass::place_sun(const RigidTransform& camera_from_plane) {
  const Eigen::Vector3d towards = -lens_of(camera_from_plane).axis;
  controls_.azimuth_rad = towards.head<2>().norm() > 0.05 ? std::atan2(towards.y(), towards.x()) : -radians(90);
  controls_.elevation_rad = std::clamp(std::asin(std::clamp(towards.z(), -1.0, 1.0)), radians(kLeastElevation_deg),
                                       radians(kMostElevation_deg));
  controls_.sun_placed = true;
}

void BurningGlass::move_controls(const GameInput& input) {
  controls_.azimuth_rad += clean(input.move.x()) * kAzimuthRate * kGameTick_s;
  controls_.azimuth_rad = std::remainder(controls_.azimuth_rad, 2 * std::numbers::pi);
  controls_.elevation_rad = std::clamp(controls_.elevation_rad + clean(input.move.y()) * kElevationRate * kGameTick_s,
                                       radians(kLeastElevation_deg), radians(kMostElevation_deg));
  double change = clean(input.dial) * kDialRate * kGameTick_s;
  if (seated_ && camera_from_plane_) {
    const double wanted = distance_along_axis(lens_of(*camera_from_plane_));
    const double most = kAutofocusRate * kGameTick_s;
    if (wanted > 0) change += std::clamp(std::log(wanted / focal_length_m()), -most, most);
  }
  controls_.focal_length = std::clamp(controls_.focal_length * std::exp(change), kLeastFocalLength, kMostFocalLength);
}

void BurningGlass::step(const GameInput& input) {
  ++tick_;
  camera_from_plane_ = input.camera_from_plane;
  if (camera_from_plane_ && !usable(*camera_from_plane_)) camera_from_plane_.reset();
  if (camera_from_plane_ && !controls_.sun_placed) place_sun(*camera_from_plane_);
  move_controls(input);

  if (covered_ticks_ > 0) --covered_ticks_;
  if (input.act && !act_held_ && undo()) make_sound("click", 0.8, 0.9, -1);
  act_held_ = input.act;
  covered_ = input.fire || covered_ticks_ > 0;

  const bool lit = camera_from_plane_.has_value() && !covered_ && camera_from_plane_->inverse().t.z() > 0;
  if (lit) {
    trace_light(LightPath(lens_of(*camera_from_plane_), towards_sun()), bundle_, tick_, grid_, &light_);
  } else {
    light_.clear();
  }
  const double warming = difficulty_ == GameDifficulty::easy ? 1.4 : difficulty_ == GameDifficulty::hard ? 0.75 : 1.0;
  const Sheet::Step& burnt = sheet_.advance(material(), lit ? &light_ : nullptr, warming, kGameTick_s);
  if (first_burn_ < 0 && !burnt.fresh.empty()) first_burn_ = burnt.fresh.front();
  strokes_.note(burnt.by_light, burnt.changed, sheet_.charred());
  pictures_.stale.include(burnt.changed);
  make_sounds(particles_.advance(sheet_, material(), kGameTick_s));
  gather_light(lit);
}

bool BurningGlass::undo() {
  Strokes::Char charred = sheet_.charred();
  if (!strokes_.undo(&charred)) return false;
  if (first_burn_ >= 0 && charred[static_cast<std::size_t>(first_burn_)] == 0) first_burn_ = -1;
  sheet_.set_char(std::move(charred));
  sheet_.cool();
  covered_ticks_ = kUndoCoverTicks;
  pictures_.stale = SheetBox::all();
  return true;
}

void BurningGlass::gather_light(bool lit) {
  if (lit) {
    for (int row = light_.box.bottom; row < light_.box.top; ++row) {
      for (int column = light_.box.left; column < light_.box.right; ++column) {
        const std::size_t i = SheetGrid::index(column, row);
        gathered_[i] += light_.concentration[i];
      }
    }
    gathered_box_.include(light_.box);
  }
  if (tick_ % kTicksPerPicture != 0) return;
  if (gathered_box_.empty() && shown_box_.empty() && sheet_.warm().empty() && pictures_.stale.empty()) return;
  for (int row = shown_box_.bottom; row < shown_box_.top; ++row) {
    for (int column = shown_box_.left; column < shown_box_.right; ++column) shown_[SheetGrid::index(column, row)] = 0;
  }
  for (int row = gathered_box_.bottom; row < gathered_box_.top; ++row) {
    for (int column = gathered_box_.left; column < gathered_box_.right; ++column) {
      const std::size_t i = SheetGrid::index(column, row);
      shown_[i] = gathered_[i] / kTicksPerPicture;
      gathered_[i] = 0;
    }
  }
  shown_box_ = gathered_box_;
  gathered_box_ = SheetBox();
  ++shown_version_;
}

void BurningGlass::make_sounds(int new_sparks) {
  const Sheet::Step& burnt = sheet_.last();
  if (burnt.fresh.empty()) return;
  const int cell = burnt.hottest_index;
  if (tick_ % 24 == 0) make_sound("sizzle", 0.25 + 0.35 * std::min(1.0, burnt.charred), 1, cell);
  if (new_sparks > 0 && tick_ % 6 == 0) make_sound("spark", 0.5, 0.9 + 0.05 * static_cast<double>(tick_ / 6 % 5), cell);
}

void BurningGlass::make_sound(const std::string& name, double volume, double pitch, int cell) {
  if (sounds_.size() >= kMostSounds) return;
  GameSound sound{name, static_cast<float>(volume), static_cast<float>(pitch), {}};
  if (cell >= 0) {
    const Eigen::Vector2d at = grid_.centre_of(cell % kSheetCells, cell / kSheetCells);
    sound.position_m = Eigen::Vector3d(at.x(), at.y(), 0);
  }
  sounds_.push_back(std::move(sound));
}

std::optional<GameLandmark> BurningGlass::landmark() const {
  if (first_burn_ < 0) return std::nullopt;
  const Eigen::Vector2d at = grid_.centre_of(first_burn_ % kSheetCells, first_burn_ / kSheetCells);
  return GameLandmark{static_cast<std::uint64_t>(first_burn_), {at.x(), at.y(), 0}};
}

std::vector<GameSound> BurningGlass::take_sounds() {
  std::vector<GameSound> out;
  out.swap(sounds_);
  return out;
}

void BurningGlass::forget_pictures() {
  pictures_ = Pictures();
  pictures_.stale = SheetBox::all();
}

cv::Mat4b BurningGlass::export_picture() const {
  BurnPicture picture;
  picture.paint(material(), sheet_.charred(), SheetBox::all());
  return picture.picture();
}

// Somebody who knows optics: turns the sun until it stands behind the lens, and takes a glass that focuses at the
// distance of the table.
GameInput BurningGlass::scripted_input(const std::optional<RigidTransform>& camera_from_plane) const {
  GameInput input;
  input.camera_from_plane = camera_from_plane;
  if (!camera_from_plane || !usable(*camera_from_plane)) return input;
  const Lens lens = lens_of(*camera_from_plane);
  const Eigen::Vector3d wanted = -lens.axis;
  if (!(wanted.z() > 0.05)) return input;
  const auto towards = [](double difference, double rate) {
    return std::clamp(difference / (rate * kGameTick_s), -1.0, 1.0);
  };
  // Under a sun overhead, azimuth means little.
  const double azimuth = std::atan2(wanted.y(), wanted.x());
  const double turn = std::remainder(azimuth - controls_.azimuth_rad, 2 * std::numbers::pi);
  if (wanted.head<2>().norm() > 0.02) input.move.x() = towards(turn, kAzimuthRate);
  input.move.y() = towards(std::asin(std::min(1.0, wanted.z())) - controls_.elevation_rad, kElevationRate);
  const double distance = distance_along_axis(lens);
  if (distance > 0 && !seated_) input.dial = towards(std::log(distance / focal_length_m()), kDialRate);
  return input;
}

}  // namespace parallax
