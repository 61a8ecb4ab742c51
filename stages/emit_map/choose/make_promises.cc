#include "stages/emit_map/choose/make_promises.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <utility>

#include "core/base/parallel.h"
#include "core/promise/expectation.h"
#include "core/promise/later_views.h"
#include "core/promise/promise_cover.h"
#include "core/promise/promise_regions.h"

namespace cairn::emit_map {
namespace {

// Where all classes are too few for the promise, this part of what they give is kept: the rest are many that
// hardly any robot matches.
constexpr double kReachableRatio = 0.9;

// The bound is then within a fiftieth of the best that the dual can prove.
constexpr int kBoundIterations = 150;

std::vector<PromiseOutcome> Outcomes(const std::vector<PromiseTrial>& fared, const PromiseModel& model,
                                     const PromiseTerms& terms) {
  std::vector<PromiseOutcome> outcomes;
  for (const PromiseTrial& trial : fared)
    outcomes.push_back(
        {model.Probability(trial.expected, terms), trial.is_right && trial.num_matches >= terms.min_matches});
  return outcomes;
}

}  // namespace

LandmarkOrder OrderOf(const Classes& classes, const MatchModel& model, std::vector<size_t> pool,
                      std::vector<size_t> first, int num_threads) {
  LandmarkOrderOptions options;
  options.first = std::move(first);
  return {classes, model.OfViews(num_threads), std::move(pool), options, num_threads};
}

PromiseMaker::PromiseMaker(const Classes& classes, const MatchModel& model, int num_threads)
    : classes_(classes),
      num_threads_(num_threads),
      distance_(model.distance()),
      sights_(classes, {}),
      nodes_(PromiseNodes(classes, distance_, ImagesOfToday(LaterViews(classes, distance_)))),
      of_class_(classes.classes.size()) {
  std::unordered_map<CameraId, const Camera*> cameras;
  for (const Camera& camera : classes.cameras) cameras[camera.camera_id] = &camera;
  std::vector<MatchModel::Look> looks;
  for (const PromiseNode& node : nodes_) {
    looks.push_back({cameras.at(classes.images[node.image].camera_id), node.cam_from_world,
                     model.evidence().SessionOf(node.image)});
  }
  of_node_ = model.At(looks, MatchModel::Where::kNearby, num_threads);
  std::vector<size_t> num_of_class(of_class_.size(), 0);
  for (const std::vector<ClassMatch>& matches : of_node_) {
    for (const ClassMatch& match : matches) ++num_of_class[match.i];
  }
  for (size_t i = 0; i < of_class_.size(); ++i) of_class_[i].reserve(num_of_class[i]);
  for (size_t node = 0; node < nodes_.size(); ++node) {
    for (const ClassMatch& match : of_node_[node])
      of_class_[match.i].push_back({static_cast<int32_t>(node), match.probability});
  }
}

PromiseBasis PromiseMaker::BasisOf(const std::vector<PromiseTrial>& fared, const PromiseOptions& options) {
  const PromiseModel model = FitPromiseModel(fared);
  return {model, CalibrationCurve(Outcomes(fared, model, options.terms))};
}

std::vector<char> PromiseMaker::Complete(const std::vector<size_t>& first, const PromiseModel& model,
                                         const PromiseOptions& options,
                                         const std::vector<NodeDemand>& demands) const {
  CoverProblem problem{.of_class = &of_class_};
  problem.demands = Demands(of_class_, nodes_.size(), model.NeededMatches(options.terms), kReachableRatio);
  for (size_t node = 0; node < demands.size(); ++node) {
    double all = 0;
    for (const ClassMatch& match : of_node_[node]) all += match.probability;
    problem.demands[node] = std::max(demands[node].needed_ratio * problem.demands[node],
                                     std::min(demands[node].least_matches, kReachableRatio * all));
  }
  std::vector<size_t> taken = first;
  std::sort(taken.begin(), taken.end());
  std::vector<char> keep(classes_.classes.size(), 0);
  for (const size_t i : CoverFast(problem, taken)) keep[i] = 1;
  return keep;
}

Promises PromiseMaker::Promise(const std::vector<char>& keep, const PromiseBasis& basis,
                               const PromiseOptions& options, const DivideLike& divide) const {
  const PromiseModel& model = basis.model;
  Promises promises;
  promises.findings = {.terms = options.terms,
                       .model = model,
                       .radius_m = distance_.radius(),
                       .radius_deg = distance_.radius_deg(),
                       .left_out = basis.left_out};
  const std::vector<char> all(keep.size(), 1);
  promises.findings.nodes.resize(nodes_.size());
  ParallelFor(static_cast<int64_t>(nodes_.size()), num_threads_, [&](int64_t node) {
    const double focal = sights_.FocalOf(classes_.images[nodes_[node].image].image_id);
    const auto expect = [&](const std::vector<char>& these) {
      return ExpectationOf(sights_, of_node_[node], these, nodes_[node].cam_from_world, focal,
                           distance_.depth());
    };
    const Expectation expected = expect(keep), most = expect(all);
    promises.findings.nodes[node] = {.image = nodes_[node].image,
                                     .other_image = nodes_[node].other_image,
                                     .probability = model.Probability(expected, options.terms),
                                     .num_matches = model.match_ratio * expected.num_matches,
                                     .sigma_m = model.error_ratio * expected.sigma_m,
                                     .most_probable = model.Probability(most, options.terms)};
  });

  // The bound is of the promise: the map has more landmarks where exactness asks for them.
  CoverProblem problem{.of_class = &of_class_};
  problem.demands = Demands(of_class_, nodes_.size(), model.NeededMatches(options.terms), kReachableRatio);
  const auto bound_of = [&](const CoverProblem& cover) {
    return CoverBest(cover, {.num_iterations = kBoundIterations, .num_threads = num_threads_}).lower_bound;
  };
  promises.findings.landmarks_lower_bound = bound_of(problem);
  // A map of few bytes may lack what its nodes demand: its regions have what it has.
  std::vector<double> kept(nodes_.size(), 0);
  for (size_t i = 0; i < keep.size(); ++i) {
    if (keep[i] == 0) continue;
    for (const ExpectedMatch& match : of_class_[i]) kept[match.view] += match.probability;
  }
  bool is_lacking = false;
  for (size_t node = 0; node < nodes_.size(); ++node) {
    if (kept[node] >= problem.demands[node]) continue;
    problem.demands[node] = kReachableRatio * kept[node];
    is_lacking = true;
  }
  const int64_t cover_bound = is_lacking ? bound_of(problem) : promises.findings.landmarks_lower_bound;
  std::optional<PromiseRegions> likewise;
  if (divide) likewise = divide(nodes_, problem, cover_bound);
  const PromiseRegions divided = likewise
                                     ? *std::move(likewise)
                                     : DivideNodes(nodes_, distance_.radius(), distance_.radius_deg(),
                                                   problem, keep, options.max_region_landmarks, cover_bound);
  promises.regions_lower_bound = divided.lower_bound;
  for (const PromiseRegion& region : divided.regions) {
    for (const int32_t node : region.nodes)
      promises.findings.nodes[node].region = static_cast<RegionIdx>(promises.regions.size());
    promises.regions.push_back({.images = {}, .classes = region.classes});
  }
  const ViewTree tree = TreeOf(nodes_, distance_.radius(), distance_.radius_deg());
  for (size_t image = 0; image < classes_.images.size(); ++image) {
    const int32_t nearest = tree.Nearest(classes_.images[image].cam_from_world, 1).front();
    promises.regions[promises.findings.nodes[nearest].region].images.push_back(image);
  }
  for (const NodePromise& node : promises.findings.nodes) {
    for (const int32_t image : {node.image, node.other_image})
      promises.regions[node.region].images.push_back(static_cast<size_t>(image));
  }
  for (Promises::Region& region : promises.regions) {
    std::sort(region.images.begin(), region.images.end());
    region.images.erase(std::unique(region.images.begin(), region.images.end()), region.images.end());
  }
  return promises;
}

}  // namespace cairn::emit_map
