#include "games/burning_glass_picture.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "games/burning_glass_noise.h"

namespace parallax::burning {
namespace {

struct Paint {
  float r = 0, g = 0, b = 0, a = 0;  // 0..1, straight
};

// A colour on the way from bare to burnt.
struct Stop {
  float at;
  Paint paint;
};

template <std::size_t N>
Paint along(const Stop (&stops)[N], float value) {
  if (value <= stops[0].at) return stops[0].paint;
  for (std::size_t i = 1; i < N; ++i) {
    if (value > stops[i].at) continue;
    const Paint &p = stops[i - 1].paint, &q = stops[i].paint;
    const float u = (value - stops[i - 1].at) / (stops[i].at - stops[i - 1].at);
    return {p.r + u * (q.r - p.r), p.g + u * (q.g - p.g), p.b + u * (q.b - p.b), p.a + u * (q.a - p.a)};
  }
  return stops[N - 1].paint;
}

constexpr Stop kWood[] = {{0.00f, {0.62f, 0.38f, 0.17f, 0.00f}},
                          {0.10f, {0.56f, 0.33f, 0.14f, 0.34f}},
                          {0.30f, {0.40f, 0.22f, 0.09f, 0.72f}},
                          {0.60f, {0.20f, 0.11f, 0.06f, 0.90f}},
                          {1.00f, {0.055f, 0.045f, 0.04f, 0.96f}}};
constexpr Stop kPaper[] = {{0.00f, {0.85f, 0.70f, 0.36f, 0.00f}},
                           {0.08f, {0.78f, 0.57f, 0.24f, 0.42f}},
                           {0.22f, {0.52f, 0.30f, 0.10f, 0.78f}},
                           {0.50f, {0.15f, 0.09f, 0.05f, 0.95f}},
                           {0.80f, {0.05f, 0.045f, 0.04f, 0.98f}}};

// Wood: browned, then black; the grain runs along x and takes the char unevenly, and cracks run across it.
Paint wood(float burnt, float x, float y) {
  const float grain = smooth_noise(x / 22, y / 1.7f, 11) - 0.5f, fleck = smooth_noise(x / 2, y / 1.3f, 12) - 0.5f;
  Paint paint = along(kWood, std::clamp(burnt * (1 + 0.55f * grain + 0.25f * fleck), 0.0f, 1.0f));
  if (burnt > 0.55f) {
    const float crack = std::abs(smooth_noise(x / 5, y / 9, 13) - 0.5f);
    const float ash = std::clamp((burnt - 0.55f) * 2.2f, 0.0f, 1.0f) * std::clamp(1 - 26 * crack, 0.0f, 1.0f);
    for (float* channel : {&paint.r, &paint.g, &paint.b}) *channel += 0.16f * ash;
  }
  return paint;
}

// Paper: a brown edge, black, and burnt through: a hole with a crumbling grey rim.
Paint paper(float burnt, float x, float y) {
  const float ragged = smooth_noise(x / 3, y / 3, 21) - 0.5f;
  const float value = std::clamp(burnt * (1 + 0.35f * ragged), 0.0f, 1.0f);
  Paint paint = along(kPaper, value);
  const float through = std::clamp((value - 0.80f) / 0.10f, 0.0f, 1.0f);
  const float rim = through * (1 - std::clamp((value - 0.90f) / 0.08f, 0.0f, 1.0f));
  const float hole = std::clamp((value - 0.92f) / 0.06f, 0.0f, 1.0f);
  const float ash = 0.32f * rim * (0.6f + 0.8f * smooth_noise(x / 1.6f, y / 1.6f, 22));
  paint.r += ash + 0.02f * hole;
  paint.g += ash;
  paint.b += ash;
  return paint;
}

// Distances to the nearest and the second nearest of points strewn one to a square.
void cell_distances(float x, float y, std::uint64_t seed, float* first, float* second) {
  const int ix = static_cast<int>(std::floor(x)), iy = static_cast<int>(std::floor(y));
  float d1 = 9, d2 = 9;
  for (int v = -1; v <= 1; ++v) {
    for (int u = -1; u <= 1; ++u) {
      const float px = static_cast<float>(ix + u) + lattice_noise(ix + u, iy + v, seed);
      const float py = static_cast<float>(iy + v) + lattice_noise(ix + u, iy + v, seed + 1);
      const float d = (px - x) * (px - x) + (py - y) * (py - y);
      if (d < d1) {
        d2 = d1;
        d1 = d;
      } else {
        d2 = std::min(d2, d);
      }
    }
  }
  *first = std::sqrt(d1);
  *second = std::sqrt(d2);
}

// A disc: the varnish goes milky and crazes; the cracks shine in the colours of thin layers, which change with their
// direction from the middle and with the heat they saw.
Paint compact_disc(float burnt, float x, float y) {
  if (burnt <= 0.004f) return {};
  float first = 0, second = 0;
  const float bent_x = x + 2.5f * smooth_noise(x / 4, y / 4, 31), bent_y = y + 2.5f * smooth_noise(x / 4, y / 4, 32);
  cell_distances(bent_x / 6.5f, bent_y / 6.5f, 33, &first, &second);
  const float width = 0.10f + 0.26f * burnt;
  const float line = std::clamp(1.25f - (second - first) / width, 0.0f, 1.0f);
  const float phase = 0.35f * std::hypot(x - kPictureSize / 2.0f, y - kPictureSize / 2.0f) / 6 + 1.8f * burnt +
                      1.6f * smooth_noise(x / 14, y / 14, 34);
  const auto band = [&](float shift) { return 0.5f + 0.5f * std::cos(6.2831853f * (phase + shift)); };
  const float shine = 0.45f + 0.55f * line;
  const float r = band(0), g = band(0.33f), b = band(0.67f);
  const float milky = std::min(1.0f, 3 * burnt);
  const float white = 0.80f * (1 - line);
  Paint paint;
  paint.r = white * 0.92f + line * shine * (0.15f + 0.85f * r);
  paint.g = white * 0.95f + line * shine * (0.15f + 0.85f * g);
  paint.b = white + line * shine * (0.20f + 0.80f * b);
  const float scar = std::clamp((burnt - 0.75f) * 3, 0.0f, 0.75f) * (1 - line);  // melted through to the dark layer
  for (float* channel : {&paint.r, &paint.g, &paint.b}) *channel *= 1 - scar;
  paint.a = milky * (0.30f + 0.65f * std::max(line, scar));
  return paint;
}

std::uint8_t byte(float value) { return static_cast<std::uint8_t>(std::clamp(value, 0.0f, 1.0f) * 255 + 0.5f); }

constexpr float kSmoothing = 1.1f;  // of the mean distance between rays, in standard deviations
constexpr float kDimmest = 0.15f;   // suns; less light is not seen
constexpr float kBrightest = 450;   // suns that are as bright as the picture can be
constexpr float kGlowFrom_k = 380, kGlowFull_k = 950;

}  // namespace

void BurnPicture::paint(const Material& material, const std::vector<std::uint16_t>& charred, const SheetBox& box) {
  const SheetBox area = box.grown(1);
  for (int y = area.bottom * kPictureScale; y < area.top * kPictureScale; ++y) {
    cv::Vec4b* out = picture_[kPictureSize - 1 - y];
    const float row = (static_cast<float>(y) + 0.5f) / kPictureScale - 0.5f;
    const int row0 = static_cast<int>(std::floor(row));
    const float v = row - static_cast<float>(row0);
    const int below = std::max(row0, 0), above = std::min(row0 + 1, kSheetCells - 1);
    for (int x = area.left * kPictureScale; x < area.right * kPictureScale; ++x) {
      const float column = (static_cast<float>(x) + 0.5f) / kPictureScale - 0.5f;
      const int column0 = static_cast<int>(std::floor(column));
      const float u = column - static_cast<float>(column0);
      const int left = std::max(column0, 0), right = std::min(column0 + 1, kSheetCells - 1);
      const auto at = [&](int c, int r) { return static_cast<float>(charred[SheetGrid::index(c, r)]); };
      const float burnt = ((1 - v) * ((1 - u) * at(left, below) + u * at(right, below)) +
                           v * ((1 - u) * at(left, above) + u * at(right, above))) /
                          kFullChar;
      if (burnt <= 0) {
        out[x] = cv::Vec4b(0, 0, 0, 0);
        continue;
      }
      const float px = static_cast<float>(x), py = static_cast<float>(y);
      Paint paint;
      switch (material.kind) {
        case MaterialKind::wood:
          paint = wood(burnt, px, py);
          break;
        case MaterialKind::paper:
          paint = paper(burnt, px, py);
          break;
        case MaterialKind::compact_disc:
          paint = compact_disc(burnt, px, py);
          break;
      }
      out[x] = cv::Vec4b(byte(paint.r), byte(paint.g), byte(paint.b), byte(paint.a));
    }
  }
}

cv::Mat4b light_picture(const std::vector<float>& concentration, const SheetBox& lit, int rays,
                        const std::vector<float>& temperature_k, const SheetBox& warm) {
  cv::Mat4b out(kSheetCells, kSheetCells, cv::Vec4b(255, 240, 214, 0));
  cv::Mat1f light(kSheetCells, kSheetCells, 0.0f);
  SheetBox area = warm;
  if (!lit.empty()) {
    double cells = 0;
    for (int row = lit.bottom; row < lit.top; ++row) {
      for (int column = lit.left; column < lit.right; ++column) {
        const float value = concentration[SheetGrid::index(column, row)];
        light(row, column) = value;
        cells += value > 0;
      }
    }
    const double sigma = kSmoothing * std::sqrt(cells / std::max(1, rays));
    const SheetBox room = lit.grown(2 + static_cast<int>(std::ceil(3 * sigma)));
    if (sigma > 0.2) {
      const cv::Rect where(room.left, room.bottom, room.right - room.left, room.top - room.bottom);
      cv::Mat1f smooth;
      cv::GaussianBlur(light(where), smooth, cv::Size(), sigma, sigma, cv::BORDER_CONSTANT | cv::BORDER_ISOLATED);
      smooth.copyTo(light(where));
    }
    area.include(room);
  }
  const float scale = 1 / std::log1p(kBrightest);
  for (int row = area.bottom; row < area.top; ++row) {
    cv::Vec4b* line = out[kSheetCells - 1 - row];
    for (int column = area.left; column < area.right; ++column) {
      const float suns = std::max(0.0f, light(row, column) - kDimmest);
      const float sun = std::min(1.0f, std::log1p(suns) * scale);
      const float heat = std::clamp(
          (temperature_k[SheetGrid::index(column, row)] - kGlowFrom_k) / (kGlowFull_k - kGlowFrom_k), 0.0f, 1.0f);
      // Sunlight is warm white, whiter where there is more; the glow goes from deep red to yellow.
      const float sun_a = std::pow(sun, 1.1f), glow_a = std::min(1.0f, 1.6f * heat);
      const float r = sun_a + glow_a, g = sun_a * (0.92f + 0.08f * sun) + glow_a * (0.22f + 0.55f * heat),
                  b = sun_a * (0.74f + 0.26f * sun * sun) + glow_a * (0.03f + 0.2f * heat * heat);
      const float most = std::max({r, g, b});
      if (most < 0.004f) continue;
      line[column] = cv::Vec4b(byte(r / most), byte(g / most), byte(b / most), byte(std::min(most, 0.97f)));
    }
  }
  return out;
}

}  // namespace parallax::burning
