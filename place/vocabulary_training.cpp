// Training a vocabulary: k-medians of binary descriptors, level by level. The median of descriptors has the bits that
// most of them have.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <random>

#include "core/error.h"
#include "place/vocabulary.h"

namespace parallax {
namespace {

using Members = std::vector<std::int32_t>;  // rows of the list of all descriptors

class Clustering {
 public:
  Clustering(const std::vector<BinaryDescriptor>& all, const VocabularyOptions& options)
      : all_(all), options_(options), rng_(options.seed) {}

  // Splits the members into at most `branching` clusters, none of them empty.
  void split(const Members& members, std::vector<BinaryDescriptor>* centres, std::vector<Members>* clusters) {
    choose_centres(members, centres);
    std::vector<std::int32_t> of(members.size(), -1);
    for (int round = 0; round < options_.rounds; ++round) {
      bool changed = false;
      clusters->assign(centres->size(), {});
      for (std::size_t i = 0; i < members.size(); ++i) {
        const auto nearest = static_cast<std::int32_t>(nearest_of(at(members[i]), *centres));
        changed = changed || nearest != of[i];
        of[i] = nearest;
        (*clusters)[static_cast<std::size_t>(nearest)].push_back(members[i]);
      }
      if (!changed) break;
      for (std::size_t c = 0; c < centres->size(); ++c)
        if (!(*clusters)[c].empty()) (*centres)[c] = median((*clusters)[c]);
    }
    std::size_t kept = 0;
    for (std::size_t c = 0; c < centres->size(); ++c) {
      if ((*clusters)[c].empty()) continue;
      if (c != kept) {
        (*centres)[kept] = (*centres)[c];
        (*clusters)[kept] = std::move((*clusters)[c]);
      }
      ++kept;
    }
    centres->resize(kept);
    clusters->resize(kept);
  }

 private:
  const BinaryDescriptor& at(std::int32_t row) const { return all_[static_cast<std::size_t>(row)]; }

  static std::size_t nearest_of(const BinaryDescriptor& d, const std::vector<BinaryDescriptor>& centres) {
    std::size_t best = 0;
    int least = 257;
    for (std::size_t c = 0; c < centres.size(); ++c) {
      const int distance = hamming(d, centres[c]);
      if (distance < least) {
        least = distance;
        best = c;
      }
    }
    return best;
  }

  // k-means++ (Arthur and Vassilvitskii 2007): far from those that there are, with a probability that grows with the
  // square of the distance. Fewer when the members are all alike.
  void choose_centres(const Members& members, std::vector<BinaryDescriptor>* centres) {
    centres->assign(1, at(members[rng_() % members.size()]));
    std::vector<std::int32_t> distance(members.size(), 257);
    while (static_cast<int>(centres->size()) < options_.branching) {
      std::uint64_t sum = 0;
      for (std::size_t i = 0; i < members.size(); ++i) {
        distance[i] = std::min(distance[i], hamming(at(members[i]), centres->back()));
        sum += static_cast<std::uint64_t>(distance[i]) * static_cast<std::uint64_t>(distance[i]);
      }
      if (sum == 0) return;
      std::uint64_t at_sum = rng_() % sum;
      std::size_t chosen = 0;
      for (; chosen + 1 < members.size(); ++chosen) {
        const auto part = static_cast<std::uint64_t>(distance[chosen]) * static_cast<std::uint64_t>(distance[chosen]);
        if (at_sum < part) break;
        at_sum -= part;
      }
      centres->push_back(at(members[chosen]));
    }
  }

  BinaryDescriptor median(const Members& members) const {
    std::array<std::int32_t, 256> ones{};
    for (const std::int32_t row : members)
      for (std::size_t word = 0; word < 4; ++word)
        for (std::uint64_t bits = at(row).bits[word]; bits != 0; bits &= bits - 1)
          ++ones[64 * word + static_cast<std::size_t>(std::countr_zero(bits))];
    BinaryDescriptor out;
    for (std::size_t bit = 0; bit < 256; ++bit)
      if (2 * ones[bit] > static_cast<std::int32_t>(members.size()))
        out.bits[bit / 64] |= std::uint64_t{1} << (bit % 64);
    return out;
  }

