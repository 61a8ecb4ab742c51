#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "core/base/content_hash.h"
#include "core/base/error.h"
#include "core/colmap/colmap_database.h"
#include "core/line/reuse.h"
#include "stages/match_features/pairs/image_features.h"
#include "stages/match_features/two_views/match_pairs.h"

namespace cairn::match_features {

// All that results depend on of a camera, and of a pose.
ContentHash HashCamera(const Camera& camera);
ContentHash HashPose(const Pose& pose);

// The result of matching and verifying a pair.
struct PairResult {
  TwoViewGeometry geometry;  // no inliers: not verified
  int num_putative = 0;
};

// Keys of pairs: hashes of all that a pair's result depends on (core/line/reuse.h): the features and cameras
// of both images, their relative pose as stated, and the options.  Not their names, ids, or places in
// the world.
class PairKeys {
 public:
  PairKeys(SQLite::Database& features, const MatchImages& images, const MatchPairsOptions& options);

  // Of a pair of indices into images.images.  Reads the features of an image when it is first named.  Errors:
  // Corrupt; throws SQLite::Exception as the readers do.
  Result<ContentHash> Of(const std::pair<int, int>& pair);
  // Of one image: its features and its camera.  Errors: as Of.
  Result<ContentHash> OfImage(int idx);

 private:
  SQLite::Database& features_;
  const MatchImages& images_;
  ContentHash options_;
  std::vector<std::optional<ContentHash>> image_keys_;  // by index
};

// The result of a pair of images from an earlier run, if one has it.
std::optional<PairResult> FindPairResult(const ContentHash& key, const MatchImage& image1,
                                         const MatchImage& image2, ReuseSources* sources);

// Where a later run finds a result: `row` is the pair_id, `count` the number of putative matches.  A pair
// that was not verified has no row: its contents are the zero hash, and `row` is the geometry's config.
ReuseEntry EntryOf(const ContentHash& key, const PairResult& result);

}  // namespace cairn::match_features
