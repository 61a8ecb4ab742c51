#include "stages/emit_map/previous/settle_rows.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <unordered_map>
#include <utility>

#include "core/base/quantiles.h"
#include "core/delta/renumbering.h"
#include "core/features/transform_code.h"
#include "stages/emit_map/previous/positions.h"

namespace cairn::emit_map {
namespace {

// An image keeps its pose while its landmarks move by less than this in it, px (median).
constexpr double kMaxShiftPx = 3;
// Places and lengths stay while they differ by less than this part of the distance of what images see.
constexpr double kHeldPlaceRatio = 0.01;
constexpr double kHeldHeadingDeg = 1;
// Figures of the promise, of entropies (nats) and of look-alikes: far within what they are known to.
constexpr double kHeldProbability = 0.02, kHeldRatio = 0.05, kHeldMatches = 0.5, kHeldSigmaRatio = 0.002,
                 kHeldEntropy = 0.03, kHeldScore = 0.03;
constexpr double kHeldDrops = 3;  // at a station

// Numbers of images, or landmarks, of a map by those of the earlier one, and what is near.
class Settler {
 public:
  Settler(const Classes& classes, const MapRows& previous, const PreviousMatches& matches, MapRows* rows)
      : previous_(previous), rows_(*rows) {
    const auto class_index = IndexClasses(classes);
    for (const MapLandmark& landmark : rows_.landmarks) {
      const size_t i = class_index.at(landmark.class_id);
      landmark_before_.push_back(matches.landmark_of_class[i]);
      holds_.push_back(matches.holds[i]);
    }
    for (const MapImage& image : rows_.images)
      image_before_.push_back(matches.row_of_image[PositionOf(classes.images, image.image_id)]);
    std::vector<double> distances;
    for (const MapImage& image : previous_.images) {
      for (const LandmarkIdx landmark : image.landmarks)
        distances.push_back((image.cam_from_world * previous_.landmarks[landmark].position).norm());
    }
    same_place_m_ = distances.empty() ? 0 : kHeldPlaceRatio * Median(distances);
  }

  void Run() {
    SettleImages();  // by landmarks as they are now
    SettleLandmarks();
    OrderLandmarks();
    SettleFloor();
    SettleStations();
    SettleAppearance();
    SettlePromise();
  }

 private:
  void SettleImages() {
    std::unordered_map<CameraId, const Camera*> cameras;
    for (const Camera& camera : rows_.cameras) cameras[camera.camera_id] = &camera;
    for (size_t i = 0; i < rows_.images.size(); ++i) {
      MapImage& image = rows_.images[i];
      if (image_before_[i] == kNotBefore || image.landmarks.empty()) continue;
      const Pose& before = previous_.images[image_before_[i]].cam_from_world;
      const Camera& camera = *cameras.at(image.camera_id);
      std::vector<double> shifts;
      for (const LandmarkIdx landmark : image.landmarks) {
        const Eigen::Vector3d& position = rows_.landmarks[landmark].position;
        const auto a = ImageFromCamera(camera, before * position);
        const auto b = ImageFromCamera(camera, image.cam_from_world * position);
        shifts.push_back(a && b ? (*a - *b).norm() : std::numeric_limits<double>::infinity());
      }
      if (Median(shifts) <= kMaxShiftPx) image.cam_from_world = before;
    }
  }

  void SettleLandmarks() {
    if (previous_.descriptor_code) QuantizeByCode(*previous_.descriptor_code, &rows_.descriptors);
    for (size_t i = 0; i < rows_.landmarks.size(); ++i) {
      if (landmark_before_[i] == kNotBefore || holds_[i] == 0) continue;
      const ClassId class_id = rows_.landmarks[i].class_id;  // by which its class is found
      rows_.landmarks[i] = previous_.landmarks[landmark_before_[i]];
      rows_.landmarks[i].class_id = class_id;
      rows_.descriptors.row(static_cast<Eigen::Index>(i)) = previous_.descriptors.row(landmark_before_[i]);
    }
  }

  // Those of the earlier map in its order, each new one behind the last of these of its first region.
  void OrderLandmarks() {
    const size_t num = rows_.landmarks.size();
    const auto no_region = static_cast<int32_t>(rows_.regions.size());
    std::vector<int32_t> home(num, no_region);
    for (int32_t region = no_region; region-- > 0;) {
      for (const LandmarkIdx landmark : rows_.regions[region].landmarks) home[landmark] = region;
    }
    std::vector<int32_t> last_of_home(rows_.regions.size() + 1, kNotBefore);
    for (size_t i = 0; i < num; ++i)
      last_of_home[home[i]] = std::max(last_of_home[home[i]], landmark_before_[i]);
    std::vector<int32_t> order(num);
    for (size_t i = 0; i < num; ++i) order[i] = static_cast<int32_t>(i);
    const auto key = [&](int32_t i) {
      const bool is_new = landmark_before_[i] == kNotBefore;
      const int32_t last = last_of_home[home[i]];
      const int32_t place =
          is_new ? (last == kNotBefore ? std::numeric_limits<int32_t>::max() : last) : landmark_before_[i];
      return std::pair(place, is_new);
    };
    std::stable_sort(order.begin(), order.end(), [&](int32_t a, int32_t b) { return key(a) < key(b); });
    Reorder(order);
  }

