#include "core/image_codec.h"

#include <zstd.h>

#include "core/check.h"

namespace parallax {
namespace {

// Fast enough for a camera beside two busy threads; what is left is mostly noise, which no level packs much better.
constexpr int kCompressionLevel = 1;

std::uint8_t byte(int value) { return static_cast<std::uint8_t>(value); }

// Residuals of one row against the mean of left and above; `above` may be null for the first row.
void foretell_row(const std::uint8_t* row, const std::uint8_t* above, int width, std::uint8_t* out) {
  if (!above) {
    out[0] = row[0];
    for (int x = 1; x < width; ++x) out[x] = byte(row[x] - row[x - 1]);
    return;
  }
  out[0] = byte(row[0] - above[0]);
  for (int x = 1; x < width; ++x) out[x] = byte(row[x] - ((row[x - 1] + above[x]) >> 1));
}

void restore_row(const std::uint8_t* residual, const std::uint8_t* above, int width, std::uint8_t* row) {
  if (!above) {
    row[0] = residual[0];
    for (int x = 1; x < width; ++x) row[x] = byte(residual[x] + row[x - 1]);
    return;
  }
  row[0] = byte(residual[0] + above[0]);
  for (int x = 1; x < width; ++x) row[x] = byte(residual[x] + ((row[x - 1] + above[x]) >> 1));
}

// One channel less grey. The difference wraps, and its middle is put at 128 so that small ones do not.
void difference_row(const cv::Vec3b* colour, const std::uint8_t* grey, int channel, int width, std::uint8_t* out) {
  for (int x = 0; x < width; ++x) out[x] = byte(colour[x][channel] - grey[x] + 128);
}

}  // namespace

struct ImageCodec::Contexts {
  ZSTD_CCtx* pack = ZSTD_createCCtx();
  ZSTD_DCtx* unpack = ZSTD_createDCtx();
  Contexts() = default;
  Contexts(const Contexts&) = delete;
  Contexts& operator=(const Contexts&) = delete;
  ~Contexts() {
    ZSTD_freeCCtx(pack);
    ZSTD_freeDCtx(unpack);
  }
};

ImageCodec::ImageCodec() : contexts_(std::make_unique<Contexts>()) {}
ImageCodec::~ImageCodec() = default;

void ImageCodec::pack(std::string* bytes) {
  const std::size_t before = bytes->size(), bound = ZSTD_compressBound(residuals_.size());
  bytes->resize(before + bound);
  const std::size_t size = ZSTD_compressCCtx(contexts_->pack, bytes->data() + before, bound, residuals_.data(),
                                             residuals_.size(), kCompressionLevel);
  PARALLAX_CHECK(!ZSTD_isError(size), "an image could not be packed");
  bytes->resize(before + size);
}

bool ImageCodec::unpack(std::span<const std::uint8_t> bytes, std::size_t expected) {
  residuals_.resize(expected);
  const std::size_t size =
      ZSTD_decompressDCtx(contexts_->unpack, residuals_.data(), residuals_.size(), bytes.data(), bytes.size());
  return !ZSTD_isError(size) && size == expected;
}

void ImageCodec::pack_grey(const GreyImage& grey, std::string* bytes) {
  residuals_.resize(grey.total());
  auto* out = reinterpret_cast<std::uint8_t*>(residuals_.data());
  for (int y = 0; y < grey.rows; ++y)
    foretell_row(grey.ptr(y), y > 0 ? grey.ptr(y - 1) : nullptr, grey.cols,
                 out + static_cast<std::size_t>(y) * grey.cols);
  pack(bytes);
}

bool ImageCodec::unpack_grey(std::span<const std::uint8_t> bytes, cv::Size size, GreyImage* grey) {
  if (!unpack(bytes, static_cast<std::size_t>(size.area()))) return false;
  grey->create(size);
  const auto* in = reinterpret_cast<const std::uint8_t*>(residuals_.data());
  for (int y = 0; y < size.height; ++y)
    restore_row(in + static_cast<std::size_t>(y) * size.width, y > 0 ? grey->ptr(y - 1) : nullptr, size.width,
                grey->ptr(y));
  return true;
}

void ImageCodec::pack_colour(const cv::Mat3b& colour, const GreyImage& grey, std::string* bytes) {
  if (colour.empty()) return;
  PARALLAX_CHECK(colour.size() == grey.size(), "a colour image of another size than the grey one");
  const int width = grey.cols;
  residuals_.resize(3 * grey.total());
  auto* out = reinterpret_cast<std::uint8_t*>(residuals_.data());
  std::vector<std::uint8_t> row(static_cast<std::size_t>(width)), above(row);
  for (int channel = 0; channel < 3; ++channel) {
    for (int y = 0; y < grey.rows; ++y, out += width) {
      difference_row(colour.ptr<cv::Vec3b>(y), grey.ptr(y), channel, width, row.data());
      foretell_row(row.data(), y > 0 ? above.data() : nullptr, width, out);
      row.swap(above);
    }
  }
  pack(bytes);
}

bool ImageCodec::unpack_colour(std::span<const std::uint8_t> bytes, const GreyImage& grey, cv::Mat3b* colour) {
  if (!unpack(bytes, 3 * grey.total())) return false;
  const int width = grey.cols;
  colour->create(grey.size());
  const auto* in = reinterpret_cast<const std::uint8_t*>(residuals_.data());
  std::vector<std::uint8_t> row(static_cast<std::size_t>(width)), above(row);
  for (int channel = 0; channel < 3; ++channel) {
    for (int y = 0; y < grey.rows; ++y, in += width) {
      restore_row(in, y > 0 ? above.data() : nullptr, width, row.data());
      const std::uint8_t* level = grey.ptr(y);
      auto* to = colour->ptr<cv::Vec3b>(y);
      for (int x = 0; x < width; ++x) to[x][channel] = byte(row[static_cast<std::size_t>(x)] + level[x] - 128);
      row.swap(above);
    }
  }
  return true;
}

}  // namespace parallax
