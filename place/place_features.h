// What a place is recognised by: corners of an image, spread over it and over the pyramid, with rotated binary
// descriptors (core/binary_descriptor.h).
//
// Plain functions, safe from any thread.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/binary_descriptor.h"
#include "core/image.h"

namespace parallax {

struct PlaceFeature {
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();  // level 0
  int level = 0;
  BinaryDescriptor descriptor;
};

struct PlaceFeatureOptions {
  int count = 600;         // at most
  int fast_threshold = 8;  // grey levels
  int cell_px = 40;        // level-0 pixels: the best corners of every square come first
};

// Maximal FAST corners by Shi-Tomasi score, the best of each square in turn, in a fixed order.
std::vector<PlaceFeature> extract_place_features(const ImagePyramid& pyramid, const PlaceFeatureOptions& options = {});

std::vector<BinaryDescriptor> descriptors_of(const std::vector<PlaceFeature>& features);

}  // namespace parallax
