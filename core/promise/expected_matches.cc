#include "core/promise/expected_matches.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include <Eigen/Cholesky>

#include "core/base/parallel.h"
#include "core/base/quantiles.h"
#include "core/geometry/pose.h"
#include "core/promise/view_distance.h"

namespace cairn {
namespace {

using FeatureVector = Eigen::Matrix<double, kNumMatchFeatures, 1>;

// Sights weigh exp(-d^2 / 2 h^2), d = distance of views, h = this many views' radii.
constexpr double kKernelWidth = 1.5;
// A priori as good as this many matches.
constexpr double kPriorWeight = 0.5;
// Nothing is certain.
constexpr double kLeastRate = 0.01;
// A class is looked for in images within these of one that saw it.
constexpr double kMaxAngleDeg = 60;
constexpr double kMaxDistanceFactor = 2.5;
// Moving to another place in the same view turns the ray, and changes the distance, by this.
constexpr double kShiftDeg = 5;
constexpr double kShiftLogRatio = 0.1;
constexpr int64_t kMaxNumPairs = 60'000;
constexpr double kViewSpacing = 0.5;
constexpr size_t kMaxNumNear = 64;
constexpr int kMinNumShared = 5;

struct View {
  Pose cam_from_world;
  Eigen::Vector3d center;
  const Camera* camera = nullptr;
  std::vector<int32_t> near;  // images that share classes with it, and itself, ascending
};

class Learner {
 public:
  Learner(const Classes& classes, const ViewOptions& options)
      : classes_(classes), distance_(classes, options) {
    std::unordered_map<CameraId, const Camera*> cameras;
    for (const Camera& camera : classes.cameras) cameras[camera.camera_id] = &camera;
    std::unordered_map<ImageId, int32_t> index;
    for (const SurveyImage& image : classes.images) {
      index[image.image_id] = static_cast<int32_t>(views_.size());
      const auto camera = cameras.find(image.camera_id);
      views_.push_back({image.cam_from_world,
                        image.cam_from_world.Center(),
                        camera == cameras.end() ? nullptr : camera->second,
                        {}});
    }
    seen_by_.resize(classes.classes.size());
    for (size_t i = 0; i < classes.classes.size(); ++i) {
      for (const Observation& observation : classes.classes[i].observations) {
        const auto image = index.find(observation.image_id);
        if (image == index.end()) continue;
        seen_by_[i].push_back(image->second);
      }
    }
    FindNear();
  }

  // Images that look at a class, ascending: those that see it and those near them in whose view it lies.
  std::vector<int32_t> Looking(size_t i) const {
    std::vector<int32_t> candidates;
    for (const int32_t image : seen_by_[i])
      candidates.insert(candidates.end(), views_[image].near.begin(), views_[image].near.end());
    std::sort(candidates.begin(), candidates.end());
    candidates.erase(std::unique(candidates.begin(), candidates.end()), candidates.end());
    std::erase_if(candidates, [&](int32_t image) {
      return !std::binary_search(seen_by_[i].begin(), seen_by_[i].end(), image) && !LooksAt(image, i);
    });
    return candidates;
  }

  // The sights of a class: where those that look at it stand, and which of them see it.
  struct Lookers {
    std::vector<int32_t> images;
    std::vector<char> sees;
    std::vector<Eigen::Vector3d> rays;  // unit vectors from the class
    std::vector<double> log_distances;  // base 2
  };
  Lookers LookersOf(size_t i) const {
    Lookers lookers;
    lookers.images = Looking(i);
    for (const int32_t image : lookers.images) {
      lookers.sees.push_back(std::binary_search(seen_by_[i].begin(), seen_by_[i].end(), image));
      const Eigen::Vector3d ray = views_[image].center - classes_.classes[i].position;
      const double distance = std::max(ray.norm(), 1e-9);
      lookers.rays.push_back(ray / distance);
      lookers.log_distances.push_back(std::log2(distance));
    }
    return lookers;
  }