  // order: per new place, the landmark that comes there.
  void Reorder(const std::vector<int32_t>& order) {
    std::vector<MapLandmark> landmarks;
    DescriptorMatrix descriptors(rows_.descriptors.rows(), rows_.descriptors.cols());
    std::vector<LandmarkIdx> place_of(order.size());
    for (size_t i = 0; i < order.size(); ++i) {
      landmarks.push_back(rows_.landmarks[order[i]]);
      descriptors.row(static_cast<Eigen::Index>(i)) = rows_.descriptors.row(order[i]);
      place_of[order[i]] = static_cast<LandmarkIdx>(i);
    }
    rows_.landmarks = std::move(landmarks);
    rows_.descriptors = std::move(descriptors);
    const auto renumber = [&](std::vector<LandmarkIdx>* list) {
      for (LandmarkIdx& landmark : *list) landmark = place_of[landmark];
      std::sort(list->begin(), list->end());
    };
    for (MapImage& image : rows_.images) renumber(&image.landmarks);
    for (MapRegion& region : rows_.regions) renumber(&region.landmarks);
  }

  void SettleFloor() {
    double farthest = 0;
    for (const MapImage& image : rows_.images) {
      const Eigen::Vector3d center = image.cam_from_world.Center();
      farthest =
          std::max(farthest, (rows_.floor_from_world * center - previous_.floor_from_world * center).norm());
    }
    if (farthest > same_place_m_) return;
    const Pose settled_from_floor = previous_.floor_from_world * rows_.floor_from_world.Inverse();
    for (MapStation& station : rows_.stations) {
      const Eigen::Vector3d on_floor(station.position.x(), station.position.y(), 0);
      station.position = (settled_from_floor * on_floor).head<2>();
    }
    rows_.floor_from_world = previous_.floor_from_world;
  }

  void SettleStations() {
    std::map<std::pair<int64_t, int64_t>, std::vector<size_t>> cells;  // of stations before
    if (!(same_place_m_ > 0)) return;
    const auto cell_of = [&](const Eigen::Vector2d& position) {
      return std::pair(static_cast<int64_t>(std::floor(position.x() / same_place_m_)),
                       static_cast<int64_t>(std::floor(position.y() / same_place_m_)));
    };
    for (size_t i = 0; i < previous_.stations.size(); ++i)
      cells[cell_of(previous_.stations[i].position)].push_back(i);
    std::vector<char> is_taken(previous_.stations.size(), 0);
    for (MapStation& station : rows_.stations) {
      const auto [x, y] = cell_of(station.position);
      size_t nearest = previous_.stations.size();
      double least = same_place_m_;
      for (int64_t u = x - 1; u <= x + 1; ++u) {
        for (int64_t v = y - 1; v <= y + 1; ++v) {
          const auto cell = cells.find({u, v});
          if (cell == cells.end()) continue;
          for (const size_t i : cell->second) {
            const double distance = (previous_.stations[i].position - station.position).norm();
            if (is_taken[i] == 0 && distance <= least && HaveSameHeading(previous_.stations[i], station))
              least = distance, nearest = i;
          }
        }
      }
      if (nearest == previous_.stations.size()) continue;
      is_taken[nearest] = 1;
      station.position = previous_.stations[nearest].position;
      station.heading_deg = previous_.stations[nearest].heading_deg;
    }
  }

  static bool HaveSameHeading(const MapStation& a, const MapStation& b) {
    if (a.heading_deg.has_value() != b.heading_deg.has_value()) return false;
    return !a.heading_deg ||
           std::abs(std::remainder(*a.heading_deg - *b.heading_deg, 360)) <= kHeldHeadingDeg;
  }

