#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/capture/capture.h"
#include "core/features/features.h"
#include "core/line/reuse.h"
#include "stages/extract_features/extract_features.h"

namespace cairn::extract_features {

// One image of the database.
struct View {
  std::string name;
  Features features;
};

// What one image file gave: its views (several for a panorama), or the reason why not.
struct Extraction {
  std::string content_hash;
  ContentHash key;  // of all that the views' features depend on
  std::vector<View> views;
  bool is_taken_over = false;
  bool is_elsewhere = false;  // a file of ReuseOptions::files has it, and a shard leaves it there: no views
  std::optional<std::string> reject_reason;
};

// Where a run of the stage finds what earlier ones did.
struct EarlierExtractions {
  ReuseSources to_take_over;
  ReuseSources to_leave;  // a shard's
};

// The mask of an image, if the folder `masks` has one; "" if not, or if `masks` is "".
std::string FindMask(const std::string& masks, const std::string& name);

// The features of one image file, taken over where an earlier run has them.  Any thread.  Errors: those of
// the image and its mask: they make it a reject.
Result<Extraction> ExtractImage(const Capture& capture, const CaptureImage& image,
                                const ExtractFeaturesOptions& options, const std::string& mask_path,
                                EarlierExtractions* earlier);

// Where a later run finds this one: `row` is the id of the first view, `count` their number.
ReuseEntry EntryOf(const Extraction& extraction, ImageId first_view);

}  // namespace cairn::extract_features
