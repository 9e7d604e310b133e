// The file of a recorded session: an eight-byte name and chunks, each with its size and checksums, only ever appended.
// Whatever was written before the program was killed can be read; a chunk that was cut off ends the file.
// docs/recording.md describes the bytes.
#pragma once

#include <cstdint>
#include <istream>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/frame.h"
#include "core/image_codec.h"

namespace parallax {

// What is known before the first frame: names and texts ("calibration", "program", "camera.exposure"...).
using RecordingHeader = std::map<std::string, std::string>;

// Appends to a new file. Not thread-safe. Every chunk is with the operating system when its call returns.
class RecordingWriter {
 public:
  // Throws RunError ("FILE: cannot be written: reason"), as every member does.
  explicit RecordingWriter(const std::string& path);
  ~RecordingWriter();
  RecordingWriter(const RecordingWriter&) = delete;
  RecordingWriter& operator=(const RecordingWriter&) = delete;

  void write_header(const RecordingHeader& header);
  void write_frame(const Frame& frame);
  void write_schedule(const std::string& bytes);
  // The last chunk: what the session came to.
  void write_end(const RecordingHeader& summary);

 private:
  void write_chunk(std::uint32_t type);
  void write_bytes(const std::string& bytes);
  [[noreturn]] void fail(int error) const;

  std::string path_;
  int file_ = -1;
  ImageCodec codec_;
  std::string payload_, chunk_;
};

// What is in a file, images apart.
struct RecordingContents {
  struct FrameAt {
    int index = 0;
    Timestamp time{0};
    std::uint64_t offset = 0;  // of the chunk
    std::uint32_t size = 0;    // of its payload
  };
  RecordingHeader header;
  std::vector<FrameAt> frames;  // index and time grow
  std::vector<std::uint8_t> schedule;
  std::optional<RecordingHeader> summary;  // nothing: the program was killed, or the disk was full
  std::string damage;                      // where and why reading ended early; empty: at the end
};

// Whether a file that begins so is a recording.
bool is_recording(std::string_view start);

// Reads all but the images. Throws InputError ("NAME: ...") when it is no recording or holds no header; damage later
// on ends the contents there.
RecordingContents read_recording(std::istream& file, const std::string& name);

// Reads the images of a frame; false, and why, when they are damaged. Without `colour` that is left empty.
bool read_recorded_frame(std::istream& file, const RecordingContents::FrameAt& at, bool colour, ImageCodec* codec,
                         Frame* frame, std::string* why);

}  // namespace parallax
