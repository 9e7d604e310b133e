#include "mapper/surface_reconstruction.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/time.h"

namespace parallax {
namespace {

constexpr std::size_t kNeighbours = 4;
constexpr double kBestBaseline = 0.22;  // of the distance to the scene
constexpr double kLeastBaseline = 0.04, kMostBaseline = 0.6;
constexpr double kMostTurn_rad = 0.6;
constexpr double kBelow =
    0.6;  // what is seen past the plane, of the camera's height over it: it shows that nothing is before
constexpr double kHighest = 0.75;         // and above
constexpr double kMarginOfHeight = 1.25;  // over the highest mapped point that is no outlier
constexpr double kSameCells = 0.4;        // a keyframe that moved less than this need not vote again

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

void want(bool good, const char* field, double found, const char* expected) {
  if (!good)
    throw InputError(std::string("surface.") + field + ": found " + std::to_string(found) + ", expected " + expected);
}

}  // namespace

void SurfaceOptions::validate() const {
  want(image_width_px >= 40, "image_width_px", image_width_px, "at least 40");
  want(keyframes >= 2, "keyframes", keyframes, "at least 2");
  want(cells >= 8 && cells <= 1024, "cells", cells, "8 to 1024");
  want(levels >= 8 && levels <= SurfaceVolume::kMostLevels, "levels", levels, "8 to 67");
  want(cell_px > 0, "cell_px", cell_px, "more than 0");
  want(least_height_px >= 0, "least_height_px", least_height_px, "at least 0");
  want(least_cells >= 0, "least_cells", least_cells, "at least 0");
}

SurfaceReconstruction::SurfaceReconstruction(const CameraModel& camera, const SurfaceOptions& options)
    : options_((options.validate(), options)), camera_(camera, options.image_width_px), stereo_(camera_) {}

void SurfaceReconstruction::update(std::shared_ptr<const TrackingSnapshot> snapshot) {
  next_snapshot_ = std::move(snapshot);
}

bool SurfaceReconstruction::step(double budget_ms, const Interruption& interrupt) {
  const auto start = SteadyClock::now();
  while (!interrupt.requested()) {
    if (!unit()) return false;
    if (std::chrono::duration<double, std::milli>(SteadyClock::now() - start).count() >= budget_ms) return true;
  }
  return true;
}

int SurfaceReconstruction::keyframe_of(KeyframeId id) const {
  for (std::size_t i = 0; i < snapshot_->keyframes.size(); ++i)
    if (snapshot_->keyframes[i].id == id) return static_cast<int>(i);
  return -1;
}

RigidTransform SurfaceReconstruction::camera_from_plane(int keyframe) const {
  return snapshot_->keyframes[static_cast<std::size_t>(keyframe)].camera_from_world *
         snapshot_->plane->world_from_plane;
}

// One piece of work, a millisecond or two; false when there is none.
bool SurfaceReconstruction::unit() {
  switch (stage_) {
    case Stage::idle:
      return plan();
    case Stage::stereo:
      if (stereo_.step()) return true;
      keep_depth();
      stage_ = Stage::idle;
      return true;
    case Stage::fuse: {
      const View& view = views_[to_fuse_[fusing_]];
      volume_.vote(row_++, camera_, *view.fused_from, fusing_depth_, view.sure);
      if (row_ < volume_.extent().rows) return true;
      row_ = 0;
      if (++fusing_ < to_fuse_.size()) {
        fusing_depth_ = depth_of(views_[to_fuse_[fusing_]]);
        return true;
      }
      stage_ = Stage::read;
      return true;
    }
    case Stage::read: {
      const auto n = static_cast<std::size_t>(making_->columns);
      const int least = views_.size() < 3 ? 1 : 2;
      for (int i = 0; i < 16 && row_ < making_->rows; ++i, ++row_) {
        const std::size_t at = static_cast<std::size_t>(row_) * n;
        volume_.read(row_, least, &making_->height_m[at], &making_->filled[at], &making_->known[at]);
      }
      if (row_ == making_->rows) {
        publish();
        stage_ = Stage::idle;
      }
      return true;
    }
  }
  return false;
}

// A depth is of use while its keyframe and the neighbour that tells its scale are there.
bool SurfaceReconstruction::holds(const View& view) const {
  return keyframe_of(view.id) >= 0 && keyframe_of(view.neighbour) >= 0;
}

// What comes next: a keyframe without depth, the newest first; else the fusion of what is new.
bool SurfaceReconstruction::plan() {
  if (next_snapshot_ != nullptr) {
    if (snapshot_ == nullptr || snapshot_->map_version != next_snapshot_->map_version) {
      views_.clear();
      surface_.reset();
      volume_.reset({});
    }
    snapshot_ = std::move(next_snapshot_);
    next_snapshot_.reset();
    const std::size_t before = views_.size();
    std::erase_if(views_, [&](const View& view) { return !holds(view); });
    changed_ = changed_ || views_.size() != before || !snapshot_->plane;
    if (!snapshot_->plane) surface_.reset();
    keyframe_ = static_cast<int>(snapshot_->keyframes.size());
  }
  if (snapshot_ == nullptr || !snapshot_->plane || snapshot_->keyframes.size() < 2) return false;
  const int oldest = std::max(0, static_cast<int>(snapshot_->keyframes.size()) - options_.keyframes);
  while (keyframe_ > oldest) {
    --keyframe_;
    const KeyframeId id = snapshot_->keyframes[static_cast<std::size_t>(keyframe_)].id;
    const bool done = std::any_of(views_.begin(), views_.end(), [&](const View& view) { return view.id == id; });
    if (!done && begin_stereo()) return true;
  }
  if (keyframe_ < 0) return false;
  keyframe_ = -1;
  begin_fusion();
  return stage_ != Stage::idle;
}

std::vector<int> SurfaceReconstruction::neighbours_of(int keyframe) const {
  const auto& all = snapshot_->keyframes;
  const SnapshotKeyframe& mine = all[static_cast<std::size_t>(keyframe)];
  struct Candidate {
    double badness;
    int index;
    Eigen::Vector3d direction;
  };
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (static_cast<int>(i) == keyframe) continue;
    const Eigen::Vector3d between = mine.camera_from_world.R * (all[i].centre - mine.centre);
    const double baseline = between.norm() / mine.mean_depth;
    const double turn = (all[i].camera_from_world * mine.camera_from_world.inverse()).angle();
    if (baseline < kLeastBaseline || baseline > kMostBaseline || turn > kMostTurn_rad) continue;
    // Motion along the axis shows less.
    const double across = between.head<2>().norm() / between.norm();
    candidates.push_back({std::abs(std::log(baseline / kBestBaseline)) + 1.5 * turn + (1 - across), static_cast<int>(i),
                          between.normalized()});
  }
  std::vector<int> out;
  std::vector<Eigen::Vector3d> taken;
  while (out.size() < kNeighbours && !candidates.empty()) {
    // Different directions see around different sides.
    const auto badness = [&](const Candidate& c) {
      double sum = c.badness;
      for (const Eigen::Vector3d& direction : taken) sum += 0.7 * std::max(0.0, direction.dot(c.direction));
      return sum;
    };
    const auto best = std::min_element(candidates.begin(), candidates.end(),
                                       [&](const auto& a, const auto& b) { return badness(a) < badness(b); });
    out.push_back(best->index);
    taken.push_back(best->direction);
    candidates.erase(best);
  }
  return out;
}

