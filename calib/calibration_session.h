// Calibrating live: frames go in one after another, and views are taken by themselves when the target is still, sharp
// and somewhere new. Says what is covered, which view is wanted next, and when there is enough.
//
// Pixels: level 0. Step functions without threads: the caller decides where they run (detection takes some 5 to 50 ms,
// so not in the drawing thread). One thread at a time; copies of what the getters return may go anywhere.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "calib/camera_calibration.h"
#include "calib/model_selection.h"
#include "calib/projection_uncertainty.h"
#include "calib/target.h"
#include "calib/target_detection.h"
#include "core/image.h"
#include "core/time.h"

namespace parallax {

struct CalibrationSessionOptions {
  int cell_columns = 6, cell_rows = 4;  // the image is divided into so many cells for its coverage
  int fewest_views = 10, most_views = 40;
  double covered_share = 0.8;          // of the cells, for enough
  double still_share = 0.003;          // of the image width: corners move less than this from frame to frame
  double sharp_edge_px = 5;            // at 640 pixels of width; wider edges are blurred
  double new_distance = 0.18;          // from every earlier view: place and size in image widths, angles in radians
  double tilt_rad = 0.26;              // a view is tilted from here on (15 degrees)
  double enough_uncertainty_px = 1.0;  // largest projection uncertainty over the image, at 640 pixels of width
  double enough_noise_px = 1.0;        // of the residuals, at 640 pixels of width
  void validate() const;               // InputError
};

enum class BoardTilt { facing, left, right, top, bottom };  // which edge is nearer to the camera

struct CalibrationCoverage {
  int columns = 0, rows = 0;
  std::vector<int> cells;             // corners seen in each, row by row
  std::array<int, 5> tilts{};         // views by BoardTilt
  int near_views = 0, far_views = 0;  // the target spans more than half, less than a third of the image's width
  int views = 0;
  int covered_cells() const;
  double covered_share() const;
};

// The view that would help most: in plain words, with the outline of the target where it should be.
struct WantedView {
  std::string text;                         // "Tilt the board: bring its left edge nearer"
  std::vector<Eigen::Vector2d> outline_px;  // closed polygon, bent as the lens bends it; may leave the image
  std::vector<Eigen::Vector2d> inner_px;    // the points of the target in that view
};

enum class FrameVerdict { no_target, moving, blurred, seen_before, kept, full };

struct CalibrationFrameResult {
  FrameVerdict verdict = FrameVerdict::no_target;
  std::string text;  // for the user: "hold still", "kept view 7"...
  std::optional<TargetDetection> detection;
};

// Whether a calibration is good for use, and what is missing when not. `missing` holds plain sentences.
struct CalibrationJudgement {
  bool enough = false;
  std::vector<std::string> missing;
};

class CalibrationSession {
 public:
  // Throws InputError for a target or options that make no sense.
  CalibrationSession(const CalibrationTarget& target, int width, int height,
                     const CalibrationSessionOptions& options = {});

  // Looks at one frame. `frame_index` is kept with the view. The image is not kept.
  CalibrationFrameResult add_frame(const GreyImage& grey, int frame_index);
  // The same for a detection made elsewhere (images on disk): no test of stillness.
  CalibrationFrameResult add_detection(const TargetDetection& detection, int frame_index);

  const CalibrationData& data() const { return data_; }  // what run_calibration wants: copy it for another thread
  const CalibrationCoverage& coverage() const { return coverage_; }
  WantedView wanted_view() const;
  // 0 to 1, by views, cells and tilts; 1: a calibration is worth while (the judgement may still ask for more).
  double progress() const;
  bool ready() const { return progress() >= 1; }

  // A better lens for tilts and outlines, such as from a calibration run in between. Until then a rough guess is made
  // from the views themselves.
  void set_estimate(const CameraModel& camera);

  // Takes the last view away; false when there is none.
  bool drop_last_view();

  CalibrationJudgement judge(const CalibrationOutcome& outcome) const;

 private:
  struct ViewPlace {
    Eigen::Vector2d centre = Eigen::Vector2d::Zero();  // in image widths
    double size = 0;                                   // root of the area, in image widths
    Eigen::Vector2d tilt = Eigen::Vector2d::Zero();    // of the target's normal: x and y
    double roll = 0;
  };
  ViewPlace place_of(const TargetDetection& detection) const;
  bool is_still(const TargetDetection& detection) const;
  bool is_new(const TargetDetection& detection, const ViewPlace& place) const;
  CalibrationFrameResult consider(const TargetDetection& detection, int frame_index);
  void keep(const TargetDetection& detection, const ViewPlace& place, int frame_index);
  void count_coverage();
  WantedView view_at(const std::string& text, const Eigen::Vector2d& centre_px, double size, BoardTilt tilt) const;

  CalibrationTarget target_;
  CalibrationSessionOptions options_;
  std::vector<Eigen::Vector3d> points_;
  CalibrationData data_;
  std::vector<ViewPlace> places_;
  CalibrationCoverage coverage_;
  CameraModel estimate_;
  bool estimate_given_ = false;
  std::optional<TargetDetection> previous_;
};

// The same judgement for images on disk.
CalibrationJudgement judge_calibration(const CalibrationCoverage& coverage, const CalibrationOutcome& outcome,
                                       const CalibrationSessionOptions& options = {});
// What views cover; `camera`: for the tilts.
CalibrationCoverage measure_coverage(const CalibrationData& data, const CameraModel& camera,
                                     const CalibrationSessionOptions& options = {});

}  // namespace parallax
