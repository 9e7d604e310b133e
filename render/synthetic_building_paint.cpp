#include "render/synthetic_building_paint.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace parallax::paint {

namespace {

// Boards on end: grain that runs up and down, with a groove between the boards.
Picture upright_boards(cv::Size size, double px_per_metre, cv::RNG& rng) {
  const cv::Scalar colour(70 + rng.uniform(-8, 8), 104 + rng.uniform(-8, 8), 146 + rng.uniform(-10, 10));
  Picture out;
  cv::rotate(wood({size.height, size.width}, px_per_metre, colour, rng), out, cv::ROTATE_90_CLOCKWISE);
  const int board = size.width / 8;
  for (int i = 0; i < 8; ++i) {
    const cv::Rect where(i * board, 0, board, size.height);
    Picture part = out(where);
    part *= rng.uniform(0.8, 1.1);
    cv::line(out, {i * board, 0}, {i * board, size.height}, {24, 34, 46}, 2);
  }
  return out;
}

void scuffs(Picture& picture, int count, int lowest, cv::RNG& rng) {
  for (int i = 0; i < count; ++i) {
    const cv::Point p(rng.uniform(0, picture.cols), rng.uniform(picture.rows * lowest / 100, picture.rows));
    const cv::Point q(p.x + rng.uniform(-30, 31), p.y + rng.uniform(-9, 10));
    const double tone = rng.uniform(60.0, 150.0);
    cv::line(picture, p, q, {tone, tone, tone}, rng.uniform(1, 3), cv::LINE_AA);
  }
}

}  // namespace

Picture corridor_wall(WallKind kind, cv::Size size, double px_per_metre, cv::RNG& rng) {
  Picture out;
  const auto px = [&](double metres) { return static_cast<int>(metres * px_per_metre); };
  switch (kind) {
    case WallKind::bare:
      out = plain(size, {196, 203, 206});
      add_mottle(out, 9, 256, 0.8, rng);
      scuffs(out, 3, 70, rng);
      break;
    case WallKind::plaster:
      out = plain(size, {188, 200, 205});
      add_mottle(out, 26, 128, 0.85, rng);
      scuffs(out, 12, 40, rng);
      break;
    case WallKind::dado: {
      out = plain(size, {190, 202, 206});
      add_mottle(out, 14, 128, 0.85, rng);
      const cv::Rect low(0, size.height - px(1.1), size.width, px(1.1));
      Picture painted = plain(low.size(), {104, 122, 110});
      add_mottle(painted, 40, 64, 0.85, rng);
      painted.copyTo(out(low));
      cv::rectangle(out, {0, low.y - px(0.015)}, {size.width, low.y + px(0.015)}, {60, 66, 62}, -1);
      scuffs(out, 16, 60, rng);
      break;
    }
    case WallKind::brick:
      out = bricks(size, px(0.275), rng);
      out *= 1.25;
      break;
    case WallKind::panel:
      out = upright_boards(size, px_per_metre, rng);
      break;
    case WallKind::concrete:
      out = plain(size, {160, 164, 164});
      add_mottle(out, 48, 96, 0.9, rng);
      for (int y = px(0.4); y < size.height; y += px(0.75))
        for (int x = size.width / 8; x < size.width; x += size.width / 4)
          cv::circle(out, {x + rng.uniform(-3, 4), y + rng.uniform(-3, 4)}, px(0.013), {60, 62, 62}, -1, cv::LINE_AA);
      cv::line(out, {0, px(1.3)}, {size.width, px(1.3)}, {112, 116, 116}, 2);
      cv::line(out, {0, 0}, {0, size.height}, {112, 116, 116}, 2);
      break;
  }
  // The light falls off towards the floor; skirting board.
  for (int y = 0; y < size.height; ++y) {
    Picture row = out.row(y);
    row *= 1.03 - 0.12 * y / size.height;
  }
  cv::rectangle(out, {0, size.height - px(0.1)}, {size.width, size.height}, {62, 66, 70}, -1);
  cv::line(out, {0, size.height - px(0.1)}, {size.width, size.height - px(0.1)}, {30, 32, 34}, 1);
  return out;
}

