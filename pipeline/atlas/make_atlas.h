#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/atlas/atlas_file.h"
#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/options/options.h"

namespace cairn::pipeline {

struct MakeAtlasOptions {
  // Most bytes that the codes of a map's landmarks take, as part of the map's own.  REQUIRES: > 0
  double max_size_ratio = 0.009;
  // So many landmarks of each map are told whatever they take.  REQUIRES: >= 1
  int min_num_codes = 64;
  // Images of each map, evenly spread, of which it is found out whether other maps know a place that looks
  // like it.  0: none.  REQUIRES: >= 0
  int num_compared_images = 200;
};
OptionTable DescribeOptions(MakeAtlasOptions* options);

// An atlas of the maps, in this order.  `atlas_path`: where it will be, for the maps' paths from there;
// `passages_path`: ReadPassages, or empty.  Same maps, same atlas, for any number of threads.  Errors: as
// MapFile::Open and ReadMapRows; InvalidArgument (two maps of one name, a map without images or landmarks),
// those of ReadPassages; Cancelled.
Result<AtlasRows> MakeAtlas(const std::vector<std::string>& map_paths, const std::string& atlas_path,
                            const std::string& passages_path, const MakeAtlasOptions& options,
                            int num_threads, Progress* progress);

}  // namespace cairn::pipeline
