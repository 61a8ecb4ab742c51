#include "core/promise/landmark_order.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <utility>

#include "core/base/parallel.h"
#include "core/promise/pose_information.h"

namespace cairn {
namespace {

// What a robot knows of its pose without landmarks: half the distance of what it sees, and this much.
constexpr double kRoughSigmaRatio = 0.5;
constexpr double kRoughSigmaDeg = 30;

class LandmarkOrder {
 public:
  LandmarkOrder(const Classes& classes, const ExpectedMatches& matches, const LandmarkOrderOptions& options)
      : classes_(classes),
        matches_(matches),
        options_(options),
        lack_(matches.views.size(), 1),
        information_(matches.views.size(), kRoughSigmaRatio * matches.depth, kRoughSigmaDeg) {
    std::unordered_map<CameraId, const Camera*> cameras;
    for (const Camera& camera : classes.cameras) cameras[camera.camera_id] = &camera;
    std::unordered_map<ImageId, const SurveyImage*> images;
    for (const SurveyImage& image : classes.images) {
      images[image.image_id] = &image;
      const auto camera = cameras.find(image.camera_id);
      focal_of_image_[image.image_id] = camera == cameras.end() ? 1 : camera->second->MeanFocal();
    }
    for (const int32_t image : matches.views) {
      const SurveyImage& row = classes.images[image];
      views_.push_back({row.cam_from_world, focal_of_image_.at(row.image_id)});
    }
    size_rad_m_.reserve(classes.classes.size());
    for (const FeatureClass& feature_class : classes.classes) {
      double sum = 0;
      int num = 0;
      for (const Observation& observation : feature_class.observations) {
        const auto image = images.find(observation.image_id);
        if (image == images.end()) continue;
        const double distance = (image->second->cam_from_world * feature_class.position).norm();
        sum += observation.keypoint.scale * distance / focal_of_image_.at(observation.image_id);
        ++num;
      }
      size_rad_m_.push_back(num > 0 ? sum / num : 0);
    }
  }

  double Gain(size_t i) const {
    double gain = 0;
    for (const ExpectedMatch& match : matches_.of_class[i]) {
      gain += options_.enough_matches * lack_[match.view] *
              (1 - std::exp(-match.probability / options_.enough_matches));
      if (const auto sight = SightOf(i, match)) gain += information_.PlaceGain(*sight);
    }
    return gain;
  }

  void Take(size_t i) {
    std::vector<SightInformation> sights;
    for (const ExpectedMatch& match : matches_.of_class[i]) {
      lack_[match.view] *= std::exp(-match.probability / options_.enough_matches);
      if (const auto sight = SightOf(i, match)) sights.push_back(*sight);
    }
    information_.Add(sights);
  }

 private:
  struct View {
    Pose cam_from_world;
    double focal;  // px
  };

  std::optional<SightInformation> SightOf(size_t i, const ExpectedMatch& match) const {
    const FeatureClass& feature_class = classes_.classes[i];
    const View& view = views_[match.view];
    const double distance = (view.cam_from_world * feature_class.position).norm();
    const double scale_px = distance > 0 ? size_rad_m_[i] * view.focal / distance : 0;
    const double sigma_px =
        std::hypot(options_.keypoint_sigma_px, options_.keypoint_sigma_per_scale * scale_px,
                   feature_class.reprojection_error_px);
    const auto root =
        InformationRoot(feature_class, view.cam_from_world, sigma_px / view.focal, match.probability);
    if (!root) return std::nullopt;
    return SightInformation{static_cast<size_t>(match.view), *root};
  }

  const Classes& classes_;
  const ExpectedMatches& matches_;
  const LandmarkOrderOptions& options_;
  std::unordered_map<ImageId, double> focal_of_image_;
  std::vector<View> views_;
  std::vector<double> size_rad_m_;  // per class: angle of its keypoints times distance
  std::vector<double> lack_;        // per view: exp(-m_v / e)
  PoseInformation information_;
};

}  // namespace

std::vector<size_t> OrderLandmarks(const Classes& classes, const ExpectedMatches& matches,
                                   const std::vector<size_t>& pool, const LandmarkOrderOptions& options,
                                   int num_threads) {
  LandmarkOrder state(classes, matches, options);
  struct Candidate {
    double bound;
    size_t i;  // in `pool`
  };
  const auto worse = [](const Candidate& a, const Candidate& b) {
    return a.bound != b.bound ? a.bound < b.bound : a.i > b.i;
  };
  std::vector<Candidate> heap(pool.size());
  for (size_t i = 0; i < pool.size(); ++i) heap[i].i = i;
  std::vector<size_t> order;
  size_t next_refresh = 0;
  while (!heap.empty()) {
    // Gains hardly grow: an earlier value is nearly a bound [Minoux, "Accelerated greedy algorithms", 1978].
    // Those that did grow are found whenever as many again have been taken.
    if (order.size() >= next_refresh) {
      ParallelFor(static_cast<int64_t>(heap.size()), num_threads,
                  [&](int64_t i) { heap[i].bound = state.Gain(pool[heap[i].i]); });
      std::make_heap(heap.begin(), heap.end(), worse);
      next_refresh = 2 * order.size() + 1;
    }
    std::pop_heap(heap.begin(), heap.end(), worse);
    heap.back().bound = state.Gain(pool[heap.back().i]);
    if (heap.size() > 1 && worse(heap.back(), heap.front())) {
      std::push_heap(heap.begin(), heap.end(), worse);
      continue;
    }
    state.Take(pool[heap.back().i]);
    order.push_back(pool[heap.back().i]);
    heap.pop_back();
  }
  return order;
}

}  // namespace cairn
