#include "app/game_field.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace parallax {
namespace {

// A point lies on the plane when it is this near, as a part of the distance it was seen from.
constexpr double kOnPlane = 0.015;
constexpr std::size_t kFewestPoints = 30;
// What lies on the plane belongs together when no gap is wider than so many times the usual distance to the fourth
// neighbour (there are several points on a corner), or than this part of the spread (the root of the area that most of
// it covers).
constexpr double kGapOfSpacing = 2.5, kGapOfSpread = 0.04;
constexpr int kNeighbour = 4;
constexpr std::size_t kAskedForNeighbours = 400;
// Nothing is seen through a table: where there are points below it, as parts of the distance no farther than this, and
// they are more than this part of those on it, a wall or a cupboard goes through its plane.
constexpr double kBelowTo = 0.2, kMostBelow = 0.3;
constexpr int kMostCells = 400;  // along a side of the grid that finds the gaps
// Of the first views the plane may be that of a book, or a few percent of its distance off; the mapper fits it anew
// when there are six keyframes. A field is put down when there are more.
constexpr std::size_t kManyKeyframes = 7;
// The points hold the field when there are so many. What they move it by is not worth a change below this: a part of
// the radius, of the scale, and radians.
constexpr std::size_t kFewestAnchors = 12;
constexpr double kStill = 3e-4;
// Weights of the fit to the anchors (Cauchy), the residuals' scale being so many times their median.
constexpr int kFitRounds = 8;
constexpr double kFitScale = 1.5;
// A map in which the points of the table are this much farther apart is not the one they were kept from.
constexpr double kLeastScale = 0.5, kGreatestScale = 2;
// A field is begun anew when the plane is another: turned by more (cosine), or moved by more of its radius.
constexpr double kSameCosine = 0.97, kSameShift = 0.5;
// A surface belongs to the field when its frame is turned by less (1 + 2 cosine: two degrees) and is as high, in radii.
constexpr double kSameFrameTrace = 2.9988, kSameHeight = 0.1;
// Smaller growth of the area is not worth a change.
constexpr double kGrowth = 1.05;

double area_of(const std::vector<Eigen::Vector2d>& outline) {
  double twice = 0;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2d &a = outline[i], &b = outline[(i + 1) % outline.size()];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return 0.5 * twice;
}

Eigen::Vector2d centroid_of(const std::vector<Eigen::Vector2d>& outline) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double twice = 0;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2d &a = outline[i], &b = outline[(i + 1) % outline.size()];
    const double cross = a.x() * b.y() - a.y() * b.x();
    twice += cross;
    sum += cross * (a + b);
  }
  return twice > 0 ? Eigen::Vector2d(sum / (3 * twice)) : outline.front();
}

// Counter-clockwise.
std::vector<Eigen::Vector2d> hull_of(const std::vector<Eigen::Vector2d>& points) {
  std::vector<cv::Point2f> in, out;
  in.reserve(points.size());
  for (const Eigen::Vector2d& p : points) in.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()));
  cv::convexHull(in, out);
  std::vector<Eigen::Vector2d> hull;
  for (const cv::Point2f& p : out) hull.emplace_back(p.x, p.y);
  if (area_of(hull) < 0) std::reverse(hull.begin(), hull.end());
  return hull;
}

double radius_of(const std::vector<Eigen::Vector2d>& outline) { return std::sqrt(area_of(outline) / M_PI); }

struct PatchPoint {
  PointId id;
  Eigen::Vector2d place;  // in the plane's frame
};

struct PlanePoints {
  std::vector<PatchPoint> on;
  std::vector<Eigen::Vector2d> below;
};

PlanePoints near_plane(const TrackingSnapshot& map, const RigidTransform& world_from_plane) {
  const RigidTransform plane_from_world = world_from_plane.inverse();
  PlanePoints out;
  for (int row = 0; row < map.size(); ++row) {
    const auto i = static_cast<std::size_t>(row);
    const SnapshotKeyframe& source = map.keyframes[static_cast<std::size_t>(map.source[i])];
    const Eigen::Vector3d p = plane_from_world * map.position[i];
    const double distance = (source.centre - map.position[i]).norm();
    if (std::abs(p.z()) < kOnPlane * distance) {
      out.on.push_back({map.id[i], p.head<2>()});
    } else if (p.z() < 0 && p.z() > -kBelowTo * distance) {
      out.below.emplace_back(p.head<2>());
    }
  }
  return out;
}

