#include "runtime/localize/place_evidence.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "core/base/quantiles.h"
#include "core/blocks/map_blocks.h"
#include "core/blocks/map_rows.h"
#include "core/promise/view_distance.h"
#include "runtime/localize/retrieve.h"

namespace cairn {
namespace {

constexpr int kNumNearViews = 8;

int CellOf(const Eigen::Vector2d& pixel, const Camera& camera, int num_cells) {
  const auto cell = [&](double coordinate, int size) {
    return std::clamp(static_cast<int>(coordinate * num_cells / size), 0, num_cells - 1);
  };
  return cell(pixel.y(), camera.height) * num_cells + cell(pixel.x(), camera.width);
}

// What an image should show from there, by the survey images near.
Result<PlaceEvidence> EvidenceOfImage(const Map& map, const Query& query, const Pose& cam_from_world,
                                      const std::vector<NearView>& near,
                                      const std::vector<LandmarkIdx>& found_idx, int num_cells) {
  PlaceEvidence evidence{.squared_distance = near.front().squared_distance};
  std::map<LandmarkIdx, double> seen;  // sum of the weights of the images that see it
  double sum = 0;
  for (const NearView& view : near) {
    const double weight = 1 / (1 + view.squared_distance);
    sum += weight;
    CAIRN_ASSIGN_OR_RETURN(const auto image, map.Image(view.image));
    for (const LandmarkIdx landmark : image->landmarks) seen[landmark] += weight;
  }
  std::vector<LandmarkIdx> idx;
  for (const auto& [landmark, weight] : seen) idx.push_back(landmark);
  CAIRN_ASSIGN_OR_RETURN(const auto expected, map.Gather(std::move(idx), false));
  std::set<int> cells_expected, cells_found;
  for (size_t k = 0; k < expected->idx.size(); ++k) {
    const MapLandmark& landmark = expected->landmarks[k];
    const Eigen::Vector3d point = cam_from_world * landmark.position;
    const auto pixel = ImageFromCamera(query.camera, point);
    if (!pixel || !IsInImage(*pixel, query.camera) ||
        !WasLookedFor(landmark, DepthOfScale(query.camera, point), query))
      continue;
    evidence.num_expected += seen.at(expected->idx[k]) / sum;
    const int cell = CellOf(*pixel, query.camera, num_cells);
    cells_expected.insert(cell);
    if (std::binary_search(found_idx.begin(), found_idx.end(), expected->idx[k])) cells_found.insert(cell);
  }
  evidence.num_cells_expected = static_cast<double>(cells_expected.size());
  evidence.num_cells_found = static_cast<double>(cells_found.size());
  return evidence;
}

}  // namespace

Result<PlaceEvidence> EvidenceOfPlace(const Map& map, const Sighting& sighting, const Pose& rig_from_world,
                                      const LandmarkSet& landmarks, const std::vector<Correspondence>& found,
                                      int num_matched, int num_cells) {
  PlaceEvidence evidence{.num_matched = num_matched};
  if (found.empty()) return evidence;
  std::vector<double> depths;
  std::vector<std::vector<LandmarkIdx>> found_idx(sighting.images.size());  // by each image
  for (const Correspondence& match : found) {
    const Query& query = sighting.images[match.image];
    const Eigen::Vector3d in_rig = rig_from_world * landmarks.Find(match.landmark).position;
    depths.push_back(DepthOfScale(query.camera, query.cam_from_rig * in_rig));
    found_idx[match.image].push_back(match.landmark);
  }
  const ViewOptions one_view;
  const double radius_m = one_view.same_view_ratio * UpperMedian(std::move(depths));
  std::vector<PlaceEvidence> of_images;
  for (int i = 0; i < sighting.num_images(); ++i) {
    const Query& query = sighting.images[i];
    const Pose cam_from_world = query.cam_from_rig * rig_from_world;
    CAIRN_ASSIGN_OR_RETURN(
        const std::vector<NearView> near,
        NearestViews(map, cam_from_world, radius_m, one_view.same_view_deg, kNumNearViews));
    std::sort(found_idx[i].begin(), found_idx[i].end());
    CAIRN_ASSIGN_OR_RETURN(PlaceEvidence of_image,
                           EvidenceOfImage(map, query, cam_from_world, near, found_idx[i], num_cells));
    of_images.push_back(of_image);
  }
  evidence.squared_distance = of_images.front().squared_distance;
  for (const PlaceEvidence& of_image : of_images)
    evidence.squared_distance = std::min(evidence.squared_distance, of_image.squared_distance);
  for (const PlaceEvidence& of_image : of_images) {
    const double weight = (1 + evidence.squared_distance) / (1 + of_image.squared_distance);
    evidence.num_expected += weight * of_image.num_expected;
    evidence.num_cells_expected += weight * of_image.num_cells_expected;
    evidence.num_cells_found += weight * of_image.num_cells_found;
  }
  return evidence;
}

double OddsOfPlace(const PlaceEvidence& evidence) {
  // Logistic regression on fixes of left-out images and on those in maps of other floors (bench/held_out).
  constexpr double kBias = 2.6, kFoundWeight = 3.4, kCellsWeight = 8;
  // Fewer are too few to miss.
  constexpr double kFewestExpected = 20, kFewestMatched = 0.5;
  // A copy of what is seen may stand where nobody surveyed, however much of it is found.
  constexpr double kMostOdds = 3000;
  const double found_ratio = std::max(kFewestMatched, static_cast<double>(evidence.num_matched)) /
                             std::max(kFewestExpected, evidence.num_expected);
  const double cells_ratio = evidence.num_cells_found / std::max(1.0, evidence.num_cells_expected);
  return std::min(std::exp(kBias + kFoundWeight * std::log(found_ratio) + kCellsWeight * cells_ratio),
                  kMostOdds / std::pow(1 + evidence.squared_distance, 1.5));
}

double ProbabilityAmong(double odds, double odds_of_others) { return odds / (1 + odds + odds_of_others); }

}  // namespace cairn
