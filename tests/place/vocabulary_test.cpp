#include "place/vocabulary.h"

#include <gtest/gtest.h>

#include <chrono>
#include <random>
#include <set>

#include "core/error.h"
#include "place/place_features.h"
#include "place/place_index.h"
#include "render/synthetic_source.h"
#include "tests/support/process.h"

namespace parallax {
namespace {

using testing::ScratchFolder;

BinaryDescriptor random_descriptor(std::mt19937_64* rng) {
  BinaryDescriptor out;
  for (auto& word : out.bits) word = (*rng)();
  return out;
}

BinaryDescriptor with_noise(BinaryDescriptor d, int bits, std::mt19937_64* rng) {
  for (int i = 0; i < bits; ++i) {
    const auto bit = (*rng)() % 256;
    d.bits[bit / 64] ^= std::uint64_t{1} << (bit % 64);
  }
  return d;
}

// Images of `words_each` of 60 prototypes with a little noise.
std::vector<std::vector<BinaryDescriptor>> images_of_prototypes(int images, std::mt19937_64* rng,
                                                                std::vector<BinaryDescriptor>* prototypes) {
  for (int i = 0; i < 60; ++i) prototypes->push_back(random_descriptor(rng));
  std::vector<std::vector<BinaryDescriptor>> out(static_cast<std::size_t>(images));
  for (auto& image : out)
    for (int i = 0; i < 30; ++i) image.push_back(with_noise((*prototypes)[(*rng)() % 60], 12, rng));
  return out;
}

TEST(Vocabulary, FindsTheClustersThereAre) {
  std::mt19937_64 rng(1);
  std::vector<BinaryDescriptor> prototypes;
  const auto images = images_of_prototypes(100, &rng, &prototypes);
  VocabularyOptions options;
  options.branching = 6;
  options.levels = 4;
  const Vocabulary vocabulary = Vocabulary::train(images, options);
  EXPECT_GE(vocabulary.words(), 60);
  // Noisy versions of one prototype mostly share a word; those of two never do.
  std::vector<std::int32_t> word;
  for (const BinaryDescriptor& p : prototypes) word.push_back(vocabulary.word_of(p));
  EXPECT_GE(std::set<std::int32_t>(word.begin(), word.end()).size(), 55U);
  int same = 0, all = 0;
  for (std::size_t i = 0; i < prototypes.size(); ++i) {
    for (int k = 0; k < 10; ++k, ++all)
      same += vocabulary.word_of(with_noise(prototypes[i], 4, &rng)) == word[i] ? 1 : 0;
  }
  EXPECT_GT(same, all / 2);
}

TEST(Vocabulary, BagsAddUpToOneAndAreLikeThemselves) {
  std::mt19937_64 rng(2);
  std::vector<BinaryDescriptor> prototypes;
  const auto images = images_of_prototypes(40, &rng, &prototypes);
  const Vocabulary vocabulary = Vocabulary::train(images, {});
  const WordBag a = vocabulary.bag_of(images[0]), b = vocabulary.bag_of(images[1]);
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    sum += a[i].second;
    if (i > 0) {
      EXPECT_LT(a[i - 1].first, a[i].first);
    }
  }
  EXPECT_NEAR(sum, 1, 1e-5);
  EXPECT_NEAR(similarity(a, a), 1, 1e-5);
  EXPECT_EQ(similarity(a, b), similarity(b, a));
  // By the definition: 1 - |a - b| / 2.
  std::map<std::int32_t, double> difference;
  for (const auto& [word, weight] : a) difference[word] += weight;
  for (const auto& [word, weight] : b) difference[word] -= weight;
  double l1 = 0;
  for (const auto& [word, d] : difference) l1 += std::abs(d);
  EXPECT_NEAR(similarity(a, b), 1 - 0.5 * l1, 1e-5);
  EXPECT_TRUE(vocabulary.bag_of({}).empty());
  EXPECT_EQ(similarity({}, a), 0);
}

TEST(Vocabulary, IsTheSameEveryTimeAndInItsFile) {
  std::mt19937_64 rng(3);
  std::vector<BinaryDescriptor> prototypes;
  const auto images = images_of_prototypes(50, &rng, &prototypes);
  VocabularyOptions options;
  options.branching = 5;
  options.levels = 3;
  const ScratchFolder folder;
  Vocabulary::train(images, options).save(folder.file("a"));
  Vocabulary::train(images, options).save(folder.file("b"));
  EXPECT_EQ(testing::read_all(folder.file("a")), testing::read_all(folder.file("b")));
  const Vocabulary trained = Vocabulary::train(images, options), loaded = Vocabulary::load(folder.file("a"));
  EXPECT_EQ(loaded.words(), trained.words());
  EXPECT_EQ(loaded.branching(), 5);
  EXPECT_EQ(loaded.levels(), 3);
  for (const auto& image : images) EXPECT_EQ(loaded.bag_of(image), trained.bag_of(image));
}

TEST(Vocabulary, DamagedFilesAreRefused) {
  std::mt19937_64 rng(4);
  std::vector<BinaryDescriptor> prototypes;
  const auto images = images_of_prototypes(20, &rng, &prototypes);
  const ScratchFolder folder;
  Vocabulary::train(images, {}).save(folder.file("v"));
  const std::string good = testing::read_all(folder.file("v"));
  EXPECT_NO_THROW(Vocabulary::parse(good, "v"));
  EXPECT_THROW(Vocabulary::parse("", "v"), InputError);
  EXPECT_THROW(Vocabulary::parse("notes", "v"), InputError);
  for (std::size_t size = 0; size < good.size(); size += 97)
    EXPECT_THROW(Vocabulary::parse(std::string_view(good).substr(0, size), "v"), InputError) << size;
  for (int i = 0; i < 200; ++i) {
    std::string bad = good;
    bad[rng() % bad.size()] ^= static_cast<char>(1U << (rng() % 8));
    try {
      // The few bytes of the head that mean nothing to the tree may differ.
      EXPECT_EQ(Vocabulary::parse(bad, "v").words(), Vocabulary::parse(good, "v").words());
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()).rfind("v: ", 0), 0U);
    }
  }
}