// The usual distance from a point to its fourth neighbour.
double usual_spacing(const std::vector<PatchPoint>& points) {
  std::vector<double> found;
  const std::size_t stride = std::max<std::size_t>(1, points.size() / kAskedForNeighbours);
  std::vector<double> squares(points.size());
  for (std::size_t i = 0; i < points.size(); i += stride) {
    for (std::size_t k = 0; k < points.size(); ++k) squares[k] = (points[k].place - points[i].place).squaredNorm();
    std::nth_element(squares.begin(), squares.begin() + kNeighbour, squares.end());  // it is its own first
    found.push_back(std::sqrt(squares[kNeighbour]));
  }
  const auto middle = found.begin() + static_cast<std::ptrdiff_t>(found.size() / 2);
  std::nth_element(found.begin(), middle, found.end());
  return *middle;
}

// The bounds of the middle four fifths of the points.
Eigen::AlignedBox2d usual_bounds(const std::vector<PatchPoint>& points) {
  Eigen::Vector2d low, high;
  for (int axis = 0; axis < 2; ++axis) {
    std::vector<double> values;
    for (const PatchPoint& p : points) values.push_back(p.place[axis]);
    std::sort(values.begin(), values.end());
    low[axis] = values[values.size() / 10];
    high[axis] = values[values.size() - 1 - values.size() / 10];
  }
  return {low, high};
}

// The largest part of the points on the plane that hangs together: on a grid of cells half as wide as the gap,
// neighbouring ones. With a field (whose frame the points are in) the part with most of its points inside that.
std::vector<PatchPoint> largest_patch(const PlanePoints& points, const PlayingField* field) {
  if (points.on.size() < kFewestPoints) return {};
  const Eigen::AlignedBox2d usual = usual_bounds(points.on);
  // Far outliers are no part of it in any case.
  const Eigen::AlignedBox2d bounds(usual.min() - 2 * usual.sizes(), usual.max() + 2 * usual.sizes());
  const double gap = std::max(kGapOfSpread * std::sqrt(usual.volume()), kGapOfSpacing * usual_spacing(points.on));
  const double cell = std::max({gap / 2, bounds.sizes().maxCoeff() / kMostCells, 1e-9});
  const auto cell_of = [&](const Eigen::Vector2d& p) {
    const Eigen::Vector2d c = (p - bounds.min()) / cell;
    return cv::Point(static_cast<int>(c.x()) + 1, static_cast<int>(c.y()) + 1);
  };
  const cv::Size size(cell_of(bounds.max()).x + 2, cell_of(bounds.max()).y + 2);
  cv::Mat1f on(size, 0.0f), below(size, 0.0f);
  for (const PatchPoint& p : points.on)
    if (bounds.contains(p.place)) on(cell_of(p.place)) += 1;
  for (const Eigen::Vector2d& p : points.below)
    if (bounds.contains(p)) below(cell_of(p)) += 1;
  cv::boxFilter(on, on, CV_32F, {3, 3}, {-1, -1}, false, cv::BORDER_CONSTANT);
  cv::boxFilter(below, below, CV_32F, {3, 3}, {-1, -1}, false, cv::BORDER_CONSTANT);
  const cv::Mat table = (on > 0.5f) & (below <= kMostBelow * on);
  cv::Mat1i labels;
  const int count = cv::connectedComponents(table, labels, 8);
  if (count < 2) return {};
  const auto label_of = [&](const PatchPoint& p) { return bounds.contains(p.place) ? labels(cell_of(p.place)) : 0; };
  std::vector<int> members(static_cast<std::size_t>(count), 0);
  for (const PatchPoint& p : points.on)
    if (!field || inside_outline(*field, p.place)) ++members[static_cast<std::size_t>(label_of(p))];
  const auto largest = static_cast<int>(std::max_element(members.begin() + 1, members.end()) - members.begin());
  std::vector<PatchPoint> out;
  if (members[static_cast<std::size_t>(largest)] == 0) return out;
  for (const PatchPoint& p : points.on)
    if (label_of(p) == largest) out.push_back(p);
  if (out.size() < kFewestPoints) return {};
  return out;
}

struct PlanarSimilarity {
  double scale = 1, angle_rad = 0;
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();

  Eigen::Matrix2d rotation() const { return Eigen::Rotation2Dd(angle_rad).toRotationMatrix(); }
  Eigen::Vector2d operator*(const Eigen::Vector2d& p) const { return scale * (rotation() * p) + shift; }
};

