#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "render/synthetic_paint.h"

namespace parallax::paint {

std::string random_text(int letters, cv::RNG& rng) {
  static constexpr std::array<const char*, 16> kSyllables = {"par", "al", "lax", "ma",  "trix", "ti",  "lon", "ver",
                                                             "do",  "sk", "cam", "era", "ke",   "yfr", "am",  "ust"};
  std::string out;
  while (static_cast<int>(out.size()) < letters) {
    if (!out.empty() && rng.uniform(0, 3) == 0) out += ' ';
    out += kSyllables[static_cast<std::size_t>(rng.uniform(0, 16))];
  }
  if (rng.uniform(0, 3) == 0)
    for (char& c : out) c = static_cast<char>(std::toupper(c));
  return out;
}

void print_line(Picture& picture, const std::string& text, cv::Point top_left, int width, double height, int font,
                const cv::Scalar& colour) {
  static constexpr std::array<int, 5> kFonts = {cv::FONT_HERSHEY_SIMPLEX, cv::FONT_HERSHEY_COMPLEX,
                                                cv::FONT_HERSHEY_DUPLEX, cv::FONT_HERSHEY_TRIPLEX,
                                                cv::FONT_HERSHEY_PLAIN};
  const int face = kFonts[static_cast<std::size_t>(font) % kFonts.size()];
  // Capitals are 21 units high in the Hershey fonts (12 in the plain one, which is drawn smaller).
  const double scale = height / (face == cv::FONT_HERSHEY_PLAIN ? 12.0 : 24.0);
  std::string line = text;
  while (!line.empty() && cv::getTextSize(line, face, scale, 1, nullptr).width > width) line.pop_back();
  cv::putText(picture, line, {top_left.x, top_left.y + static_cast<int>(height)}, face, scale, colour,
              std::max(1, static_cast<int>(height / 12)), cv::LINE_AA);
}

void bar_code(Picture& picture, cv::Rect where, cv::RNG& rng) {
  cv::rectangle(picture, where, {235, 238, 238}, -1);
  const int margin = std::max(1, where.width / 12);
  for (int x = where.x + margin; x < where.x + where.width - margin;) {
    const int bar = rng.uniform(1, 1 + std::max(2, where.width / 24));
    if (rng.uniform(0, 2))
      cv::rectangle(picture, {x, where.y + margin}, {x + bar - 1, where.y + where.height - margin}, {25, 25, 25}, -1);
    x += bar;
  }
}

Picture photograph(cv::Size size, cv::RNG& rng) {
  // A landscape: sky, ridges one behind the other, and a foreground of blades; every part with noise of its own.
  Picture out(size);
  const cv::Mat1f clouds = fractal_noise(size, size.width / 2.0, 0.6, rng, 2);
  const cv::Mat1f rough = fractal_noise(size, size.width / 4.0, 0.8, rng);
  const cv::Scalar sky = {rng.uniform(170.0, 250.0), rng.uniform(140.0, 200.0), rng.uniform(90.0, 210.0)};
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) {
      const float light = 0.75f + 0.35f * static_cast<float>(y) / static_cast<float>(size.height) + 0.5f * clouds(y, x);
      for (int c = 0; c < 3; ++c) out(y, x)[c] = cv::saturate_cast<uchar>(static_cast<float>(sky[c]) * light);
    }
  const int ridges = rng.uniform(2, 5);
  for (int k = 0; k < ridges; ++k) {
    const cv::Scalar colour = random_colour(rng, 20, 170) * (1.0 - 0.12 * k);
    const double base = size.height * (0.3 + 0.5 * (k + rng.uniform(0.0, 0.6)) / ridges);
    const cv::Mat1f line = fractal_noise({size.width, 2}, size.width / 2.0, 0.55, rng);
    for (int x = 0; x < size.width; ++x)
      for (int y = std::max(0, static_cast<int>(base + line(0, x) * size.height * 0.25)); y < size.height; ++y)
        for (int c = 0; c < 3; ++c)
          out(y, x)[c] = cv::saturate_cast<uchar>(static_cast<float>(colour[c]) * (1.0f + 0.9f * rough(y, x)));
  }
  const int blades = size.width / 3;
  const cv::Scalar blade = random_colour(rng, 40, 170);
  for (int k = 0; k < blades; ++k) {
    const cv::Point root(rng.uniform(0, size.width), size.height - rng.uniform(0, std::max(1, size.height / 10)));
    const cv::Point tip(root.x + rng.uniform(-size.width / 10 - 1, size.width / 10 + 1),
                        root.y - rng.uniform(0, size.height / 3 + 1));
    cv::line(out, root, tip, blade * rng.uniform(0.35, 1.5), 1 + size.width / 300, cv::LINE_AA);
  }
  return out;
}

