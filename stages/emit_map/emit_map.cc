#include "stages/emit_map/emit_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <tuple>

#include "core/blocks/map_documents.h"
#include "core/camera/pixel_ray.h"
#include "core/features/transform_code.h"
#include "core/promise/view_distance.h"
#include "stages/emit_map/images_of_map.h"
#include "stages/emit_map/map_vocabulary.h"
#include "stages/emit_map/previous/keep_roles.h"
#include "stages/emit_map/previous/settle_rows.h"
#include "stages/emit_map/quantize_descriptors.h"

namespace cairn::emit_map {
namespace {

constexpr RegionIdx kNoRegion = std::numeric_limits<RegionIdx>::max();

// Per region, the classes (positions in `classes.classes`) that it keeps.
Result<std::vector<std::vector<size_t>>> ClassesOfRegions(const Classes& classes, const World& world,
                                                          const Decomposition& decomposition) {
  const auto class_index = IndexClasses(classes);
  std::vector<std::vector<size_t>> classes_of_regions(decomposition.regions.size());
  for (size_t region = 0; region < decomposition.regions.size(); ++region) {
    for (const FeatureIdx feature : decomposition.regions[region].features) {
      if (feature < 0 || feature >= static_cast<FeatureIdx>(world.class_ids.size())) {
        return MakeError(
            ErrorCode::kInvalidArgument,
            "emit_map: region {} keeps feature {}, but the world knows the classes of {} features; were the "
            "regions made from another world?",
            region, feature, world.class_ids.size());
      }
      const auto found = class_index.find(world.class_ids[feature]);
      if (found == class_index.end()) {
        return MakeError(ErrorCode::kInvalidArgument,
                         "emit_map: feature {} of the world is class {}, which the classes lack; was the "
                         "world made from other classes?",
                         feature, world.class_ids[feature]);
      }
      classes_of_regions[region].push_back(found->second);
    }
    for (const StationIdx station : decomposition.regions[region].stations) {
      if (station < 0 || station >= world.num_stations()) {
        return MakeError(ErrorCode::kInvalidArgument, "emit_map: region {} has station {} of {}", region,
                         station, world.num_stations());
      }
    }
  }
  return classes_of_regions;
}

// Per region, the classes that `keep` marks and that can be seen from all of its stations.
std::vector<std::vector<size_t>> CommonClasses(const Classes& classes, const World& world,
                                               const Decomposition& decomposition,
                                               const std::vector<char>& keep) {
  const auto class_index = IndexClasses(classes);
  const std::vector<std::vector<FeatureIdx>> seen_from = VisibilitySets(world);
  std::vector<std::vector<size_t>> common(decomposition.regions.size());
  for (size_t region = 0; region < decomposition.regions.size(); ++region) {
    const std::vector<StationIdx>& stations = decomposition.regions[region].stations;
    if (stations.empty()) continue;
    for (const FeatureIdx feature : seen_from[stations[0]]) {
      const auto found = class_index.find(world.class_ids[feature]);
      if (found == class_index.end() || keep[found->second] == 0) continue;
      const std::vector<StationIdx>& area = world.areas[feature];
      if (std::includes(area.begin(), area.end(), stations.begin(), stations.end()))
        common[region].push_back(found->second);
    }
  }
  return common;
}

// Per class, whether a map without a limit keeps it.
std::vector<char> MarkKept(size_t num_classes, const std::vector<std::vector<size_t>>& classes_of_regions,
                           const EmitMapOptions& options) {
  std::vector<char> kept(num_classes, options.landmarks == "regions" ? 0 : 1);
  for (const std::vector<size_t>& of_region : classes_of_regions) {
    for (const size_t i : of_region) kept[i] = 1;
  }
  return kept;
}

// The classes that `keep` marks in the order in which the map stores them.
std::vector<size_t> StoredOrder(const Classes& classes,
                                const std::vector<std::vector<size_t>>& classes_of_regions,
                                const std::vector<char>& keep) {
  std::vector<RegionIdx> first_region(classes.classes.size(), kNoRegion);
  for (size_t region = 0; region < classes_of_regions.size(); ++region) {
    for (const size_t i : classes_of_regions[region]) {
      first_region[i] = std::min(first_region[i], static_cast<RegionIdx>(region));
    }
  }
  std::vector<size_t> order;
  for (size_t i = 0; i < classes.classes.size(); ++i) {
    if (keep[i] != 0) order.push_back(i);
  }
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    const auto key = [&](size_t i) {
      const FeatureClass& feature_class = classes.classes[i];
      return std::tuple(first_region[i],
                        feature_class.observations.empty() ? 0u : feature_class.observations[0].image_id,
                        feature_class.class_id);
    };
    return key(a) < key(b);
  });
  return order;
}