bool SurfaceReconstruction::begin_stereo() {
  neighbours_ = neighbours_of(keyframe_);
  if (neighbours_.empty()) return false;
  const auto view = [&](int keyframe) {
    const auto& images = snapshot_->keyframes[static_cast<std::size_t>(keyframe)].images;
    return SurfaceView{camera_.see(images->pyramid.level[static_cast<std::size_t>(camera_.level())]),
                       camera_from_plane(keyframe)};
  };
  const double over_plane = camera_from_plane(keyframe_).inverse().t.z();
  double lowest_camera = over_plane;
  std::vector<SurfaceView> others;
  for (const int neighbour : neighbours_) {
    others.push_back(view(neighbour));
    lowest_camera = std::min(lowest_camera, others.back().camera_from_plane.inverse().t.z());
  }
  if (!(lowest_camera > 0)) return false;  // looks at the plane from below
  const SurfaceExtent extent = wanted_extent();
  const double highest = std::min(kHighest * lowest_camera, extent.levels * extent.cell_m);
  stereo_.begin(view(keyframe_), std::move(others), -kBelow * over_plane, highest);
  stage_ = Stage::stereo;
  return true;
}

void SurfaceReconstruction::keep_depth() {
  View view;
  const SnapshotKeyframe& keyframe = snapshot_->keyframes[static_cast<std::size_t>(keyframe_)];
  const SnapshotKeyframe& neighbour = snapshot_->keyframes[static_cast<std::size_t>(neighbours_.front())];
  view.id = keyframe.id;
  view.neighbour = neighbour.id;
  view.baseline_m = (neighbour.centre - keyframe.centre).norm();
  view.unit_m = 4 * keyframe.mean_depth / 65535;  // what is farther than four times the usual is no concern
  stereo_.depth().convertTo(view.depth, CV_16U, 1 / view.unit_m);
  view.depth.setTo(0, view.depth == 65535);
  view.sure = stereo_.sure().clone();
  const auto place = std::upper_bound(views_.begin(), views_.end(), view.id,
                                      [](const KeyframeId& id, const View& v) { return id < v.id; });
  views_.insert(place, std::move(view));
  // Beyond the bound the oldest goes.
  if (static_cast<int>(views_.size()) > options_.keyframes) views_.erase(views_.begin());
  changed_ = true;
}

