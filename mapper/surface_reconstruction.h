// What stands on the dominant plane, kept up with the map: stereo of every keyframe (mapper/surface_stereo), fused to a
// grid of heights (mapper/surface_volume), a new map/scene_surface when something changed.
//
// Frames: the plane's, metres. Belongs to one thread, that of whoever calls step(); the surfaces it gives are immutable
// and may go anywhere. Memory is bounded by the options: some 16 bytes a pixel and label for one keyframe at work, 3 a
// pixel for those done, 6 a box of the grid. In the same order of updates and finished work it gives the same surfaces
// to the last bit.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/camera_model.h"
#include "core/interruption.h"
#include "map/scene_surface.h"
#include "map/tracking_snapshot.h"
#include "mapper/surface_stereo.h"
#include "mapper/surface_volume.h"

namespace parallax {

struct SurfaceOptions {
  int image_width_px = 320;      // keyframes are looked at no larger than this
  int keyframes = 40;            // the newest so many
  int cells = 320;               // of the grid, along its longer side at most
  int levels = 67;               // of the votes over a cell, at most
  double cell_px = 1.3;          // side of a cell in pixels of that image at the usual distance, at least
  double least_height_px = 2.5;  // lower things are part of the plane; the same unit
  int least_cells = 12;          // smaller things are noise

  // Throws InputError.
  void validate() const;
};

class SurfaceReconstruction {
 public:
  explicit SurfaceReconstruction(const CameraModel& camera, const SurfaceOptions& options = {});

  // The map as it is now. Cheap; what has been computed and still holds is kept.
  void update(std::shared_ptr<const TrackingSnapshot> snapshot);
  // Works for about this long, or until interrupted (asked every millisecond or two). False when nothing is left to do
  // until the next update().
  bool step(double budget_ms, const Interruption& interrupt);
  // The newest surface; null before the first one is done and when the map has no plane.
  std::shared_ptr<const SceneSurface> surface() const { return surface_; }

 private:
  enum class Stage { idle, stereo, fuse, read };
  struct View {
    KeyframeId id, neighbour;
    double baseline_m = 0;  // to that neighbour when the depth was found: maps are scaled now and then
    cv::Mat1w depth;        // along z, in steps of `unit_m`
    cv::Mat1b sure;         // as SurfaceStereo has it
    double unit_m = 0;
    std::optional<RigidTransform> fused_from;  // camera_from_plane of its vote
  };

  bool unit();
  bool plan();
  bool begin_stereo();
  void keep_depth();
  void begin_fusion();
  void publish();
  std::vector<int> neighbours_of(int keyframe) const;
  RigidTransform camera_from_plane(int keyframe) const;
  SurfaceExtent wanted_extent() const;
  cv::Mat1f depth_of(const View& view) const;
  int keyframe_of(KeyframeId id) const;
  bool holds(const View& view) const;

  SurfaceOptions options_;
  SurfaceCamera camera_;
  std::shared_ptr<const TrackingSnapshot> snapshot_, next_snapshot_;
  SurfaceStereo stereo_;
  SurfaceVolume volume_;
  std::vector<View> views_;  // in order of age
  Stage stage_ = Stage::idle;
  int keyframe_ = -1;            // at work
  std::vector<int> neighbours_;  // of it
  std::vector<std::size_t> to_fuse_;
  std::size_t fusing_ = 0;
  int row_ = 0;
  cv::Mat1f fusing_depth_;
  bool changed_ = false;
  std::shared_ptr<SceneSurface> making_;
  std::shared_ptr<const SceneSurface> surface_;
  std::uint64_t version_ = 0;
};

}  // namespace parallax