// Mean size of the feature in space: keypoint scale times depth over focal length.
double MeanScaleM(const FeatureClass& feature_class, const std::map<ImageId, const SurveyImage*>& images,
                  const std::map<CameraId, const Camera*>& cameras) {
  double sum = 0;
  int count = 0;
  for (const Observation& observation : feature_class.observations) {
    const auto image = images.find(observation.image_id);
    if (image == images.end()) continue;
    const auto camera = cameras.find(image->second->camera_id);
    if (camera == cameras.end()) continue;
    const double depth =
        DepthOfScale(*camera->second, image->second->cam_from_world * feature_class.position);
    if (depth <= 0) continue;
    sum += static_cast<double>(observation.keypoint.scale) * depth / camera->second->MeanFocal();
    ++count;
  }
  return count > 0 ? sum / count : 0;
}

// A listed image sees what it saw, and what those whose views it shows saw.
Status AddLandmarks(const Classes& classes, const std::vector<size_t>& order,
                    const ImagesOfMap& images_of_map, MapRows* rows) {
  std::map<ImageId, const SurveyImage*> images;
  std::map<CameraId, const Camera*> cameras;
  std::map<ImageId, size_t> image_index;
  for (const SurveyImage& image : classes.images) {
    image_index[image.image_id] = images.size();
    images[image.image_id] = &image;
  }
  for (const int32_t i : images_of_map.listed) {
    const SurveyImage& image = classes.images[i];
    rows->images.push_back({.image_id = image.image_id,
                            .name = image.name,
                            .camera_id = image.camera_id,
                            .cam_from_world = image.cam_from_world});
  }
  for (const Camera& camera : classes.cameras) cameras[camera.camera_id] = &camera;

  rows->descriptors.resize(static_cast<Eigen::Index>(order.size()), classes.descriptor_kind.num_values);
  for (size_t landmark_idx = 0; landmark_idx < order.size(); ++landmark_idx) {
    const FeatureClass& feature_class = classes.classes[order[landmark_idx]];
    rows->landmarks.push_back({.class_id = feature_class.class_id,
                               .position = feature_class.position,
                               .covariance = feature_class.covariance,
                               .scale_m = MeanScaleM(feature_class, images, cameras),
                               .num_observations = static_cast<int>(feature_class.observations.size())});
    rows->descriptors.row(landmark_idx) = feature_class.descriptor;
    for (const Observation& observation : feature_class.observations) {
      const auto image = image_index.find(observation.image_id);
      if (image == image_index.end()) {
        return MakeError(ErrorCode::kInvalidArgument,
                         "emit_map: class {} is seen in image {}, which has no pose", feature_class.class_id,
                         observation.image_id);
      }
      MapImage& row = rows->images[images_of_map.row_of_image[image->second]];
      if (!images_of_map.Lists(image->second) &&
          !IsInView(*cameras.at(row.camera_id), row.cam_from_world, feature_class.position))
        continue;
      const auto landmark = static_cast<LandmarkIdx>(landmark_idx);
      if (row.landmarks.empty() || row.landmarks.back() != landmark) row.landmarks.push_back(landmark);
    }
  }
  return Ok();
}

