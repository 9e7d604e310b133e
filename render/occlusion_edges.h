// Pulls the outlines of a depth image to the edges of the camera's image. What the map knows of a thing ends a few
// pixels beside its true rim, evenly along the rim; the image shows where. Every place of an outline asks how strong an
// edge is at each distance from it, along its normal; neighbours along the outline are asked together, so that texture
// on one side does not decide; and the outline moves to the best distance.
//
// Depth along the camera's z, metres; both images as wide as the depth image. No state; any thread.
#pragma once

#include <opencv2/core/mat.hpp>

namespace parallax {

struct OcclusionEdgeOptions {
  double reach = 3;          // how far an outline may move, pixels of the depth image; 0: not at all
  double least_jump = 0.01;  // of the depth at an outline, as a share of it: what is less is one surface
  double noise = 30;         // slope of the image, grey levels a pixel: of this an edge is worth half of the most
  int together = 3;          // pixels to each side along an outline that are asked together
  double stay = 0.6;         // what moving by the whole reach costs; the strongest edge is worth 1
  void validate() const;     // throws InputError
};

// `grey`: the camera's image, resampled to the depth image's size. `inverse_ground`: one over the depth of the plane
// that is seen where nothing stands on it (where `depth` is 0), 1/m; 0 over the horizon.
void align_to_edges(const cv::Mat1f& grey, const cv::Mat1f& inverse_ground, const OcclusionEdgeOptions& options,
                    cv::Mat1f* depth);

}  // namespace parallax
