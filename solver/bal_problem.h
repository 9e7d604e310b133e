// "Bundle adjustment in the large" problems (Agarwal et al., ECCV 2010): Snavely's camera, angle-axis rotation,
// translation, focal length and two radial distortion coefficients, all adjusted together with the points. The camera
// looks along -z: p = -P / P.z, pixel = f (1 + k1 |p|^2 + k2 |p|^4) p.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "core/interruption.h"
#include "solver/bundle_adjustment.h"

namespace parallax {

struct BalProblem {
  std::vector<std::array<double, 9>> cameras;   // rotation vector, translation, f, k1, k2
  std::vector<Eigen::Vector3d> points;          // world
  std::vector<BundleObservation> observations;  // pose: index into cameras; pixels from the image centre, y up
};

// Reads the text format: counts, observations (camera, point, x, y), nine values a camera, three a point. `name` is
// used in messages. Throws InputError with the line for anything missing, superfluous, out of range or not finite.
BalProblem parse_bal(const std::string& text, const std::string& name);
std::string format_bal(const BalProblem& problem);

// Adjusts every camera and point in place; options, stopping and summary as for adjust_bundle().
BundleSummary adjust_bal(BalProblem* problem, const BundleOptions& options, const Interruption& stop = {},
                         std::vector<std::uint8_t>* outlier = nullptr);

}  // namespace parallax
