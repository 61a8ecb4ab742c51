#pragma once

#include <string>

#include "core/base/error.h"
#include "stages/match_features/pairs/image_features.h"
#include "stages/match_features/pairs/select_pairs.h"

namespace cairn::match_features {

struct PairList {
  IndexPairs pairs;              // ascending, each once
  int num_without_features = 0;  // pairs left out: an image without features cannot be matched
};

// Pairs named in a text file, one "NAME1 NAME2" a line (COLMAP's image pair list; '#' starts a comment, a
// pair may be listed more than once, in either order).  Errors: NotFound (no such file), InvalidArgument (a
// line that is not two names, or names an image that the database does not have, or one image twice; says the
// line), NoData (no pair).
Result<PairList> ReadPairList(const std::string& path, const MatchImages& images);

}  // namespace cairn::match_features
