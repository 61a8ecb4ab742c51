// Blocks of the appearance graph as bytes: drawn in schemas/FORMAT.md.
#include <algorithm>
#include <limits>

#include "core/base/blob.h"
#include "core/blocks/map_blocks.h"
#include "core/packing/map_codes.h"
#include "core/world/appearance.h"

namespace cairn {

std::string EncodeBlock(const AppearanceBlock& block) {
  BlobWriter writer;
  for (const MapAppearanceNode& node : block.nodes) {
    writer.UInt8(node.is_kept ? 1 : 0);
    WriteRuns(node.images, &writer);
    std::vector<int32_t> linked;
    for (const MapAppearanceNode::Link& link : node.links) linked.push_back(link.node);
    WriteRuns(linked, &writer);
    for (const MapAppearanceNode::Link& link : node.links)
      writer.Varint(static_cast<uint64_t>(link.num_inliers));
  }
  return writer.Take();
}

Result<AppearanceBlock> DecodeAppearanceBlock(std::string_view bytes, const BlockEntry& entry,
                                              const MapDirectory& directory, const std::string& what) {
  BlobReader reader(bytes);
  AppearanceBlock block;
  block.first = static_cast<int32_t>(entry.first);
  int64_t max_num_values = kMaxListElements;
  for (uint32_t i = 0; i < entry.count; ++i) {
    const int64_t node_idx = int64_t{entry.first} + i;
    MapAppearanceNode& node = block.nodes.emplace_back();
    std::vector<int32_t> linked;
    const uint8_t flags = reader.UInt8();
    node.is_kept = flags == 1;
    if (flags > 1 || !ReadRuns(&reader, directory.Count(BlockKind::kImages), &max_num_values, &node.images) ||
        !ReadRuns(&reader, directory.Count(BlockKind::kAppearance), &max_num_values, &linked) ||
        node.images.empty()) {
      return Corrupt(what, "the images or links of node {} make no sense", node_idx);
    }
    if (!linked.empty() && linked.front() <= node_idx) {
      return Corrupt(what, "node {} is linked to one that is not larger", node_idx);
    }
    for (const int32_t other : linked) {
      const uint64_t num_inliers = reader.Varint();
      if (num_inliers == 0 || num_inliers > std::numeric_limits<int32_t>::max()) {
        return Corrupt(what, "a link of node {} has {} inliers", node_idx, num_inliers);
      }
      node.links.push_back({other, static_cast<int32_t>(num_inliers)});
    }
  }
  if (!reader.Finished()) return Corrupt(what, "bytes are left after {} nodes", entry.count);
  return block;
}

std::string EncodeBlock(const AmbiguityBlock& block) {
  BlobWriter writer;
  for (const AmbiguityBlock::Node& node : block.nodes) {
    writer.Varint(static_cast<uint64_t>(Thousandths(node.entropy)));
    std::vector<int32_t> others;
    for (const MapAppearanceNode::LookAlike& other : node.look_alikes) others.push_back(other.node);
    WriteRuns(others, &writer);
    for (const MapAppearanceNode::LookAlike& other : node.look_alikes)
      writer.Varint(static_cast<uint64_t>(Thousandths(other.score)));
  }
  return writer.Take();
}

Result<AmbiguityBlock> DecodeAmbiguityBlock(std::string_view bytes, const BlockEntry& entry,
                                            const MapDirectory& directory, const std::string& what) {
  BlobReader reader(bytes);
  AmbiguityBlock block;
  block.first = static_cast<int32_t>(entry.first);
  int64_t max_num_values = kMaxListElements;
  for (uint32_t i = 0; i < entry.count; ++i) {
    const int64_t node_idx = int64_t{entry.first} + i;
    const uint64_t entropy = reader.Varint();
    std::vector<int32_t> others;
    if (!ReadRuns(&reader, directory.Count(BlockKind::kAppearance), &max_num_values, &others) ||
        node_idx >= directory.Count(BlockKind::kAppearance) ||
        (!others.empty() && others.front() <= node_idx) ||
        entropy > static_cast<uint64_t>(Thousandths(kMaxEntropy))) {
      return Corrupt(what, "the entropy or look-alikes of node {} make no sense", node_idx);
    }
    AmbiguityBlock::Node& node = block.nodes.emplace_back();
    node.entropy = OfThousandths(static_cast<int64_t>(entropy));
    for (const int32_t other : others) {
      const uint64_t score = reader.Varint();
      if (score == 0 || score > static_cast<uint64_t>(Thousandths(1)))
        return Corrupt(what, "a look-alike of node {} scores {} thousandths", node_idx, score);
      node.look_alikes.push_back({other, OfThousandths(static_cast<int64_t>(score))});
    }
  }
  if (!reader.Finished()) return Corrupt(what, "bytes are left after {} nodes", entry.count);
  return block;
}

void CompleteLookAlikes(std::vector<std::vector<MapAppearanceNode::LookAlike>>* look_alikes) {
  const std::vector<std::vector<MapAppearanceNode::LookAlike>> stored = *look_alikes;
  for (size_t node = 0; node < stored.size(); ++node) {
    for (const MapAppearanceNode::LookAlike& other : stored[node])
      (*look_alikes)[other.node].push_back({static_cast<int32_t>(node), other.score});
  }
  for (auto& others : *look_alikes)
    std::sort(others.begin(), others.end(), [](const auto& a, const auto& b) { return a.node < b.node; });
}

int64_t NumBytes(const AmbiguityBlock& block) {
  int64_t num_bytes = sizeof(block);
  for (const AmbiguityBlock::Node& node : block.nodes) {
    num_bytes +=
        static_cast<int64_t>(sizeof(node) + node.look_alikes.size() * sizeof(MapAppearanceNode::LookAlike));
  }
  return num_bytes;
}

int64_t NumBytes(const AppearanceBlock& block) {
  int64_t num_bytes = sizeof(block);
  for (const MapAppearanceNode& node : block.nodes) {
    num_bytes += static_cast<int64_t>(sizeof(node) + node.images.size() * sizeof(int32_t) +
                                      node.links.size() * sizeof(MapAppearanceNode::Link));
  }
  return num_bytes;
}

}  // namespace cairn
