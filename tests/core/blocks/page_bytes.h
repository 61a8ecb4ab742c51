#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/base/blob.h"
#include "core/blocks/map_blocks.h"

namespace cairn {

// Numbers as schemas/FORMAT.md writes them, to put blocks together by hand.
inline std::string U8(uint8_t value) { return std::string(1, static_cast<char>(value)); }
inline std::string U32(int64_t value) {
  BlobWriter writer;
  writer.UInt32(static_cast<uint32_t>(value));
  return writer.Take();
}
inline std::string F32(float value) {
  BlobWriter writer;
  writer.Float32(value);
  return writer.Take();
}
inline std::string V(uint64_t value) {
  BlobWriter writer;
  writer.Varint(value);
  return writer.Take();
}
inline std::string Z(int64_t value) {
  return V(value < 0 ? 2 * (static_cast<uint64_t>(-(value + 1))) + 1 : 2 * static_cast<uint64_t>(value));
}
// Runs of one number, and of num >= 2 numbers from first on.
inline std::string RunOf(uint64_t value) { return V(1) + V(2 * value); }
inline std::string RunOf(uint64_t first, uint64_t num) { return V(1) + V(2 * first + 1) + V(num - 2); }
inline std::string NoRuns() { return V(0); }

// A directory with so many elements of each kind, each in one block.
inline MapDirectory DirectoryOf(const std::vector<std::pair<BlockKind, uint32_t>>& counts) {
  MapDirectory directory;
  for (const auto& [kind, count] : counts)
    directory.Add({.kind = static_cast<uint8_t>(kind), .count = count});
  return directory;
}

inline BlockEntry EntryOf(BlockKind kind, uint32_t first, uint32_t count) {
  return {.kind = static_cast<uint8_t>(kind), .first = first, .count = count};
}

// The message of a refusal; "" where there is none.
template <typename T>
std::string RefusalOf(const Result<T>& result) {
  return result.ok() ? "" : result.error().message;
}

}  // namespace cairn