Status AddStations(const World& world, const std::vector<StationIdx>& uncovered, const Classes& classes,
                   MapRows* rows) {
  for (StationIdx i = 0; i < world.num_stations(); ++i) {
    MapStation station{.position = world.positions[i]};
    if (!world.headings_deg.empty()) station.heading_deg = world.headings_deg[i];
    rows->stations.push_back(station);
  }
  for (const StationIdx station : uncovered) {
    if (station < 0 || station >= world.num_stations()) {
      return MakeError(ErrorCode::kInvalidArgument, "emit_map: uncovered station {} of {}", station,
                       world.num_stations());
    }
    rows->stations[station].is_covered = false;
  }
  rows->station_edges = world.edges;
  for (size_t station = 0; station < world.station_images.size(); ++station) {
    for (const ImageId image_id : world.station_images[station]) {
      if (PositionOf(classes.images, image_id) < 0) {
        return MakeError(ErrorCode::kInvalidArgument,
                         "emit_map: station {} has image {}, which the classes lack", station, image_id);
      }
      const int32_t image = PositionOf(rows->images, image_id);
      if (image >= 0) rows->images[image].station = static_cast<StationIdx>(station);
    }
  }
  return Ok();
}

// The stations at which these images of the survey were taken, or those that show their views, ascending.
std::vector<StationIdx> StationsOf(const std::vector<size_t>& images, const ImagesOfMap& images_of_map,
                                   const MapRows& rows) {
  std::set<StationIdx> stations;
  for (const size_t image : images) {
    const StationIdx station = rows.images[images_of_map.row_of_image[image]].station;
    if (station >= 0) stations.insert(station);
  }
  return {stations.begin(), stations.end()};
}

// Nodes with images of the map, and those of their links that have a kept one at an end.
void AddAppearance(const Appearance& appearance, MapRows* rows) {
  std::map<ImageId, int32_t> image_index;
  for (size_t i = 0; i < rows->images.size(); ++i)
    image_index[rows->images[i].image_id] = static_cast<int32_t>(i);
  std::vector<int32_t> row_of_node;
  for (const AppearanceNode& node : appearance.nodes) {
    MapAppearanceNode row{.is_kept = node.role != NodeRole::kDropped, .entropy = node.entropy};
    for (const ImageId image_id : node.images) {
      const auto found = image_index.find(image_id);
      if (found != image_index.end()) row.images.push_back(found->second);
    }
    row_of_node.push_back(row.images.empty() ? -1 : static_cast<int32_t>(rows->appearance.size()));
    if (!row.images.empty()) rows->appearance.push_back(std::move(row));
  }
  for (const AppearanceLink& link : appearance.graph.Links()) {
    const int32_t row1 = row_of_node[link.node1], row2 = row_of_node[link.node2];
    if (row1 < 0 || row2 < 0 || !(rows->appearance[row1].is_kept || rows->appearance[row2].is_kept)) continue;
    rows->appearance[row1].links.push_back({row2, link.num_inliers});
  }
  for (const ConfusablePair& pair : appearance.confusable) {
    const int32_t row1 = row_of_node[pair.node1], row2 = row_of_node[pair.node2];
    if (row1 >= 0 && row2 >= 0) rows->appearance[row1].look_alikes.push_back({row2, pair.score});
  }
}

// Whether descriptors are stored by the levels of a transform's coefficients.
bool StoresTransform(const EmitMapOptions& options) {
  if (options.descriptor_bits > kMostTransformBits) return false;
  return options.descriptor_code == "transform" ||
         (options.descriptor_code == "auto" && (options.landmarks == "fewest" || options.max_bytes > 0));
}

// The mean of the entropies of the images at each region's stations.
void AddRegionEntropies(MapRows* rows) {
  std::vector<std::vector<double>> at_station(rows->stations.size());
  for (const MapAppearanceNode& node : rows->appearance) {
    if (!node.entropy) return;
    for (const int32_t image : node.images) {
      if (rows->images[image].station >= 0) at_station[rows->images[image].station].push_back(*node.entropy);
    }
  }
  for (size_t region = 0; region < rows->regions.size(); ++region) {
    double sum = 0;
    int num_images = 0;
    for (const StationIdx station : rows->regions[region].stations) {
      for (const double entropy : at_station[station]) sum += entropy;
      num_images += static_cast<int>(at_station[station].size());
    }
    if (num_images > 0)
      rows->findings.region_entropies.push_back({static_cast<RegionIdx>(region), sum / num_images});
  }
}

}  // namespace

