// Place recognition on a sequence with known loops: precision and recall by threshold, and what an image costs.
//
//   bench_place_recognition VOCABULARY IMAGE_FOLDER TRUTH.bmp [gap=5 [CURVES.svg]]
//
// Images are FOLDER/1.jpg, 2.jpg...; the truth is a picture with a pixel a pair, white where both show one place. Every
// image asks for the most similar of the images at least `gap` before it. Recall: right answers over images that have a
// right answer. Three scores: similarity of the bags, that over the similarity with the image before (McDonald et al.,
// Eq. 4), and of the ten most alike the one with the most matches that agree with an epipolar geometry.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "place/image_consistency.h"
#include "place/place_features.h"
#include "place/place_index.h"

using namespace parallax;

namespace {

constexpr int kVerified = 10;

// What one way of asking answers for an image.
struct Answer {
  double score = 0;
  bool has_loop = false, right = false;
};
struct Curve {
  std::string name, colour;
  std::vector<Answer> answers;
  std::vector<std::pair<double, double>> recall_and_precision;
};

void draw(const std::vector<Curve>& curves, const std::string& path) {
  std::ofstream out(path);
  const auto x = [](double recall) { return 60 + 400 * recall; };
  const auto y = [](double precision) { return 320 - 280 * precision; };
  out << "<svg xmlns='http://www.w3.org/2000/svg' width='500' height='380' font-family='sans-serif' font-size='12'>\n"
      << "<rect width='500' height='380' fill='white'/>\n";
  for (int i = 0; i <= 5; ++i) {
    const double v = 0.2 * i;
    out << "<path d='M" << x(v) << ' ' << y(0) << 'V' << y(1) << 'M' << x(0) << ' ' << y(v) << 'H' << x(1)
        << "' stroke='#ddd'/><text x='" << x(v) << "' y='336' text-anchor='middle'>" << v << "</text><text x='52' y='"
        << y(v) + 4 << "' text-anchor='end'>" << v << "</text>\n";
  }
  out << "<text x='260' y='354' text-anchor='middle'>recall</text><text x='18' y='180' text-anchor='middle' "
         "transform='rotate(-90 18 180)'>precision</text>\n";
  double legend = 250;
  for (const Curve& c : curves) {
    out << "<polyline fill='none' stroke-width='2' stroke='" << c.colour << "' points='";
    for (const auto& [recall, precision] : c.recall_and_precision) out << x(recall) << ',' << y(precision) << ' ';
    out << "'/><path d='M80 " << legend << "h24' stroke-width='2' stroke='" << c.colour << "'/><text x='110' y='"
        << legend + 4 << "'>" << c.name << "</text>\n";
    legend += 18;
  }
  out << "</svg>\n";
}

void print(Curve* curve) {
  std::vector<Answer>& answers = curve->answers;
  std::stable_sort(answers.begin(), answers.end(), [](const Answer& a, const Answer& b) { return a.score > b.score; });
  int loops = 0;
  for (const Answer& a : answers) loops += a.has_loop ? 1 : 0;
  std::printf("\n%s (%d images with a loop)\n\n| threshold | precision | recall |\n|---|---|---|\n",
              curve->name.c_str(), loops);
  int right = 0;
  double perfect = 0;
  for (std::size_t i = 0; i < answers.size(); ++i) {
    right += answers[i].right ? 1 : 0;
    // Answers of one score come together: a threshold cannot tell them apart.
    if (i + 1 < answers.size() && answers[i + 1].score == answers[i].score) continue;
    const double precision = right / static_cast<double>(i + 1), recall = right / static_cast<double>(loops);
    if (right == static_cast<int>(i) + 1) perfect = recall;
    curve->recall_and_precision.emplace_back(recall, precision);
    if (curve->recall_and_precision.size() % 6 == 0 || i + 1 == answers.size())
      std::printf("| %.3f | %.3f | %.3f |\n", answers[i].score, precision, recall);
  }
  std::printf("\nrecall at 100 %% precision: %.3f\n", perfect);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr, "bench_place_recognition VOCABULARY IMAGE_FOLDER TRUTH.bmp [gap]\n");
    return 2;
  }
  const Vocabulary vocabulary = Vocabulary::load(argv[1]);
  const cv::Mat1b truth = cv::imread(argv[3], cv::IMREAD_GRAYSCALE);
  const int gap = argc > 4 ? std::atoi(argv[4]) : 5;
  PlaceIndex index;
  std::vector<WordBag> bags;
  std::vector<std::vector<PlaceFeature>> features_of;
  std::vector<Curve> curves = {{"similarity", "#888888", {}, {}},
                               {"normalised similarity", "#d55e00", {}, {}},
                               {"epipolar geometry of the ten most alike", "#0072b2", {}, {}}};
  std::mt19937_64 rng(1);
  double features_ms = 0, words_ms = 0, query_ms = 0, verify_ms = 0;
  const auto now = [] { return std::chrono::steady_clock::now(); };
  const auto since = [&](auto start) { return std::chrono::duration<double, std::milli>(now() - start).count(); };
  for (int i = 0; i < truth.rows; ++i) {
    const cv::Mat1b image =
        cv::imread(std::string(argv[2]) + "/" + std::to_string(i + 1) + ".jpg", cv::IMREAD_GRAYSCALE);
    if (image.empty()) {
      std::fprintf(stderr, "image %d cannot be read\n", i + 1);
      return 2;
    }
    auto start = now();
    ImagePyramid pyramid;
    build_pyramid(image, &pyramid);
    features_of.push_back(extract_place_features(pyramid));
    features_ms += since(start);
    start = now();
    bags.push_back(vocabulary.bag_of(descriptors_of(features_of.back())));
    words_ms += since(start);
    start = now();
    const auto matches = index.query(bags.back(), kVerified, [&](int entry) { return entry > i - gap; });
    query_ms += since(start);
    index.add(i, bags.back());
    const auto same_place = [&](int j) { return truth(i, j) > 127 || truth(j, i) > 127; };
    Answer answer;
    for (int j = 0; j <= i - gap; ++j) answer.has_loop = answer.has_loop || same_place(j);
    if (matches.empty()) continue;
    answer.score = matches.front().score;
    answer.right = same_place(matches.front().entry);
    curves[0].answers.push_back(answer);
    if (i > 0) answer.score /= std::max(1e-6, similarity(bags.back(), bags[static_cast<std::size_t>(i) - 1]));
    curves[1].answers.push_back(answer);
    start = now();
    int most = -1;
    for (const PlaceMatch& match : matches) {
      const int inliers = check_image_consistency(features_of[static_cast<std::size_t>(match.entry)],
                                                  features_of.back(), ImageConsistencyOptions{}, &rng)
                              .inliers;
      if (inliers <= most) continue;
      most = inliers;
      answer.score = inliers;
      answer.right = same_place(match.entry);
    }
    verify_ms += since(start);
    curves[2].answers.push_back(answer);
  }
  std::printf(
      "%d images, %d words; an image: features %.2f ms, words %.2f ms, query %.3f ms, epipolar geometry %.2f ms\n",
      truth.rows, vocabulary.words(), features_ms / truth.rows, words_ms / truth.rows, query_ms / truth.rows,
      verify_ms / truth.rows);
  for (Curve& curve : curves) print(&curve);
  if (argc > 5) draw(curves, argv[5]);
}
