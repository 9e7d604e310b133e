#include "camera/recording_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

#include "core/check.h"
#include "core/checksum.h"
#include "core/error.h"

namespace parallax {
namespace {

constexpr char kMagic[] = "PLXREC1\n";
constexpr std::size_t kMagicSize = 8;

constexpr std::uint32_t type_of(const char (&name)[5]) {
  return static_cast<std::uint32_t>(static_cast<unsigned char>(name[0])) |
         static_cast<std::uint32_t>(static_cast<unsigned char>(name[1])) << 8 |
         static_cast<std::uint32_t>(static_cast<unsigned char>(name[2])) << 16 |
         static_cast<std::uint32_t>(static_cast<unsigned char>(name[3])) << 24;
}
constexpr std::uint32_t kHeader = type_of("HEAD"), kFrame = type_of("FRAM"), kSchedule = type_of("SCHD"),
                        kEnd = type_of("DONE");

// Of a payload: no camera's frame is larger.
constexpr std::uint32_t kMostBytes = 1U << 28;
constexpr std::uint32_t kMostTexts = 4096;
constexpr int kMostPixels = 1 << 14;  // a side

// What stands before a payload. The first three fields have a checksum of their own, so that a size is believed only
// when it is right.
struct ChunkHead {
  std::uint32_t type = 0, size = 0;
  std::uint64_t payload_sum = 0;
  std::uint64_t head_sum = 0;

  std::uint64_t sum() const {
    char raw[16];
    std::memcpy(raw, &type, 4);
    std::memcpy(raw + 4, &size, 4);
    std::memcpy(raw + 8, &payload_sum, 8);
    return checksum(raw, sizeof raw);
  }
};
constexpr std::size_t kHeadSize = 24;

// What a frame's payload begins with; packed grey and packed colour follow.
struct FrameHead {
  std::int32_t index = 0;
  std::uint16_t width = 0, height = 0;
  std::int64_t time_ns = 0;
  std::uint32_t grey_bytes = 0, colour_bytes = 0;
};
constexpr std::size_t kFrameHeadSize = 24;
static_assert(sizeof(ChunkHead) == kHeadSize && sizeof(FrameHead) == kFrameHeadSize, "no padding in what is written");

void put_text(const std::string& text, std::string* bytes) {
  const auto size = static_cast<std::uint32_t>(text.size());
  char raw[4];
  std::memcpy(raw, &size, 4);
  bytes->append(raw, 4);
  bytes->append(text);
}

void put_texts(const RecordingHeader& texts, std::string* bytes) {
  for (const auto& [name, text] : texts) {
    put_text(name, bytes);
    put_text(text, bytes);
  }
}

// False when the bytes are not what put_texts makes.
bool take_texts(std::string_view bytes, RecordingHeader* texts) {
  const auto take = [&](std::string* text) {
    std::uint32_t size;
    if (bytes.size() < 4) return false;
    std::memcpy(&size, bytes.data(), 4);
    bytes.remove_prefix(4);
    if (size > bytes.size()) return false;
    text->assign(bytes.substr(0, size));
    bytes.remove_prefix(size);
    return true;
  };
  while (!bytes.empty()) {
    std::string name, text;
    if (texts->size() >= kMostTexts || !take(&name) || !take(&text)) return false;
    (*texts)[std::move(name)] = std::move(text);
  }
  return true;
}

// The head of the chunk at the stream's place; false at the end and where it is damaged (with the reason).
bool read_head(std::istream& file, ChunkHead* head, std::string* why) {
  char raw[kHeadSize];
  file.read(raw, kHeadSize);
  if (file.gcount() == 0) return false;
  if (file.gcount() < static_cast<std::streamsize>(kHeadSize)) {
    *why = "a chunk that was cut off";
    return false;
  }
  std::memcpy(head, raw, kHeadSize);
  if (head->head_sum != head->sum() || head->size > kMostBytes) {
    *why = "damaged bytes";
    return false;
  }
  return true;
}

// The payload, its checksum checked.
bool read_payload(std::istream& file, const ChunkHead& head, std::string* payload, std::string* why) {
  // In pieces, so that a size that the file does not hold costs no memory.
  constexpr std::size_t kPiece = 1U << 22;
  payload->clear();
  while (payload->size() < head.size) {
    const std::size_t before = payload->size(), piece = std::min<std::size_t>(kPiece, head.size - before);
    payload->resize(before + piece);
    file.read(payload->data() + before, static_cast<std::streamsize>(piece));
    if (file.gcount() < static_cast<std::streamsize>(piece)) {
      *why = "a chunk that was cut off";
      return false;
    }
  }
  if (checksum(payload->data(), payload->size()) == head.payload_sum) return true;
  *why = "damaged bytes";
  return false;
}

bool is_sane(const FrameHead& head, std::uint32_t payload_size) {
  return head.index >= 0 && head.width > 0 && head.height > 0 && head.width <= kMostPixels &&
         head.height <= kMostPixels &&
         static_cast<std::uint64_t>(head.grey_bytes) + head.colour_bytes + kFrameHeadSize == payload_size;
}

}  // namespace

RecordingWriter::RecordingWriter(const std::string& path) : path_(path) {
  file_ = open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file_ < 0) fail(errno);
  write_bytes(std::string(kMagic, kMagicSize));
}

RecordingWriter::~RecordingWriter() {
  if (file_ >= 0) close(file_);
}

void RecordingWriter::fail(int error) const {
  throw RunError(path_ + ": cannot be written: " + std::generic_category().message(error));
}

void RecordingWriter::write_bytes(const std::string& bytes) {
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t written = write(file_, bytes.data() + done, bytes.size() - done);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail(errno);
    if (written == 0) fail(ENOSPC);
    done += static_cast<std::size_t>(written);
  }
}

