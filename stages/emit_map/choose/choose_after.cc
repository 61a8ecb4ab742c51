#include "stages/emit_map/choose/choose_after.h"

#include <algorithm>
#include <iterator>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "core/base/quantiles.h"
#include "core/blocks/node_poses.h"
#include "core/capture/sessions.h"
#include "core/promise/promise_nodes.h"

namespace cairn::emit_map {
namespace {

// A place keeps this part of the matches that it expected, as far as a robot needs them to be localized for
// certain: less, and more landmarks come in.
constexpr double kKeptRatio = 0.9;
// What was enough for the promise is, while it is this part of what is enough now: how probable matches are
// is learnt anew from a survey with a few more images.
constexpr double kMetRatio = 0.97;
constexpr double kMostlyNewRatio = 0.2;
// A region grows by this factor before all are divided anew.
constexpr double kMaxGrowth = 1.5;

// Per node of the survey the nearest one of the earlier map's promise, as far as that reaches.
std::vector<int32_t> NodesBefore(const std::vector<PromiseNode>& nodes, const MapRows& previous, bool any) {
  const MapPromise& promise = *previous.findings.promise;
  const std::vector<Pose> poses = NodePoses(previous);
  std::vector<int32_t> before;
  for (const PromiseNode& node : nodes) {
    const std::optional<NearestNode> nearest = FindNearestNode(promise, poses, node.cam_from_world);
    const bool reaches = nearest && (any || nearest->squared_distance <= kNodeReach * kNodeReach);
    before.push_back(reaches ? static_cast<int32_t>(nearest->node) : kNotBefore);
  }
  return before;
}

// Nearly as many matches as there were, where the earlier map looked from about there, and what the promise
// takes as far as that is known; else as many as in half of its places.
std::vector<NodeDemand> DemandsAfter(const std::vector<PromiseNode>& nodes, const MapRows& previous) {
  const MapPromise& promise = *previous.findings.promise;
  if (!(promise.model.match_ratio > 0) || promise.nodes.empty()) return {};
  std::vector<double> expected;
  for (const NodePromise& node : promise.nodes)
    expected.push_back(node.num_matches / promise.model.match_ratio);
  const double elsewhere = Median(expected);
  std::vector<NodeDemand> demands;
  for (const int32_t before : NodesBefore(nodes, previous, /*any=*/false)) {
    const bool is_new = before == kNotBefore;
    demands.push_back({.least_matches = std::min(LandmarkOrderOptions().enough_matches,
                                                 kKeptRatio * (is_new ? elsewhere : expected[before])),
                       .needed_ratio = is_new ? 1 : kMetRatio});
  }
  return demands;
}

// The earlier map's regions with what was added, and what nodes lack that others of the map show.
class RegionsAfter {
 public:
  RegionsAfter(const MapRows& previous, const PreviousMatches& matches, const std::vector<char>& keep,
               size_t max_landmarks)
      : previous_(previous), matches_(matches), keep_(keep), max_landmarks_(max_landmarks) {}

  std::optional<PromiseRegions> Divide(const std::vector<PromiseNode>& nodes, const CoverProblem& problem,
                                       int64_t cover_bound) const {
    const MapPromise& promise = *previous_.findings.promise;
    std::vector<PromiseRegion> regions(previous_.regions.size());
    const std::vector<int32_t> before = NodesBefore(nodes, previous_, /*any=*/true);
    std::vector<RegionIdx> region_of_node;
    for (size_t node = 0; node < nodes.size(); ++node) {
      if (before[node] == kNotBefore) return std::nullopt;
      region_of_node.push_back(promise.nodes[before[node]].region);
      regions[region_of_node.back()].nodes.push_back(static_cast<int32_t>(node));
    }
    KeepLandmarks(&regions);
    AddNew(*problem.of_class, region_of_node, &regions);
    MeetDemands(problem, &regions);
    PromiseRegions result;
    size_t most =
        std::max(max_landmarks_, static_cast<size_t>(kMaxGrowth * static_cast<double>(max_landmarks_)));
    for (const MapRegion& region : previous_.regions) most = std::max(most, region.landmarks.size());
    for (PromiseRegion& region : regions) {
      // A region that no node is left of goes, and one that grew out of bounds changes all.
      if (region.classes.size() > most) return std::nullopt;
      if (!region.nodes.empty()) result.regions.push_back(std::move(region));
    }
    const auto num = static_cast<int64_t>(most);
    result.lower_bound = static_cast<int>(std::max<int64_t>(1, (cover_bound + num - 1) / num));
    return result;
  }

