// How far an estimated trajectory is from the truth: association by time, alignment, absolute trajectory error (ATE)
// and relative pose error (RPE), as in Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems" (IROS
// 2012), with the conventions of the usual public tool, so that figures can be compared to the sixth decimal.
//
// Poses are camera to world. Units: metres (or the file's own), degrees for rotations, seconds. Plain functions, safe
// on any thread. Bad input (nothing in common, a path along one line) throws InputError.
#pragma once

#include <string>
#include <vector>

#include "core/se3.h"
#include "core/trajectory.h"

namespace parallax {

// Statistics of a list of errors; all zero when there is none. The deviation is that of the population.
struct ErrorStatistics {
  int count = 0;
  double rmse = 0, mean = 0, median = 0, deviation = 0, min = 0, max = 0;
};
ErrorStatistics summarise_errors(const std::vector<double>& errors);

// An estimated pose and the true pose it belongs to, as indices.
struct PoseMatch {
  int estimate = -1;
  int truth = -1;
};

// Every pose of the shorter trajectory takes the nearest in time of the longer one, when that is at most
// `max_difference_s` away (of two equally near the earlier). A pose that several took stays with the nearest of them:
// one to one. In order of time.
std::vector<PoseMatch> associate_by_time(const Trajectory& estimate, const Trajectory& truth, double max_difference_s);

// Line by line; the trajectories must be equally long.
std::vector<PoseMatch> associate_by_line(const Trajectory& estimate, const Trajectory& truth);

enum class Alignment { none, se3, sim3 };

// The transform from the estimate's world to the truth's that minimises the squared distances of the matched positions
// (Umeyama 1991). Throws InputError when there are fewer than 3 matches, or all positions lie on one line.
SimilarityTransform find_alignment(const Trajectory& estimate, const Trajectory& truth,
                                   const std::vector<PoseMatch>& matches, Alignment alignment);

// Every pose of the trajectory, in the truth's world.
Trajectory transform_trajectory(const Trajectory& trajectory, const SimilarityTransform& new_from_old);

// One error a match: distance of the positions, and the angle (degrees) of the rotation between the two poses.
std::vector<double> position_errors(const Trajectory& aligned, const Trajectory& truth,
                                    const std::vector<PoseMatch>& matches);
std::vector<double> rotation_errors_deg(const Trajectory& aligned, const Trajectory& truth,
                                        const std::vector<PoseMatch>& matches);

// Which pairs of poses the relative error compares.
struct RelativePairOptions {
  double delta = 1;        // distance between the two poses of a pair, in frames or metres
  bool in_metres = false;  // metres of path (of the estimate, as the public tool does by default), or matched frames
  bool all_pairs = false;  // a pair from every pose, or one after the other without overlap
  double tolerance = 0.1;  // metres and all_pairs only: a path may miss delta by this part of it

  // Throws InputError when a value makes no sense.
  void validate() const;
};

// Indices into `path`, first < second. Without overlap and in metres, the path is added up until it reaches delta; the
// pairs are the consecutive places where it did.
struct IndexPair {
  int first = 0, second = 0;
};
std::vector<IndexPair> relative_pairs(const Trajectory& path, const RelativePairOptions& options);

// Errors of the motions over the pairs: translation (metres) and rotation (degrees).
struct RelativeErrors {
  std::vector<double> translation, rotation_deg;
};
RelativeErrors relative_errors(const Trajectory& aligned, const Trajectory& truth,
                               const std::vector<PoseMatch>& matches, const RelativePairOptions& options);

// How many frames the recording had between the first and the last true pose: the number of true poses, or, when the
// truth was taken at a clearly higher rate than the estimate, its duration in intervals of the estimate.
int expected_frames(const Trajectory& estimate, const Trajectory& truth);

// Everything at once.
struct TrajectoryErrorOptions {
  Alignment alignment = Alignment::sim3;
  double max_time_difference_s = 0.01;
  bool match_by_line = false;  // the files carry no times
  int frames = -1;             // frames of the recording, for the tracked fraction; -1: expected_frames()
  RelativePairOptions relative;

  void validate() const;
};

struct TrajectoryError {
  std::vector<PoseMatch> matches;
  Trajectory aligned;                       // the whole estimate in the truth's world
  SimilarityTransform truth_from_estimate;  // what the alignment found
  // The truth's size over the estimate's, from a similarity alignment whatever alignment was asked for; 0 when the path
  // does not determine it.
  double scale = 0;
  double scale_error = 0;  // estimate / truth - 1
  int frames = 0;          // of the recording
  double tracked_fraction = 0;
  std::vector<double> position, rotation_deg;  // one a match
  RelativeErrors relative;
};

TrajectoryError evaluate_trajectory(const Trajectory& estimate, const Trajectory& truth,
                                    const TrajectoryErrorOptions& options);

}  // namespace parallax
