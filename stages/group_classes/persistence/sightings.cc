#include "stages/group_classes/persistence/sightings.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>

#include "core/base/parallel.h"
#include "core/base/quantiles.h"
#include "core/camera/camera.h"

namespace cairn::group_classes {
namespace {

// Kernel of the regression: of the angle between two viewpoints at the class, and of the binary logarithm of
// the ratio of their distances.
constexpr double kAngleKernelRad = 10 * std::numbers::pi / 180;
constexpr double kScaleKernel = 0.5;
// A viewpoint farther than this many kernels away says nothing.
constexpr double kMaxKernels = 2.5;
// Added to the weight of all neighbours, as images that did not see the class: one neighbour far away is not
// believed.
constexpr double kPriorWeight = 0.5;
// Most neighbours of an image, the nearest ones, and how far they may be, as part of how far the image sees
// on the median.
constexpr size_t kMaxNumNearImages = 60;
constexpr double kMaxNeighbourDistance = 0.6;
constexpr double kMinNeighbourCosine = 0.5;
// A class this much farther than ever seen is not expected.
constexpr double kMaxDistanceRatio = 2;
// Part of an image's width and height at its edges where nothing is expected: the descriptor needs a patch.
constexpr double kMargin = 0.02;
// An image's own classes hide what is behind them where at least this many are near, all but a fifth of them
// nearer than this part of the depth.
constexpr int kMinNumHiding = 3;
constexpr double kHidingDepthRatio = 0.8;
constexpr double kMinHidingShare = 0.8;
constexpr int kDepthColumns = 24, kDepthRows = 18;

// One image, as the regression needs it.
struct View {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation, center, direction;
  const Camera* camera = nullptr;
  double min_cosine = -1;  // of the angle between its axis and what it sees
  int session = -1;
  bool shows_landmarks_only = false;
  double typical_distance = 0;  // of the classes that it sees
  std::vector<int> neighbours;
  // Of the classes that it sees, cell by cell, row after row: those of cell c from first_depth[c] on.
  std::vector<float> depths;
  std::vector<int> first_depth;
};

// Of the angle between a camera's axis and the corners of its image; -1 where one has no ray, or beyond 80
// degrees, where an edge may see farther than the corners.
double MinCosine(const Camera& camera) {
  double min_cosine = 1;
  for (const double x : {0.0, static_cast<double>(camera.width)}) {
    for (const double y : {0.0, static_cast<double>(camera.height)}) {
      const std::optional<Eigen::Vector3d> bearing = BearingFromImage(camera, {x, y});
      min_cosine = std::min(min_cosine, bearing ? bearing->z() : -1.0);
    }
  }
  return min_cosine > 0.17 ? 0.95 * min_cosine : -1;
}

struct CellOfPixel {
  int column = 0, row = 0;
};

CellOfPixel CellOf(const Camera& camera, const Eigen::Vector2d& pixel) {
  return {std::clamp(static_cast<int>(pixel.x() * kDepthColumns / camera.width), 0, kDepthColumns - 1),
          std::clamp(static_cast<int>(pixel.y() * kDepthRows / camera.height), 0, kDepthRows - 1)};
}

// The pixel and the distance of a point that lies well inside of an image.
struct Sight {
  Eigen::Vector2d pixel;
  double distance = 0;
};

std::optional<Sight> SightOf(const View& view, const Eigen::Vector3d& point) {
  const Eigen::Vector3d in_cam = view.rotation * point + view.translation;
  const std::optional<Eigen::Vector2d> pixel = ImageFromCamera(*view.camera, in_cam);
  if (!pixel) return std::nullopt;
  const double margin_x = kMargin * view.camera->width, margin_y = kMargin * view.camera->height;
  if (pixel->x() < margin_x || pixel->x() > view.camera->width - margin_x || pixel->y() < margin_y ||
      pixel->y() > view.camera->height - margin_y)
    return std::nullopt;
  return Sight{*pixel, in_cam.norm()};
}

// Whether what the image sees around a pixel is nearer than `distance`.
bool IsHidden(const View& view, const Sight& sight) {
  const CellOfPixel at = CellOf(*view.camera, sight.pixel);
  int num = 0, num_nearer = 0;
  const double hiding_depth = kHidingDepthRatio * sight.distance;
  const int first_column = std::max(0, at.column - 1),
            last_column = std::min(kDepthColumns - 1, at.column + 1);
  for (int row = std::max(0, at.row - 1); row <= std::min(kDepthRows - 1, at.row + 1); ++row) {
    const int begin = view.first_depth[row * kDepthColumns + first_column];
    const int end = view.first_depth[row * kDepthColumns + last_column + 1];
    num += end - begin;
    for (int i = begin; i < end; ++i) num_nearer += view.depths[i] < hiding_depth ? 1 : 0;
  }
  return num >= kMinNumHiding && num_nearer >= kMinHidingShare * num;
}

void SortDepths(const std::vector<double>& distances, const std::vector<int>& cells, View* view) {
  view->first_depth.assign(kDepthColumns * kDepthRows + 1, 0);
  for (const int cell : cells) ++view->first_depth[cell + 1];
  std::partial_sum(view->first_depth.begin(), view->first_depth.end(), view->first_depth.begin());
  std::vector<int> next = view->first_depth;
  view->depths.resize(distances.size());
  for (size_t k = 0; k < cells.size(); ++k) view->depths[next[cells[k]]++] = static_cast<float>(distances[k]);
}

std::vector<View> ViewsOf(const Classes& classes, const ImageSessions& images, int num_threads) {
  std::map<CameraId, const Camera*> cameras;
  std::map<CameraId, double> min_cosines;
  for (const Camera& camera : classes.cameras) {
    cameras[camera.camera_id] = &camera;
    min_cosines[camera.camera_id] = MinCosine(camera);
  }
  std::map<ImageId, int> idx_of_id;
  std::vector<View> views(classes.images.size());
  for (size_t i = 0; i < views.size(); ++i) {
    const SurveyImage& image = classes.images[i];
    idx_of_id[image.image_id] = static_cast<int>(i);
    views[i].rotation = image.cam_from_world.rotation.toRotationMatrix();
    views[i].translation = image.cam_from_world.translation;
    views[i].center = image.cam_from_world.Center();
    views[i].direction = image.cam_from_world.ViewingDirection();
    views[i].camera = cameras.at(image.camera_id);
    views[i].min_cosine = min_cosines.at(image.camera_id);
    views[i].session = images.session[i];
    views[i].shows_landmarks_only =
        !images.shows_landmarks_only.empty() && images.shows_landmarks_only[i] != 0;
  }
  std::vector<std::vector<double>> distances(views.size());
  std::vector<std::vector<int>> cells(views.size());  // of each of these
  for (const FeatureClass& feature : classes.classes) {
    for (const Observation& observation : feature.observations) {
      const int i = idx_of_id.at(observation.image_id);
      View& view = views[i];
      const double distance = (feature.position - view.center).norm();
      distances[i].push_back(distance);
      const CellOfPixel cell = CellOf(*view.camera, {observation.keypoint.x, observation.keypoint.y});
      cells[i].push_back(cell.row * kDepthColumns + cell.column);
    }
  }
  for (size_t i = 0; i < views.size(); ++i) SortDepths(distances[i], cells[i], &views[i]);
  // An image that sees nothing sees as far as the others do.
  std::vector<double> typical;
  for (size_t i = 0; i < views.size(); ++i) {
    if (distances[i].empty()) continue;
    views[i].typical_distance = UpperMedian(distances[i]);
    typical.push_back(views[i].typical_distance);
  }
  if (typical.empty()) return views;
  const double typical_of_all = UpperMedian(typical);
  for (size_t i = 0; i < views.size(); ++i) {
    if (distances[i].empty()) views[i].typical_distance = typical_of_all;
  }
  ParallelFor(static_cast<int64_t>(views.size()), num_threads, [&](int64_t i) {
    if (views[i].session < 0) return;
    std::vector<std::pair<double, int>> near;
    for (size_t j = 0; j < views.size(); ++j) {
      if (views[j].session < 0 || views[j].session == views[i].session) continue;
      const double distance = (views[j].center - views[i].center).norm();
      if (distance > kMaxNeighbourDistance * views[i].typical_distance) continue;
      if (views[j].direction.dot(views[i].direction) < kMinNeighbourCosine) continue;
      near.emplace_back(distance, static_cast<int>(j));
    }
    const size_t num = std::min(near.size(), kMaxNumNearImages);
    std::partial_sort(near.begin(), near.begin() + static_cast<ptrdiff_t>(num), near.end());
    for (size_t k = 0; k < num; ++k) views[i].neighbours.push_back(near[k].second);
  });
  return views;
}

// What all images could see of one class.
class ClassRegression {
 public:
  ClassRegression(const std::vector<View>& views, int num_sessions)
      : views_(views),
        num_sessions_(num_sessions),
        is_inside_(views.size()),
        seen_(views.size()),
        rays_(views.size()) {}