Result<MapRows> EmitMap(const Classes& classes, const World& world, const Decomposition& decomposition,
                        const Vocabulary& vocabulary, const EmitMapOptions& options,
                        const Appearance* appearance, const std::vector<char>* keep, const Promises* promises,
                        const PreviousMap* previous) {
  EmitMapOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  if (options.words == "survey" && options.documents == "kept") {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "emit_map: words = \"survey\" with documents = \"kept\"; one of them must be the default");
  }
  if (options.landmarks == "fewest" && keep == nullptr) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "emit_map: landmarks = \"fewest\", but it is not said which these are");
  }
  CAIRN_ASSIGN_OR_RETURN(auto classes_of_regions, ClassesOfRegions(classes, world, decomposition));
  std::vector<char> kept = MarkKept(classes.classes.size(), classes_of_regions, options);
  if (keep != nullptr) {
    kept = *keep;
    classes_of_regions = CommonClasses(classes, world, decomposition, kept);
  }
  if (promises != nullptr) {
    classes_of_regions.clear();
    for (const Promises::Region& region : promises->regions) classes_of_regions.push_back(region.classes);
  }
  const std::vector<size_t> order = StoredOrder(classes, classes_of_regions, kept);
  if (order.empty()) {
    return MakeError(
        ErrorCode::kNoData,
        "emit_map: no landmark: {} regions keep none of {} classes; a smaller k or landmarks = \"all\" keeps "
        "more",
        decomposition.regions.size(), classes.classes.size());
  }
  MapRows rows;
  rows.landmark_choice = options.landmarks;
  if (promises != nullptr) {
    rows.algorithm = kPromiseAlgorithm;
    rows.lower_bound = promises->regions_lower_bound;
    rows.findings.promise = promises->findings;
  } else {
    rows.algorithm = decomposition.algorithm;
    rows.k = decomposition.k;
    rows.tau = decomposition.tau;
    rows.rho = decomposition.rho;
    rows.lower_bound = decomposition.lower_bound;
    rows.uncovered_limit = decomposition.uncovered_limit;
  }
  rows.floor_from_world = world.floor_from_world;
  rows.camera_from_given = classes.camera_from_given;
  rows.stated_pose_sigma_m = classes.stated_pose_sigma_m;
  rows.stated_pose_sigma_deg = classes.stated_pose_sigma_deg;
  rows.keypoint_correlation = classes.keypoint_correlation;
  rows.cameras = classes.cameras;
  rows.stated_cameras = classes.stated_cameras;
  // The visual map's sights are of all images.
  const ImagesOfMap images_of_map = ChooseImages(classes, /*all_images=*/options.visual_map);
  CAIRN_RETURN_IF_ERROR(AddLandmarks(classes, order, images_of_map, &rows));
  CAIRN_RETURN_IF_ERROR(AddStations(
      world, promises != nullptr ? std::vector<StationIdx>() : decomposition.uncovered, classes, &rows));
  if (rows.findings.promise) {
    for (NodePromise& node : rows.findings.promise->nodes) {
      for (int32_t* image : {&node.image, &node.other_image}) *image = images_of_map.row_of_image[*image];
    }
  }
  if (appearance) {
    Appearance listed =
        images_of_map.ListsAll() ? *appearance : OfListedImages(*appearance, classes, images_of_map);
    if (previous != nullptr) KeepRoles(WereKept(listed, classes, previous->rows, previous->matches), &listed);
    AddAppearance(listed, &rows);
  }
  rows.documents = options.documents;
  const std::vector<char> is_document = DocumentImages(rows);
  if (std::count(is_document.begin(), is_document.end(), 1) == 0) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "emit_map: documents = \"kept\", but {}; give --appearance the file that link-appearance "
        "wrote for these images, or choose documents = \"all\"",
        appearance ? "no image is kept" : "no appearance graph is given");
  }

  std::vector<LandmarkIdx> landmark_of_class(classes.classes.size(), -1);
  for (size_t i = 0; i < order.size(); ++i) landmark_of_class[order[i]] = static_cast<LandmarkIdx>(i);
  for (size_t region = 0; region < classes_of_regions.size(); ++region) {
    MapRegion row{.stations = promises != nullptr
                                  ? StationsOf(promises->regions[region].images, images_of_map, rows)
                                  : decomposition.regions[region].stations};
    for (const size_t i : classes_of_regions[region]) row.landmarks.push_back(landmark_of_class[i]);
    std::sort(row.landmarks.begin(), row.landmarks.end());
    // Two features of a world may be parts of one class.
    row.landmarks.erase(std::unique(row.landmarks.begin(), row.landmarks.end()), row.landmarks.end());
    rows.regions.push_back(std::move(row));
  }
  rows.descriptor_kind = classes.descriptor_kind;
  const bool stores_transform = classes.descriptor_kind.is_sift() && StoresTransform(options);
  if (previous != nullptr && stores_transform == previous->rows.descriptor_code.has_value())
    SettleRows(classes, previous->rows, previous->matches, &rows);
  if (classes.descriptor_kind.type == DescriptorType::kBinary) {
    RoundToBits(classes.descriptor_kind, &rows.descriptors);
  } else if (!stores_transform) {
    QuantizeDescriptorValues(options.descriptor_bits, &rows.descriptors);
  } else if (!rows.descriptor_code) {  // where there is one, it is the earlier map's
    rows.descriptor_code = QuantizeByTransform(TransformStep(options.descriptor_bits), &rows.descriptors);
  }
  AddRegionEntropies(&rows);
  const auto num_landmarks = static_cast<double>(rows.landmarks.size());
  if (options.words == "survey") {
    rows.vocabulary = SurveyVocabulary(vocabulary, rows.images, is_document);
  } else if (num_landmarks >= options.min_num_landmarks_for_words && !vocabulary.nodes.empty()) {
    rows.vocabulary =
        CutVocabulary(vocabulary, rows.descriptors, rows.images, is_document,
                      std::max(options.landmarks_per_word, num_landmarks / options.max_num_words));
  }
  CAIRN_RETURN_IF_ERROR(CheckMapRows(rows));
  return rows;
}

