#include "stages/decompose_regions/choose_features.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <queue>
#include <utility>
#include <vector>

#include "core/base/pooled.h"
#include "core/features/descriptor_distance.h"
#include "core/features/descriptor_matcher.h"
#include "stages/decompose_regions/cover/reduced_world.h"
#include "stages/decompose_regions/observed_sights.h"

namespace cairn::decompose_regions {
namespace {

// The stations that a region still has: those that see all features taken so far.
class ShrinkingRegion {
 public:
  // `required`: the stations that it must hold, connected.
  ShrinkingRegion(std::vector<StationIdx> stations, std::vector<StationIdx> required, double min_kept_ratio,
                  ComponentFinder* finder)
      : stations_(std::move(stations)),
        required_(std::move(required)),
        min_num_stations_(
            static_cast<size_t>(std::ceil(min_kept_ratio * static_cast<double>(stations_.size())))),
        finder_(*finder) {}

  // Shrinks to the stations that see a feature; returns false and changes nothing where too few
  // would be left.
  bool Take(const std::vector<StationIdx>& area) {
    std::vector<StationIdx> seen;
    std::set_intersection(stations_.begin(), stations_.end(), area.begin(), area.end(),
                          std::back_inserter(seen));
    if (seen.size() == stations_.size()) return true;
    for (std::vector<StationIdx>& component : finder_.Components(seen)) {
      if (component.size() < min_num_stations_) continue;
      if (!std::includes(component.begin(), component.end(), required_.begin(), required_.end())) continue;
      stations_ = std::move(component);
      return true;
    }
    return false;
  }
  const std::vector<StationIdx>& stations() const { return stations_; }
  const std::vector<StationIdx>& required() const { return required_; }

 private:
  std::vector<StationIdx> stations_;
  std::vector<StationIdx> required_;
  size_t min_num_stations_;
  ComponentFinder& finder_;
};

// A feature that a region could have.
struct Candidate {
  FeatureIdx feature = 0;
  std::vector<SightInformation> sights;
};

class Chooser {
 public:
  Chooser(const World& world, const Classes& classes, const ChooseFeaturesOptions& options)
      : world_(world),
        classes_(classes),
        options_(options),
        sets_(VisibilitySets(world)),
        is_landmark_(world.num_features(), 0),
        information_(classes.images.size(), options.rough_sigma_m, options.rough_sigma_deg) {}

  // As many features as the region has, those that add most first.
  Result<std::vector<FeatureIdx>> Choose(size_t num_features, ShrinkingRegion* region) {
    CAIRN_ASSIGN_OR_RETURN(const std::vector<Candidate> candidates, CandidatesOf(region->required()));
    // The gain of a candidate never grows: of outdated values the largest is updated first.  Ties: the
    // smaller feature.
    std::priority_queue<std::pair<double, int>> gains;
    for (int i = 0; i < std::ssize(candidates); ++i) gains.emplace(Gain(candidates[i]), -i);
    std::vector<FeatureIdx> features;
    while (features.size() < num_features && !gains.empty()) {
      const Candidate& candidate = candidates[-gains.top().second];
      const std::pair<double, int> gain(Gain(candidate), gains.top().second);
      gains.pop();
      if (!gains.empty() && gain < gains.top()) {
        gains.push(gain);
        continue;
      }
      if (!region->Take(world_.areas[candidate.feature])) continue;
      features.push_back(candidate.feature);
      if (!is_landmark_[candidate.feature]) information_.Add(candidate.sights);
      is_landmark_[candidate.feature] = true;
    }
    std::sort(features.begin(), features.end());
    return features;
  }

 private:
  double Gain(const Candidate& candidate) const {
    return is_landmark_[candidate.feature] ? 0 : information_.DeterminantGain(candidate.sights);
  }

  // The features that all of these stations see, ascending.
  std::vector<FeatureIdx> CommonFeatures(const std::vector<StationIdx>& stations) const {
    const auto fewest = std::min_element(stations.begin(), stations.end(), [&](StationIdx a, StationIdx b) {
      return sets_[a].size() < sets_[b].size();
    });
    std::vector<FeatureIdx> common;
    for (const FeatureIdx feature : sets_[*fewest]) {
      const std::vector<StationIdx>& area = world_.areas[feature];
      if (std::includes(area.begin(), area.end(), stations.begin(), stations.end())) {
        common.push_back(feature);
      }
    }
    return common;
  }

  Result<const FeatureClass*> ClassOf(FeatureIdx feature) const {
    const ClassId class_id = world_.class_ids[feature];
    const auto found = std::lower_bound(
        classes_.classes.begin(), classes_.classes.end(), class_id,
        [](const FeatureClass& feature_class, ClassId id) { return feature_class.class_id < id; });
    if (found == classes_.classes.end() || found->class_id != class_id) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "feature {} of the world is class {}, which the classes lack; was the world made from "
                       "other classes?",
                       feature, class_id);
    }
    return &*found;
  }

