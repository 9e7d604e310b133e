#include "render/synthetic_sensor.h"

#include <algorithm>
#include <cmath>

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_THREAD__) && \
    !defined(__SANITIZE_ADDRESS__)
#define PARALLAX_SENSOR_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define PARALLAX_SENSOR_CLONES
#endif

namespace parallax {

namespace {

// A well-mixed 32-bit hash; vectorises.
inline std::uint32_t mixed(std::uint32_t x) {
  x = (x ^ (x >> 16)) * 0x7feb352du;
  x = (x ^ (x >> 15)) * 0x846ca68bu;
  return x ^ (x >> 16);
}

// The sum of four uniform numbers of 16 bits is close to a normal one; scaled to unit variance.
inline float nearly_normal(std::uint32_t index, std::uint32_t salt) {
  const std::uint32_t a = mixed(index ^ salt), b = mixed(index * 0x9e3779b9u + ~salt);
  const std::uint32_t sum = (a & 0xffffu) + (a >> 16) + (b & 0xffffu) + (b >> 16);
  return (static_cast<float>(static_cast<std::int32_t>(sum)) - 131070.0f) * (1.7320508f / 65536.0f);
}

inline float quantised(float v) { return std::min(255.0f, std::max(0.0f, v)) + 0.5f; }

// One row of a grey picture behind a free lens: what expose() does, to the last bit, many pixels at a time.
PARALLAX_SENSOR_CLONES
void expose_row(const float* __restrict in, int width, std::uint32_t first, std::uint32_t salt, float gain, float fall,
                float cx, float dy_squared, float noise, std::uint8_t* __restrict out) {
  for (int x = 0; x < width; ++x) {
    const float dx = static_cast<float>(x) - cx;
    const float light = gain * (1.0f - fall * (dx * dx + dy_squared));
    const float e = noise * nearly_normal(first + static_cast<std::uint32_t>(x), salt);
    out[x] = static_cast<std::uint8_t>(static_cast<std::int32_t>(quantised(in[x] * light + e)));
  }
}

}  // namespace

void expose(const cv::Mat1f& grey, const cv::Mat3f& colour, const SensorSettings& settings, cv::Mat1b* out_grey,
            cv::Mat3b* out_colour) {
  const int width = grey.cols, height = grey.rows;
  // New images, never the caller's old ones: frames share their pixels with whoever still holds them.
  *out_grey = cv::Mat1b(height, width);
  if (!colour.empty()) *out_colour = cv::Mat3b(height, width);
  const std::uint32_t salt = mixed(static_cast<std::uint32_t>(settings.seed)) ^
                             mixed(static_cast<std::uint32_t>(settings.seed >> 32) + 0x51ed270bu);
  const float cx = 0.5f * static_cast<float>(width - 1), cy = 0.5f * static_cast<float>(height - 1);
  const float fall = static_cast<float>(settings.vignetting) / (cx * cx + cy * cy + 1e-6f);
  const float gain = static_cast<float>(settings.gain), noise = static_cast<float>(settings.noise);
  // The edge of the hand is soft (it is far out of focus) and lies at `edge`; nothing is covered when cover is 0.
  const float softness = 0.12f * static_cast<float>(width);
  const float edge = static_cast<float>(width) * (1.2f - 1.4f * static_cast<float>(settings.cover));
  const bool covered = settings.cover > 0;
  for (int y = 0; y < height; ++y) {
    const float dy = static_cast<float>(y) - cy;
    const float* in = grey[y];
    if (!covered && colour.empty()) {
      expose_row(in, width, static_cast<std::uint32_t>(y * width), salt, gain, fall, cx, dy * dy, noise,
                 (*out_grey)[y]);
      continue;
    }
    for (int x = 0; x < width; ++x) {
      const float dx = static_cast<float>(x) - cx;
      const float light = gain * (1.0f - fall * (dx * dx + dy * dy));
      const float e = noise * nearly_normal(static_cast<std::uint32_t>(y * width + x), salt);
      float open = 1;
      if (covered) {
        const float a = std::clamp((edge - static_cast<float>(x) - 0.15f * dy) / softness * 0.5f + 0.5f, 0.0f, 1.0f);
        open = a * a * (3 - 2 * a);
      }
      const float hand = (1 - open) * light;
      (*out_grey)(y, x) = static_cast<std::uint8_t>(quantised(in[x] * light * open + 22.0f * hand + e));
      if (!colour.empty()) {
        const cv::Vec3f& c = colour(y, x);
        (*out_colour)(y, x) = {static_cast<std::uint8_t>(quantised(c[0] * light * open + 14.0f * hand + e)),
                               static_cast<std::uint8_t>(quantised(c[1] * light * open + 18.0f * hand + e)),
                               static_cast<std::uint8_t>(quantised(c[2] * light * open + 34.0f * hand + e))};
      }
    }
  }
}

}  // namespace parallax
