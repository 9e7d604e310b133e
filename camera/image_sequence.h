// A recording made of image files: what the data-set layouts are turned into, and the reader they share.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "camera/frame_source.h"
#include "camera/image_file.h"

namespace parallax {

struct SequenceImage {
  int index = 0;  // the frame's number
  Timestamp time{0};
  std::string path;
};

// One camera's images with what the layout knows of them. Built by the open_*_sequence functions, which throw
// InputError when there is nothing to read or when the calibration's size is not the images'.
struct ImageSequence {
  std::string description;            // "TUM folder /data/desk"
  std::vector<SequenceImage> images;  // times strictly increasing
  int positions = 0;                  // frame numbers used up, images that are missing included
  double frames_per_second = 0;
  ImageProbe probe;  // of the first image that can be read
  std::optional<CameraModel> calibration;
  RigidTransform body_from_camera;  // of the rig (EuRoC: T_BS; KITTI: camera 0 from this camera)
  std::vector<StampedPose> ground_truth;
  std::vector<SourceWarning> warnings;
};

// `camera`: 0 left, 1 right. Only the left camera of a sequence gets ground truth.
ImageSequence open_tum_sequence(const std::string& folder, const SourceOptions& options);
ImageSequence open_euroc_sequence(const std::string& folder, int camera, const SourceOptions& options);
ImageSequence open_kitti_sequence(const std::string& folder, int camera, const SourceOptions& options);
ImageSequence open_numbered_sequence(const std::string& folder, const SourceOptions& options);

// Whether the folder has the layout, by the names in it alone.
bool is_tum_folder(const std::string& folder);
bool is_euroc_folder(const std::string& folder);
bool is_kitti_folder(const std::string& folder);

// Steps the open_*_sequence functions share. probe_sequence reads images until one can be read (InputError if none of
// the first ones can), check_calibration_size throws when the calibration is for another size.
void probe_sequence(ImageSequence* sequence);
void check_calibration_size(const CameraModel& calibration, const std::string& calibration_name,
                            const ImageSequence& sequence);
double median_rate(const std::vector<SequenceImage>& images, double fallback);

// Turns one entry into a frame; returns why not ("FILE: skipped: reason"), or an empty text.
std::string load_frame(const ImageSequence& sequence, const SequenceImage& image, bool colour, Frame* frame);

// Frames of a sequence, one after another.
std::unique_ptr<FrameSource> make_sequence_source(ImageSequence sequence, const SourceOptions& options);

}  // namespace parallax