  void SettleAppearance() {
    std::vector<int32_t> node_of_image(previous_.images.size(), kNotBefore);
    for (size_t node = 0; node < previous_.appearance.size(); ++node) {
      for (const int32_t image : previous_.appearance[node].images)
        node_of_image[image] = static_cast<int32_t>(node);
    }
    std::vector<int32_t> node_before;
    for (const MapAppearanceNode& node : rows_.appearance) {
      const int32_t image = image_before_[node.images[0]];
      node_before.push_back(image == kNotBefore ? kNotBefore : node_of_image[image]);
    }
    for (size_t i = 0; i < rows_.appearance.size(); ++i) {
      if (node_before[i] == kNotBefore) continue;
      MapAppearanceNode& node = rows_.appearance[i];
      const MapAppearanceNode& before = previous_.appearance[node_before[i]];
      if (node.entropy && before.entropy && std::abs(*node.entropy - *before.entropy) <= kHeldEntropy)
        node.entropy = before.entropy;
      for (MapAppearanceNode::LookAlike& other : node.look_alikes) {
        for (const MapAppearanceNode::LookAlike& known : before.look_alikes) {
          if (known.node == node_before[other.node] && std::abs(known.score - other.score) <= kHeldScore)
            other.score = known.score;
        }
      }
    }
  }

  void SettlePromise() {
    if (!rows_.findings.promise || !previous_.findings.promise) return;
    MapPromise& promise = *rows_.findings.promise;
    const MapPromise& before = *previous_.findings.promise;
    if (std::abs(promise.radius_m - before.radius_m) <= kHeldRatio * before.radius_m)
      promise.radius_m = before.radius_m;
    std::map<std::pair<int32_t, int32_t>, std::vector<const NodePromise*>> known;  // by images before
    for (const NodePromise& node : before.nodes) known[{node.image, node.other_image}].push_back(&node);
    std::map<std::pair<int32_t, int32_t>, size_t> next;
    for (NodePromise& node : promise.nodes) {
      const std::pair images(image_before_[node.image], image_before_[node.other_image]);
      const auto found = known.find(images);
      const size_t part = next[images]++;
      if (found == known.end() || part >= found->second.size()) continue;
      const NodePromise& other = *found->second[part];
      // A step of what a map stores is more than that of small numbers.
      const auto is_near = [](double a, double b, double step) {
        return std::abs(a - b) <= std::max(kHeldRatio * b, step);
      };
      if (std::abs(node.probability - other.probability) > kHeldProbability ||
          std::abs(node.most_probable - other.most_probable) > kHeldProbability ||
          !is_near(node.num_matches, other.num_matches, kHeldMatches) ||
          !is_near(node.sigma_m, other.sigma_m, kHeldSigmaRatio * promise.radius_m))
        continue;
      const RegionIdx region = node.region;
      const int32_t image = node.image, other_image = node.other_image;
      node = other;
      node.region = region;
      node.image = image;
      node.other_image = other_image;
    }
  }

  const MapRows& previous_;
  MapRows& rows_;
  std::vector<int32_t> landmark_before_;  // per landmark, in the order in which they came
  std::vector<char> holds_;               // the same
  std::vector<int32_t> image_before_;     // per image
  double same_place_m_ = 0;
};

}  // namespace

void SettleRows(const Classes& classes, const MapRows& previous, const PreviousMatches& matches,
                MapRows* rows) {
  Settler(classes, previous, matches, rows).Run();
  if (previous.descriptor_code) rows->descriptor_code = previous.descriptor_code;
}

void SettleDrops(const MapRows& previous, MapRows* rows) {
  const std::vector<int32_t> station_before = FindSameStations(previous, *rows);
  std::map<int, const DropCount*> known;
  for (const DropCount& drop : previous.findings.drops) known[drop.reason_id] = &drop;
  for (DropCount& drop : rows->findings.drops) {
    const auto before = known.find(drop.reason_id);
    if (before == known.end() || before->second->at_stations.empty()) continue;
    for (size_t i = 0; i < drop.at_stations.size(); ++i) {
      if (station_before[i] == Renumbering::kNew) continue;
      const int32_t number = before->second->at_stations[station_before[i]];
      const double most = std::max(kHeldDrops, kHeldRatio * number);
      if (std::abs(drop.at_stations[i] - number) <= most && number <= drop.num_dropped)
        drop.at_stations[i] = number;
    }
  }
}

void KeepClassIds(const Classes& classes, const MapRows& previous, const PreviousMatches& matches,
                  MapRows* rows) {
  const auto class_index = IndexClasses(classes);
  ClassId next = 0;
  for (const MapLandmark& landmark : previous.landmarks) next = std::max(next, landmark.class_id + 1);
  for (MapLandmark& landmark : rows->landmarks) {
    const int32_t before = matches.landmark_of_class[class_index.at(landmark.class_id)];
    landmark.class_id = before == kNotBefore ? next++ : previous.landmarks[before].class_id;
  }
}

}  // namespace cairn::emit_map