  // What is known of a class at the j-th image that looks at it.  `is_left_out`: from other views alone;
  // false: as a robot in the image's view would find it.  False where no sight is left or all are far.
  bool Describe(const Lookers& lookers, size_t j, double prior, bool is_left_out,
                FeatureVector* features) const {
    double sum = 0, seen = 0, least = 1e9, nearest_deg = 180, nearest_log = 10;
    int num_seen = 0;
    for (size_t other = 0; other < lookers.images.size(); ++other) {
      double d2 = distance_.Squared(lookers.images[j], lookers.images[other]);
      if (is_left_out && d2 < 1) continue;
      if (!is_left_out) d2 += 1;
      const double weight = std::exp(-d2 / (2 * kKernelWidth * kKernelWidth));
      sum += weight;
      if (!lookers.sees[other]) continue;
      seen += weight;
      ++num_seen;
      const double angle =
          DegFromRad(std::acos(std::clamp(lookers.rays[j].dot(lookers.rays[other]), -1.0, 1.0)));
      const double log_ratio = std::abs(lookers.log_distances[j] - lookers.log_distances[other]);
      const double far = angle * angle / (20 * 20) + log_ratio * log_ratio / (0.5 * 0.5);
      if (far < least) least = far, nearest_deg = angle, nearest_log = log_ratio;
    }
    if (num_seen == 0 || nearest_deg > kMaxAngleDeg || nearest_log > std::log2(kMaxDistanceFactor))
      return false;
    if (is_left_out && num_seen < 2) return false;
    if (!is_left_out) {
      nearest_deg = std::hypot(nearest_deg, kShiftDeg);
      nearest_log = std::hypot(nearest_log, kShiftLogRatio);
    }
    const double rate =
        std::clamp((seen + kPriorWeight * prior) / (sum + kPriorWeight), kLeastRate, 1 - kLeastRate);
    *features << 1, std::log(rate / (1 - rate)), std::log1p(sum), std::log(num_seen), nearest_deg / 20,
        nearest_log / 0.5, static_cast<double>(num_seen) / static_cast<double>(lookers.images.size());
    return true;
  }

  double depth() const { return distance_.depth(); }
  const std::vector<int32_t>& seen_by(size_t i) const { return seen_by_[i]; }

  // Images that lie apart, so that every image is within kViewSpacing of one of them.
  std::vector<int32_t> Views() const {
    std::vector<int32_t> chosen;
    for (int32_t image = 0; image < static_cast<int32_t>(views_.size()); ++image) {
      const bool is_near = std::any_of(chosen.begin(), chosen.end(), [&](int32_t other) {
        return distance_.Squared(image, other) < kViewSpacing * kViewSpacing;
      });
      if (!is_near) chosen.push_back(image);
    }
    return chosen;
  }

 private:
  bool LooksAt(int32_t image, size_t i) const {
    const View& view = views_[image];
    if (view.camera == nullptr) return false;
    const auto pixel = ImageFromCamera(*view.camera, view.cam_from_world * classes_.classes[i].position);
    return pixel && pixel->x() >= 0 && pixel->y() >= 0 && pixel->x() < view.camera->width &&
           pixel->y() < view.camera->height;
  }

  void FindNear() {
    std::vector<std::unordered_map<int32_t, int>> shared(views_.size());
    for (const std::vector<int32_t>& images : seen_by_) {
      for (const int32_t a : images) {
        for (const int32_t b : images) {
          if (a != b) ++shared[a][b];
        }
      }
    }
    for (size_t a = 0; a < views_.size(); ++a) {
      std::vector<std::pair<int, int32_t>> order;
      for (const auto& [b, num] : shared[a]) {
        if (num >= kMinNumShared) order.emplace_back(-num, b);
      }
      std::sort(order.begin(), order.end());
      if (order.size() > kMaxNumNear) order.resize(kMaxNumNear);
      views_[a].near.push_back(static_cast<int32_t>(a));
      for (const auto& [num, b] : order) views_[a].near.push_back(b);
      std::sort(views_[a].near.begin(), views_[a].near.end());
    }
  }

