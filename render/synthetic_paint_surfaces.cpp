#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "render/synthetic_paint.h"

namespace parallax::paint {

cv::Mat1f fractal_noise(cv::Size size, double coarsest_px, double persistence, cv::RNG& rng, double stretch) {
  // From coarse to fine, doubling the size each time.
  int octaves = 1;
  while (coarsest_px / (1 << octaves) >= 1.0) ++octaves;
  cv::Mat1f sum;
  double strength = 1, total = 0;
  for (int i = octaves - 1; i >= 0; --i) {
    const cv::Size s((size.width >> i) + 2, (size.height >> i) + 2);
    if (sum.empty())
      sum = cv::Mat1f::zeros(s);
    else
      cv::resize(sum, sum, s, 0, 0, cv::INTER_LINEAR);
    cv::Mat1f layer(s.height, stretch > 1 ? std::max(2, static_cast<int>(s.width / stretch)) : s.width);
    rng.fill(layer, cv::RNG::UNIFORM, -1.0, 1.0);
    if (layer.cols != s.width) cv::resize(layer, layer, s, 0, 0, cv::INTER_LINEAR);
    cv::scaleAdd(layer, strength, sum, sum);
    total += strength;
    strength *= persistence;
  }
  sum = sum(cv::Rect(0, 0, size.width, size.height)).clone();
  sum *= 2.0 / total;
  return sum;
}

void add_mottle(Picture& picture, double strength, double coarsest_px, double persistence, cv::RNG& rng) {
  const cv::Mat1f noise = fractal_noise(picture.size(), coarsest_px, persistence, rng);
  for (int y = 0; y < picture.rows; ++y)
    for (int x = 0; x < picture.cols; ++x) {
      const float d = noise(y, x) * static_cast<float>(strength);
      for (int c = 0; c < 3; ++c) picture(y, x)[c] = cv::saturate_cast<uchar>(picture(y, x)[c] + d);
    }
}

cv::Scalar random_colour(cv::RNG& rng, int low, int high) {
  return {static_cast<double>(rng.uniform(low, high)), static_cast<double>(rng.uniform(low, high)),
          static_cast<double>(rng.uniform(low, high))};
}

Picture plain(cv::Size size, const cv::Scalar& colour) {
  return Picture(size, cv::Vec3b(cv::saturate_cast<uchar>(colour[0]), cv::saturate_cast<uchar>(colour[1]),
                                 cv::saturate_cast<uchar>(colour[2])));
}

Picture wood(cv::Size size, double px_per_metre, const cv::Scalar& colour, cv::RNG& rng) {
  Picture out(size);
  // Growth rings: slow waves across the grain, broken up by noise stretched along it; fine fibres on top.
  const cv::Mat1f warp = fractal_noise(size, 0.25 * px_per_metre, 0.5, rng, 6);
  const cv::Mat1f fibre = fractal_noise(size, 0.01 * px_per_metre, 0.85, rng, 24);
  const cv::Mat1f speckle = fractal_noise(size, 4, 1.0, rng);
  const double ring_px = 0.022 * px_per_metre;
  constexpr int kTable = 1024;
  float ring_table[kTable];
  for (int i = 0; i < kTable; ++i) {
    const double phase = static_cast<double>(i) / kTable;  // sharp late wood, soft early wood
    ring_table[i] = static_cast<float>(std::pow(phase, 3) * 1.2 - 0.3 - (phase > 0.94 ? (phase - 0.94) * 20 : 0));
  }
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) {
      const float rings = static_cast<float>(y / ring_px) + 5.0f * warp(y, x) + 1000.0f;
      const float ring = ring_table[static_cast<int>((rings - std::floor(rings)) * kTable) % kTable];
      const float shade = 1.0f - 0.26f * ring + 0.2f * fibre(y, x) + 0.07f * warp(y, x) + 0.06f * speckle(y, x);
      for (int c = 0; c < 3; ++c)
        out(y, x)[c] = cv::saturate_cast<uchar>(static_cast<float>(colour[c]) * (c == 0 ? shade * shade : shade));
    }
  // Knots, scratches, crumbs and the ring a mug has left.
  const double area = static_cast<double>(size.area()) / (px_per_metre * px_per_metre);
  const auto at = [&] { return cv::Point(rng.uniform(0, size.width), rng.uniform(0, size.height)); };
  for (int i = 0; i < 14 * area; ++i) {
    const int r = std::max(1, static_cast<int>(px_per_metre * rng.uniform(0.002, 0.006)));
    cv::ellipse(out, at(), {r * 2, r}, rng.uniform(-20, 20), 0, 360, colour * 0.35, -1, cv::LINE_AA);
  }
  for (int i = 0; i < 40 * area; ++i) {
    const cv::Point p = at();
    const double angle = rng.uniform(0.0, 6.28), length = px_per_metre * rng.uniform(0.01, 0.12);
    const cv::Point q(p.x + static_cast<int>(length * std::cos(angle)),
                      p.y + static_cast<int>(length * std::sin(angle)));
    cv::line(out, p, q, colour * rng.uniform(0.35, 1.35), rng.uniform(1, 3), cv::LINE_AA);
  }
  for (int i = 0; i < 160 * area; ++i)
    cv::circle(out, at(), std::max(1, static_cast<int>(px_per_metre * rng.uniform(0.0006, 0.002))),
               colour * (rng.uniform(0, 2) ? 0.3 : 1.5), -1, cv::LINE_AA);
  for (int i = 0; i < 4 * area; ++i)
    cv::circle(out, at(), static_cast<int>(px_per_metre * rng.uniform(0.035, 0.05)), colour * 0.55,
               std::max(1, static_cast<int>(px_per_metre * 0.0015)), cv::LINE_AA);
  return out;
}

