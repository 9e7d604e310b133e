// Place recognition on a sequence with known loops: precision and recall by threshold, and what an image costs.
//
//   bench_place_recognition VOCABULARY IMAGE_FOLDER TRUTH.bmp [gap=5]
//
// Images are FOLDER/1.jpg, 2.jpg...; the truth is a picture with a pixel a pair, white where both show one place. Every
// image asks for the most similar of the images at least `gap` before it. Recall: right answers over images that have a
// right answer. Two scores: similarity of the bags, and that over the similarity with the image before (McDonald et
// al., Eq. 4).
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "place/place_features.h"
#include "place/place_index.h"

using namespace parallax;

namespace {

struct Answer {
  double score = 0, normalised = 0;
  bool has_loop = false, right = false;
};

void print_curve(const char* name, std::vector<Answer> answers, double Answer::*score) {
  std::sort(answers.begin(), answers.end(), [&](const Answer& a, const Answer& b) { return a.*score > b.*score; });
  int loops = 0;
  for (const Answer& a : answers) loops += a.has_loop ? 1 : 0;
  std::printf("\n%s (%d images with a loop)\n\n| threshold | precision | recall |\n|---|---|---|\n", name, loops);
  int right = 0, all = 0;
  double perfect = 0;
  bool still_perfect = true;
  for (const Answer& a : answers) {
    ++all;
    right += a.right ? 1 : 0;
    still_perfect = still_perfect && a.right;
    if (still_perfect) perfect = static_cast<double>(right) / loops;
    if (all % 8 == 0 || all == static_cast<int>(answers.size()))
      std::printf("| %.3f | %.3f | %.3f |\n", a.*score, static_cast<double>(right) / all,
                  static_cast<double>(right) / loops);
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
  std::vector<Answer> answers;
  double features_ms = 0, words_ms = 0, query_ms = 0;
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
    const auto features = extract_place_features(pyramid);
    features_ms += since(start);
    start = now();
    bags.push_back(vocabulary.bag_of(descriptors_of(features)));
    words_ms += since(start);
    start = now();
    const auto matches = index.query(bags.back(), 1, [&](int entry) { return entry > i - gap; });
    query_ms += since(start);
    index.add(i, bags.back());
    Answer answer;
    for (int j = 0; j <= i - gap; ++j) answer.has_loop = answer.has_loop || truth(i, j) > 127 || truth(j, i) > 127;
    if (!matches.empty()) {
      const int j = matches.front().entry;
      answer.score = matches.front().score;
      answer.normalised =
          i > 0 ? answer.score / std::max(1e-6, similarity(bags.back(), bags[static_cast<std::size_t>(i) - 1])) : 0;
      answer.right = truth(i, j) > 127 || truth(j, i) > 127;
      answers.push_back(answer);
    }
  }
  std::printf("%d images, %d words; an image: features %.2f ms, words %.2f ms, query %.3f ms\n", truth.rows,
              vocabulary.words(), features_ms / truth.rows, words_ms / truth.rows, query_ms / truth.rows);
  print_curve("similarity", answers, &Answer::score);
  print_curve("normalised similarity", answers, &Answer::normalised);
}