TEST(Vocabulary, TooLittleToLearnFromIsSaid) {
  EXPECT_THROW(Vocabulary::train({}, {}), InputError);
  VocabularyOptions options;
  options.levels = 20;
  EXPECT_THROW(options.validate(), InputError);
  // All alike: one word.
  const std::vector<std::vector<BinaryDescriptor>> alike(3, std::vector<BinaryDescriptor>(20));
  EXPECT_EQ(Vocabulary::train(alike, {}).words(), 1);
}

TEST(PlaceIndex, GivesWhatComparingWithEveryImageGives) {
  std::mt19937_64 rng(5);
  std::vector<BinaryDescriptor> prototypes;
  const auto images = images_of_prototypes(60, &rng, &prototypes);
  const Vocabulary vocabulary = Vocabulary::train(images, {});
  PlaceIndex index;
  std::map<int, WordBag> bags;
  for (int i = 0; i < 60; ++i) {
    bags[i] = vocabulary.bag_of(images[static_cast<std::size_t>(i)]);
    index.add(i, bags[i]);
  }
  for (int i = 0; i < 60; i += 3) {
    index.erase(i);
    bags.erase(i);
  }
  index.erase(0);
  EXPECT_EQ(index.size(), 40);
  for (int round = 0; round < 20; ++round) {
    std::vector<BinaryDescriptor> image;
    for (int k = 0; k < 25; ++k) image.push_back(with_noise(prototypes[rng() % 60], 6, &rng));
    const WordBag bag = vocabulary.bag_of(image);
    std::vector<std::pair<double, int>> expected;
    for (const auto& [entry, other] : bags)
      if (entry % 2 == 0 && similarity(bag, other) > 0) expected.emplace_back(-similarity(bag, other), entry);
    std::sort(expected.begin(), expected.end());
    const auto found = index.query(bag, 7, [](int entry) { return entry % 2 != 0; });
    ASSERT_EQ(found.size(), std::min<std::size_t>(7, expected.size()));
    for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i].score, -expected[i].first, 1e-5);
    EXPECT_EQ(found[0].entry, expected[0].second);
  }
}

TEST(PlaceFeatures, AreSpreadAndTheSameEveryTime) {
  const auto source = open_synthetic_source("synthetic:desk?size=320x240&noise=0&blur=0");
  ImagePyramid pyramid;
  build_pyramid(source->frame(100).grey, &pyramid);
  PlaceFeatureOptions options;
  options.count = 200;
  const auto features = extract_place_features(pyramid, options);
  ASSERT_EQ(features.size(), 200U);
  std::set<std::pair<int, int>> cells;
  for (const PlaceFeature& f : features) {
    EXPECT_GE(f.pixel.minCoeff(), 0);
    EXPECT_LT(f.pixel.x(), 320);
    EXPECT_LT(f.pixel.y(), 240);
    cells.emplace(static_cast<int>(f.pixel.x()) / 40, static_cast<int>(f.pixel.y()) / 40);
  }
  EXPECT_GE(cells.size(), 24U);
  const auto again = extract_place_features(pyramid, options);
  for (std::size_t i = 0; i < features.size(); ++i) {
    EXPECT_EQ(features[i].pixel, again[i].pixel);
    EXPECT_EQ(features[i].descriptor.bits, again[i].descriptor.bits);
  }
  ImagePyramid blank;
  build_pyramid(GreyImage(240, 320, std::uint8_t{90}), &blank);
  EXPECT_TRUE(extract_place_features(blank).empty());
}

}  // namespace
}  // namespace parallax
