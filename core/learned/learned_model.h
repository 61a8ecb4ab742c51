#pragma once

#include <memory>
#include <string>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "core/base/content_hash.h"
#include "core/base/error.h"
#include "core/base/pooled.h"
#include "core/features/features.h"

namespace cairn {

struct LearnedOptions {
  // Most features per image; those with the best scores are kept.  REQUIRES: in [1, 1000000]
  int max_num_features = 2000;
  // Images with a longer side are made smaller before, and their keypoints larger again.
  // REQUIRES: in [64, 65536]
  int max_image_side_px = 3200;
  // Least heat of a keypoint: the probability that it is its cell's one keypoint [Potje24's program: 0.05].
  // The reliability that the score has besides is no part of it.  REQUIRES: in [0, 1]
  double min_score = 0.05;
};

// The features of one image, row i of `descriptors` belonging to keypoint i.
struct LearnedFeatures {
  PooledVector<Keypoint> keypoints;  // scale and orientation are 0: they are not measured
  FloatDescriptors descriptors;      // of norm 1
};

// A net that finds features in a grey image, from an ONNX file, with the outputs of XFeat [Potje24 §3.2]
// (dense_heads.h): for each cell of 8 x 8 px the 65 logits of a keypoint, a reliability and a descriptor, in
// any order; they are known by their numbers of channels.  The net takes grey or RGB, of which each is the
// grey value over 255, and normalises it itself.  It has one size of image, of multiples of 32 px, or takes
// any such size.
//
// Images are continued by their mirror image to the net's size, or to the next multiples of 32 px, without
// being resized: a keypoint is the centre of one of the image's pixels.  Images larger than a net's one size
// are seen in windows of that size, which overlap by 128 px; keypoints are sought when the windows' outputs
// are together.  Only what the net normalises differs from window to window.
//
// XFeat takes 65 ms of one core for a window of 640 x 640 px; an image of 640 x 480 px is one.
//
// One thread at a time.  Results do not depend on the number of OpenCV's threads, and are the same in every
// run on processors with the same vector instructions: sums of OpenCV's convolutions have another order where
// there are others.
class LearnedModel {
 public:
  // Reads the file and runs the net once.  Errors: NotFound; Io; Corrupt for a file that is no ONNX, or
  // damaged, or has weights that are no numbers; Unsupported for a net with other inputs or outputs, with
  // operators that OpenCV does not know, or of more than 512 MiB.
  static Result<LearnedModel> Open(const std::string& path);

  LearnedModel(LearnedModel&&) noexcept;
  LearnedModel& operator=(LearnedModel&&) noexcept;
  ~LearnedModel();

  int num_values() const;           // of a descriptor
  const ContentHash& hash() const;  // of the file's bytes
  const std::string& name() const;  // the file's, without its extension

  // Features of an 8-bit grey image, ordered by (y, x).  `mask`, if not empty, has the image's size; features
  // at zero pixels are dropped.  A blank image or one of less than 32 px gives no features, not an error.
  // Errors: InvalidArgument for an image or mask of another type or size; Unsupported where the net does not
  // run at the image's size, Corrupt where its outputs are no numbers.
  Result<LearnedFeatures> Extract(const cv::Mat& grey, const LearnedOptions& options,
                                  const cv::Mat& mask = {});

 private:
  struct Net;
  explicit LearnedModel(std::unique_ptr<Net> net);
  std::unique_ptr<Net> net_;
};

}  // namespace cairn