  const std::vector<BinaryDescriptor>& all_;
  const VocabularyOptions& options_;
  std::mt19937_64 rng_;
};

}  // namespace

void VocabularyOptions::validate() const {
  if (branching < 2 || branching > 64) throw InputError("vocabulary: branching: expected 2 to 64");
  if (levels < 1 || levels > 8) throw InputError("vocabulary: levels: expected 1 to 8");
  if (rounds < 1) throw InputError("vocabulary: rounds: expected at least 1");
  if (std::pow(branching, levels) > 2e6) throw InputError("vocabulary: expected at most 2 million words");
}

Vocabulary Vocabulary::train(std::span<const std::vector<BinaryDescriptor>> images, const VocabularyOptions& options) {
  options.validate();
  std::vector<BinaryDescriptor> all;
  for (const auto& image : images) all.insert(all.end(), image.begin(), image.end());
  if (all.size() < static_cast<std::size_t>(options.branching))
    throw InputError("vocabulary: found " + std::to_string(all.size()) + " features in the images, expected at least " +
                     std::to_string(options.branching));
  Vocabulary out;
  out.branching_ = options.branching;
  out.levels_ = options.levels;
  Clustering clustering(all, options);
  Members everything(all.size());
  for (std::size_t i = 0; i < all.size(); ++i) everything[i] = static_cast<std::int32_t>(i);

  // Nodes level by level; members[i] are those of node i of the level before.
  struct Open {
    std::int32_t node = -1;  // -1: the root
    Members members;
  };
  std::vector<Open> level{{-1, std::move(everything)}};
  for (int depth = 0; depth < options.levels; ++depth) {
    std::vector<Open> next;
    for (Open& open : level) {
      if (open.node >= 0 && static_cast<int>(open.members.size()) <= options.branching) continue;  // stays a leaf
      std::vector<BinaryDescriptor> centres;
      std::vector<Members> clusters;
      clustering.split(open.members, &centres, &clusters);
      if (open.node >= 0 && centres.size() < 2) continue;
      const auto first = static_cast<std::int32_t>(out.nodes_.size());
      const auto count = static_cast<std::int32_t>(centres.size());
      if (open.node < 0) {
        out.root_children_ = count;
      } else {
        out.nodes_[static_cast<std::size_t>(open.node)].first_child = first;
        out.nodes_[static_cast<std::size_t>(open.node)].children = count;
      }
      for (std::size_t c = 0; c < centres.size(); ++c) {
        Node node;
        node.descriptor = centres[c];
        out.nodes_.push_back(node);
        next.push_back({static_cast<std::int32_t>(out.nodes_.size()) - 1, std::move(clusters[c])});
      }
      open.members = {};
    }
    level = std::move(next);
  }
  for (Node& node : out.nodes_)
    if (node.children == 0) node.word = out.words_++;

  // How rare each word is.
  std::vector<std::int32_t> images_with(out.nodes_.size(), 0);
  for (const auto& image : images) {
    std::vector<std::size_t> leaves;
    for (const BinaryDescriptor& d : image) leaves.push_back(out.leaf_of(d));
    std::sort(leaves.begin(), leaves.end());
    leaves.erase(std::unique(leaves.begin(), leaves.end()), leaves.end());
    for (const std::size_t leaf : leaves) ++images_with[leaf];
  }
  for (std::size_t i = 0; i < out.nodes_.size(); ++i)
    if (out.nodes_[i].children == 0)
      out.nodes_[i].weight =
          static_cast<float>(std::log(static_cast<double>(images.size() + 1) / std::max(1, images_with[i])));
  return out;
}

}  // namespace parallax
