// A frame as it comes from a source: what the tracker gets.
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "core/image.h"
#include "core/time.h"

namespace parallax {

struct Frame {
  int index = 0;      // position in the source, from 0; frames that could not be read keep their number
  Timestamp time{0};  // of the recording
  GreyImage grey;     // 8 bit, level 0
  cv::Mat3b colour;   // BGR; empty when the source is grey or colour was not asked for
};

}  // namespace parallax