  Result<std::vector<Candidate>> CandidatesOf(const std::vector<StationIdx>& stations) const {
    const std::vector<FeatureIdx> common = CommonFeatures(stations);
    std::vector<const FeatureClass*> feature_classes;
    const DescriptorSpace space = classes_.descriptor_kind.space();
    DescriptorMatrix descriptors(static_cast<Eigen::Index>(common.size()), space.num_values);
    for (const FeatureIdx feature : common) {
      CAIRN_ASSIGN_OR_RETURN(const FeatureClass* feature_class, ClassOf(feature));
      descriptors.row(static_cast<Eigen::Index>(feature_classes.size())) = feature_class->descriptor;
      feature_classes.push_back(feature_class);
    }
    // The best of a descriptor among all is itself, or its equal.
    PooledVector<BestTwo> nearest, columns;
    FindBestTwo(descriptors, descriptors, space, FastestKernel(), &nearest, &columns);
    std::vector<Candidate> candidates;
    for (size_t i = 0; i < common.size(); ++i) {
      const double angle = DescriptorAngleRad(nearest[i].second, space);
      const double distinctiveness =
          angle * angle / (angle * angle + options_.confusion_angle_rad * options_.confusion_angle_rad);
      CAIRN_ASSIGN_OR_RETURN(std::vector<SightInformation> sights,
                             ObservedSights(*feature_classes[i], distinctiveness, classes_, options_));
      candidates.push_back({common[i], std::move(sights)});
    }
    return candidates;
  }

  const World& world_;
  const Classes& classes_;
  const ChooseFeaturesOptions& options_;
  const std::vector<std::vector<FeatureIdx>> sets_;
  std::vector<char> is_landmark_;  // per feature: some region has it
  PoseInformation information_;
};

}  // namespace

OptionTable DescribeOptions(ChooseFeaturesOptions* o) {
  OptionTable table = {
      {.name = "feature_choice",
       .value = &o->feature_choice,
       .help = "features that a region keeps: pose (the possible ones that determine a camera's pose best) "
               "or cover (those that the algorithm found)",
       .choices = {"pose", "cover"}},
      {.name = "min_kept_ratio",
       .value = &o->min_kept_ratio,
       .help =
           "feature choice: smallest part of its stations that a region keeps when it takes better features",
       .min = 0,
       .max = 1},
      {.name = "keypoint_sigma_px",
       .value = &o->keypoint_sigma_px,
       .help = "feature choice: standard deviation of a small keypoint's position, px",
       .min = 1e-3,
       .max = 1e3},
      {.name = "keypoint_sigma_per_scale",
       .value = &o->keypoint_sigma_per_scale,
       .help = "feature choice: growth of that standard deviation with the keypoint's scale",
       .min = 0,
       .max = 1e3},
      {.name = "confusion_angle_rad",
       .value = &o->confusion_angle_rad,
       .help = "feature choice: angle to the nearest other descriptor at which half of the matches survive",
       .min = 1e-3,
       .max = 10},
      {.name = "rough_sigma_m",
       .value = &o->rough_sigma_m,
       .help = "feature choice: standard deviation of a camera's place without landmarks, m",
       .min = 1e-3,
       .max = 1e6},
      {.name = "rough_sigma_deg",
       .value = &o->rough_sigma_deg,
       .help = "feature choice: standard deviation of its rotation without landmarks, degrees",
       .min = 1e-2,
       .max = 1e3},
  };
  AddCondition({"feature_choice", {"pose"}},
               {"min_kept_ratio", "keypoint_sigma_px", "keypoint_sigma_per_scale", "confusion_angle_rad",
                "rough_sigma_m", "rough_sigma_deg"},
               &table);
  return table;
}

Result<Decomposition> ChooseFeatures(const World& world, const Classes& classes,
                                     const Decomposition& decomposition,
                                     const ChooseFeaturesOptions& options) {
  ChooseFeaturesOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  if (options.feature_choice == "cover") return decomposition;
  if (world.class_ids.empty() && world.num_features() > 0) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "the world does not name the classes of its features, as filter-visibility's worlds do");
  }
  const IndexLists neighbours = NeighbourLists(world);
  ComponentFinder finder(neighbours);
  // Per station, how many regions hold its neighbourhood.
  std::vector<int> num_regions(world.num_stations(), 0);
  const auto count = [&](const Region& region, int change) {
    for (const StationIdx station : ShrinkStations(neighbours, region.stations, decomposition.tau))
      num_regions[station] += change;
  };
  for (const Region& region : decomposition.regions) count(region, 1);

  Chooser chooser(world, classes, options);
  Decomposition chosen = decomposition;
  for (Region& region : chosen.regions) {
    std::vector<StationIdx> required = region.stations;
    if (options.min_kept_ratio < 1) {
      required = ShrinkStations(neighbours, region.stations, decomposition.tau);
      std::erase_if(required, [&](StationIdx station) { return num_regions[station] > 1; });
      required = GrowStations(neighbours, std::move(required), decomposition.tau);
    }
    count(region, -1);
    // A region that no station needs is redundant, and stays as it is.
    if (required.empty()) required = region.stations;
    ShrinkingRegion shrinking(region.stations, std::move(required), options.min_kept_ratio, &finder);
    CAIRN_ASSIGN_OR_RETURN(region.features, chooser.Choose(region.features.size(), &shrinking));
    region.stations = shrinking.stations();
    count(region, 1);
  }
  return chosen;
}

}  // namespace cairn::decompose_regions