  const Classes& classes_;
  const ViewDistance distance_;
  std::vector<View> views_;
  std::vector<std::vector<int32_t>> seen_by_;
};

// Maximum likelihood of logistic regression by Newton's method, with a weak pull to 0.
FeatureVector FitLogistic(const std::vector<FeatureVector>& rows, const std::vector<char>& seen) {
  FeatureVector weights = FeatureVector::Zero();
  for (int iteration = 0; iteration < 20; ++iteration) {
    Eigen::Matrix<double, kNumMatchFeatures, kNumMatchFeatures> hessian =
        Eigen::Matrix<double, kNumMatchFeatures, kNumMatchFeatures>::Identity();
    FeatureVector gradient = -weights;
    for (size_t i = 0; i < rows.size(); ++i) {
      const double p = 1 / (1 + std::exp(-weights.dot(rows[i])));
      gradient += ((seen[i] ? 1.0 : 0.0) - p) * rows[i];
      hessian += p * (1 - p) * rows[i] * rows[i].transpose();
    }
    const FeatureVector step = hessian.ldlt().solve(gradient);
    weights += step;
    if (step.cwiseAbs().maxCoeff() < 1e-8) break;
  }
  return weights;
}

}  // namespace

ExpectedMatches LearnMatches(const Classes& classes, const ViewOptions& options, int num_threads) {
  const Learner learner(classes, options);
  const auto num_classes = static_cast<int64_t>(classes.classes.size());
  std::vector<Learner::Lookers> lookers(num_classes);
  ParallelFor(num_classes, num_threads, [&](int64_t i) { lookers[i] = learner.LookersOf(i); });
  int64_t num_looking = 0, num_seen = 0;
  for (int64_t i = 0; i < num_classes; ++i) {
    num_looking += static_cast<int64_t>(lookers[i].images.size());
    num_seen += static_cast<int64_t>(learner.seen_by(i).size());
  }
  ExpectedMatches matches;
  matches.views = learner.Views();
  matches.depth = learner.depth();
  matches.of_class.resize(num_classes);
  if (num_looking == 0) return matches;
  const double prior = static_cast<double>(num_seen) / static_cast<double>(num_looking);

  const int64_t step = std::max<int64_t>(1, num_looking / kMaxNumPairs);
  std::vector<std::vector<std::pair<FeatureVector, char>>> learnt(num_classes);
  ParallelFor((num_classes + step - 1) / step, num_threads, [&](int64_t n) {
    const int64_t i = n * step;
    for (size_t j = 0; j < lookers[i].images.size(); ++j) {
      FeatureVector features;
      if (learner.Describe(lookers[i], j, prior, true, &features))
        learnt[i].emplace_back(features, lookers[i].sees[j]);
    }
  });
  std::vector<FeatureVector> rows;
  std::vector<char> seen;
  for (const auto& list : learnt) {
    for (const auto& [features, is_seen] : list) rows.push_back(features), seen.push_back(is_seen);
  }
  matches.num_learnt_from = static_cast<int64_t>(rows.size());
  const FeatureVector weights = FitLogistic(rows, seen);
  for (int f = 0; f < kNumMatchFeatures; ++f) matches.weights[f] = weights[f];

  std::vector<int32_t> view_of_image(classes.images.size(), -1);
  for (size_t view = 0; view < matches.views.size(); ++view)
    view_of_image[matches.views[view]] = static_cast<int32_t>(view);
  ParallelFor(num_classes, num_threads, [&](int64_t i) {
    for (size_t j = 0; j < lookers[i].images.size(); ++j) {
      FeatureVector features;
      const int32_t view = view_of_image[lookers[i].images[j]];
      if (view < 0 || !learner.Describe(lookers[i], j, prior, false, &features)) continue;
      matches.of_class[i].push_back({view, static_cast<float>(1 / (1 + std::exp(-weights.dot(features))))});
    }
  });
  return matches;
}

}  // namespace cairn
