// libFuzzer's entry: feeds any bytes to the files that a robot reads.  The first byte chooses: 0 a whole map
// file, opened, read and asked for a place and a way; 1 to 12 a block of that kind, the next 13 bytes being
// the counts that its directory states; 13 a directory; 14 a map of format 1; 15 a whole map some of whose
// blocks are replaced, each by a kind, a count, a length and bytes, and sealed again; 16 and 17 a block of
// packed landmarks and of packed images, after its counts.  Built with the preset
// `fuzz`, hashes are not compared, so that what lies behind them is reached.
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>

#include "core/base/blob.h"
#include "core/base/progress.h"
#include "core/base/random.h"
#include "core/blocks/map_blocks.h"
#include "core/map/map_file.h"
#include "runtime/drive/route.h"
#include "runtime/localize/localizer.h"
#include "runtime/visual_map/visual_estimate.h"
#include "tests/core/map/sealed_blocks.h"

namespace cairn {
namespace {

constexpr int kMaxDividedWalls = 40;  // of floor plans: more take long
constexpr int kImageSide = 400;
constexpr size_t kCountBytes = kNumBlockKinds;

// Features that any map may be asked about.
const Features& SomeFeatures() {
  static const Features features = [] {
    Random random(1);
    Features some;
    some.descriptors.resize(100, kSiftDescriptorDim);
    for (int i = 0; i < 100; ++i) {
      some.keypoints.push_back({static_cast<float>(random.Uniform(0, kImageSide)),
                                static_cast<float>(random.Uniform(0, kImageSide)), 2, 0});
      for (int k = 0; k < kSiftDescriptorDim; ++k) {
        some.descriptors(i, k) = static_cast<uint8_t>(random.UniformInt(0, 60));
      }
    }
    return some;
  }();
  return features;
}

std::string WriteTemporary(std::string_view bytes) {
  static const std::string path = std::string(access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp") +
                                  "/cairn_fuzz_" + std::to_string(getpid());
  std::FILE* const file = std::fopen(path.c_str(), "wb");
  if (file == nullptr) std::abort();
  std::fwrite(bytes.data(), 1, bytes.size(), file);
  std::fclose(file);
  return path;
}

void TryMap(const std::string& path) {
  (void)ReadMapRows(path).ok();
  const auto map = Map::Open(path, {.memory_budget_bytes = 1 << 20});
  if (!map.ok()) return;
  Camera camera;
  camera.width = camera.height = kImageSide;
  camera.params = {300, 200, 200};
  Localizer localizer(*map);
  (void)localizer.LocalizeFeatures(SomeFeatures(), camera).ok();
  (void)localizer.LocalizeFeatures(SomeFeatures(), camera, PosePrior{}).ok();
  if (const auto plan = (*map)->Plan(); plan.ok() && (*plan)->plan.num_walls() <= kMaxDividedWalls) {
    NoProgress progress;
    const auto views = (*map)->FloorViews(/*num_threads=*/1, /*memory_mib=*/64, progress);
    if (views.ok()) (void)FaceLocator(**views).Find({0.5, 0.5});
  }
  if (const auto visual = VisualMap::Load(**map); visual.ok())
    (void)EstimateVisualPose(**visual, {{0, {10, 20, 1}}, {2, {90, 40, 2}}}).ok();
  (void)PlanRoute(**map, 0, static_cast<int32_t>((*map)->num_images()) - 1).ok();
}

void TryFile(std::string_view bytes) { TryMap(WriteTemporary(bytes)); }

// Blocks that fit their directory, and lie.
void TryReplacedBlocks(std::string_view bytes) {
  static const std::string base = ReadFile(FUZZ_BASE).value().substr(1);
  static const std::vector<BlockContents> blocks_of_base =
      BlocksOf(MapFile::Open(WriteTemporary(base), {}).value());
  std::vector<BlockContents> blocks = blocks_of_base;
  BlobReader reader(bytes);
  for (int i = 0; i < 4 && reader.num_left() > 0 && reader.ok(); ++i) {
    const auto kind = static_cast<BlockKind>(reader.UInt8());
    const auto count = static_cast<uint32_t>(reader.Varint());
    const size_t num_bytes = std::min<uint64_t>(reader.Varint(), reader.num_left());
    for (BlockContents& block : blocks) {
      if (block.kind != kind) continue;
      block.count = count;
      block.bytes = reader.Bytes(num_bytes);
      break;
    }
  }
  static const std::string path = WriteTemporary("") + "_sealed";
  if (!WriteSealedBlocks(base, blocks, path).ok()) return;
  TryMap(path);
}

// Postings are read without checks: what was decoded must be right.
void ReadWords(const WordBlock& words, int64_t num_images) {
  for (size_t i = 0; i < words.num_words(); ++i) {
    int64_t last = -1;
    size_t num = 0;
    words.ForPostings(i, [&](const Posting& posting) {
      if (posting.document <= last || posting.document >= num_images || posting.count < 1) std::abort();
      last = posting.document;
      ++num;
    });
    if (num != words.NumPostings(i)) std::abort();
  }
}

// Counts as the directory of a small map would state them: from the bytes.
MapDirectory DirectoryFor(BlockKind kind, bool is_packed, std::string_view counts, size_t num_bytes) {
  MapDirectory directory;
  for (int k = 1; k < kNumBlockKinds; ++k) {
    const auto count = static_cast<uint32_t>(static_cast<uint8_t>(counts[k])) + 1;
    const bool is_own = k == static_cast<int>(kind);
    if (!is_own && kind != BlockKind::kVocabularyTree && k == static_cast<int>(BlockKind::kVocabularyTree))
      continue;
    directory.Add({.kind = static_cast<uint8_t>(k),
                   .is_packed = is_own && is_packed,
                   .first = 0,
                   .count = is_own ? std::min<uint32_t>(count, static_cast<uint32_t>(num_bytes) + 1) : count,
                   .num_bytes = static_cast<uint32_t>(num_bytes)});
  }
  return directory;
}

void TryBlock(BlockKind kind, bool is_packed, std::string_view bytes) {
  if (bytes.size() < kCountBytes) return;
  const MapDirectory directory =
      DirectoryFor(kind, is_packed, bytes.substr(0, kCountBytes), bytes.size() - kCountBytes);
  if (directory.NumBlocks(kind) == 0) return;  // a kind of a later version
  const BlockEntry& entry = directory.Entry(kind, 0);
  bytes.remove_prefix(kCountBytes);
  switch (kind) {
    case BlockKind::kStations:
      (void)DecodeStationBlock(bytes, entry, directory, "block").ok();
      break;
    case BlockKind::kRegions:
      (void)DecodeRegionBlock(bytes, entry, directory, "block").ok();
      break;
    case BlockKind::kVocabularyTree: {
      const auto tree = DecodeVocabularyTree(bytes, entry, directory, "block");
      if (tree.ok()) (void)QuantizeDescriptor(*tree, SomeFeatures().descriptors.data());
      break;
    }
    case BlockKind::kDocumentNorms:
      (void)DecodeDocumentNorms(bytes, entry, "block").ok();
      break;
    case BlockKind::kWords: {
      const auto words = DecodeWordBlock(bytes, entry, directory, "block");
      if (words.ok()) ReadWords(*words, directory.Count(BlockKind::kImages));
      break;
    }
    case BlockKind::kImages: {
      const auto images = DecodeImageBlock(bytes, entry, directory, "block");
      if (images.ok()) (void)EncodeBlock(*images);
      break;
    }
    case BlockKind::kLandmarks: {
      const auto landmarks = DecodeLandmarkBlock(bytes, entry, directory, "block");
      // Decoded data is encoded to bytes that can be decoded.
      if (landmarks.ok() && !DecodeLandmarkBlock(EncodeBlock(*landmarks), entry, directory, "block").ok()) {
        std::abort();
      }
      break;
    }
    case BlockKind::kAmbiguity: {
      const auto nodes = DecodeAmbiguityBlock(bytes, entry, directory, "block");
      if (nodes.ok() && !DecodeAmbiguityBlock(EncodeBlock(*nodes), entry, directory, "block").ok())
        __builtin_trap();
      break;
    }
    case BlockKind::kAppearance: {
      const auto nodes = DecodeAppearanceBlock(bytes, entry, directory, "block");
      if (nodes.ok() && !DecodeAppearanceBlock(EncodeBlock(*nodes), entry, directory, "block").ok())
        std::abort();
      break;
    }
    case BlockKind::kFloorPlan: {
      const auto plan = DecodeFloorPlan(bytes, entry, directory, "block");
      if (plan.ok() && !DecodeFloorPlan(EncodeFloorPlan(*plan), entry, directory, "block").ok()) std::abort();
      break;
    }
    case BlockKind::kLandmarkModels: {
      const auto models = DecodeVisualBlock(bytes, entry, directory, "block");
      if (models.ok() && !DecodeVisualBlock(EncodeBlock(*models), entry, directory, "block").ok())
        std::abort();
      break;
    }
    case BlockKind::kViewRegions: {
      const auto regions = DecodeViewBlock(bytes, entry, directory, "block");
      if (regions.ok() && !DecodeViewBlock(EncodeBlock(*regions), entry, directory, "block").ok())
        std::abort();
      break;
    }
  }
}

}  // namespace
}  // namespace cairn

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size) {
  if (size == 0) return 0;
  const std::string_view rest(reinterpret_cast<const char*>(bytes) + 1, size - 1);
  const int choice = bytes[0] % 18;
  if (choice == 0) {
    cairn::TryFile(rest);
  } else if (choice < cairn::kNumBlockKinds) {
    cairn::TryBlock(static_cast<cairn::BlockKind>(choice), false, rest);
  } else if (choice == 13) {
    (void)cairn::MapDirectory::Decode(rest, 1 << 20).ok();
  } else if (choice == 15) {
    cairn::TryReplacedBlocks(rest);
  } else if (choice > 15) {
    cairn::TryBlock(choice == 16 ? cairn::BlockKind::kLandmarks : cairn::BlockKind::kImages, true, rest);
  } else {
    (void)cairn::ReadMapRowsVersion1(cairn::WriteTemporary(rest)).ok();
  }
  return 0;
}
