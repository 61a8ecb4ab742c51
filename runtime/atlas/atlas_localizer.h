#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "core/base/error.h"
#include "core/camera/camera.h"
#include "core/features/features.h"
#include "core/options/options.h"
#include "runtime/atlas/atlas.h"
#include "runtime/localize/localization.h"
#include "runtime/localize/localizer_options.h"

namespace cairn {

struct AtlasLocalizerOptions {
  // Most maps in which an image is localized, those with most evidence first, until one is sure: an image of
  // none of them takes as many localizations.  Maps of which a place is known that looks like the one found
  // come on top.  REQUIRES: >= 1
  int max_num_maps = 128;
  // Once a map has a fix of this probability, only those are asked that have at least `rival_ratio` of the
  // image's features that it has.  REQUIRES: both in [0, 1]
  double sure_probability = 0.99;
  double rival_ratio = 0.3;
};
OptionTable DescribeOptions(AtlasLocalizerOptions* options);

// Where an image may have been taken.
struct AtlasHypothesis {
  int map = 0;
  Localization found;      // in this map alone: a fix, or one of several (possible_poses)
  double probability = 0;  // P(it was taken here), all maps considered
};

struct AtlasAnswer {
  std::vector<AtlasHypothesis> hypotheses;  // the most probable first; none: no map knows the image
  double elsewhere = 1;                     // P(in none of the maps)
  std::vector<int> maps_tried;              // in this order
  // Of the first map tried: why it has no fix, where there is no hypothesis.  Without one tried:
  // kNoCandidates, and that maps lack a camera of that size, where that is why.
  Localization best_failure;
};

// Finds where a camera is, in any of an atlas's maps.  One per thread; the atlas is shared.
class AtlasLocalizer {
 public:
  explicit AtlasLocalizer(std::shared_ptr<const Atlas> atlas, const LocalizerOptions& localizer_options = {},
                          const AtlasLocalizerOptions& options = {});

  // From 8-bit grey pixels.  Without a camera: each map's own camera of that size; maps without one are left
  // out.  Errors: as Localizer::Localize and Atlas::OpenMap; InvalidArgument (an option).  An image that is
  // of none of the maps is no error.
  Result<AtlasAnswer> Localize(const cv::Mat& grey, const std::optional<Camera>& camera = std::nullopt);
  // The same from features that were already extracted from an image of that size.
  Result<AtlasAnswer> LocalizeFeatures(const Features& features, int width, int height,
                                       const std::optional<Camera>& camera = std::nullopt);

 private:
  std::shared_ptr<const Atlas> atlas_;
  LocalizerOptions localizer_options_;
  AtlasLocalizerOptions options_;
};

}  // namespace cairn
