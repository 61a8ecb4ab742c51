#include "pipeline/explain/block_bytes.h"

namespace cairn::pipeline {

std::map<std::string, int64_t> BytesPerBlockKind(const MapDirectory& directory) {
  std::map<std::string, int64_t> bytes;
  for (const BlockEntry& entry : directory.blocks())
    bytes[BlockKindName(static_cast<BlockKind>(entry.kind))] += entry.num_bytes;
  return bytes;
}

}  // namespace cairn::pipeline
