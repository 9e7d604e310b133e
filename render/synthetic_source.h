// `synthetic:` sequences: made-up recordings with exact truth, for tests, benchmarks and a first run without a camera.
//
// A name is NAME[?key=value[&key=value...]], with or without "synthetic:" in front:
//   desk      cluttered desk, hand-held: still 1 s, a 10 cm slide (frames 30 to 75), then exploring; blur, noise, drift
//   walls     PTAM §7.3: two walls at right angles, sideways along both, 18.2 m in 600 frames at 600x480
//   shakes    desk with violent shaking, a covered lens, kidnapping, an unknown place, sudden light changes (labelled)
//   repeat    a table of strictly repeating tiles, desk motion
//   rotation  above the desk, turning on the spot only
//   blank     nothing but one grey
//   room      circling in a furnished room, for as long as one likes
//   board     a calibration board on a table, visited as for a calibration, still at every view (synthetic_board.h)
//   building  a corridor round a rectangle of 35 by 15 m, and stairs, at 20 frames a second (synthetic_building.h)
// Keys: seed (scene, motion and noise), walk (another seed for motion and noise), day (of `desk` and what is seen on
// it, and of `building`: each day a third of the things have been moved), light (brightness factor), frames, lens
// (pinhole, radtan, kannala_brandt, fov: another lens of about the same width), size (WIDTHxHEIGHT), noise (grey
// levels), blur (exposure time, milliseconds), baseline (metres, as a pair of cameras: synthetic_stereo_source.h),
// threads; of `board` also target (chessboard or circles). Of `building`, walk is 0 to 4 or stairs, start a number of
// its frames to leave out, and the lens is a pinhole's.
//
// Frames are a pure function of name and index: the same on every machine run after run, in any order, with any number
// of threads, whether or not colour is asked for. Stamped poses are those of the middle of the exposure. World: z up,
// metres. Not thread-safe: one thread at a time uses a source.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "camera/frame_source.h"
#include "core/camera_model.h"
#include "core/se3.h"
#include "render/synthetic_path.h"
#include "render/synthetic_scene.h"

namespace parallax {

class RayCaster;

// What a sequence is made of, after its name has been read. Also for tests that want a set-up of their own.
struct SyntheticOptions {
  std::string scene = "desk";         // for synthetic_scene()
  std::uint64_t seed = 1;             // of the scene, and of all else unless `walk` is given
  std::optional<std::uint64_t> walk;  // of motion and noise
  int day = 0;                        // see synthetic_scene()
  double light = 1;                   // factor on the brightness
  int frames = 400;
  CameraModel camera;
  double exposure_s = 0.010;  // 0: no motion blur
  double noise = 2.0;         // standard deviation of the sensor noise, grey levels
  double vignetting = 0.15;   // loss of light in the image corner, 0..1
  double nearest_m = 0.5;     // things are hardly ever nearer: how far blur reaches (see samples())
  double baseline_m = 0.119;  // between the cameras of a pair
  double fps = kSyntheticFps;
  int threads = 1;

  std::uint64_t motion_seed() const { return walk.value_or(seed); }
};

class SyntheticSource final : public FrameSource {
 public:
  // `description` is for messages. Throws InputError when an option is out of range.
  SyntheticSource(const std::string& description, const SyntheticOptions& options, SyntheticMotion motion,
                  const SourceOptions& source_options = {});
  ~SyntheticSource() override;

  std::optional<Frame> next() override;
  std::vector<SourceWarning> take_warnings() override { return {}; }
  int frame_count() const override;
  double frames_per_second() const override { return options_.fps; }
  std::string description() const override { return description_; }
  std::optional<CameraModel> calibration() const override { return options_.camera; }
  std::vector<StampedPose> ground_truth() const override;

  // Any frame of the sequence, in any order; does not move next().
  Frame frame(int index);
  // The same moment seen by another camera with the same lens that is fixed to this one: its picture is `gain` times as
  // bright, with noise of its own (told apart by `camera`, not 0).
  Frame frame_beside(int index, const RigidTransform& other_from_camera, double gain, int camera);
  // Depth along z, metres, at the middle of the exposure, through pixel centres; 0 where there is nothing.
  cv::Mat1f depth(int index);
  RigidTransform world_from_camera(int index) const { return motion_.world_from_camera(index, 0.0); }
  FrameLabel label(int index) const { return motion_.label(index); }
  Timestamp time(int index) const;
  // How many sub-exposure samples the frame is made of: more, the faster it moves.
  int samples(int index) const;

  const SyntheticOptions& options() const { return options_; }
  const SyntheticScene& scene() const { return *scene_; }

 private:
  Frame draw(int index, const RigidTransform& other_from_camera, double gain, std::uint64_t noise_seed);

  std::string description_;
  SyntheticOptions options_;
  SyntheticMotion motion_;
  SourceOptions source_options_;
  std::shared_ptr<const SyntheticScene> scene_;
  std::unique_ptr<RayCaster> caster_;
  int next_ = 0, delivered_ = 0;
};

// Throws InputError, listing what is known, for an unknown name or key or a value out of range.
std::unique_ptr<SyntheticSource> open_synthetic_source(const std::string& name, const SourceOptions& options = {},
                                                       int threads = 1);

// "desk, walls, ...", for messages and help.
std::string synthetic_names();

}  // namespace parallax
