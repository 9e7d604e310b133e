// Two-stage coarse-to-fine tracking of the map in one frame, from a prior pose (PTAM §5, §5.5).
#pragma once

#include <array>
#include <vector>

#include "map/tracking_snapshot.h"
#include "solver/pose_refinement.h"
#include "tracker/patch_search.h"
#include "tracker/projection.h"
#include "tracker/tracker_options.h"
#include "tracker/tracking_types.h"

namespace parallax {

struct TwoStageRequest {
  RigidTransform prior;          // camera_from_world
  bool coarse = true;            // run the coarse stage
  bool needs_coarse = false;     // the prior is a guess: where the coarse stage finds no pose, it ends (not ok)
  double coarse_radius_px = 30;  // level 0
  double fine_radius_px = 8;
  // A first look at a guess: so many points in both stages together, and only at corners. 0: as the options say.
  int first_look_points = 0;
  // By row of the snapshot's keyframes, where given: points of those that hold 1 are only probed, one in
  // kProbedOne, and neither count nor move the pose (tracker/source_trust.h).
  const std::vector<std::uint8_t>* out_of_place = nullptr;
  int turn = 0;  // which of them: another one next time
};

// Of a source that is out of place, one point in so many is looked for.
inline constexpr int kProbedOne = 8;

struct MatchedPoint {
  std::int32_t row = 0;  // in the snapshot
  std::int8_t level = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  // level 0
  double sigma_px = 1;
  float weight = 0;  // Tukey weight at the end: 0 is an outlier
};

// A point of a source that is out of place.
struct ProbedPoint {
  std::int32_t row = 0;
  bool found = false, agrees = false;  // with the pose
};

struct TwoStageResult {
  bool ok = false;  // a pose could be computed; its quality is another matter
  RigidTransform camera_from_world;
  std::vector<MatchedPoint> matches;
  std::vector<Candidate> missed;  // searched, not found
  std::vector<ProbedPoint> probed;
  std::array<int, kPyramidLevels> attempted{}, found{};
  bool coarse_used = false;
  double sigma = 0;
  int inliers = 0;
  Matrix6d covariance = Matrix6d::Zero();  // of the left increment
  TrackingTimes times;                     // projection, search, pose
};

// Not thread-safe (scratch arrays, template cache); belongs to the tracking thread.
class TwoStageTracker {
 public:
  TwoStageTracker(const CameraModel& camera, const TrackerOptions& options);

  void track(const TrackingSnapshot& map, const FrameImages& frame, const TwoStageRequest& request,
             TwoStageResult* out);

  void clear_cache() { search_.clear(); }

 private:
  bool coarse_stage(const TrackingSnapshot& map, const FrameImages& frame, double radius_px, TwoStageResult* out);
  void fine_stage(const TrackingSnapshot& map, const FrameImages& frame, double radius_px, int first_look_points,
                  TwoStageResult* out);
  void try_candidate(const TrackingSnapshot& map, const FrameImages& frame, const Candidate& candidate,
                     double radius_px, bool align_directly, TwoStageResult* out);
  void refine(const TrackingSnapshot& map, TwoStageResult* out);
  void set_aside(const TrackingSnapshot& map, const TwoStageRequest& request);
  void probe(const TrackingSnapshot& map, const FrameImages& frame, double radius_px, TwoStageResult* out);

  CameraModel camera_;
  TrackerOptions options_;
  MapProjector projector_;
  PatchSearch search_;
  std::vector<Candidate> candidates_, to_probe_;
  std::vector<std::uint8_t> tried_;  // per row: searched in the coarse stage
  std::vector<int> chosen_;
  std::vector<PoseObservation> observations_;
  std::vector<float> weights_;
};

}  // namespace parallax
