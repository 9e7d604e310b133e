#include "tracker/trail_tracker.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/check.h"
#include "core/patch.h"
#include "tracker/affine_alignment.h"
#include "tracker/trail_flow.h"

namespace parallax {
namespace {

constexpr int kBorder_px = 8;         // of starting corners
constexpr float kMinScore = 12.0F;    // Shi-Tomasi, grey levels squared: below it is noise
constexpr int kLevel1Threshold = 10;  // FAST, where level 0 has too few corners
constexpr int kCells = 8;             // the image is cut into kCells x kCells to spread the corners
constexpr int kMinCoarseSide = 36;    // pixels: the coarsest level used is at least this large
constexpr int kMaxIterations = 10;
constexpr double kMaxShift_px = 3.0;  // from the start, at each level
constexpr float kMaxResidual = 8.0F;  // grey levels rms, or this part of the patch's contrast:
constexpr float kMaxResidualPart = 0.45F;

int coarsest_level(const ImagePyramid& pyramid) {
  int level = kPyramidLevels - 1;
  while (level > 0 && std::min(pyramid.width(), pyramid.height()) / (1 << level) < kMinCoarseSide) --level;
  return level;
}

float contrast(const AlignmentTemplate& t) {
  float sum = 0, squares = 0;
  for (const float v : t.intensity) {
    sum += v;
    squares += v * v;
  }
  return std::sqrt(std::max(0.0F, squares / kPatchPixels - sum * sum / (kPatchPixels * kPatchPixels)));
}

// Follows the patch around `from` in image `a` into image `b`, coarse to fine from `start`; false when level 0 fails.
bool follow(const ImagePyramid& a, const ImagePyramid& b, const Eigen::Vector2d& from, const Eigen::Vector2d& start,
            int coarse, Eigen::Vector2d* found) {
  Eigen::Vector2d estimate = start;
  AlignmentTemplate patch;
  for (int level = coarse; level >= 0; --level) {
    const auto l = static_cast<std::size_t>(level);
    if (!warp_alignment_template(a.level[l], level0_to_level(from, level), Eigen::Matrix2d::Identity(), &patch) ||
        !patch.valid) {
      if (level == 0) return false;
      continue;
    }
    const AlignmentResult r =
        align_patch(patch, b.level[l], level0_to_level(estimate, level), kMaxIterations, kMaxShift_px);
    const bool good = r.converged && r.rms_residual < std::max(kMaxResidual, kMaxResidualPart * contrast(patch));
    if (level == 0 && !good) return false;
    if (good) estimate = level_to_level0(r.position, level);
  }
  *found = estimate;
  return true;
}

struct Candidate {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  // level 0
  float score = 0;
};

// Takes corners best first, no two nearer than the distance, in two rounds: first with a quota for each cell of the
// image, then whatever is best.
class Selection {
 public:
  Selection(int width, int height, const TrailOptions& options)
      : width_(width),
        height_(height),
        options_(options),
        bin_(std::max(1.0, options.min_distance_px)),
        columns_(static_cast<int>(width / bin_) + 1),
        bins_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(static_cast<int>(height / bin_) + 1)),
        in_cell_(static_cast<std::size_t>(kCells * kCells), 0) {}

  void add(std::vector<Candidate> candidates, int quota) {
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Candidate& a, const Candidate& b) { return a.score > b.score; });
    for (const bool limited : {true, false}) {
      for (Candidate& c : candidates) {
        if (static_cast<int>(chosen_.size()) >= options_.max_trails) return;
        if (c.score < 0) continue;
        int& here = in_cell_[cell(c.position)];
        if ((limited && here >= quota) || !is_free(c.position)) continue;
        ++here;
        bins_[bin(c.position)].push_back(c.position);
        chosen_.push_back(c.position);
        c.score = -1;
      }
    }
  }
  const std::vector<Eigen::Vector2d>& chosen() const { return chosen_; }

 private:
  std::size_t cell(const Eigen::Vector2d& p) const {
    const int x = std::clamp(static_cast<int>(p.x() * kCells / width_), 0, kCells - 1);
    const int y = std::clamp(static_cast<int>(p.y() * kCells / height_), 0, kCells - 1);
    return static_cast<std::size_t>(y * kCells + x);
  }
  std::size_t bin(const Eigen::Vector2d& p) const {
    return static_cast<std::size_t>(static_cast<int>(p.y() / bin_) * columns_ + static_cast<int>(p.x() / bin_));
  }
  bool is_free(const Eigen::Vector2d& p) const {
    const int bx = static_cast<int>(p.x() / bin_), by = static_cast<int>(p.y() / bin_);
    const int rows = static_cast<int>(bins_.size()) / columns_;
    const double limit = options_.min_distance_px * options_.min_distance_px;
    for (int y = std::max(0, by - 1); y <= std::min(rows - 1, by + 1); ++y) {
      for (int x = std::max(0, bx - 1); x <= std::min(columns_ - 1, bx + 1); ++x) {
        for (const Eigen::Vector2d& q : bins_[static_cast<std::size_t>(y * columns_ + x)]) {
          if ((q - p).squaredNorm() < limit) return false;
        }
      }
    }
    return true;
  }

  int width_, height_;
  const TrailOptions& options_;
  double bin_;
  int columns_;
  std::vector<std::vector<Eigen::Vector2d>> bins_;
  std::vector<int> in_cell_;
  std::vector<Eigen::Vector2d> chosen_;
};

