// Procedural pictures for synthetic scenes, with detail at every scale: noise of many octaves, grain, print, collages.
// Every painter returns a picture whose size texture_size() accepts, and draws only from the generator it is given.
#pragma once

#include <opencv2/core.hpp>
#include <string>

namespace parallax::paint {

using Picture = cv::Mat3b;

// Noise of many octaves, zero mean, roughly within -1..1. Details shrink from `coarsest_px` to one pixel; each octave
// has `persistence` times the strength of the coarser one. `stretch` > 1 draws it out along x.
cv::Mat1f fractal_noise(cv::Size size, double coarsest_px, double persistence, cv::RNG& rng, double stretch = 1);
// Adds noise of many octaves to every channel alike, +-strength grey levels.
void add_mottle(Picture& picture, double strength, double coarsest_px, double persistence, cv::RNG& rng);

cv::Scalar random_colour(cv::RNG& rng, int low = 30, int high = 225);
std::string random_text(int letters, cv::RNG& rng);

// Surfaces.
Picture plain(cv::Size size, const cv::Scalar& colour);
Picture wood(cv::Size size, double px_per_metre, const cv::Scalar& colour, cv::RNG& rng);
Picture carpet(cv::Size size, const cv::Scalar& colour, cv::RNG& rng);
Picture plaster(cv::Size size, const cv::Scalar& colour, cv::RNG& rng);
// Courses of bricks with mortar; brick_px wide, half as high.
Picture bricks(cv::Size size, int brick_px, cv::RNG& rng);
// The same tile over and over, to the last bit: `tile_px` divides both sides.
Picture tiles(cv::Size size, int tile_px, cv::RNG& rng);
// Overlapping shapes, words and small photographs on top of what is there, so that corners abound at every scale.
// smallest_px..largest_px: sizes of the things.
void add_collage(Picture& picture, int count, int smallest_px, int largest_px, cv::RNG& rng);

// Things.
Picture photograph(cv::Size size, cv::RNG& rng);
Picture printed_page(cv::Size size, cv::RNG& rng);
Picture book_cover(cv::Size size, cv::RNG& rng);
Picture page_edges(cv::Size size, cv::RNG& rng);
Picture cardboard(cv::Size size, cv::RNG& rng);
Picture keyboard(cv::Size size, cv::RNG& rng);
Picture can_label(cv::Size size, cv::RNG& rng);
Picture book_shelf(cv::Size size, cv::RNG& rng);
Picture screen(cv::Size size, cv::RNG& rng);
Picture poster(cv::Size size, cv::RNG& rng);

// Helpers the painters share: a line of print with its top-left at (x, y), at most `width` pixels wide, `height` pixels
// high; and a bar code.
void print_line(Picture& picture, const std::string& text, cv::Point top_left, int width, double height, int font,
                const cv::Scalar& colour);
void bar_code(Picture& picture, cv::Rect where, cv::RNG& rng);

}  // namespace parallax::paint
