#include "tracker/stereo_check.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/check.h"
#include "core/error.h"
#include "core/fast.h"
#include "core/patch.h"

namespace parallax {
namespace {

constexpr double kLeastScore = 3;          // Shi-Tomasi, grey levels squared, at half size
constexpr double kLargestResidual = 0.35;  // of the patch's variance: a correlation of 0.8 and more
constexpr double kUniqueness = 0.7;        // the best place against any other
constexpr int kApart = 2;                  // pixels of half size that make another place
constexpr double kBackwardsPx = 1.5;       // to the wrong side of infinity
constexpr double kLeastShareMatched = 0.15;
constexpr double kBlankShare = 0.02;     // an image with less texture than this is blank
constexpr double kTexturedShare = 0.1;   // one that could be matched has more
constexpr double kSameGrey = 0.1;        // mean difference in grey levels: two sensors' noise is more
constexpr double kMostBackwards = 0.75;  // of all that were found: swapped

GreyImage half_size(const GreyImage& image) {
  GreyImage half;
  cv::resize(image, half, {image.cols / 2, image.rows / 2}, 0, 0, cv::INTER_AREA);
  return half;
}

double texture_share(const GreyImage& half, double least_contrast) {
  int textured = 0, blocks = 0;
  PatchTemplate block;
  for (int y = 4; y + 4 <= half.rows; y += kPatchSize) {
    for (int x = 4; x + 4 <= half.cols; x += kPatchSize) {
      if (!copy_patch(half, x, y, &block)) continue;
      ++blocks;
      const double variance =
          (block.sum_squares - static_cast<double>(block.sum) * block.sum / kPatchPixels) / kPatchPixels;
      textured += variance >= least_contrast * least_contrast;
    }
  }
  return blocks > 0 ? static_cast<double>(textured) / blocks : 0;
}

// The best corner of each of so many cells.
std::vector<cv::Point> corners_of(const GreyImage& half, int wanted) {
  constexpr int border = 6;
  std::vector<cv::Point> corners;
  if (half.cols <= 4 * border || half.rows <= 4 * border) return corners;
  cv::Mat1f score;
  cv::cornerMinEigenVal(half, score, 5, 3);
  const double side = std::sqrt(static_cast<double>(half.cols) * half.rows / wanted);
  const int columns = std::max(1, static_cast<int>(half.cols / side)),
            rows = std::max(1, static_cast<int>(half.rows / side));
  const int width = half.cols - 2 * border, height = half.rows - 2 * border;
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      const cv::Rect cell(cv::Point(border + j * width / columns, border + i * height / rows),
                          cv::Point(border + (j + 1) * width / columns, border + (i + 1) * height / rows));
      cv::Point best;
      cv::minMaxLoc(score(cell), nullptr, nullptr, nullptr, &best);
      best += cell.tl();
      if (shi_tomasi_score(half, best.x, best.y) >= kLeastScore) corners.push_back(best);
    }
  }
  return corners;
}

double variance_sum(const PatchTemplate& t) {
  return t.sum_squares - static_cast<double>(t.sum) * t.sum / kPatchPixels;
}

struct Match {
  double disparity_px, rows_px;  // left x - right x, right y - left y; level 0
};

class PairSearch {
 public:
  PairSearch(const GreyImage& left, const GreyImage& right, const StereoCheckOptions& options)
      : left_(left), right_(right), left_half_(half_size(left)), right_half_(half_size(right)), options_(options) {}

  const GreyImage& left_half() const { return left_half_; }
  const GreyImage& right_half() const { return right_half_; }

