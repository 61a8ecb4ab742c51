#include "runtime/localize/place_evidence.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <utility>

#include "core/base/pooled.h"
#include "core/base/quantiles.h"
#include "core/blocks/map_blocks.h"
#include "core/blocks/map_rows.h"
#include "core/promise/view_distance.h"
#include "core/work/work_budget.h"
#include "runtime/localize/retrieve.h"
#include "runtime/map/landmark_set.h"

namespace cairn {
namespace {

constexpr int kNumNearViews = 8;

int CellOf(const Eigen::Vector2d& pixel, const Camera& camera, int num_cells) {
  const auto cell = [&](double coordinate, int size) {
    return std::clamp(static_cast<int>(coordinate * num_cells / size), 0, num_cells - 1);
  };
  return cell(pixel.y(), camera.height) * num_cells + cell(pixel.x(), camera.width);
}

double WeightOf(const NearView& view) { return 1 / (1 + view.squared_distance); }

// What an image should show from there, by the survey images near.
Result<PlaceEvidence> EvidenceOfImage(const Map& map, const Query& query, const Pose& cam_from_world,
                                      std::span<const NearView> near, std::span<const LandmarkIdx> found_idx,
                                      int num_cells) {
  PlaceEvidence evidence{.squared_distance = near.front().squared_distance};
  PooledVector<std::shared_ptr<const MapImage>> images;
  PooledVector<LandmarkIdx> idx;
  double sum = 0;
  for (const NearView& view : near) {
    sum += WeightOf(view);
    CAIRN_ASSIGN_OR_RETURN(const auto image, map.Image(view.image));
    idx.insert(idx.end(), image->landmarks.begin(), image->landmarks.end());
    images.push_back(image);
  }
  SortUnique(&idx);
  WorkBudget* const work = query.work.get();
  if (!Spend(work, Work::kLandmark, idx.size()) || !Spend(work, Work::kProject, idx.size())) return evidence;
  PooledVector<double> weights(idx.size(), 0);  // sums over the images that see it
  for (size_t i = 0; i < images.size(); ++i) {
    size_t k = 0;
    for (const LandmarkIdx landmark : images[i]->landmarks) {  // ascending
      while (idx[k] < landmark) ++k;
      weights[k] += WeightOf(near[i]);
    }
  }
  CAIRN_ASSIGN_OR_RETURN(const auto expected, map.Gather(idx, false));
  PooledVector<char> cells_expected(static_cast<size_t>(num_cells) * num_cells), cells_found = cells_expected;
  for (size_t k = 0; k < expected->idx.size(); ++k) {
    const MapLandmark& landmark = expected->landmarks[k];
    const Eigen::Vector3d point = cam_from_world * landmark.position;
    const auto pixel = ImageFromCamera(query.camera, point);
    if (!pixel || !IsInImage(*pixel, query.camera) ||
        !WasLookedFor(landmark, DepthOfScale(query.camera, point), query))
      continue;
    evidence.num_expected += weights[k] / sum;
    const int cell = CellOf(*pixel, query.camera, num_cells);
    cells_expected[cell] = 1;
    if (std::binary_search(found_idx.begin(), found_idx.end(), expected->idx[k])) cells_found[cell] = 1;
  }
  evidence.num_cells_expected = static_cast<double>(std::ranges::count(cells_expected, 1));
  evidence.num_cells_found = static_cast<double>(std::ranges::count(cells_found, 1));
  return evidence;
}

}  // namespace

Result<PlaceEvidence> EvidenceOfPlace(const Map& map, const Sighting& sighting, const Pose& rig_from_world,
                                      const LandmarkSet& landmarks, std::span<const Correspondence> found,
                                      int num_matched, int num_cells) {
  PlaceEvidence evidence{.num_matched = num_matched};
  if (found.empty()) return evidence;
  PooledVector<double> depths;
  depths.reserve(found.size());
  PooledVector<PooledVector<LandmarkIdx>> found_idx(sighting.images.size());  // by each image
  for (const Correspondence& match : found) {
    const Query& query = sighting.images[match.image];
    const Eigen::Vector3d in_rig = rig_from_world * landmarks.Find(match.landmark).position;
    depths.push_back(DepthOfScale(query.camera, query.cam_from_rig * in_rig));
    found_idx[match.image].push_back(match.landmark);
  }
  const ViewOptions one_view;
  const double radius_m = one_view.same_view_ratio * UpperMedian(std::move(depths));
  PooledVector<PlaceEvidence> of_images;
  for (int i = 0; i < sighting.num_images(); ++i) {
    const Query& query = sighting.images[i];
    const Pose cam_from_world = query.cam_from_rig * rig_from_world;
    CAIRN_ASSIGN_OR_RETURN(
        const PooledVector<NearView> near,
        NearestViews(map, cam_from_world, radius_m, one_view.same_view_deg, kNumNearViews, query.work.get()));
    if (near.empty()) return evidence;  // no work is left
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
