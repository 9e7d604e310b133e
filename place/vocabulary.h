// A hierarchical vocabulary of binary visual words (Nister and Stewenius 2006; binary words after Galvez-Lopez and
// Tardos 2012): a tree whose nodes are descriptors, and whose leaves are the words. An image is a bag of them: how
// often each occurs, weighted by how rare it is.
//
// Immutable once made, then safe from any thread.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/binary_descriptor.h"

namespace parallax {

// Words in order with their weights, which add up to 1 (tf-idf, L1).
using WordBag = std::vector<std::pair<std::int32_t, float>>;

// How alike two bags are: 1 - |a - b| / 2 in the L1 norm, which is the sum of the smaller weights. 0 to 1.
double similarity(const WordBag& a, const WordBag& b);

struct VocabularyOptions {
  int branching = 10;  // children of a node
  int levels = 4;      // below the root: branching^levels words at most
  int rounds = 8;      // of k-medians at each node, at most
  std::uint64_t seed = 1;

  // Throws InputError when a value is out of range.
  void validate() const;
};

class Vocabulary {
 public:
  Vocabulary() = default;

  // From the descriptors of many images, one list an image. Throws InputError when there are fewer descriptors than
  // children of a node. Memory: the descriptors once more.
  static Vocabulary train(std::span<const std::vector<BinaryDescriptor>> images, const VocabularyOptions& options);

  // Throws InputError ("PATH: ...") for anything that is no whole vocabulary.
  static Vocabulary load(const std::string& path);
  static Vocabulary parse(std::string_view bytes, const std::string& name);
  // Throws RunError. The same vocabulary gives the same bytes.
  void save(const std::string& path) const;

  bool empty() const { return nodes_.empty(); }
  int words() const { return words_; }
  int branching() const { return branching_; }
  int levels() const { return levels_; }

  // The word of a descriptor: from the root always to the nearest child (the first of equally near ones).
  std::int32_t word_of(const BinaryDescriptor& descriptor) const { return nodes_[leaf_of(descriptor)].word; }
  WordBag bag_of(std::span<const BinaryDescriptor> descriptors) const;

 private:
  // Children of a node follow each other; the root's begin at 0.
  struct Node {
    BinaryDescriptor descriptor;
    std::int32_t first_child = -1;  // a leaf has none
    std::int32_t children = 0;
    std::int32_t word = -1;  // of a leaf
    float weight = 0;        // of its word: log(images / images with the word)
  };
  std::size_t leaf_of(const BinaryDescriptor& descriptor) const;

  std::vector<Node> nodes_;
  int root_children_ = 0;
  int words_ = 0, branching_ = 0, levels_ = 0;
};

}  // namespace parallax
