#include "pipeline/atlas/make_atlas.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <utility>

#include "core/base/parallel.h"
#include "core/blocks/map_rows.h"
#include "core/features/features.h"
#include "core/files/output_path.h"
#include "core/map/map_file.h"
#include "pipeline/atlas/choose_places.h"
#include "pipeline/atlas/find_look_alikes.h"
#include "pipeline/atlas/read_passages.h"
#include "runtime/atlas/code_index.h"
#include "runtime/map/map.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

// How the atlas names a map's file: from its own folder, where one leads there.
std::string FileFrom(const std::string& atlas_path, const std::string& map_path) {
  std::error_code error;
  const fs::path folder = fs::weakly_canonical(FolderOf(atlas_path), error);
  const fs::path map = fs::weakly_canonical(map_path, error);
  const fs::path relative = map.lexically_relative(folder);
  return (relative.empty() ? map : relative).string();
}

// The maps' landmarks, and their codes, one list per map.
struct CodedMaps {
  std::vector<MapRows> rows;
  std::vector<std::vector<DescriptorCode>> codes;
};

void CodeAll(const CodeBook& book, CodedMaps* maps) {
  maps->codes.resize(maps->rows.size());
  for (size_t map = 0; map < maps->rows.size(); ++map) {
    const DescriptorMatrix& descriptors = maps->rows[map].descriptors;
    for (Eigen::Index row = 0; row < descriptors.rows(); ++row)
      maps->codes[map].push_back(CodeOf(book, descriptors.data() + row * kSiftDescriptorDim));
  }
}

DescriptorMatrix AllDescriptors(const std::vector<MapRows>& rows) {
  Eigen::Index num = 0;
  for (const MapRows& of_map : rows) num += of_map.descriptors.rows();
  DescriptorMatrix all(num, kSiftDescriptorDim);
  Eigen::Index first = 0;
  for (const MapRows& of_map : rows) {
    all.middleRows(first, of_map.descriptors.rows()) = of_map.descriptors;
    first += of_map.descriptors.rows();
  }
  return all;
}

// Of each landmark of each map, how many other maps have one that would be taken for it.
std::vector<std::vector<int>> CountMapsAlike(const AtlasRows& atlas, const CodedMaps& maps, int num_threads) {
  AtlasRows whole{.code_book = atlas.code_book};
  for (const std::vector<DescriptorCode>& codes : maps.codes) {
    std::vector<uint32_t> bits;
    for (const DescriptorCode& code : codes) bits.push_back(code.bits);
    std::sort(bits.begin(), bits.end());
    whole.maps.push_back({.places = {std::move(bits)}});
  }
  const CodeIndex index(whole);
  std::vector<std::vector<int>> counts(maps.codes.size());
  ParallelFor(static_cast<int64_t>(maps.codes.size()), num_threads, [&](int64_t map) {
    for (const DescriptorCode& code : maps.codes[map])
      counts[map].push_back(static_cast<int>(index.MapsWith(code).size()) - 1);
  });
  return counts;
}

Status CheckNames(const AtlasRows& atlas, const std::vector<std::string>& map_paths) {
  std::map<std::string, std::string> path_of;
  for (size_t map = 0; map < atlas.maps.size(); ++map) {
    const auto [known, is_new] = path_of.emplace(atlas.maps[map].name, map_paths[map]);
    if (!is_new) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "{} and {}: both maps are called '{}', and places are named by their maps; compile "
                       "one with another `name` in its recipe",
                       known->second, map_paths[map], known->first);
    }
  }
  return Ok();
}

Result<std::vector<std::shared_ptr<const Map>>> OpenAll(const std::vector<std::string>& map_paths) {
  std::vector<std::shared_ptr<const Map>> maps;
  for (const std::string& path : map_paths) {
    CAIRN_ASSIGN_OR_RETURN(auto map, Map::Open(path));
    maps.push_back(std::move(map));
  }
  return maps;
}

}  // namespace