  std::optional<Match> find(cv::Point corner) {
    PatchTemplate patch;
    if (!copy_patch(left_half_, corner.x, corner.y, &patch)) return std::nullopt;
    const double variance = variance_sum(patch);
    if (variance < kPatchPixels * options_.least_contrast * options_.least_contrast) return std::nullopt;
    const int reach = static_cast<int>(options_.largest_disparity * left_half_.cols);
    const int x0 = std::max(4, corner.x - reach), x1 = std::min(right_half_.cols - 4, corner.x + reach);
    const int rows = options_.rows_px / 2;
    const int y0 = std::max(4, corner.y - rows), y1 = std::min(right_half_.rows - 4, corner.y + rows);
    const int width = x1 - x0 + 1, height = y1 - y0 + 1;
    if (width < 1 || height < 1) return std::nullopt;
    scores_.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    for (int y = y0, i = 0; y <= y1; ++y)
      for (int x = x0; x <= x1; ++x, ++i) scores_[static_cast<std::size_t>(i)] = zmssd(patch, right_half_, x, y);
    const int best = static_cast<int>(std::min_element(scores_.begin(), scores_.end()) - scores_.begin());
    const int best_x = best % width, best_y = best / width, lowest = scores_[static_cast<std::size_t>(best)];
    if (lowest > kLargestResidual * variance) return std::nullopt;
    int second = INT32_MAX;
    for (int y = 0, i = 0; y < height; ++y)
      for (int x = 0; x < width; ++x, ++i)
        if (std::abs(x - best_x) > kApart || std::abs(y - best_y) > kApart)
          second = std::min(second, scores_[static_cast<std::size_t>(i)]);
    if (lowest > kUniqueness * second) return std::nullopt;
    return refine(2 * corner, cv::Point(2 * (x0 + best_x), 2 * (y0 + best_y)));
  }

 private:
  // At full size, about a place of half size; rows between pixels.
  std::optional<Match> refine(cv::Point from, cv::Point guess) const {
    PatchTemplate patch;
    if (!copy_patch(left_, from.x, from.y, &patch)) return std::nullopt;
    constexpr int reach = 3;
    if (guess.x < 4 + reach || guess.y < 4 + reach + 1 || guess.x + 4 + reach > right_.cols ||
        guess.y + 4 + reach + 1 > right_.rows)
      return std::nullopt;
    int lowest = INT32_MAX;
    cv::Point best;
    for (int dy = -reach; dy <= reach; ++dy) {
      for (int dx = -reach; dx <= reach; ++dx) {
        const int score = zmssd(patch, right_, guess.x + dx, guess.y + dy);
        if (score >= lowest) continue;
        lowest = score;
        best = {guess.x + dx, guess.y + dy};
      }
    }
    if (lowest > 1.5 * kLargestResidual * variance_sum(patch)) return std::nullopt;
    const double above = zmssd(patch, right_, best.x, best.y - 1), below = zmssd(patch, right_, best.x, best.y + 1);
    const double bend = above - 2.0 * lowest + below;
    const double part = bend > 0 ? std::clamp(0.5 * (above - below) / bend, -0.5, 0.5) : 0;
    return Match{static_cast<double>(from.x - best.x), best.y + part - from.y};
  }

  const GreyImage &left_, &right_;
  GreyImage left_half_, right_half_;
  const StereoCheckOptions& options_;
  std::vector<int> scores_;
};

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

template <typename... Values>
std::string line(const char* format, Values... values) {
  char text[256];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

void judge(const StereoCheckOptions& options, bool same, StereoVerdict* v) {
  const auto say = [v](StereoProblem problem, std::string text) {
    v->problem = problem;
    v->text = std::move(text);
  };
  const double left = 100 * v->left_texture, right = 100 * v->right_texture;
  const bool blank = std::max(v->left_texture, v->right_texture) < kTexturedShare;
  if (!blank && v->left_texture < options.covered_share * v->right_texture)
    return say(
        StereoProblem::left_covered,
        line("the left camera sees next to nothing (texture in %.0f %% of its image, %.0f %% of the right one's): "
             "is its lens covered?",
             left, right));
  if (!blank && v->right_texture < options.covered_share * v->left_texture)
    return say(
        StereoProblem::right_covered,
        line("the right camera sees next to nothing (texture in %.0f %% of its image, %.0f %% of the left one's): "
             "is its lens covered?",
             right, left));
  if (v->corners < options.least_matches || std::max(v->left_texture, v->right_texture) < kBlankShare)
    return say(StereoProblem::too_little_texture,
               "both cameras see next to nothing to hold on to: a blank wall, or darkness");
  if (same)
    return say(StereoProblem::one_image,
               "the left and the right image are one and the same: is one camera given twice?");
  const int found = v->matched + v->matched_backwards;
  if (found < options.least_matches || found < kLeastShareMatched * v->corners) {
    if (blank)
      return say(StereoProblem::too_little_texture,
                 "the cameras see too little to hold on to: a blank wall, or darkness");
    return say(
        StereoProblem::unrelated,
        line("hardly anything of the left image is found in the right one (%d of %d corners): are they of one rig, "
             "and of one moment?",
             found, v->corners));
  }
  const bool backwards = v->matched_backwards > kMostBackwards * found;
  if (v->row_spread_px > options.row_spread_px)
    return say(
        StereoProblem::unsynchronised,
        line("the rows of the two images do not agree (they differ by %.1f px here and there): the images are not of "
             "one moment%s, or the calibration is not this rig's",
             v->row_spread_px, backwards ? ", or swapped" : ""));
  if (backwards)
    return say(StereoProblem::swapped,
               line("the left and the right image seem to be swapped: %d of %d corners are found on the wrong side",
                    v->matched_backwards, found));
  if (std::abs(v->row_offset_px) > options.row_offset_px)
    return say(
        StereoProblem::rows_apart,
        line("the rows of the two images are %.1f px apart: the calibration is not this rig's, or the images are not "
             "of one moment",
             std::abs(v->row_offset_px)));
}

}  // namespace

