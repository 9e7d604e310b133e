// Whether two rectified images are the left and the right one of a rig, seen at one moment: finds swapped cameras, a
// covered lens, rows that do not agree (another moment, another calibration) and images with nothing in common.
//
// A sparse search of its own, some milliseconds, for the first frames and now and then: corners of the left image are
// looked for in the right one to both sides, and some rows up and down, so that what is wrong can be named. A wrong
// baseline cannot be seen in the images of one rig (it scales the world); only values no rig has are refused
// (camera/stereo_rectification).
#pragma once

#include <optional>
#include <string>

#include "core/image.h"

namespace parallax {

struct StereoCheckOptions {
  int corners = 130;                // looked for, spread over the image
  double largest_disparity = 0.25;  // of the image's width, to both sides
  int rows_px = 8;                  // up and down
  double least_contrast = 4;        // grey levels, standard deviation of 8x8 pixels at half size: less is a blank wall
  int least_matches = 12;           // to say anything from matches
  double row_offset_px = 1;         // the median difference of the rows may be this
  double row_spread_px = 1;         // and its spread (1.48 times the median deviation) this
  double covered_share = 0.1;       // a covered image has less than this share of the other's texture
  // StereoWatch: looks in a row that must agree before a problem is told, or is over; frames between looks when all is
  // well, and while something is wrong.
  int confirmations = 3, interval = 50, interval_in_trouble = 5;

  void validate() const;  // throws InputError naming the field
};

enum class StereoProblem {
  none,
  too_little_texture,  // both images are nearly blank: nothing can be said, and nothing is wrong with the rig
  left_covered,
  right_covered,
  swapped,
  rows_apart,      // all by the same: the calibration is not this rig's, a camera has moved, or nodding and out of step
  unsynchronised,  // here and there: the images are not of one moment, or the calibration is quite another's
  unrelated,       // hardly anything of one image is found in the other
  one_image,       // both are the same image: one camera, given twice
};
const char* to_string(StereoProblem problem);  // "none", "too little texture"...

struct StereoVerdict {
  StereoProblem problem = StereoProblem::none;
  std::string text;  // one line for the user; empty when there is no problem
  // What it stands on.
  int corners = 0;                             // of the left image
  int matched = 0;                             // found where a point before the cameras may be, at infinity included
  int matched_backwards = 0;                   // found on the other side
  double row_offset_px = 0;                    // median of right row - left row of all that were found
  double row_spread_px = 0;                    // 1.48 times the median deviation from that
  double left_texture = 0, right_texture = 0;  // share of the image that is no blank wall
};

// The images are rectified and of one size (CHECK). Safe from any thread.
StereoVerdict check_stereo_pair(const GreyImage& left, const GreyImage& right, const StereoCheckOptions& options = {});

// Looks at the first pairs, then at one now and then, and tells what changes, once. Not thread-safe.
class StereoWatch {
 public:
  explicit StereoWatch(const StereoCheckOptions& options = {});

  // For every pair, in order. A verdict when a problem has begun, another has taken its place, or it is over
  // (StereoProblem::none). `too_little_texture` is told too: it is no fault of the rig.
  std::optional<StereoVerdict> look(const GreyImage& left, const GreyImage& right);

  StereoProblem problem() const { return told_; }  // as told last
  int looks() const { return looks_; }

 private:
  StereoCheckOptions options_;
  StereoProblem told_ = StereoProblem::none, last_ = StereoProblem::none;
  int agreeing_ = 0, wait_ = 0, looks_ = 0;
};

}  // namespace parallax