 private:
  void KeepLandmarks(std::vector<PromiseRegion>* regions) const {
    std::vector<size_t> class_of_landmark(previous_.landmarks.size(), keep_.size());
    for (size_t i = 0; i < keep_.size(); ++i) {
      if (keep_[i] != 0 && matches_.landmark_of_class[i] != kNotBefore)
        class_of_landmark[matches_.landmark_of_class[i]] = i;
    }
    for (size_t r = 0; r < previous_.regions.size(); ++r) {
      for (const LandmarkIdx landmark : previous_.regions[r].landmarks) {
        if (class_of_landmark[landmark] < keep_.size())
          (*regions)[r].classes.push_back(class_of_landmark[landmark]);
      }
    }
  }

  void AddNew(const std::vector<std::vector<ExpectedMatch>>& of_class,
              const std::vector<RegionIdx>& region_of_node, std::vector<PromiseRegion>* regions) const {
    for (size_t i = 0; i < keep_.size(); ++i) {
      if (keep_[i] == 0 || matches_.landmark_of_class[i] != kNotBefore) continue;
      for (const ExpectedMatch& match : of_class[i]) {
        std::vector<size_t>& classes = (*regions)[region_of_node[match.view]].classes;
        if (classes.empty() || classes.back() != i) classes.push_back(i);
      }
    }
    for (PromiseRegion& region : *regions) std::sort(region.classes.begin(), region.classes.end());
  }

  // Where a region's landmarks are too few for one of its nodes, the fewest others of the map that it takes.
  void MeetDemands(const CoverProblem& problem, std::vector<PromiseRegion>* regions) const {
    ClassesOfNodes of_node(problem.demands.size());
    for (size_t i = 0; i < keep_.size(); ++i) {
      if (keep_[i] == 0) continue;
      for (const ExpectedMatch& match : (*problem.of_class)[i])
        of_node[match.view].push_back({static_cast<uint32_t>(i), match.probability});
    }
    std::vector<double> demands = problem.demands;
    for (double& demand : demands) demand *= kMetRatio;
    for (PromiseRegion& region : *regions) {
      const std::vector<size_t> cover = CoverNodes(of_node, demands, region.nodes, region.classes);
      std::vector<size_t> all;
      std::set_union(region.classes.begin(), region.classes.end(), cover.begin(), cover.end(),
                     std::back_inserter(all));
      region.classes = std::move(all);
    }
  }

  const MapRows& previous_;
  const PreviousMatches& matches_;
  const std::vector<char>& keep_;
  size_t max_landmarks_;
};

}  // namespace

bool IsMostlyNew(const Classes& classes, const MapRows& previous) {
  const std::set<std::string> before(previous.sessions.begin(), previous.sessions.end());
  const auto is_new = [&](const SurveyImage& image) {
    const int session = SessionOfImage(classes.sessions, image.name);
    // Where it had no names for them, the earlier map is of the first.
    return before.empty() ? session > 0 : session >= 0 && !before.contains(classes.sessions[session]);
  };
  const auto num_new =
      static_cast<double>(std::count_if(classes.images.begin(), classes.images.end(), is_new));
  return num_new > kMostlyNewRatio * (num_new + static_cast<double>(previous.images.size()));
}

std::vector<size_t> StillThere(const std::vector<char>& may_keep, const PreviousMatches& matches) {
  std::vector<size_t> there;
  for (size_t i = 0; i < may_keep.size(); ++i) {
    if (may_keep[i] != 0 && matches.landmark_of_class[i] != kNotBefore) there.push_back(i);
  }
  std::sort(there.begin(), there.end(),
            [&](size_t a, size_t b) { return matches.landmark_of_class[a] < matches.landmark_of_class[b]; });
  return there;
}

ChosenAfter ChooseAfter(const Classes& classes, const std::vector<char>& may_keep, const MapRows& previous,
                        const PreviousMatches& matches, const PromiseOptions& options, int num_threads) {
  const PromiseMaker maker(classes, MatchModel(classes, {}, num_threads), num_threads);
  const PromiseBasis basis{previous.findings.promise->model, previous.findings.promise->left_out};
  ChosenAfter chosen;
  chosen.keep = maker.Complete(StillThere(may_keep, matches), basis.model, options,
                               DemandsAfter(maker.nodes(), previous));
  const RegionsAfter regions(previous, matches, chosen.keep, options.max_region_landmarks);
  chosen.promises =
      maker.Promise(chosen.keep, basis, options,
                    [&](const std::vector<PromiseNode>& nodes, const CoverProblem& problem,
                        int64_t cover_bound) { return regions.Divide(nodes, problem, cover_bound); });
  return chosen;
}

}  // namespace cairn::emit_map
