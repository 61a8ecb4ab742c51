#include "core/learned/feature_finder.h"

#include <cctype>
#include <utility>

#include <fmt/format.h>

#include "core/features/features.h"

namespace cairn {
namespace {

// A word: what a map names its kind by.
std::string WordOf(std::string text) {
  for (char& c : text) {
    const bool is_plain = std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_' || c == '.';
    if (!is_plain) c = '_';
  }
  return text;
}

}  // namespace

Result<std::shared_ptr<const FeatureFinder>> FeatureFinder::Make(const SiftOptions& options,
                                                                 const std::string& model_path) {
  std::shared_ptr<FeatureFinder> finder(new FeatureFinder(options));
  if (model_path.empty()) return std::shared_ptr<const FeatureFinder>(finder);
  CAIRN_ASSIGN_OR_RETURN(LearnedModel model, LearnedModel::Open(model_path));
  finder->model_path_ = model_path;
  finder->model_hash_ = model.hash();
  finder->kind_ = {.type = DescriptorType::kDense,
                   .num_values = model.num_values(),
                   .extractor = fmt::format("{}-{:08x}", WordOf(model.name()), model.hash().high >> 32)};
  if (model.num_values() < kMinDescriptorDim || model.num_values() > kMaxDescriptorDim) {
    return MakeError(ErrorCode::kUnsupported, "{}: descriptors of {} values; {} to {} are taken", model_path,
                     model.num_values(), kMinDescriptorDim, kMaxDescriptorDim);
  }
  finder->idle_.push_back(std::make_unique<LearnedModel>(std::move(model)));
  return std::shared_ptr<const FeatureFinder>(std::move(finder));
}

Result<std::unique_ptr<LearnedModel>> FeatureFinder::TakeModel() const {
  {
    const std::lock_guard lock(mutex_);
    if (!idle_.empty()) {
      std::unique_ptr<LearnedModel> model = std::move(idle_.back());
      idle_.pop_back();
      return model;
    }
  }
  CAIRN_ASSIGN_OR_RETURN(LearnedModel model, LearnedModel::Open(model_path_));
  if (!(model.hash() == model_hash_))
    return MakeError(ErrorCode::kCorrupt, "{}: the file was changed while it was used", model_path_);
  return std::make_unique<LearnedModel>(std::move(model));
}

Result<Features> FeatureFinder::Find(const cv::Mat& grey, const cv::Mat& mask) const {
  if (kind_.is_sift()) return ExtractSift(grey, options_, mask);
  CAIRN_ASSIGN_OR_RETURN(std::unique_ptr<LearnedModel> model, TakeModel());
  const LearnedOptions options{.max_num_features = options_.max_num_features,
                               .max_image_side_px = options_.max_image_side_px};
  Result<LearnedFeatures> found = model->Extract(grey, options, mask);
  {
    const std::lock_guard lock(mutex_);
    idle_.push_back(std::move(model));
  }
  if (!found.ok()) return found.error();
  Features features{.keypoints = std::move(found->keypoints),
                    .descriptors = DescriptorMatrix(0, kind_.num_values),
                    .kind = kind_};
  if (features.keypoints.empty()) return features;
  CAIRN_ASSIGN_OR_RETURN(features.descriptors, DescriptorsFromFloats(found->descriptors, kind_));
  return features;
}

}  // namespace cairn