Picture printed_page(cv::Size size, cv::RNG& rng) {
  Picture out = plain(size, {232, 238, 240});
  const int margin = size.width / 12, line = std::max(8, size.height / 62);
  int y = margin;
  print_line(out, random_text(16, rng), {margin, y}, size.width - 2 * margin, line * 2.2, rng.uniform(1, 4),
             {30, 25, 25});
  y += line * 4;
  const int figure_at = rng.uniform(0, 3) * size.height / 4;
  bool figure_done = rng.uniform(0, 4) == 0;
  const int font = rng.uniform(0, 5);
  while (y < size.height - margin - line) {
    if (!figure_done && y > figure_at) {
      const cv::Rect box(margin + rng.uniform(0, size.width / 5), y, size.width * 6 / 10, size.height * 22 / 100);
      if (box.br().y < size.height - margin) {
        photograph(box.size(), rng).copyTo(out(box));
        cv::rectangle(out, box, {20, 20, 20}, 1);
        y += box.height + line;
      }
      figure_done = true;
    }
    const bool last = rng.uniform(0, 6) == 0, headline = rng.uniform(0, 14) == 0;
    const int width = (size.width - 2 * margin) * (last ? rng.uniform(3, 8) : 10) / 10;
    if (headline) {
      y += line;
      print_line(out, random_text(14, rng), {margin, y}, width, line * 1.2, rng.uniform(1, 4), {120, 30, 30});
      y += line * 2;
    } else {
      print_line(out, random_text(90, rng), {margin, y}, width, line * 0.78, font, {50, 48, 46});
      y += line * (last ? 2 : 1) + line / 3;
    }
  }
  cv::rectangle(out, {0, 0}, {size.width - 1, size.height - 1}, {190, 195, 196}, 1);
  add_mottle(out, 7, 64, 0.8, rng);
  return out;
}

Picture book_cover(cv::Size size, cv::RNG& rng) {
  Picture out = plain(size, random_colour(rng, 20, 200));
  const cv::Rect photo(size.width / 10, size.height * 4 / 10, size.width * 8 / 10, size.height * 5 / 10);
  photograph(photo.size(), rng).copyTo(out(photo));
  const cv::Scalar ink = random_colour(rng, 170, 255);
  print_line(out, random_text(9, rng), {size.width / 12, size.height / 14}, size.width, size.height / 9.0,
             rng.uniform(1, 4), ink);
  print_line(out, random_text(14, rng), {size.width / 12, size.height * 23 / 100}, size.width, size.height / 18.0,
             rng.uniform(0, 4), ink);
  print_line(out, random_text(18, rng), {size.width / 12, size.height * 32 / 100}, size.width, size.height / 30.0, 0,
             ink);
  add_collage(out, 6, size.width / 20 + 1, size.width / 4, rng);
  add_mottle(out, 22, size.width / 2.0, 0.75, rng);
  return out;
}

Picture page_edges(cv::Size size, cv::RNG& rng) {
  Picture out(size);
  const cv::Mat1f grain = fractal_noise(size, 16, 0.9, rng, 20);
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) {
      const bool cover = y < size.height / 10 || y >= size.height * 9 / 10;
      const float v = (cover ? 90.0f : 200.0f) * (1.0f + 0.35f * grain(y, x));
      out(y, x) = {cv::saturate_cast<uchar>(v * 0.9f), cv::saturate_cast<uchar>(v * 0.97f),
                   cv::saturate_cast<uchar>(v)};
    }
  return out;
}