std::vector<Candidate> score_corners(const ImagePyramid& pyramid, int level, const CornerList& corners) {
  const GreyImage& image = pyramid.level[static_cast<std::size_t>(level)];
  std::vector<Candidate> out;
  for (const Corner& c : maximal_corners(image, corners)) {
    const Eigen::Vector2d p = level_to_level0(Eigen::Vector2d(c.x, c.y), level);
    if (p.x() < kBorder_px || p.y() < kBorder_px || p.x() >= pyramid.width() - kBorder_px ||
        p.y() >= pyramid.height() - kBorder_px) {
      continue;
    }
    const float score = shi_tomasi_score(image, c.x, c.y);
    if (score >= kMinScore) out.push_back({p, score});
  }
  return out;
}

}  // namespace

TrailTracker::TrailTracker(const TrailOptions& options) : options_(options) {}

void TrailTracker::clear() {
  first_.reset();
  last_.reset();
  trails_.clear();
  started_ = 0;
}

void TrailTracker::start(std::shared_ptr<const ImagePyramid> pyramid, const CornerList& level0_corners) {
  PARALLAX_CHECK(pyramid != nullptr && pyramid->width() > 0, "trails start from an image");
  clear();
  first_ = pyramid;
  last_ = std::move(pyramid);
  const int quota = std::max(1, 2 * options_.max_trails / (kCells * kCells));
  Selection selection(first_->width(), first_->height(), options_);
  selection.add(score_corners(*first_, 0, level0_corners), quota);
  if (static_cast<int>(selection.chosen().size()) < options_.max_trails && first_->level[1].cols > 2 * kBorder_px &&
      first_->level[1].rows > 2 * kBorder_px) {
    CornerList level1;
    fast_corners(first_->level[1], kLevel1Threshold, &level1);
    selection.add(score_corners(*first_, 1, level1), quota);
  }
  for (const Eigen::Vector2d& p : selection.chosen()) {
    trails_.push_back({p, p, static_cast<int>(trails_.size())});
  }
  started_ = static_cast<int>(trails_.size());
}

void TrailTracker::track(std::shared_ptr<const ImagePyramid> pyramid, const Eigen::Vector2d& predicted_shift) {
  PARALLAX_CHECK(active(), "trails are tracked after start()");
  PARALLAX_CHECK(pyramid != nullptr && pyramid->level[0].size() == last_->level[0].size(),
                 "trails are tracked in images of one size");
  const int coarse = coarsest_level(*pyramid);
  const ImageFlow flow = estimate_flow(*last_, *pyramid, trails_, coarse, predicted_shift, options_.search_radius_px);
  const double back_limit = options_.max_back_error_px * options_.max_back_error_px;
  std::size_t kept = 0;
  for (const Trail& trail : trails_) {
    const Eigen::Vector2d start = flow(trail.current);
    Eigen::Vector2d found, back;
    bool good = false;
    // Large windows see other surfaces and occluders too: a trail that fails gets a second chance from level 1.
    for (const int level : {coarse, 1}) {
      if (level == 1 && coarse <= 1 && good) break;
      good = follow(*last_, *pyramid, trail.current, start, level, &found) &&
             follow(*pyramid, *last_, found, Eigen::Vector2d(found - start + trail.current), level, &back) &&
             (back - trail.current).squaredNorm() <= back_limit;
      if (good) break;
    }
    if (good) {
      Trail& keep = trails_[kept++];
      keep = trail;
      keep.current = found;
    }
  }
  trails_.resize(kept);
  last_ = std::move(pyramid);
}

std::vector<Trail> TrailTracker::refined() const {
  constexpr double kMaxCorrection_px = 3.0;  // from the track
  constexpr double kMinCorrelation = 0.8;    // of the first and the current window
  constexpr double kMaxAffineMove_px = 1.0;  // what the affine stage may move the translation's result
  constexpr double kMaxLinearChange = 0.25;  // ... and the linear part
  constexpr int kIterations = 15;
  std::vector<Trail> out;
  if (!active() || trails_.empty()) return out;
  const cv::Mat1f first = smooth_for_alignment(first_->level[0]);
  const cv::Mat1f current = smooth_for_alignment(last_->level[0]);
  const std::vector<Eigen::Matrix2d> linear = local_linear_motion(trails_);
  AffineTemplate window;
  for (std::size_t i = 0; i < trails_.size(); ++i) {
    const Trail& trail = trails_[i];
    if (!window.prepare(first, trail.first)) continue;
    AffineTemplate::Result best = window.align(current, trail.current, linear[i], false, kIterations);
    const Eigen::Vector2d start = best.converged ? best.position : trail.current;
    const AffineTemplate::Result affine = window.align(current, start, linear[i], true, kIterations);
    if (affine.converged && (affine.position - start).norm() < kMaxAffineMove_px &&
        (affine.linear - linear[i]).norm() < kMaxLinearChange && affine.correlation >= best.correlation) {
      best = affine;
    }
    if (!best.converged || best.correlation < kMinCorrelation ||
        (best.position - trail.current).norm() > kMaxCorrection_px) {
      continue;
    }
    out.push_back(trail);
    out.back().current = best.position;
  }
  return out;
}

}  // namespace parallax