void RecordingWriter::write_chunk(std::uint32_t type) {
  PARALLAX_CHECK(payload_.size() <= kMostBytes, "a chunk too large for a recording");
  ChunkHead head;
  head.type = type;
  head.size = static_cast<std::uint32_t>(payload_.size());
  head.payload_sum = checksum(payload_.data(), payload_.size());
  head.head_sum = head.sum();
  chunk_.resize(kHeadSize);
  std::memcpy(chunk_.data(), &head, kHeadSize);
  chunk_ += payload_;
  write_bytes(chunk_);
}

void RecordingWriter::write_header(const RecordingHeader& header) {
  payload_.clear();
  put_texts(header, &payload_);
  write_chunk(kHeader);
}

void RecordingWriter::write_frame(const Frame& frame) {
  PARALLAX_CHECK(frame.grey.cols <= kMostPixels && frame.grey.rows <= kMostPixels, "a frame too large to record");
  FrameHead head;
  head.index = frame.index;
  head.width = static_cast<std::uint16_t>(frame.grey.cols);
  head.height = static_cast<std::uint16_t>(frame.grey.rows);
  head.time_ns = frame.time.count();
  payload_.assign(kFrameHeadSize, '\0');
  codec_.pack_grey(frame.grey, &payload_);
  head.grey_bytes = static_cast<std::uint32_t>(payload_.size() - kFrameHeadSize);
  codec_.pack_colour(frame.colour, frame.grey, &payload_);
  head.colour_bytes = static_cast<std::uint32_t>(payload_.size() - kFrameHeadSize - head.grey_bytes);
  std::memcpy(payload_.data(), &head, kFrameHeadSize);
  write_chunk(kFrame);
}

void RecordingWriter::write_schedule(const std::string& bytes) {
  payload_ = bytes;
  write_chunk(kSchedule);
}

void RecordingWriter::write_end(const RecordingHeader& summary) {
  payload_.clear();
  put_texts(summary, &payload_);
  write_chunk(kEnd);
}

bool is_recording(std::string_view start) {
  return start.substr(0, kMagicSize) == std::string_view(kMagic, kMagicSize);
}

RecordingContents read_recording(std::istream& file, const std::string& name) {
  RecordingContents out;
  std::string start(kMagicSize, '\0'), payload, why;
  file.read(start.data(), kMagicSize);
  if (file.gcount() < static_cast<std::streamsize>(kMagicSize) || !is_recording(start)) {
    throw InputError(name + ": found something else, expected a recorded session");
  }
  ChunkHead head;
  if (!read_head(file, &head, &why) || head.type != kHeader || !read_payload(file, head, &payload, &why) ||
      !take_texts(payload, &out.header)) {
    throw InputError(name + ": found " + (why.empty() ? "no header" : why) + ", expected a recording's header");
  }
  std::uint64_t offset = kMagicSize + kHeadSize + head.size;
  const auto size_of_file = [&] {
    file.seekg(0, std::ios::end);
    const auto size = static_cast<std::uint64_t>(file.tellg());
    file.seekg(static_cast<std::streamoff>(offset));
    return size;
  }();
  while (!out.summary && read_head(file, &head, &why)) {
    const std::uint64_t next = offset + kHeadSize + head.size;
    if (next > size_of_file) {
      why = "a chunk that was cut off";
      break;
    }
    if (head.type == kFrame) {
      // The images are looked at when they are wanted.
      FrameHead frame;
      char raw[kFrameHeadSize];
      file.read(raw, kFrameHeadSize);
      if (head.size >= kFrameHeadSize) std::memcpy(&frame, raw, kFrameHeadSize);
      const Timestamp time(frame.time_ns);
      if (!is_sane(frame, head.size) ||
          (!out.frames.empty() && (frame.index <= out.frames.back().index || time <= out.frames.back().time))) {
        why = "a frame that does not follow the one before";
        break;
      }
      out.frames.push_back({frame.index, time, offset, head.size});
      file.seekg(static_cast<std::streamoff>(next));
    } else if (!read_payload(file, head, &payload, &why)) {
      break;
    } else if (head.type == kSchedule) {
      out.schedule.insert(out.schedule.end(), payload.begin(), payload.end());
    } else if (head.type == kEnd) {
      RecordingHeader summary;
      if (take_texts(payload, &summary)) out.summary = std::move(summary);
    }
    // A chunk of a later version is passed over.
    offset = next;
  }
  if (!why.empty()) out.damage = "byte " + std::to_string(offset) + ": found " + why;
  return out;
}

bool read_recorded_frame(std::istream& file, const RecordingContents::FrameAt& at, bool colour, ImageCodec* codec,
                         Frame* frame, std::string* why) {
  file.clear();
  file.seekg(static_cast<std::streamoff>(at.offset));
  ChunkHead chunk;
  std::string payload;
  *why = "damaged bytes";
  if (!read_head(file, &chunk, why) || chunk.size != at.size || !read_payload(file, chunk, &payload, why)) return false;
  *why = "damaged images";
  FrameHead head;
  if (payload.size() < kFrameHeadSize) return false;
  std::memcpy(&head, payload.data(), kFrameHeadSize);
  if (!is_sane(head, chunk.size)) return false;
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(payload.data()) + kFrameHeadSize;
  frame->index = head.index;
  frame->time = Timestamp(head.time_ns);
  frame->grey = GreyImage();
  frame->colour = cv::Mat3b();
  if (!codec->unpack_grey({bytes, head.grey_bytes}, {head.width, head.height}, &frame->grey)) return false;
  return !colour || head.colour_bytes == 0 ||
         codec->unpack_colour({bytes + head.grey_bytes, head.colour_bytes}, frame->grey, &frame->colour);
}

}  // namespace parallax