void StereoCheckOptions::validate() const {
  const auto need = [](bool good, const char* field, const char* expected) {
    if (!good) throw InputError(std::string("stereo check: ") + field + ": expected " + expected);
  };
  need(corners >= 20 && corners <= 2000, "corners", "20 to 2000");
  need(largest_disparity > 0 && largest_disparity <= 1, "largest_disparity", "more than 0, at most 1");
  need(rows_px >= 2 && rows_px <= 64, "rows_px", "2 to 64");
  need(least_contrast > 0 && least_contrast < 128, "least_contrast", "more than 0, less than 128");
  need(least_matches >= 5, "least_matches", "5 or more");
  need(row_offset_px > 0 && row_spread_px > 0, "row_offset_px, row_spread_px", "more than 0");
  need(covered_share > 0 && covered_share < 1, "covered_share", "more than 0, less than 1");
  need(confirmations >= 1 && interval >= 1 && interval_in_trouble >= 1, "confirmations, interval, interval_in_trouble",
       "1 or more");
}

const char* to_string(StereoProblem problem) {
  switch (problem) {
    case StereoProblem::none:
      return "none";
    case StereoProblem::too_little_texture:
      return "too little texture";
    case StereoProblem::left_covered:
      return "left covered";
    case StereoProblem::right_covered:
      return "right covered";
    case StereoProblem::swapped:
      return "swapped";
    case StereoProblem::rows_apart:
      return "rows apart";
    case StereoProblem::unsynchronised:
      return "unsynchronised";
    case StereoProblem::unrelated:
      return "unrelated";
    case StereoProblem::one_image:
      return "one image";
  }
  return "unknown";
}

StereoVerdict check_stereo_pair(const GreyImage& left, const GreyImage& right, const StereoCheckOptions& options) {
  PARALLAX_CHECK(!left.empty() && left.size() == right.size(), "a pair of images of one size");
  PairSearch search(left, right, options);
  StereoVerdict verdict;
  verdict.left_texture = texture_share(search.left_half(), options.least_contrast);
  verdict.right_texture = texture_share(search.right_half(), options.least_contrast);
  std::vector<double> rows;
  for (const cv::Point& corner : corners_of(search.left_half(), options.corners)) {
    ++verdict.corners;
    const auto match = search.find(corner);
    if (!match) continue;
    ++(match->disparity_px < -kBackwardsPx ? verdict.matched_backwards : verdict.matched);
    rows.push_back(match->rows_px);
  }
  if (!rows.empty()) {
    verdict.row_offset_px = median(rows);
    for (double& row : rows) row = std::abs(row - verdict.row_offset_px);
    verdict.row_spread_px = 1.4826 * median(rows);
  }
  const double difference = cv::norm(left, right, cv::NORM_L1) / static_cast<double>(left.total());
  judge(options, difference < kSameGrey, &verdict);
  return verdict;
}

StereoWatch::StereoWatch(const StereoCheckOptions& options) : options_(options) { options_.validate(); }

std::optional<StereoVerdict> StereoWatch::look(const GreyImage& left, const GreyImage& right) {
  if (wait_ > 0) {
    --wait_;
    return std::nullopt;
  }
  StereoVerdict verdict = check_stereo_pair(left, right, options_);
  ++looks_;
  agreeing_ = verdict.problem == last_ ? agreeing_ + 1 : 1;
  last_ = verdict.problem;
  const bool sure = agreeing_ >= options_.confirmations;
  if (sure) wait_ = (last_ == StereoProblem::none ? options_.interval : options_.interval_in_trouble) - 1;
  if (!sure || last_ == told_) return std::nullopt;
  told_ = last_;
  return verdict;
}

}  // namespace parallax