Picture corridor_floor(FloorKind kind, int side_px, int tiles, cv::RNG& rng) {
  const cv::Size size(side_px, side_px);
  if (kind == FloorKind::carpet) {
    Picture out = carpet(size, {92, 84, 96}, rng);
    for (int i = 0; i < 30; ++i)
      cv::circle(out, {rng.uniform(0, side_px), rng.uniform(0, side_px)}, rng.uniform(1, 5),
                 random_colour(rng, 30, 140), -1, cv::LINE_AA);
    return out;
  }
  if (kind == FloorKind::lino) {
    Picture out = plain(size, {146, 152, 150});
    add_mottle(out, 34, 48, 0.9, rng);
    for (int i = 0; i < 900; ++i) {
      const double tone = rng.uniform(0, 2) ? 70 : 215;
      cv::circle(out, {rng.uniform(0, side_px), rng.uniform(0, side_px)}, rng.uniform(1, 3), {tone, tone, tone}, -1,
                 cv::LINE_AA);
    }
    return out;
  }
  Picture out(size);
  const int tile = side_px / tiles;
  for (int r = 0; r < tiles; ++r)
    for (int c = 0; c < tiles; ++c) {
      const double tone = ((r + c) % 2 ? 196 : 104) + rng.uniform(-16, 17);
      cv::rectangle(out, cv::Rect(c * tile, r * tile, tile, tile), {tone * 0.96, tone, tone}, -1);
      cv::rectangle(out, cv::Rect(c * tile, r * tile, tile, tile), {84, 86, 86}, 1);
    }
  add_mottle(out, 44, tile / 1.5, 0.85, rng);
  return out;
}

Picture corridor_ceiling(int side_px, int panels, cv::RNG& rng) {
  const cv::Size size(side_px, side_px);
  Picture out = plain(size, {196, 200, 200});
  add_mottle(out, 22, 24, 0.95, rng);
  const int panel = side_px / panels;
  for (int i = 0; i < 500; ++i)
    cv::circle(out, {rng.uniform(0, side_px), rng.uniform(0, side_px)}, 1, {120, 122, 122}, -1, cv::LINE_AA);
  for (int i = 0; i < panels; ++i) {
    cv::line(out, {i * panel, 0}, {i * panel, side_px}, {126, 130, 130}, 3);
    cv::line(out, {0, i * panel}, {side_px, i * panel}, {126, 130, 130}, 3);
  }
  return out;
}

Picture corridor_door(cv::Size size, const cv::Scalar& colour, cv::RNG& rng) {
  const int w = size.width, h = size.height, frame = w / 16;
  Picture out = plain(size, colour * 0.55);
  const cv::Rect leaf(frame, frame, w - 2 * frame, h - frame);
  Picture wooden;
  cv::rotate(wood({leaf.height, leaf.width}, 210, colour, rng), wooden, cv::ROTATE_90_CLOCKWISE);
  wooden.copyTo(out(leaf));
  cv::rectangle(out, leaf, {20, 22, 26}, 2);
  for (const int part : {12, 54})
    cv::rectangle(out, cv::Rect(w / 5, h * part / 100, w * 3 / 5, h * 32 / 100), colour * 0.5, std::max(2, w / 60));
  const cv::Point handle(w * 84 / 100, h / 2);
  cv::rectangle(out, {handle.x - w / 40, handle.y - h / 40}, {handle.x + w / 40, handle.y + h / 20}, {170, 178, 180},
                -1);
  cv::line(out, handle, {handle.x - w / 8, handle.y}, {205, 212, 214}, std::max(2, w / 40), cv::LINE_AA);
  cv::rectangle(out, {frame, h - h / 14}, {w - frame, h}, {150, 154, 156}, -1);
  add_mottle(out, 14, 32, 0.85, rng);
  return out;
}

