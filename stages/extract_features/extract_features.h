#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/camera/panorama.h"
#include "core/capture/capture.h"
#include "core/features/sift.h"
#include "core/line/reuse.h"
#include "core/options/options.h"

namespace cairn::extract_features {

// Finds the features of every survey image, SIFT's or a learned model's, and writes them as a COLMAP
// database.  First stage of the line; after it: match_features and build_vocabulary.
//
// Images get ids 1, 2, ... in the order of their names.  An image that cannot be read, or whose size is not
// its camera's, is listed as rejected; the others are processed.  A mask MASKS/NAME.png (or MASKS/NAME with
// its suffix replaced) of the image's size excludes the pixels where it is zero.
//
// A panorama (camera EQUIRECTANGULAR) becomes pinhole views with the names NAME#0of6, NAME#1of6, ... and one
// camera with the panorama's id; each keypoint is in the one view whose axis is nearest.
//
// An image without a file has the features that the capture's database has of it (core/capture/
// capture_features.h): they are checked and taken as they are, whatever the options say.
struct ExtractFeaturesOptions {
  SiftOptions sift;
  PanoramaOptions panorama;
  // Model that finds features in place of SIFT, an ONNX file (core/learned/learned_model.h); empty: none.
  std::string model;
  // Folder of masks, absolute or relative to the capture; empty: none.
  std::string masks;
};
OptionTable DescribeOptions(ExtractFeaturesOptions* options);

struct ExtractFeaturesSummary {
  int num_images = 0;  // files that were read
  int num_views = 0;   // images in the database: more where there are panoramas
  int64_t num_keypoints = 0;
  int num_taken_over = 0;       // of num_images: unchanged since an earlier run
  std::vector<Reject> rejects;  // those of the capture and those found here, ascending by name
  // Every file that was read, for a dependency file: images, masks, lists.
  std::vector<std::string> inputs;
  std::vector<std::string> not_reused;  // why earlier outputs gave nothing
};

// Writes `features_path`: COLMAP's tables, and ours: cairn_images (content hash of each image file, or of
// the features that stand for it), cairn_rejects, where there are such images cairn_landmark_images; and its
// ReuseFile (core/line/reuse.h).  An image's features are taken over from `reuse` where an earlier run of
// this program found them in the same image file, with the same mask, camera size and options (the name may
// differ): same bytes as without.  A shard has every n-th of the images that `reuse.files` lack; it may have
// none.  Memory: features of all images of one batch (64 images), and for each thread a pyramid of
// SiftOptions::max_image_side_px.  Same bytes for any number of threads.  Errors: InvalidArgument for
// options, NoData when no image is left; Io; Cancelled; of `reuse.files` NotFound, Corrupt.
Result<ExtractFeaturesSummary> ExtractFeatures(const Capture& capture, const ExtractFeaturesOptions& options,
                                               const std::string& features_path, int num_threads,
                                               Progress& progress, const ReuseOptions& reuse = {});

}  // namespace cairn::extract_features
