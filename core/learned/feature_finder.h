#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "core/base/content_hash.h"
#include "core/base/error.h"
#include "core/features/features.h"
#include "core/features/sift.h"
#include "core/learned/learned_model.h"

namespace cairn {

// What finds features in images: SIFT, or a learned model.  May be used by several threads.
class FeatureFinder {
 public:
  // `model_path`: an ONNX file (LearnedModel); empty: SIFT.  Of `options`, a model reads max_num_features and
  // max_image_side_px.  Errors: those of LearnedModel::Open.
  static Result<std::shared_ptr<const FeatureFinder>> Make(const SiftOptions& options,
                                                           const std::string& model_path);

  // Of a model: dense, and as its extractor the file's name and the first 8 digits of its hash.
  const DescriptorKind& kind() const { return kind_; }
  // Of the model's bytes; all zeros: SIFT.
  const ContentHash& model_hash() const { return model_hash_; }
  // As ExtractSift and LearnedModel::Extract.
  Result<Features> Find(const cv::Mat& grey, const cv::Mat& mask = {}) const;

 private:
  explicit FeatureFinder(const SiftOptions& options) : options_(options) {}
  // One that no other thread uses, as many as there are threads.
  Result<std::unique_ptr<LearnedModel>> TakeModel() const;

  SiftOptions options_;
  std::string model_path_;
  DescriptorKind kind_;
  ContentHash model_hash_ = {};
  mutable std::mutex mutex_;
  mutable std::vector<std::unique_ptr<LearnedModel>> idle_;
};

}  // namespace cairn