cv::Mat1f SurfaceReconstruction::depth_of(const View& view) const {
  const auto& all = snapshot_->keyframes;
  const double baseline = (all[static_cast<std::size_t>(keyframe_of(view.neighbour))].centre -
                           all[static_cast<std::size_t>(keyframe_of(view.id))].centre)
                              .norm();
  cv::Mat1f out;
  view.depth.convertTo(out, CV_32F, view.unit_m * baseline / view.baseline_m);
  return out;
}

// Over the mapped part of the plane, as fine as the images are, as high as the map's points.
SurfaceExtent SurfaceReconstruction::wanted_extent() const {
  const RigidTransform plane_from_world = snapshot_->plane->world_from_plane.inverse();
  std::vector<double> depths, over_plane, x, y, z;
  for (const SnapshotKeyframe& keyframe : snapshot_->keyframes) {
    depths.push_back(keyframe.mean_depth);
    over_plane.push_back((plane_from_world * keyframe.centre).z());
  }
  const double pixel = quantile(depths, 0.5) / camera_.focal_px();
  const double highest = kHighest * std::max(quantile(over_plane, 0.5), 8 * pixel);
  for (const Eigen::Vector3d& point : snapshot_->position) {
    const Eigen::Vector3d p = plane_from_world * point;
    if (p.z() < -8 * pixel || p.z() > highest) continue;
    z.push_back(p.z());
    if (p.z() > 8 * pixel) continue;  // a wall behind does not belong to the plane
    x.push_back(p.x());
    y.push_back(p.y());
  }
  SurfaceExtent out;
  if (x.size() < 10) return out;
  const Eigen::Vector2d low(quantile(x, 0.02), quantile(y, 0.02)), high(quantile(x, 0.98), quantile(y, 0.98));
  const Eigen::Vector2d margin = 0.05 * (high - low) + Eigen::Vector2d::Constant(4 * pixel);
  const Eigen::Vector2d size = high - low + 2 * margin;
  out.cell_m = std::max(options_.cell_px * pixel, size.maxCoeff() / options_.cells);
  // The grid keeps to round places, so that it does not move with every new point.
  const double step = 8 * out.cell_m;
  out.corner_m = ((low - margin) / step).array().floor() * step;
  out.columns = static_cast<int>(std::ceil((high.x() + margin.x() - out.corner_m.x()) / out.cell_m));
  out.rows = static_cast<int>(std::ceil((high.y() + margin.y() - out.corner_m.y()) / out.cell_m));
  const double top = std::min(highest, kMarginOfHeight * quantile(z, 0.995) + 6 * pixel);
  out.levels = std::clamp(static_cast<int>(std::ceil(top / out.cell_m)) + 4, 8, options_.levels);
  return out;
}

