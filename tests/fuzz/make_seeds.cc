// Writes the fuzzers' first inputs, made from the example of tests/emit_map:  make_fuzz_seeds
// FOLDER GOLDEN_1.0 READERS      FOLDER: of map_fuzzer, READERS: of readers_fuzzer
#include <cstdio>
#include <string>

#include "core/base/blob.h"
#include "core/base/progress.h"
#include "core/delta/map_delta.h"
#include "core/features/transform_code.h"
#include "core/files/file.h"
#include "core/map/map_file.h"
#include "core/plan/views_database.h"
#include "stages/emit_map/emit_map.h"
#include "tests/core/atlas/two_floors.h"
#include "tests/core/map/example.h"

namespace {

using namespace cairn;

// The counts of a map's kinds of blocks, each less 1, as the fuzzer takes them.
std::string CountsOf(const MapDirectory& directory) {
  std::string counts(kNumBlockKinds, '\0');
  for (int kind = 1; kind < kNumBlockKinds; ++kind)
    counts[kind] = static_cast<char>(directory.Count(static_cast<BlockKind>(kind)) - 1);
  return counts;
}

// The packed blocks of a map, and it itself.
bool WritePacked(MapRows rows, const std::string& folder) {
  const std::string map = folder + "/map_packed";
  rows.descriptor_code = QuantizeByTransform(16, &rows.descriptors);
  if (!WriteMapRows(rows, map).ok()) return false;
  const auto file = MapFile::Open(map, {});
  if (!file.ok()) return false;
  for (size_t i = 0; i < file->directory().blocks().size(); ++i) {
    const BlockEntry& entry = file->directory().blocks()[i];
    if (!entry.is_packed) continue;
    const bool is_landmarks = entry.kind == static_cast<uint8_t>(BlockKind::kLandmarks);
    const std::string seed =
        (is_landmarks ? "\x10" : "\x11") + CountsOf(file->directory()) + *file->ReadBlock(i);
    if (!WriteFileAtomically(fmt::format("{}/packed_{}", folder, entry.kind), seed).ok()) return false;
  }
  return WriteFileAtomically(map, std::string(1, '\0') + *ReadFile(map)).ok();
}

// What the stages leave for each other, and a delta, an atlas and a map, each behind the name of its reader.
// The text files of tests/fuzz/readers are written by hand.
bool WriteReaders(const EmitExample& example, const MapRows& rows, const std::string& folder) {
  const std::string path = folder + "/written";
  const auto keep = [&](const std::string& reader, const std::string& name, const Status& status) {
    return status.ok() && WriteFileAtomically(folder + "/" + name, reader + "\n" + *ReadFile(path)).ok();
  };
  NoProgress progress;
  bool is_whole =
      keep("classes", "classes", WriteClasses(example.classes, path)) &&
      keep("world", "world", WriteWorldDatabase(example.world, path)) &&
      keep("world", "world_json", WriteWorldJson(example.world, path)) &&
      keep("regions", "regions", WriteDecompositionDatabase(example.decomposition, path)) &&
      keep("regions", "regions_json", WriteDecompositionJson(example.decomposition, path)) &&
      keep("appearance", "appearance", WriteAppearance(example.appearance, path)) &&
      keep("vocabulary", "vocabulary", WriteVocabulary(example.vocabulary, path)) &&
      keep("views", "views",
           WriteViews(MakeExampleViews(), path, progress, [](SQLite::Database&) { return Ok(); }));
  AtlasRows atlas = TwoFloors();
  const auto bytes = EncodeAtlas(std::nullopt, &atlas);
  is_whole &= bytes.ok() && keep("atlas", "atlas", WriteFileAtomically(path, *bytes));
  MapRows after = rows;
  after.name = "after";
  const std::string old_map = folder + "/old", new_map = folder + "/new";
  is_whole &= WriteMapRows(rows, old_map).ok() && WriteMapRows(after, new_map).ok();
  const auto delta = MakeMapDelta(old_map, new_map, std::nullopt);
  is_whole &= delta.ok() && keep("delta", "delta", WriteFileAtomically(path, EncodeMapDelta(*delta)));
  is_whole &= WriteFileAtomically(path, *ReadFile(old_map)).ok() && keep("seal", "seal", Ok());
  for (const std::string& file : {path, old_map, new_map}) std::remove(file.c_str());
  return is_whole;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return std::fprintf(stderr, "usage: make_fuzz_seeds FOLDER map_1.0.cairn READERS\n"), 2;
  const std::string folder = argv[1];
  const EmitExample example = MakeEmitExample();
  for (const int min_num_landmarks_for_words : {0, 100}) {
    auto rows = emit_map::EmitMap(example.classes, example.world, example.decomposition, example.vocabulary,
                                  {.landmarks = "regions",
                                   .min_num_landmarks_for_words = min_num_landmarks_for_words,
                                   .landmarks_per_word = 1,
                                   .documents = "kept"},
                                  &example.appearance);
    if (!rows.ok() || !emit_map::AddViews(MakeExampleViews(), /*regions=*/true, &*rows).ok()) return 1;
    rows->visual_map = MakeExampleVisualMap();
    rows->findings.self_test_regions = {{kOutsideRegions, 2, 0, 0, {}},
                                        {1, 4, 3, 1, RegionSelfTest::Errors{0.03, 0.3, 0.8, 8}}};
    rows->findings.drops = {
        {44, "decompose_regions", "station", "left_over", "not covered", 200, {0, 200, 1}}};
    rows->sessions = {"old", "new"};
    rows->findings.changes = {{1, {0.5, -1.25, 2}, 0.25, 20, 3, 0, -1}};
    const std::string map = folder + (min_num_landmarks_for_words == 0 ? "/map_words" : "/map");
    if (min_num_landmarks_for_words == 0 && !WritePacked(*rows, folder)) return 1;
    if (!WriteMapRows(*rows, map).ok()) return 1;
    if (min_num_landmarks_for_words == 0 && !WriteReaders(example, *rows, argv[3])) return 1;
    const auto file = MapFile::Open(map, {});
    if (!file.ok()) return 1;
    for (size_t i = 0; min_num_landmarks_for_words == 0 && i < file->directory().blocks().size(); ++i) {
      const BlockEntry& entry = file->directory().blocks()[i];
      const std::string seed =
          std::string(1, static_cast<char>(entry.kind)) + CountsOf(file->directory()) + *file->ReadBlock(i);
      if (!WriteFileAtomically(fmt::format("{}/block_{}", folder, entry.kind), seed).ok()) return 1;
      BlobWriter replaced;  // by itself
      replaced.UInt8(15);
      replaced.UInt8(entry.kind);
      replaced.Varint(entry.count);
      replaced.Varint(entry.num_bytes);
      replaced.Bytes(*file->ReadBlock(static_cast<int64_t>(i)));
      if (!WriteFileAtomically(fmt::format("{}/replaced_{}", folder, entry.kind), replaced.Take()).ok())
        return 1;
    }
    if (!WriteFileAtomically(folder + "/directory", "\x0d" + file->directory().Encode()).ok()) return 1;
    if (!WriteFileAtomically(map, std::string(1, '\0') + *ReadFile(map)).ok()) return 1;
  }
  const auto old = ReadFile(argv[2]);
  return old.ok() && WriteFileAtomically(folder + "/map_version1", "\x0e" + *old).ok() ? 0 : 1;
}
