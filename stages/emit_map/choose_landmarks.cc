#include "stages/emit_map/choose_landmarks.h"

#include <algorithm>
#include <cmath>
#include <queue>
#include <unordered_map>

#include "core/base/parallel.h"
#include "core/camera/camera.h"

namespace cairn::emit_map {
namespace {

// An image looks at a class from about where it was seen if it is no farther away than this many times the
// farthest image that saw it, and its ray is within the widest angle from the mean ray plus this, degrees.
constexpr double kFarther = 1.2;
constexpr double kWiderDeg = 10;

// The images that look at the classes of a survey, and those that see them.
class Viewers {
 public:
  explicit Viewers(const Classes& classes) : classes_(classes) {
    std::unordered_map<CameraId, const Camera*> cameras;
    for (const Camera& camera : classes.cameras) cameras[camera.camera_id] = &camera;
    for (const SurveyImage& image : classes.images) {
      index_[image.image_id] = static_cast<int>(centers_.size());
      centers_.push_back(image.cam_from_world.Center());
      const auto camera = cameras.find(image.camera_id);
      camera_.push_back(camera == cameras.end() ? nullptr : camera->second);
    }
  }

  int num_images() const { return static_cast<int>(centers_.size()); }

  // Indices of the images that see a class, ascending.
  std::vector<int> SeenBy(const FeatureClass& feature_class) const {
    std::vector<int> images;
    for (const Observation& observation : feature_class.observations) {
      const auto image = index_.find(observation.image_id);
      if (image != index_.end()) images.push_back(image->second);
    }
    return images;
  }

  // Of the images that could see it, the part that does.
  double Repeatability(const FeatureClass& feature_class, const std::vector<int>& seen_by) const {
    if (seen_by.empty()) return 0;
    double farthest = 0;
    Eigen::Vector3d mean_ray = Eigen::Vector3d::Zero();
    for (const int image : seen_by) {
      const Eigen::Vector3d ray = centers_[image] - feature_class.position;
      farthest = std::max(farthest, ray.norm());
      mean_ray += ray.normalized();
    }
    mean_ray.normalize();
    double least_cosine = 1;
    for (const int image : seen_by)
      least_cosine =
          std::min(least_cosine, (centers_[image] - feature_class.position).normalized().dot(mean_ray));
    const double widest = std::acos(std::clamp(least_cosine, -1.0, 1.0)) + RadFromDeg(kWiderDeg);
    int num_looking = 0;
    for (int image = 0; image < num_images(); ++image) {
      const Eigen::Vector3d ray = centers_[image] - feature_class.position;
      if (ray.norm() > kFarther * farthest ||
          ray.normalized().dot(mean_ray) < std::cos(std::min(widest, M_PI)))
        continue;
      if (LooksAt(image, feature_class.position)) ++num_looking;
    }
    return static_cast<double>(seen_by.size()) /
           std::max<double>(num_looking, static_cast<double>(seen_by.size()));
  }

 private:
  bool LooksAt(int image, const Eigen::Vector3d& place) const {
    if (camera_[image] == nullptr) return false;
    const auto pixel = ImageFromCamera(*camera_[image], classes_.images[image].cam_from_world * place);
    return pixel && pixel->x() >= 0 && pixel->y() >= 0 && pixel->x() < camera_[image]->width &&
           pixel->y() < camera_[image]->height;
  }

  const Classes& classes_;
  std::unordered_map<ImageId, int> index_;
  std::vector<Eigen::Vector3d> centers_;
  std::vector<const Camera*> camera_;
};

}  // namespace

std::vector<size_t> OrderByUse(const Classes& classes, const std::vector<size_t>& pool, double enough,
                               int num_threads) {
  const Viewers viewers(classes);
  std::vector<std::vector<int>> seen_by(pool.size());
  std::vector<double> repeatability(pool.size());
  ParallelFor(static_cast<int64_t>(pool.size()), num_threads, [&](int64_t i) {
    const FeatureClass& feature_class = classes.classes[pool[i]];
    seen_by[i] = viewers.SeenBy(feature_class);
    repeatability[i] = viewers.Repeatability(feature_class, seen_by[i]);
  });

  // exp(-m / enough) per image: another class reduces it.
  std::vector<double> lack(viewers.num_images(), 1);
  const auto gain = [&](size_t i) {
    double sum = 0;
    for (const int image : seen_by[i]) sum += lack[image];
    return sum * (1 - std::exp(-repeatability[i] / enough));
  };
  // Gains only fall: an earlier value is a bound [Minoux, "Accelerated greedy algorithms", 1978].
  struct Candidate {
    double bound;
    size_t index;
    size_t round;  // in which the bound was computed
  };
  const auto worse = [&](const Candidate& a, const Candidate& b) {
    if (a.bound != b.bound) return a.bound < b.bound;
    if (seen_by[a.index].size() != seen_by[b.index].size())
      return seen_by[a.index].size() < seen_by[b.index].size();
    return a.index > b.index;
  };
  std::priority_queue<Candidate, std::vector<Candidate>, decltype(worse)> queue(worse);
  for (size_t i = 0; i < pool.size(); ++i) queue.push({gain(i), i, 0});
  std::vector<size_t> order;
  while (!queue.empty()) {
    Candidate candidate = queue.top();
    queue.pop();
    if (candidate.round < order.size()) {
      queue.push({gain(candidate.index), candidate.index, order.size()});
      continue;
    }
    for (const int image : seen_by[candidate.index])
      lack[image] *= std::exp(-repeatability[candidate.index] / enough);
    order.push_back(pool[candidate.index]);
  }
  return order;
}

}  // namespace cairn::emit_map
