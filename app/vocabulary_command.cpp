// `parallax vocabulary`: the visual words that places are recognised by.
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "app/command.h"
#include "app/matching_training.h"
#include "app/place_vocabulary.h"
#include "app/progress_bar.h"
#include "app/source.h"
#include "core/error.h"
#include "core/file_io.h"
#include "place/place_features.h"
#include "place/vocabulary.h"
#include "render/synthetic_source.h"

namespace parallax {
namespace {

struct TrainArguments {
  std::vector<std::string> sources;
  std::string output;
  int every = 10, features = 600;
  VocabularyOptions options;
};

void print_info(const Vocabulary& vocabulary, const std::string& path) {
  std::cout << path << ": " << vocabulary.words() << " words, " << vocabulary.levels() << " levels of "
            << vocabulary.branching() << '\n';
}

void train(const TrainArguments& args) {
  args.options.validate();
  check_can_be_written(args.output);
  PlaceFeatureOptions feature_options;
  feature_options.count = args.features;
  std::vector<std::vector<BinaryDescriptor>> images;
  for (const std::string& name : args.sources) {
    SourceOptions source_options;
    const std::unique_ptr<FrameSource> source = open_frames(name, source_options);
    ProgressBar progress(name, source->frame_count());
    const auto use = [&](int i, const GreyImage& grey) {
      progress.update(i, std::to_string(images.size()) + " images");
      ImagePyramid pyramid;
      build_pyramid(grey, &pyramid);
      images.push_back(descriptors_of(extract_place_features(pyramid, feature_options)));
    };
    if (auto* synthetic = dynamic_cast<SyntheticSource*>(source.get())) {
      // What is not used is not drawn.
      for (int i = 0; i < synthetic->frame_count(); i += args.every) use(i, synthetic->frame(i).grey);
      continue;
    }
    for (int i = 0; const auto frame = source->next(); ++i)
      if (i % args.every == 0) use(i, frame->grey);
  }
  const Vocabulary vocabulary = Vocabulary::train(images, args.options);
  vocabulary.save(args.output);
  print_info(vocabulary, args.output);
}

struct MatchingArguments {
  std::vector<std::string> sources;
  std::string output, vocabulary;
  MatchingTrainingOptions options;
};

void train_matching_weights(const MatchingArguments& args) {
  check_can_be_written(args.output);
  const auto vocabulary = args.vocabulary.empty()
                              ? place_vocabulary()
                              : std::make_shared<const Vocabulary>(Vocabulary::load(args.vocabulary));
  const CrfModel model = train_matching(args.sources, vocabulary, args.options, std::cout);
  model.save(args.output);
}

}  // namespace

void add_vocabulary_command(CLI::App& app, int*) {
  CLI::App* command = app.add_subcommand("vocabulary", "The visual words that places are recognised by");
  command->require_subcommand(1);
  auto args = std::make_shared<TrainArguments>();
  CLI::App* sub = command->add_subcommand("train", "Make a vocabulary from images");
  sub->add_option("sources", args->sources, "Videos, image folders, data-set folders or synthetic:NAME")->required();
  sub->add_option("--output", args->output, "The vocabulary's file")->required();
  sub->add_option("--every", args->every, "Use every so-manieth frame")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  sub->add_option("--features", args->features, "Features of an image, at most")
      ->check(CLI::Range(10, 100000))
      ->capture_default_str();
  sub->add_option("--branching", args->options.branching, "Children of a node")->capture_default_str();
  sub->add_option("--levels", args->options.levels, "Levels of the tree")->capture_default_str();
  sub->add_option("--seed", args->options.seed, "Of the clustering")->capture_default_str();
  sub->callback([args] { train(*args); });

  auto matching = std::make_shared<MatchingArguments>();
  CLI::App* crf =
      command->add_subcommand("train-crf", "Learn the weights that scenes of stereo sessions are matched by");
  crf->add_option("sources", matching->sources,
                  "Stereo recordings with true poses; those of one world are joined by '+'")
      ->required();
  crf->add_option("--output", matching->output, "The weights' file")->required();
  crf->add_option("--vocabulary", matching->vocabulary, "Vocabulary file (default: the program's own)");
  crf->add_option("--every", matching->options.every_s, "Seconds between scenes")->capture_default_str();
  crf->callback([matching] { train_matching_weights(*matching); });

  auto path = std::make_shared<std::string>();
  CLI::App* info = command->add_subcommand("info", "Say what is in a vocabulary file");
  info->add_option("vocabulary", *path, "Vocabulary file")->required();
  info->callback([path] { print_info(Vocabulary::load(*path), *path); });
}

}  // namespace parallax