// The similarity that takes `from` to `to`, fitted by weights that leave out what does not go with the others.
PlanarSimilarity fit_similarity(const std::vector<Eigen::Vector2d>& from, const std::vector<Eigen::Vector2d>& to) {
  PlanarSimilarity fitted;
  std::vector<double> squares(from.size());
  for (int round = 0; round < kFitRounds; ++round) {
    for (std::size_t i = 0; i < from.size(); ++i) squares[i] = (to[i] - fitted * from[i]).squaredNorm();
    std::vector<double> sorted = squares;
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    const double scale = std::max(kFitScale * kFitScale * *middle, 1e-24);
    Eigen::Vector2d mean_from = Eigen::Vector2d::Zero(), mean_to = Eigen::Vector2d::Zero();
    double sum = 0;
    for (std::size_t i = 0; i < from.size(); ++i) {
      const double weight = 1 / (1 + squares[i] / scale);
      mean_from += weight * from[i];
      mean_to += weight * to[i];
      sum += weight;
    }
    mean_from /= sum;
    mean_to /= sum;
    double along = 0, across = 0, spread = 0;
    for (std::size_t i = 0; i < from.size(); ++i) {
      const double weight = 1 / (1 + squares[i] / scale);
      const Eigen::Vector2d a = from[i] - mean_from, b = to[i] - mean_to;
      along += weight * a.dot(b);
      across += weight * (a.x() * b.y() - a.y() * b.x());
      spread += weight * a.squaredNorm();
    }
    if (!(spread > 0)) return {};
    fitted.scale = std::hypot(along, across) / spread;
    fitted.angle_rad = std::atan2(across, along);
    fitted.shift.setZero();
    fitted.shift = mean_to - fitted * mean_from;
  }
  return fitted;
}

// Counter-clockwise; empty when the points are too few.
std::vector<Eigen::Vector2d> outline_of(const std::vector<PatchPoint>& points) {
  std::vector<Eigen::Vector2d> places;
  places.reserve(points.size());
  for (const PatchPoint& p : points) places.push_back(p.place);
  if (places.size() < 3) return {};
  std::vector<Eigen::Vector2d> hull = hull_of(places);
  if (hull.size() < 3 || !(area_of(hull) > 0)) return {};
  return hull;
}

// The same things in other metres.
std::shared_ptr<const SceneSurface> scaled_surface(const std::shared_ptr<const SceneSurface>& surface, double factor) {
  if (!surface) return nullptr;
  auto out = std::make_shared<SceneSurface>(*surface);
  out->cell_m *= factor;
  out->corner_m *= factor;
  for (float& height : out->height_m) height *= static_cast<float>(factor);
  return out;
}

}  // namespace

std::vector<Eigen::Vector2d> mapped_outline(const TrackingSnapshot& map, const RigidTransform& world_from_plane) {
  return outline_of(largest_patch(near_plane(map, world_from_plane), nullptr));
}

void GameField::begin(const TrackingSnapshot& map, const Plane& plane, const std::vector<Eigen::Vector2d>& outline) {
  const Eigen::Vector2d centre = centroid_of(outline);
  plane_from_field_ = RigidTransform();
  plane_from_field_.t.head<2>() = centre;
  PlayingField made;
  made.world_from_plane = plane.world_from_plane * plane_from_field_;
  for (const Eigen::Vector2d& corner : outline) made.outline_m.push_back(corner - centre);
  made.radius_m = radius_of(made.outline_m);
  made.number = ++begun_;
  field_ = std::move(made);
  world_from_plane_ = plane.world_from_plane;
  world_ = map.stamp();
  map_version_ = map.map_version;
  anchors_.clear();
  hold_by_points(map);
}

void GameField::rescale(double factor) {
  for (Eigen::Vector2d& corner : field_->outline_m) corner *= factor;
  field_->radius_m *= factor;
  field_->scale *= factor;
  field_->surface = scaled_surface(field_->surface, factor);
}

// Remembers where points of the table lie on the field: those it is not held by yet. Those that are gone are forgotten.
void GameField::hold_by_points(const TrackingSnapshot& map) {
  std::map<PointId, Eigen::Vector2d> held;
  for (const PatchPoint& p : largest_patch(near_plane(map, field_->world_from_plane), &*field_)) {
    const auto known = anchors_.find(p.id);
    held.emplace(p.id, known != anchors_.end() ? known->second : Eigen::Vector2d(p.place / field_->scale));
  }
  if (held.size() >= kFewestAnchors) anchors_ = std::move(held);
}

