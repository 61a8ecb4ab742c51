#pragma once

#include <cstdint>

#include "core/base/error.h"
#include "core/capture/capture.h"
#include "stages/extract_features/extract_features.h"

namespace cairn::extract_features {

// Number of images whose features are held in memory before they are written.
inline constexpr int64_t kNumImagesPerBatch = 64;

// How many of `num_threads` threads (0: all cores) can each work on a capture's largest image within
// `memory_mib`.  Errors: NoMemory when not even one fits: says how much memory one takes.
Result<int> ThreadsThatFit(const Capture& capture, const ExtractFeaturesOptions& options, int num_threads,
                           int64_t memory_mib);

// Bytes of features.db, estimated: images mostly have fewer keypoints than they may.
int64_t EstimateFeaturesBytes(const Capture& capture, const ExtractFeaturesOptions& options);

}  // namespace cairn::extract_features
