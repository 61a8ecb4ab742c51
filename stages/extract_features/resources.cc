#include "stages/extract_features/resources.h"

#include <algorithm>
#include <cmath>

#include "core/base/parallel.h"
#include "core/features/features.h"
#include "core/line/memory.h"

namespace cairn::extract_features {
namespace {

// SIFT doubles an image and keeps 3 blurred copies of each octave, of 4 bytes a pixel, and a few rows of
// others: 4 * 4 * 3 * 4/3 bytes per pixel of the image, and an eighth of them; its own grey values and the
// file come on top.
constexpr int64_t kPyramidBytesPerPixel = 76;
constexpr int64_t kImageBytesPerPixel = 8;
constexpr int64_t kBytesPerKeypoint = kSiftDescriptorDim + sizeof(Keypoint);
// SIFT finds at most one keypoint per this many pixels.
constexpr int64_t kPixelsPerKeypoint = 100;
constexpr double kKeypointsOfThoseAllowed = 0.75;

int64_t NumPixels(const Camera& camera) { return static_cast<int64_t>(camera.width) * camera.height; }

// Pixels of the image that SIFT searches.
int64_t NumPixelsSearched(const Camera& camera, const ExtractFeaturesOptions& options) {
  const int longer_side = std::max({camera.width, camera.height, 1});
  const double scale = std::min(1.0, static_cast<double>(options.sift.max_image_side_px) / longer_side);
  return std::llround(static_cast<double>(NumPixels(camera)) * scale * scale);
}

int64_t MostKeypoints(const Camera& camera, const ExtractFeaturesOptions& options) {
  return std::min<int64_t>(options.sift.max_num_features,
                           NumPixelsSearched(camera, options) / kPixelsPerKeypoint);
}

}  // namespace

Result<int> ThreadsThatFit(const Capture& capture, const ExtractFeaturesOptions& options, int num_threads,
                           int64_t memory_mib) {
  int64_t bytes_per_thread = 0, batch_bytes = 0;
  for (const auto& [camera_id, camera] : capture.cameras) {
    bytes_per_thread = std::max(bytes_per_thread, kPyramidBytesPerPixel * NumPixelsSearched(camera, options) +
                                                      kImageBytesPerPixel * NumPixels(camera));
    batch_bytes =
        std::max(batch_bytes, kNumImagesPerBatch * kBytesPerKeypoint * MostKeypoints(camera, options));
  }
  CAIRN_RETURN_IF_ERROR(CheckMemory("finding features in an image as large as this capture's",
                                    bytes_per_thread + batch_bytes, memory_mib));
  const int64_t room = (memory_mib << 20) - kProgramBytes - batch_bytes;
  return static_cast<int>(
      std::clamp<int64_t>(room / std::max<int64_t>(bytes_per_thread, 1), 1, NumThreads(num_threads)));
}

int64_t EstimateFeaturesBytes(const Capture& capture, const ExtractFeaturesOptions& options) {
  int64_t num_bytes = 0;
  for (const CaptureImage& image : capture.images) {
    const auto camera = capture.cameras.find(image.camera_id);
    if (camera == capture.cameras.end()) continue;
    const int64_t most = MostKeypoints(camera->second, options);
    num_bytes += std::llround(kKeypointsOfThoseAllowed * static_cast<double>(most * kBytesPerKeypoint));
  }
  return num_bytes;
}

}  // namespace cairn::extract_features
