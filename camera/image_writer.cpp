#include "camera/image_writer.h"

#include <opencv2/imgcodecs.hpp>
#include <ostream>
#include <vector>

#include "core/error.h"
#include "core/file_io.h"

namespace parallax {

void write_png(const std::string& path, const cv::Mat& image) {
  std::vector<unsigned char> bytes;
  if (image.empty() || !cv::imencode(".png", image, bytes)) throw RunError(path + ": the picture could not be encoded");
  const std::string content(bytes.begin(), bytes.end());
  write_file_atomically(path, [&](std::ostream& out) { out << content; });
}

}  // namespace parallax