Picture name_plate(cv::Size size, const std::string& text, cv::RNG& rng) {
  Picture out = plain(size, {222, 224, 224});
  cv::rectangle(out, {0, 0}, {size.width - 1, size.height - 1}, {60, 60, 60}, 2);
  print_line(out, text, {size.width / 10, size.height / 6}, size.width, size.height * 0.36, 2, {30, 26, 24});
  print_line(out, random_text(14, rng), {size.width / 10, size.height * 64 / 100}, size.width * 8 / 10,
             size.height * 0.16, 0, {70, 70, 70});
  add_mottle(out, 6, 8, 1.0, rng);
  return out;
}

Picture notice_board(cv::Size size, cv::RNG& rng) {
  Picture out = plain(size, {92, 128, 160});
  add_mottle(out, 46, 12, 0.95, rng);
  for (int i = 0; i < 13; ++i) {
    const int w = size.width * rng.uniform(10, 20) / 100,
              h = std::min(w * rng.uniform(100, 142) / 100, size.height * 6 / 10);
    const cv::Rect where(rng.uniform(4, size.width - w - 4), rng.uniform(4, size.height - h - 4), w, h);
    (i % 3 == 0 ? poster(where.size(), rng) : printed_page(where.size(), rng)).copyTo(out(where));
    cv::circle(out, {where.x + w / 2, where.y + 4}, 3, random_colour(rng, 20, 220), -1, cv::LINE_AA);
  }
  cv::rectangle(out, {0, 0}, {size.width - 1, size.height - 1}, {50, 66, 84}, size.width / 30);
  return out;
}

Picture window_view(cv::Size size, cv::RNG& rng) {
  Picture out = photograph(size, rng);
  out *= 1.2;
  const int bar = size.width / 24;
  cv::rectangle(out, {0, 0}, {size.width - 1, size.height - 1}, {214, 216, 216}, 2 * bar);
  cv::rectangle(out, {size.width / 2 - bar / 2, 0}, {size.width / 2 + bar / 2, size.height}, {208, 210, 210}, -1);
  cv::rectangle(out, {0, size.height * 7 / 10}, {size.width, size.height * 7 / 10 + bar}, {208, 210, 210}, -1);
  cv::rectangle(out, {0, 0}, {size.width - 1, size.height - 1}, {90, 94, 94}, 2);
  add_mottle(out, 6, 16, 0.9, rng);
  return out;
}

Picture radiator(cv::Size size, cv::RNG& rng) {
  Picture out = plain(size, {206, 210, 210});
  const int rib = std::max(6, size.width / 24);
  for (int x = 0; x < size.width; x += rib) {
    cv::rectangle(out, {x, 0}, {x + rib / 4, size.height}, {112, 116, 116}, -1);
    cv::line(out, {x + rib / 2, 0}, {x + rib / 2, size.height}, {228, 230, 230}, 1);
  }
  cv::rectangle(out, {0, 0}, {size.width - 1, size.height - 1}, {150, 154, 154}, 2);
  add_mottle(out, 16, 24, 0.9, rng);
  return out;
}

Picture stair_tread(cv::Size size, cv::RNG& rng) {
  Picture out = plain(size, {150, 152, 152});
  add_mottle(out, 50, 20, 0.92, rng);
  cv::rectangle(out, {0, size.height * 8 / 10}, {size.width, size.height}, {62, 64, 66}, -1);
  for (int i = 0; i < 160; ++i)
    cv::circle(out, {rng.uniform(0, size.width), rng.uniform(0, size.height)}, rng.uniform(1, 3),
               random_colour(rng, 40, 230), -1, cv::LINE_AA);
  return out;
}

}  // namespace parallax::paint