  ClassViews ViewsOfClass(const Eigen::Vector3d& position, const std::vector<int>& seen_by) {
    double max_distance = 0;
    std::fill(is_inside_.begin(), is_inside_.end(), 0);
    std::fill(seen_.begin(), seen_.end(), 0);
    std::vector<char> knows(num_sessions_, 0);
    for (const int i : seen_by) {
      seen_[i] = 1;
      max_distance = std::max(max_distance, (position - views_[i].center).norm());
      if (views_[i].session >= 0) knows[views_[i].session] = 1;
    }
    max_distance *= kMaxDistanceRatio;
    std::vector<int> inside;
    for (size_t i = 0; i < views_.size(); ++i) {
      const View& view = views_[i];
      const Eigen::Vector3d to_class = position - view.center;
      const double squared = to_class.squaredNorm();
      if (view.session < 0 || squared > max_distance * max_distance) continue;
      const double distance = std::sqrt(squared);
      if (!seen_[i]) {
        if (to_class.dot(view.direction) < view.min_cosine * distance) continue;
        const std::optional<Sight> sight = SightOf(view, position);
        if (!sight || IsHidden(view, *sight)) continue;
      }
      is_inside_[i] = knows[view.session] ? 2 : 1;
      rays_[i] = {to_class / distance, std::log2(distance)};
      inside.push_back(static_cast<int>(i));
    }
    ClassViews found;
    for (const int i : inside) {
      const float visibility = views_[i].shows_landmarks_only ? 0 : Visibility(i);
      if (visibility > 0 || seen_[i]) found.push_back({i, visibility, seen_[i] != 0});
    }
    return found;
  }