Result<std::vector<char>> KeptClasses(const Classes& classes, const World& world,
                                      const Decomposition& decomposition, const EmitMapOptions& options) {
  CAIRN_ASSIGN_OR_RETURN(const auto classes_of_regions, ClassesOfRegions(classes, world, decomposition));
  return MarkKept(classes.classes.size(), classes_of_regions, options);
}

void AddChanges(const Classes& classes, MapRows* rows) {
  const auto index_of = [&](ImageId image_id) {
    return image_id == 0 ? -1 : PositionOf(rows->images, image_id);
  };
  const auto rounded = [](double value) { return std::round(1000 * value) / 1000; };
  std::vector<int32_t> row_of_change;  // -1: it has none
  for (const PlaceChange& change : classes.changes) {
    row_of_change.push_back(-1);
    const auto session =
        std::find(rows->sessions.begin(), rows->sessions.end(), classes.sessions[change.session]);
    if (session == rows->sessions.end()) continue;
    if (!((change.position.array().abs() <= kMaxChangeExtentM).all() && change.radius_m <= kMaxChangeExtentM))
      continue;
    row_of_change.back() = static_cast<int32_t>(rows->findings.changes.size());
    rows->findings.changes.push_back({.session = static_cast<int>(session - rows->sessions.begin()),
                                      .position = change.position.unaryExpr(rounded),
                                      .radius_m = rounded(change.radius_m),
                                      .num_vanished = change.num_vanished,
                                      .num_appeared = change.num_appeared,
                                      .image_before = index_of(change.image_before),
                                      .image_after = index_of(change.image_after)});
  }
  for (size_t i = 0; i < classes.changes.size(); ++i) {
    const PlaceChange& change = classes.changes[i];
    if (row_of_change[i] < 0 || change.moved_to < 0 || row_of_change[change.moved_to] < 0) continue;
    MapChange& row = rows->findings.changes[row_of_change[i]];
    row.moved_to = row_of_change[change.moved_to];
    row.num_moved = change.num_moved;
  }
}

Status AddViews(Views views, bool regions, MapRows* rows) {
  if (!IsMetric(rows->frame)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "map '{}' has no scale (unit = {}), and floor plans are in metres; give the scale to "
                     "[reconstruct] (distances, control_points), or take floor_plan out of the recipe",
                     rows->name, rows->frame.unit);
  }
  if (!regions) {
    Views walls;
    walls.plan = std::move(views.plan);
    views = std::move(walls);
  }
  NumberVerticesByUse(&views);
  rows->views = std::move(views);
  return Ok();
}

}  // namespace cairn::emit_map
