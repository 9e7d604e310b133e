// Frames of a video file, decoded by FFmpeg through OpenCV.
#pragma once

#include <memory>
#include <string>

#include "camera/frame_source.h"

namespace parallax {

// Time stamps come from the file where they increase by sane steps, else from the frame rate. Grey is made from the
// decoded colour image in the same way whether colour is wanted or not. Throws InputError when the file is no video,
// holds no frame, or its size is not one this program works with.
std::unique_ptr<FrameSource> open_video_source(const std::string& path, const SourceOptions& options);

}  // namespace parallax