// Votes are kept where keyframes stayed put; else all vote again.
void SurfaceReconstruction::begin_fusion() {
  SurfaceExtent extent = wanted_extent();
  if (extent.columns == 0 || views_.empty()) return;
  const SurfaceExtent& old = volume_.extent();
  const Eigen::Vector2d high = extent.corner_m + extent.cell_m * Eigen::Vector2d(extent.columns, extent.rows);
  const Eigen::Vector2d old_high = old.corner_m + old.cell_m * Eigen::Vector2d(old.columns, old.rows);
  // The old place serves as long as it holds the new one and is not much too large or coarse.
  const bool fits = old.columns > 0 && (old.corner_m.array() <= extent.corner_m.array() + 2 * old.cell_m).all() &&
                    (old_high.array() >= high.array() - 2 * old.cell_m).all() && old.cell_m < 1.25 * extent.cell_m &&
                    old.cell_m > 0.8 * extent.cell_m && old.levels * old.cell_m > 0.9 * extent.levels * extent.cell_m;
  bool moved = changed_ && !fits;
  if (fits) {
    for (const View& view : views_) {
      if (!view.fused_from) continue;
      const int keyframe = keyframe_of(view.id);
      const RigidTransform now = camera_from_plane(keyframe), difference = now * view.fused_from->inverse();
      const double reach = snapshot_->keyframes[static_cast<std::size_t>(keyframe)].mean_depth;
      if (difference.t.norm() + difference.angle() * reach > kSameCells * old.cell_m) moved = true;
    }
  } else {
    moved = true;
  }
  to_fuse_.clear();
  if (moved) {
    volume_.reset(extent);
    for (View& view : views_) view.fused_from.reset();
  }
  for (std::size_t i = 0; i < views_.size(); ++i) {
    if (views_[i].fused_from) continue;
    views_[i].fused_from = camera_from_plane(keyframe_of(views_[i].id));
    to_fuse_.push_back(i);
  }
  if (to_fuse_.empty() && !changed_) return;
  changed_ = false;
  making_ = std::make_shared<SceneSurface>();
  making_->world_from_plane = snapshot_->plane->world_from_plane;
  making_->columns = volume_.extent().columns;
  making_->rows = volume_.extent().rows;
  making_->cell_m = volume_.extent().cell_m;
  making_->corner_m = volume_.extent().corner_m;
  making_->map_version = static_cast<int>(snapshot_->map_version);
  const std::size_t n = static_cast<std::size_t>(making_->columns) * static_cast<std::size_t>(making_->rows);
  making_->height_m.assign(n, 0);
  making_->filled.assign(n, 0);
  making_->known.assign(n, 0);
  fusing_ = 0;
  row_ = 0;
  stage_ = to_fuse_.empty() ? Stage::read : Stage::fuse;
  if (!to_fuse_.empty()) fusing_depth_ = depth_of(views_[to_fuse_.front()]);
}

void SurfaceReconstruction::publish() {
  std::vector<double> depths;
  for (const SnapshotKeyframe& keyframe : snapshot_->keyframes) depths.push_back(keyframe.mean_depth);
  const double pixel = quantile(depths, 0.5) / camera_.focal_px();
  clean_surface(options_.least_height_px * pixel, options_.least_cells, making_.get());
  making_->version = ++version_;
  surface_ = std::move(making_);
  making_.reset();
}

}  // namespace parallax
