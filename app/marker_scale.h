// The scale of the map: from a printed ArUco marker of known side seen in several keyframes (or lying on the plane and
// seen in one image), or from two points and their distance. A map from one camera has none of its own (PTAM §6.1).
//
// Pure functions; thread-safe. Frames: world as it is now, in map metres; the factor is what the world is to be
// multiplied by to be in true metres (ScaleEdit::factor).
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "core/image.h"
#include "map/tracking_snapshot.h"

namespace parallax {

struct MarkerOptions {
  double side_m = 0.05;              // of the printed black square, as measured with a ruler
  double corner_sigma_px = 0.3;      // of a detected corner, one standard deviation
  double max_relative_sigma = 0.03;  // a less certain scale is refused
  double max_residual_px = 3;        // RMS over the corners: more is not one and the same marker, or it moved
  void validate() const;             // throws InputError naming the field
};

// One detected marker of the dictionary 4x4_50: its corners from the top left, clockwise as printed, level 0.
struct DetectedMarker {
  int id = -1;
  std::array<Eigen::Vector2d, 4> corners_px;
};
std::vector<DetectedMarker> detect_markers(const GreyImage& image);

// A sheet to print: the marker `id` (0 to 49) in the middle third of a white square. Its side is measured with a ruler
// once it is printed.
GreyImage marker_sheet(int id = 0);

struct MarkerSighting {
  RigidTransform camera_from_world;
  DetectedMarker marker;
};

struct MarkerScale {
  bool ok = false;
  std::string reason;  // one sentence for the user when refused
  double factor = 1;
  double sigma = 0;  // of the factor, one standard deviation
  int id = -1;       // of the marker
  int views = 0;
  double residual_px = 0;                  // RMS
  std::array<Eigen::Vector3d, 4> corners;  // world, as it is now
};

// All sightings are of one marker that does not move. Least squares over the marker's pose and its side in the map's
// units, the cameras held.
MarkerScale scale_from_sightings(const CameraModel& camera, std::span<const MarkerSighting> sightings,
                                 const MarkerOptions& options);

// One sighting of a marker that lies on the plane.
MarkerScale scale_from_plane(const CameraModel& camera, const MarkerSighting& sighting, const Plane& plane,
                             const MarkerOptions& options);

// Looks for markers in all keyframes and takes the one that is seen most often. When it is seen too seldom, or from too
// much the same place, and the present frame is given, the plane helps.
struct PresentView {
  GreyImage image;
  RigidTransform camera_from_world;
};
MarkerScale scale_from_marker(const CameraModel& camera, const TrackingSnapshot& map, const MarkerOptions& options,
                              const std::optional<PresentView>& present = {});

struct DistanceScale {
  bool ok = false;
  std::string reason;
  double factor = 1;
};
// Two points of the world, and how far apart they truly are.
DistanceScale scale_from_distance(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double distance_m);

}  // namespace parallax