// Takes the field where its points are now. True when that is somewhere else.
bool GameField::follow_points(const TrackingSnapshot& map, const Plane& plane) {
  const RigidTransform field_from_world = (plane.world_from_plane * plane_from_field_).inverse();
  std::vector<Eigen::Vector2d> kept, now;
  for (int row = 0; row < map.size(); ++row) {
    const auto i = static_cast<std::size_t>(row);
    const auto anchor = anchors_.find(map.id[i]);
    if (anchor == anchors_.end()) continue;
    kept.emplace_back(field_->scale * anchor->second);
    now.emplace_back((field_from_world * map.position[i]).head<2>());
  }
  if (kept.size() < kFewestAnchors) return false;
  const PlanarSimilarity moved = fit_similarity(kept, now);
  if (!(moved.scale > kLeastScale && moved.scale < kGreatestScale)) return false;
  const bool still = std::abs(moved.scale - 1) < kStill && std::abs(moved.angle_rad) < kStill &&
                     moved.shift.norm() < kStill * field_->radius_m;
  if (still) return false;
  RigidTransform step;
  step.R.topLeftCorner<2, 2>() = moved.rotation();
  step.t.head<2>() = moved.shift;
  plane_from_field_ = plane_from_field_ * step;
  rescale(moved.scale);
  return true;
}

bool GameField::update(const TrackingSnapshot& map, bool anyway) {
  if (map.map_version == map_version_ && map.version == version_ && !(anyway && settling_)) return false;
  version_ = map.version;
  const bool new_map = map.map_version != map_version_;
  if (new_map || !map.plane) {
    const bool had = field_.has_value();
    if (new_map) field_.reset();
    map_version_ = map.map_version;
    keyframes_ = 0;
    settling_ = false;
    if (!map.plane) return had && new_map;
  }
  // The world may have been scaled, here if not everywhere: with it everything that is known of the field.
  const SimilarityTransform moved = field_ ? map.world().now_from(world_, world_from_plane_.t) : SimilarityTransform();
  const double scale = moved.s;
  bool changed = false;
  if (field_ && scale != 1.0) {
    rescale(scale);
    plane_from_field_.t *= scale;
    changed = true;
  }
  const Plane& plane = *map.plane;
  if (field_) {
    const Eigen::Vector3d expected = moved * world_from_plane_.t;
    const double cosine = (moved.R * world_from_plane_.R.col(2)).dot(plane.world_from_plane.R.col(2));
    if (cosine < kSameCosine || (expected - plane.world_from_plane.t).norm() > kSameShift * field_->radius_m) {
      field_.reset();
      keyframes_ = 0;
    }
  }
  const bool grown = map.keyframes.size() != keyframes_;
  keyframes_ = map.keyframes.size();
  if (!field_) {
    const std::vector<Eigen::Vector2d> outline = mapped_outline(map, plane.world_from_plane);
    if (outline.empty()) {
      keyframes_ = 0;
      return changed;
    }
    settling_ = map.keyframes.size() < kManyKeyframes && !anyway;
    if (settling_) {
      keyframes_ = 0;
      return changed;
    }
    begin(map, plane, outline);
    return true;
  }
  world_ = map.stamp();
  world_from_plane_ = plane.world_from_plane;
  changed = follow_points(map, plane) || changed;
  const RigidTransform world_from_field = plane.world_from_plane * plane_from_field_;
  if ((world_from_field.t - field_->world_from_plane.t).norm() > 0 ||
      world_from_field.R != field_->world_from_plane.R) {
    field_->world_from_plane = world_from_field;
    changed = true;
  }
  if (grown) {
    // What was part of the field stays part of it.
    std::vector<Eigen::Vector2d> points =
        outline_of(largest_patch(near_plane(map, field_->world_from_plane), &*field_));
    points.insert(points.end(), field_->outline_m.begin(), field_->outline_m.end());
    std::vector<Eigen::Vector2d> hull = hull_of(points);
    if (area_of(hull) > kGrowth * area_of(field_->outline_m)) {
      field_->outline_m = std::move(hull);
      field_->radius_m = radius_of(field_->outline_m);
      changed = true;
    }
    hold_by_points(map);
  }
  return changed;
}

// The surface is in the plane's frame as it was when it was made; the field is centred elsewhere on it.
void GameField::set_surface(const std::shared_ptr<const SceneSurface>& surface) {
  if (!field_) return;
  field_->surface.reset();
  if (!surface || surface->empty()) return;
  const RigidTransform field_from_surface = field_->world_from_plane.inverse() * surface->world_from_plane;
  const bool same_plane = field_from_surface.R.trace() > kSameFrameTrace &&
                          std::abs(field_from_surface.t.z()) < kSameHeight * field_->radius_m;
  if (!same_plane) return;
  auto moved = std::make_shared<SceneSurface>(*surface);
  moved->world_from_plane = field_->world_from_plane;
  moved->corner_m += field_from_surface.t.head<2>();
  field_->surface = std::move(moved);
}

}  // namespace parallax