Picture cardboard(cv::Size size, cv::RNG& rng) {
  Picture out = plain(size, {96, 138, 172});
  add_mottle(out, 34, size.width / 3.0, 0.75, rng);
  const int w = size.width, h = size.height;
  cv::rectangle(out, {0, h * 44 / 100}, {w, h * 52 / 100}, {120, 168, 196}, -1);
  print_line(out, random_text(7, rng), {w / 12, h / 10}, w * 9 / 10, h / 6.0, rng.uniform(1, 4), {30, 30, 150});
  print_line(out, random_text(12, rng), {w / 12, h * 33 / 100}, w * 9 / 10, h / 14.0, rng.uniform(0, 4), {40, 40, 40});
  bar_code(out, {w * 6 / 10, h * 7 / 10, w * 3 / 10, h * 2 / 10}, rng);
  for (int i = 0; i < 5; ++i)
    print_line(out, random_text(18, rng), {w / 12, h * (62 + 6 * i) / 100}, w / 2, h / 26.0, 0, {40, 50, 60});
  add_mottle(out, 14, 8, 1.0, rng);
  return out;
}

Picture keyboard(cv::Size size, cv::RNG& rng) {
  Picture out = plain(size, {38, 36, 36});
  const int rows = 6, columns = 20;
  const double kw = size.width * 0.96 / columns, kh = size.height * 0.9 / rows;
  static const std::string kLegends = "QWERTYUIOPASDFGHJKLZXCVBNM1234567890-=[];',./#";
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < columns; ++c) {
      const double shift = r % 5 * 0.2 * kw * (c < 13 ? 1 : 0);
      const cv::Point a(static_cast<int>(size.width * 0.02 + c * kw + shift * 0.5 + kw * 0.07),
                        static_cast<int>(size.height * 0.05 + r * kh + kh * 0.07));
      const cv::Point b(static_cast<int>(a.x + kw * 0.84), static_cast<int>(a.y + kh * 0.84));
      if (r == rows - 1 && c > 4 && c < 9) continue;
      const double tone = rng.uniform(62.0, 84.0);
      cv::rectangle(out, a, b, {16, 16, 16}, -1);
      cv::rectangle(out, {a.x + static_cast<int>(kw * 0.08), a.y + static_cast<int>(kh * 0.04)},
                    {b.x - static_cast<int>(kw * 0.08), b.y - static_cast<int>(kh * 0.14)}, {tone, tone, tone * 0.97},
                    -1);
      const std::string legend(1,
                               kLegends[static_cast<std::size_t>(rng.uniform(0, static_cast<int>(kLegends.size())))]);
      print_line(out, legend, {a.x + static_cast<int>(kw * 0.2), a.y + static_cast<int>(kh * 0.12)}, size.width,
                 kh * 0.36, 2, {225, 228, 228});
    }
  const int space_y = static_cast<int>(size.height * 0.05 + 5 * kh + kh * 0.1);
  cv::rectangle(out, {static_cast<int>(size.width * 0.02 + 5.3 * kw), space_y},
                {static_cast<int>(size.width * 0.02 + 9.2 * kw), static_cast<int>(space_y + kh * 0.7)}, {76, 76, 74},
                -1);
  add_mottle(out, 9, 8, 1.0, rng);
  return out;
}

Picture can_label(cv::Size size, cv::RNG& rng) {
  const cv::Scalar base = random_colour(rng, 20, 200), ink = random_colour(rng, 150, 255);
  Picture out = plain(size, base);
  const int w = size.width, h = size.height;
  cv::rectangle(out, {0, 0}, {w, h / 14}, {175, 175, 178}, -1);
  cv::rectangle(out, {0, h * 13 / 14}, {w, h}, {175, 175, 178}, -1);
  cv::rectangle(out, {0, h * 7 / 10}, {w, h * 8 / 10}, ink * 0.7, -1);
  for (int i = 0; i < 2; ++i) {
    const int x = w * i / 2;
    print_line(out, random_text(6, rng), {x + w / 40, h / 5}, w * 4 / 10, h / 5.0, 3, ink);
    print_line(out, random_text(10, rng), {x + w / 40, h * 48 / 100}, w * 4 / 10, h / 10.0, 1, ink);
  }
  for (int i = 0; i < 7; ++i)
    print_line(out, random_text(22, rng), {w * 28 / 100, h * (20 + 6 * i) / 100}, w * 18 / 100, h / 22.0, 0, ink);
  bar_code(out, {w * 82 / 100, h / 4, w * 14 / 100, h / 3}, rng);
  const cv::Rect photo(w * 66 / 100, h / 5, w * 13 / 100, h * 45 / 100);
  photograph(photo.size(), rng).copyTo(out(photo));
  add_mottle(out, 16, w / 4.0, 0.8, rng);
  return out;
}

