#include "stages/reconstruct/registration/standing_images.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <span>

#include "core/base/pooled.h"

namespace cairn::reconstruct {
namespace {

// How far nine of ten matched keypoints moved.  REQUIRES: matches
double ShiftPx(const PooledVector<Keypoint>& keypoints1, const PooledVector<Keypoint>& keypoints2,
               std::span<const Match> matches) {
  std::vector<double> shifts;
  for (const Match& match : matches) {
    const Keypoint &a = keypoints1[match.idx1], &b = keypoints2[match.idx2];
    shifts.push_back(std::hypot(a.x - b.x, a.y - b.y));
  }
  const auto ninth = shifts.begin() + static_cast<int64_t>(0.9 * static_cast<double>(shifts.size() - 1));
  std::nth_element(shifts.begin(), ninth, shifts.end());
  return *ninth;
}

}  // namespace

std::vector<std::optional<RepeatedImage>> FindStandingImages(const MapperInput& input,
                                                             const std::vector<int>& images,
                                                             const StandingImagesOptions& options) {
  const std::map<ImageId, int> index = IndexOf(input);
  std::vector<int> place(input.images.size(), -1);  // in `images`
  for (size_t k = 0; k < images.size(); ++k) place[images[k]] = static_cast<int>(k);
  // Per image: earlier ones from whose place it was taken.
  std::vector<std::vector<RepeatedImage>> same(input.images.size());
  for (const TwoViewGeometry& pair : input.geometries) {
    const int image1 = index.at(pair.image_id1), image2 = index.at(pair.image_id2);
    if (place[image1] < 0 || place[image2] < 0) continue;
    if (input.images[image1].camera_id != input.images[image2].camera_id) continue;
    const PooledVector<Keypoint>&keypoints1 = input.keypoints[image1], &keypoints2 = input.keypoints[image2];
    const auto fewer = static_cast<double>(std::min(keypoints1.size(), keypoints2.size()));
    if (pair.inliers.empty() || static_cast<double>(pair.inliers.size()) < options.min_matched_ratio * fewer)
      continue;
    const Camera& camera = input.cameras.at(input.images[image1].camera_id);
    const double shift_px = ShiftPx(keypoints1, keypoints2, pair.inliers);
    if (shift_px > options.max_shift_ratio * std::max(camera.width, camera.height)) continue;
    const bool is_first_earlier = place[image1] < place[image2];
    same[is_first_earlier ? image2 : image1].push_back({is_first_earlier ? image1 : image2, shift_px});
  }
  std::vector<std::optional<RepeatedImage>> repeated(input.images.size());
  for (const int image : images) {
    for (const RepeatedImage& earlier : same[image]) {
      if (repeated[earlier.image]) continue;
      if (!repeated[image] || earlier.shift_px < repeated[image]->shift_px) repeated[image] = earlier;
    }
  }
  return repeated;
}

std::vector<ImageMotion> MotionsOfRepeated(const std::vector<ImageMotion>& motions,
                                           const std::vector<std::optional<RepeatedImage>>& repeated) {
  const auto kept = [&](int image) { return repeated[image] ? repeated[image]->image : image; };
  std::vector<ImageMotion> between;
  for (const ImageMotion& motion : motions) {
    const int image1 = kept(motion.image1), image2 = kept(motion.image2);
    if (image1 != image2) between.push_back({image1, image2, motion.cam2_from_cam1});
  }
  return between;
}

}  // namespace cairn::reconstruct
