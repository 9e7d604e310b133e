// Whether two scenes show one place, and from where (MS §4.2): matched features, the three-point algorithm in RANSAC on
// the 3D points of one scene and the measurements of the other, refined on the residuals of both images, with
// covariance. Then all that should be seen if it were so is looked for: a place that only shares a repeated structure
// (bricks, doors that are alike) with another does not show what it should.
//
// Frames: those of the left cameras; `found_from_query` takes a point in the query's frame to that of the scene found.
// Metres, level-0 pixels of rectified pairs. Plain functions, safe from any thread; deterministic for a given state of
// the generator. A place that is not recognised is a reason in words, never an error.
#pragma once

#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/se3.h"
#include "core/stereo_camera.h"
#include "place/stereo_scene.h"

namespace parallax {

struct LoopGeometryOptions {
  int max_distance = 70;             // bits of 256 of mutual nearest descriptors...
  double ratio = 0.9;                // ... nearest to second nearest
  int guided_distance = 80;          // the same where geometry says where to look
  double guided_px = 4;              // how far from there, pixels of the feature's level
  double sigma_px = 0.6;             // standard deviation of a feature's place, pixels of its level
  double disparity_sigma_px = 0.25;  // of a feature's disparity, pixels of its level
  int max_hypotheses = 300;          // of RANSAC
  double inlier_sigmas = 3.5;        // that a match agrees within
  // Of the matches before geometry that must agree with it. Six parameters are fitted to three matches; among 60 wrong
  // matches the best of 300 hypotheses finds some 6 to 8 that agree by chance, so 12 after it is beyond chance.
  int min_first_inliers = 10;
  double min_first_share = 0.2;
  // After what should be seen has been looked for.
  int min_inliers = 20;
  double min_seen_share = 0.2;  // of the near features that the other camera should see
  int min_cells = 5;            // of the 16 parts of either image that have inliers
  // Parts of either image in which many features of the other should be seen and next to none is (posters, shelves,
  // furniture that are others): a corridor whose floor, ceiling and doors repeat shows a quarter of what it should from
  // every door, but not everywhere.
  double max_silent_share = 0.2;
  // A second pose that explains this part of the matches, without those of the first, is a rival: repeated structure.
  double max_rival = 0.6;
  // The two directions (points of the one in the images of the other) agree to so many of their standard deviations.
  double max_disagreement = 4;
  // Matching errors that all features share, and what the camera's calibration is off by: added to the covariance.
  double floor_m = 0.003, floor_rad = 0.0005;
  double max_sigma_m = 0.25, max_sigma_rad = 0.05;  // less well known is not accepted

  void validate() const;  // throws InputError naming the field
};

struct LoopGeometry {
  std::string refused;  // why not; empty: accepted
  int matches = 0;      // before geometry, of near features of the query
  int first_inliers = 0;
  int inliers = 0;          // after all that should be seen has been looked for
  double seen_share = 0;    // inliers to near features that should be seen
  double silent_share = 0;  // of the parts of both images that should show something known, and do not
  int cells = 0;
  int rival = 0;  // matches that agree with another pose
  RigidTransform found_from_query;
  Matrix6d covariance = Matrix6d::Zero();  // of a left increment of found_from_query, translation first
  std::vector<std::pair<int, int>> pairs;  // inliers: row of the query's features, of the found scene's

  bool accepted() const { return refused.empty(); }
};

// `associations`: pairs (row of the query's features, of the found scene's) that are matched already (CRF-Matching);
// those by descriptor alone are added to them. Scenes are complete.
LoopGeometry check_loop_geometry(const StereoCamera& query_camera, const StereoScene& query,
                                 const StereoCamera& found_camera, const StereoScene& found,
                                 std::span<const std::pair<int, int>> associations, const LoopGeometryOptions& options,
                                 std::mt19937_64* rng);

}  // namespace parallax