OptionTable DescribeOptions(MakeAtlasOptions* o) {
  return {
      {.name = "max_size_ratio",
       .value = &o->max_size_ratio,
       .help = "most bytes of a map's part of the atlas, as part of the map's own",
       .min = 1e-6,
       .max = 1},
      {.name = "min_num_codes",
       .value = &o->min_num_codes,
       .help = "landmarks of each map that the atlas tells whatever they take",
       .min = 1,
       .max = 1 << 20},
      {.name = "num_compared_images",
       .value = &o->num_compared_images,
       .help = "images of each map that are looked for in the others; 0: none",
       .min = 0,
       .max = 1 << 20},
  };
}

Result<AtlasRows> MakeAtlas(const std::vector<std::string>& map_paths, const std::string& atlas_path,
                            const std::string& passages_path, const MakeAtlasOptions& options,
                            int num_threads, Progress* progress) {
  AtlasRows atlas;
  CodedMaps coded;
  progress->Begin("reading", static_cast<int64_t>(map_paths.size()), "maps");
  for (const std::string& path : map_paths) {
    CAIRN_ASSIGN_OR_RETURN(const MapFile file, MapFile::Open(path, {}));
    CAIRN_ASSIGN_OR_RETURN(MapRows rows, ReadMapRows(file));
    if (!rows.descriptor_kind.is_sift()) {
      return MakeError(ErrorCode::kUnsupported,
                       "{}: descriptors of the kind '{}'; an atlas finds places by SIFT's", path,
                       ToString(rows.descriptor_kind));
    }
    if (rows.images.empty() || rows.landmarks.empty()) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}: map '{}' has {} images and {} landmarks: nothing says "
                       "what its place looks like",
                       path, rows.name, rows.images.size(), rows.landmarks.size());
    }
    atlas.maps.push_back({.name = rows.name,
                          .file = FileFrom(atlas_path, path),
                          .fingerprint = FingerprintOf(file.seal().root),
                          .num_bytes = static_cast<uint64_t>(file.num_bytes()),
                          .num_images = static_cast<int64_t>(rows.images.size())});
    coded.rows.push_back(std::move(rows));
    progress->Advance();
  }
  progress->End();
  CAIRN_RETURN_IF_ERROR(CheckNames(atlas, map_paths));
  atlas.code_book = LearnCodeBook(AllDescriptors(coded.rows));
  CodeAll(atlas.code_book, &coded);
  const std::vector<std::vector<int>> num_maps_alike = CountMapsAlike(atlas, coded, num_threads);
  progress->Begin("choosing", static_cast<int64_t>(map_paths.size()), "maps");
  ParallelFor(static_cast<int64_t>(map_paths.size()), num_threads, [&](int64_t i) {
    if (progress->Cancelled()) return;
    AtlasMap& map = atlas.maps[i];
    const auto max_num_bytes =
        static_cast<size_t>(options.max_size_ratio * static_cast<double>(map.num_bytes));
    const size_t of_names = map.name.size() + map.file.size() + map.fingerprint.size();
    map.places = ChoosePlaces(coded.rows[i], coded.codes[i],
                              RankLandmarks(coded.rows[i], coded.codes[i], num_maps_alike[i]),
                              max_num_bytes - std::min(max_num_bytes, of_names), options.min_num_codes);
    progress->Advance();
  });
  progress->End();
  if (progress->Cancelled()) return MakeError(ErrorCode::kCancelled, "making the atlas was stopped");
  coded = {};
  CAIRN_ASSIGN_OR_RETURN(const auto maps, OpenAll(map_paths));
  if (!passages_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(atlas.passages, ReadPassages(passages_path, atlas, maps));
  }
  if (options.num_compared_images > 0 && maps.size() > 1) {
    CAIRN_ASSIGN_OR_RETURN(atlas.look_alikes,
                           FindLookAlikes(atlas, maps, options.num_compared_images, num_threads, progress));
  }
  return atlas;
}

}  // namespace cairn::pipeline
