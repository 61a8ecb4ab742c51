#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/capture/capture.h"
#include "core/features/features.h"
#include "core/learned/feature_finder.h"
#include "core/line/reuse.h"
#include "stages/extract_features/extract_features.h"

namespace cairn::extract_features {

// One image of the database.
struct View {
  std::string name;
  Features features;
};

// The result of one image file: its views (several for a panorama), or the reason why there are none.
struct Extraction {
  std::string content_hash;
  ContentHash key;  // of everything that the views' features depend on
  std::vector<View> views;
  bool are_landmarks = false;  // given features that are landmarks of a map
  bool is_taken_over = false;
  bool is_elsewhere = false;  // a file of ReuseOptions::files has it, so a shard leaves it out: no views
  std::optional<std::string> reject_reason;
};

// Where a run of the stage finds results of earlier runs.
struct EarlierExtractions {
  ReuseSources to_take_over;
  ReuseSources to_leave;  // a shard's
};

// The mask of an image, if the folder `masks` has one; "" if not, or if `masks` is "".
std::string FindMask(const std::string& masks, const std::string& name);

// The features of one image file, taken over where an earlier run has them; of an image without a file those
// that the capture has, without its mask.  May be called from any thread.
// Errors: those of the image and its mask, which make it a reject.
Result<Extraction> ExtractImage(const Capture& capture, const CaptureImage& image,
                                const ExtractFeaturesOptions& options, const FeatureFinder& finder,
                                const std::string& mask_path, EarlierExtractions* earlier);

// Where a later run finds this one: `row` is the id of the first view, `count` their number.
ReuseEntry EntryOf(const Extraction& extraction, ImageId first_view);

}  // namespace cairn::extract_features