 private:
  struct Ray {
    Eigen::Vector3d direction;
    double log_distance = 0;
  };

  // The kernel regression at one image.
  float Visibility(int i) const {
    double weights = kPriorWeight, seen = 0;
    for (const int j : views_[i].neighbours) {
      if (is_inside_[j] != 2) continue;
      // The square of a small angle is that of the chord.
      const double angle_squared = (rays_[i].direction - rays_[j].direction).squaredNorm();
      const double scale = (rays_[j].log_distance - rays_[i].log_distance) / kScaleKernel;
      const double squared = angle_squared / (kAngleKernelRad * kAngleKernelRad) + scale * scale;
      if (squared > kMaxKernels * kMaxKernels) continue;
      const double weight = std::exp(-0.5 * squared);
      weights += weight;
      if (seen_[j]) seen += weight;
    }
    return static_cast<float>(seen / weights);
  }

  const std::vector<View>& views_;
  const int num_sessions_;
  std::vector<char> is_inside_;  // 1: could see it; 2: and is of a session that knows it
  std::vector<char> seen_;
  std::vector<Ray> rays_;  // of those inside
};

}  // namespace

std::vector<ClassViews> FindExpectedViews(const Classes& classes, const ImageSessions& images,
                                          int num_threads) {
  const std::vector<View> views = ViewsOf(classes, images, num_threads);
  std::map<ImageId, int> idx_of_id;
  int num_sessions = 0;
  for (size_t i = 0; i < classes.images.size(); ++i) {
    idx_of_id[classes.images[i].image_id] = static_cast<int>(i);
    num_sessions = std::max(num_sessions, images.session[i] + 1);
  }
  std::vector<ClassViews> found(classes.classes.size());
  constexpr int64_t kBlock = 256;
  const auto num_classes = static_cast<int64_t>(found.size());
  ParallelFor((num_classes + kBlock - 1) / kBlock, num_threads, [&](int64_t block) {
    ClassRegression regression(views, num_sessions);
    std::vector<int> seen_by;
    for (int64_t c = block * kBlock; c < std::min(num_classes, (block + 1) * kBlock); ++c) {
      seen_by.clear();
      for (const Observation& observation : classes.classes[c].observations)
        seen_by.push_back(idx_of_id.at(observation.image_id));
      found[c] = regression.ViewsOfClass(classes.classes[c].position, seen_by);
    }
  });
  return found;
}

}  // namespace cairn::group_classes