Picture carpet(cv::Size size, const cv::Scalar& colour, cv::RNG& rng) {
  Picture out = plain(size, colour);
  add_mottle(out, 55, 32, 0.95, rng);
  return out;
}

Picture plaster(cv::Size size, const cv::Scalar& colour, cv::RNG& rng) {
  Picture out = plain(size, colour);
  add_mottle(out, 22, 256, 0.75, rng);
  return out;
}

Picture bricks(cv::Size size, int brick_px, cv::RNG& rng) {
  Picture out = plain(size, {150, 158, 165});
  const int height = brick_px / 2, gap = std::max(1, brick_px / 16);
  for (int row = 0; row * height < size.height; ++row)
    for (int x = row % 2 ? -brick_px / 2 : 0; x < size.width; x += brick_px) {
      const double shade = rng.uniform(0.65, 1.2);
      const cv::Scalar colour = cv::Scalar(62 + rng.uniform(-15, 15), 82 + rng.uniform(-18, 18), 150) * shade;
      const int jitter = gap > 2 ? rng.uniform(0, gap / 2) : 0;
      cv::rectangle(out, {x + gap / 2 + jitter, row * height + gap / 2},
                    {x + brick_px - gap / 2 - 1, row * height + height - gap / 2 - 1 - jitter}, colour, -1);
    }
  add_mottle(out, 50, brick_px * 2.0, 0.8, rng);
  return out;
}

Picture tiles(cv::Size size, int tile_px, cv::RNG& rng) {
  Picture tile = plain({tile_px, tile_px}, {196, 204, 208});
  add_collage(tile, 7, tile_px / 8, tile_px / 3, rng);
  add_mottle(tile, 14, tile_px / 2.0, 0.8, rng);
  cv::rectangle(tile, {0, 0}, {tile_px - 1, tile_px - 1}, {70, 74, 78}, std::max(1, tile_px / 32));
  Picture out(size);
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) out(y, x) = tile(y % tile_px, x % tile_px);
  return out;
}

void add_collage(Picture& picture, int count, int smallest_px, int largest_px, cv::RNG& rng) {
  const double ratio = static_cast<double>(largest_px) / smallest_px;
  for (int i = 0; i < count; ++i) {
    // Many small things, few large ones; the large ones first, so that they do not hide the small.
    const double rank = (i + rng.uniform(0.0, 1.0)) / count;
    const int r = std::max(1, static_cast<int>(largest_px * std::pow(ratio, -std::sqrt(rank)) / 2));
    const cv::Point p(rng.uniform(0, picture.cols), rng.uniform(0, picture.rows));
    const cv::Scalar colour = random_colour(rng, 15, 240);
    switch (rng.uniform(0, 7)) {
      case 0:
        cv::rectangle(picture,
                      cv::RotatedRect(p, cv::Size2f(static_cast<float>(r) * 2, static_cast<float>(r) * 1.3f),
                                      static_cast<float>(rng.uniform(0, 180)))
                          .boundingRect(),
                      colour, rng.uniform(0, 2) ? -1 : std::max(1, r / 5), cv::LINE_AA);
        break;
      case 1:
        cv::circle(picture, p, r, colour, rng.uniform(0, 2) ? -1 : std::max(1, r / 4), cv::LINE_AA);
        break;
      case 2: {
        std::vector<cv::Point> corners;
        const int n = rng.uniform(3, 7);
        for (int k = 0; k < n; ++k) {
          const double angle = (k + rng.uniform(0.0, 0.8)) * 6.2832 / n, length = r * rng.uniform(0.6, 1.3);
          corners.emplace_back(p.x + static_cast<int>(length * std::cos(angle)),
                               p.y + static_cast<int>(length * std::sin(angle)));
        }
        cv::fillPoly(picture, std::vector<std::vector<cv::Point>>{corners}, colour, cv::LINE_AA);
        break;
      }
      case 3:
        cv::line(picture, p, {p.x + rng.uniform(-3 * r, 3 * r + 1), p.y + rng.uniform(-3 * r, 3 * r + 1)}, colour,
                 std::max(1, r / 6), cv::LINE_AA);
        break;
      case 4: {
        const cv::Rect box = cv::Rect(p.x - r, p.y - r, 2 * r, 2 * r) & cv::Rect({0, 0}, picture.size());
        if (box.width > 12 && box.height > 12) photograph(box.size(), rng).copyTo(picture(box));
        break;
      }
      default:
        print_line(picture, random_text(rng.uniform(3, 10), rng), p, 8 * r, std::max(5, r), rng.uniform(0, 5), colour);
    }
  }
}

}  // namespace parallax::paint