Picture book_shelf(cv::Size size, cv::RNG& rng) {
  Picture out = plain(size, {24, 30, 40});
  const int shelves = 5, board = size.height / 60;
  for (int r = 0; r < shelves; ++r) {
    const int bottom = size.height * (r + 1) / shelves - board, room = size.height / shelves - 2 * board;
    for (int x = size.width / 40; x < size.width * 39 / 40;) {
      const int w = rng.uniform(size.width / 50, size.width / 20), h = room * rng.uniform(62, 96) / 100;
      const cv::Scalar colour = random_colour(rng, 20, 215);
      cv::rectangle(out, {x, bottom - h}, {x + w - 2, bottom}, colour, -1);
      cv::rectangle(out, {x, bottom - h * 8 / 10}, {x + w - 2, bottom - h * 7 / 10}, colour * 0.5, -1);
      // Titles run up the back: printed on a strip that is then turned.
      Picture strip = plain({h * 6 / 10, std::max(6, w - 6)}, colour);
      print_line(strip, random_text(12, rng), {2, 1}, strip.cols - 4, strip.rows * 0.6, rng.uniform(0, 4),
                 random_colour(rng, 180, 255));
      cv::Mat turned;
      cv::rotate(strip, turned, cv::ROTATE_90_CLOCKWISE);
      const cv::Rect where(x + 2, bottom - h * 65 / 100, turned.cols, turned.rows);
      if ((where & cv::Rect({0, 0}, size)) == where) turned.copyTo(out(where));
      x += w;
    }
    cv::rectangle(out, {0, bottom}, {size.width, bottom + board}, {60, 88, 120}, -1);
  }
  cv::rectangle(out, {0, 0}, {size.width - 1, size.height - 1}, {60, 88, 120}, size.width / 40);
  add_mottle(out, 16, 16, 0.9, rng);
  return out;
}

Picture screen(cv::Size size, cv::RNG& rng) {
  Picture out = photograph(size, rng);
  for (int i = 0; i < 3; ++i) {
    const int w = size.width * 45 / 100, h = size.height * 4 / 10;
    const cv::Rect box(size.width / 30 + i * size.width / 5, size.height / 12 + i * size.height / 5, w, h);
    cv::rectangle(out, box, {236, 236, 234}, -1);
    cv::rectangle(out, {box.x, box.y}, {box.x + w, box.y + h / 10}, {150, 80, 50}, -1);
    for (int y = box.y + h / 7; y < box.y + h - h / 12; y += std::max(6, h / 14))
      print_line(out, random_text(60, rng), {box.x + w / 30, y}, w * rng.uniform(5, 10) / 10 - w / 15, h / 22.0, 0,
                 {40, 40, 40});
  }
  cv::rectangle(out, {0, 0}, {size.width - 1, size.height - 1}, {28, 28, 28}, size.width / 50);
  add_mottle(out, 6, 4, 1.0, rng);
  return out;
}

Picture poster(cv::Size size, cv::RNG& rng) {
  Picture out = plain(size, {225, 228, 230});
  const int b = size.width / 16;
  const cv::Rect photo(b, b, size.width - 2 * b, size.height * 3 / 4 - b);
  photograph(photo.size(), rng).copyTo(out(photo));
  print_line(out, random_text(10, rng), {b, size.height * 78 / 100}, size.width - 2 * b, size.height / 12.0, 3,
             {30, 30, 40});
  print_line(out, random_text(24, rng), {b, size.height * 90 / 100}, size.width - 2 * b, size.height / 28.0, 0,
             {60, 60, 60});
  add_collage(out, 12, size.width / 24 + 1, size.width / 4, rng);
  add_mottle(out, 14, 32, 0.9, rng);
  return out;
}

}  // namespace parallax::paint
