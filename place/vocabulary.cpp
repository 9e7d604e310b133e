#include "place/vocabulary.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/checksum.h"
#include "core/error.h"
#include "core/file_io.h"

namespace parallax {
namespace {

constexpr char kMagic[] = "PLXVOC1\n";
constexpr std::size_t kMagicSize = 8;
constexpr std::uint32_t kMostNodes = 4'000'000;

// What follows the magic; nodes in order, each a descriptor, its number of children, and a leaf's weight.
struct Head {
  std::uint32_t nodes = 0, root_children = 0;
  std::uint16_t branching = 0, levels = 0;
  std::uint32_t unused = 0;
  std::uint64_t sum = 0;  // of the nodes' bytes
};
static_assert(sizeof(Head) == 24, "no padding in what is written");
struct StoredNode {
  std::uint64_t bits[4];
  std::uint32_t children;
  float weight;
};
static_assert(sizeof(StoredNode) == 40, "no padding in what is written");

}  // namespace

double similarity(const WordBag& a, const WordBag& b) {
  double sum = 0;
  auto i = a.begin(), j = b.begin();
  while (i != a.end() && j != b.end()) {
    if (i->first < j->first) {
      ++i;
    } else if (j->first < i->first) {
      ++j;
    } else {
      sum += std::min(i->second, j->second);
      ++i;
      ++j;
    }
  }
  return sum;
}

std::size_t Vocabulary::leaf_of(const BinaryDescriptor& descriptor) const {
  std::int32_t first = 0, count = root_children_;
  for (;;) {
    std::int32_t best = first;
    int least = 257;
    for (std::int32_t i = first; i < first + count; ++i) {
      const int distance = hamming(descriptor, nodes_[static_cast<std::size_t>(i)].descriptor);
      if (distance < least) {
        least = distance;
        best = i;
      }
    }
    const Node& node = nodes_[static_cast<std::size_t>(best)];
    if (node.children == 0) return static_cast<std::size_t>(best);
    first = node.first_child;
    count = node.children;
  }
}

WordBag Vocabulary::bag_of(std::span<const BinaryDescriptor> descriptors) const {
  WordBag out;
  if (empty()) return out;
  std::vector<std::size_t> leaves;  // in the order of their words
  leaves.reserve(descriptors.size());
  for (const BinaryDescriptor& d : descriptors) leaves.push_back(leaf_of(d));
  std::sort(leaves.begin(), leaves.end());
  double sum = 0;
  for (std::size_t i = 0; i < leaves.size();) {
    std::size_t end = i;
    while (end < leaves.size() && leaves[end] == leaves[i]) ++end;
    const Node& leaf = nodes_[leaves[i]];
    const float weight = leaf.weight * static_cast<float>(end - i);
    if (weight > 0) {
      out.emplace_back(leaf.word, weight);
      sum += weight;
    }
    i = end;
  }
  for (auto& [word, weight] : out) weight = static_cast<float>(weight / sum);
  return out;
}

void Vocabulary::save(const std::string& path) const {
  std::vector<StoredNode> stored;
  stored.reserve(nodes_.size());
  for (const Node& node : nodes_) {
    StoredNode s{};
    std::copy(node.descriptor.bits.begin(), node.descriptor.bits.end(), s.bits);
    s.children = static_cast<std::uint32_t>(node.children);
    s.weight = node.weight;
    stored.push_back(s);
  }
  Head head;
  head.nodes = static_cast<std::uint32_t>(nodes_.size());
  head.root_children = static_cast<std::uint32_t>(root_children_);
  head.branching = static_cast<std::uint16_t>(branching_);
  head.levels = static_cast<std::uint16_t>(levels_);
  head.sum = checksum(stored.data(), stored.size() * sizeof(StoredNode));
  write_file_atomically(path, [&](std::ostream& out) {
    out.write(kMagic, kMagicSize);
    out.write(reinterpret_cast<const char*>(&head), sizeof head);
    out.write(reinterpret_cast<const char*>(stored.data()),
              static_cast<std::streamsize>(stored.size() * sizeof(StoredNode)));
  });
}

Vocabulary Vocabulary::load(const std::string& path) { return parse(read_text_file(path), path); }

Vocabulary Vocabulary::parse(std::string_view bytes, const std::string& name) {
  if (bytes.substr(0, kMagicSize) != std::string_view(kMagic, kMagicSize))
    throw InputError(name + ": found something else, expected a vocabulary");
  bytes.remove_prefix(kMagicSize);
  Head head;
  if (bytes.size() < sizeof head) throw InputError(name + ": found a file that was cut off, expected a vocabulary");
  std::memcpy(&head, bytes.data(), sizeof head);
  bytes.remove_prefix(sizeof head);
  if (head.nodes == 0 || head.nodes > kMostNodes || bytes.size() != head.nodes * sizeof(StoredNode))
    throw InputError(name + ": found " + std::to_string(bytes.size()) + " bytes of words, expected those of " +
                     std::to_string(head.nodes) + " nodes");
  if (checksum(bytes.data(), bytes.size()) != head.sum)
    throw InputError(name + ": found damaged bytes, expected those of its checksum");
  Vocabulary out;
  out.branching_ = head.branching;
  out.levels_ = head.levels;
  out.root_children_ = static_cast<int>(head.root_children);
  out.nodes_.resize(head.nodes);
  // Level by level: the children of the first node come after the root's, then those of the second...
  std::uint64_t next = head.root_children;
  for (std::size_t i = 0; i < out.nodes_.size(); ++i) {
    StoredNode stored;
    std::memcpy(&stored, bytes.data() + i * sizeof stored, sizeof stored);
    Node& node = out.nodes_[i];
    std::copy(std::begin(stored.bits), std::end(stored.bits), node.descriptor.bits.begin());
    node.children = static_cast<std::int32_t>(std::min<std::uint32_t>(stored.children, kMostNodes));
    node.weight = stored.weight;
    if (!(node.weight >= 0) || !std::isfinite(node.weight))
      throw InputError(name + ": node " + std::to_string(i) + ": found an impossible weight");
    if (node.children > 0) {
      // Children come later than their parent, so that every way down ends.
      node.first_child = static_cast<std::int32_t>(std::min<std::uint64_t>(next, kMostNodes));
      if (next <= i) throw InputError(name + ": node " + std::to_string(i) + ": found no place for its children");
      next += stored.children;
    } else {
      node.word = out.words_++;
    }
    if (next > head.nodes) throw InputError(name + ": found fewer nodes than their numbers of children add up to");
  }
  if (next != head.nodes || head.root_children == 0)
    throw InputError(name + ": found " + std::to_string(head.nodes) + " nodes, expected " + std::to_string(next));
  return out;
}

}  // namespace parallax
