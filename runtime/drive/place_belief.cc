#include "runtime/drive/place_belief.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "core/base/no_throw.h"
#include "core/blocks/map_rows.h"
#include "runtime/drive/place_graph.h"
#include "runtime/localize/localization.h"
#include "runtime/localize/measurement.h"
#include "runtime/localize/retrieve.h"
#include "runtime/map/map.h"
#include "runtime/track/camera_motion.h"

namespace cairn {
namespace {

// After so many links without an image the robot may be anywhere.
constexpr double kMaxNumLinks = 100;

// P(something of this probability in a second within so many).
double Within(double seconds, double probability) { return 1 - std::pow(1 - probability, seconds); }

}  // namespace

struct PlaceBelief::Evidence {
  std::vector<double> at_image;
  double elsewhere = 1;
  std::vector<PlaceGraph::Place> places;
};

OptionTable DescribeOptions(PlaceBeliefOptions* o) {
  constexpr double kTiny = 1e-9, kAlmostOne = 1 - 1e-9;
  return {
      {.name = "fix_ratio",
       .value = &o->fix_ratio,
       .help = "share of the images of the map's places that have a fix there",
       .min = kTiny,
       .max = 0.89},
      {.name = "wrong_fix_ratio",
       .value = &o->wrong_fix_ratio,
       .help = "share of the images of the map's places that have a fix at another place",
       .min = kTiny,
       .max = 0.009},
      {.name = "look_alike_fix_ratio",
       .value = &o->look_alike_fix_ratio,
       .help = "share of the images of places with look-alikes that have a fix at one of these",
       .min = kTiny,
       .max = 0.1},
      {.name = "foreign_fix_ratio",
       .value = &o->foreign_fix_ratio,
       .help = "share of the images of other places that have a fix",
       .min = kTiny,
       .max = kAlmostOne},
      {.name = "max_fix_odds",
       .value = &o->max_fix_odds,
       .help = "largest odds by which one fix counts as right",
       .min = 1},
      {.name = "misled_ratio",
       .value = &o->misled_ratio,
       .help = "share of the views whose evidence means nothing, whatever it says",
       .min = kTiny,
       .max = kAlmostOne},
      {.name = "least_new_ratio",
       .value = &o->least_new_ratio,
       .help = "least part by which an image counts that shows the same, for each second",
       .min = kTiny,
       .max = 1},
      {.name = "likeness_weight",
       .value = &o->likeness_weight,
       .help = "how much likelier an image without a fix is where the survey looks most like it, less 1",
       .min = 0},
      {.name = "elsewhere_ratio",
       .value = &o->elsewhere_ratio,
       .help = "at start, the probability of being where the map shows nothing",
       .min = kTiny,
       .max = kAlmostOne},
      {.name = "leave_ratio",
       .value = &o->leave_ratio,
       .help = "probability of leaving what the map shows, per second",
       .min = kTiny,
       .max = kAlmostOne},
      {.name = "return_ratio",
       .value = &o->return_ratio,
       .help = "probability of coming back to it, per second",
       .min = kTiny,
       .max = kAlmostOne},
      {.name = "kidnapped_ratio",
       .value = &o->kidnapped_ratio,
       .help = "probability of being carried to any other place, per second",
       .min = kTiny,
       .max = kAlmostOne},
      {.name = "reach_links",
       .value = &o->reach_links,
       .help = "most links between images of the same landmarks in a second, without odometry",
       .min = 1,
       .max = 100},
      {.name = "way_sigma_ratio",
       .value = &o->way_sigma_ratio,
       .help = "standard deviation of odometry's way, as part of it",
       .min = 0},
      {.name = "turn_sigma_ratio",
       .value = &o->turn_sigma_ratio,
       .help = "standard deviation of odometry's turn, as part of it",
       .min = 0},
      {.name = "way_sigma_m", .value = &o->way_sigma_m, .help = "and per view, m", .min = kTiny},
      {.name = "turn_sigma_deg", .value = &o->turn_sigma_deg, .help = "and per view, degrees", .min = kTiny},
      {.name = "map_up_sigma_deg",
       .value = &o->map_up_sigma_deg,
       .help = "standard deviation of the map's vertical, degrees",
       .min = kTiny,
       .max = 90},
  };
}

PlaceBelief::PlaceBelief(std::shared_ptr<const Map> map, std::shared_ptr<const PlaceGraph> graph,
                         const PlaceBeliefOptions& options)
    : map_(std::move(map)), graph_(std::move(graph)), options_(options) {
  const auto num = static_cast<size_t>(graph_->num_places());
  believed_ = {std::vector<double>(num, (1 - options.elsewhere_ratio) / static_cast<double>(num)),
               options.elsewhere_ratio};
  before_view_ = with_view_ = believed_;
}

Result<PlaceBelief> PlaceBelief::Make(std::shared_ptr<const Map> map, const PlaceBeliefOptions& options) {
  return WithoutExceptions("place belief", [&]() -> Result<PlaceBelief> {
    PlaceBeliefOptions checked = options;
    CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
    CAIRN_ASSIGN_OR_RETURN(PlaceGraph graph, PlaceGraph::Make(map));
    return PlaceBelief(std::move(map), std::make_shared<const PlaceGraph>(std::move(graph)), options);
  });
}

Status PlaceBelief::Move(const Eigen::Vector2d& way_m, double turn_left_rad) {
  return WithoutExceptions("place belief", [&]() -> Status {
    CAIRN_RETURN_IF_ERROR(CheckFloorMotion({way_m, turn_left_rad}, map_->head()));
    way_m_ += Eigen::Rotation2Dd(turn_left_rad_) * way_m;
    turn_left_rad_ += turn_left_rad;
    driven_views_ += graph_->ViewDistance(way_m, turn_left_rad);
    has_moved_ = true;
    return Ok();
  });
}

Status PlaceBelief::Elapse(double seconds) {
  if (!(seconds >= 0) || !std::isfinite(seconds))
    return MakeError(ErrorCode::kInvalidArgument, "{} seconds since the last image; expected 0 or more",
                     seconds);
  elapsed_s_ = elapsed_s_.value_or(0) + seconds;
  return Ok();
}

Status PlaceBelief::SenseUp(const Eigen::Vector3d& up_in_camera, double sigma_deg) {
  CAIRN_RETURN_IF_ERROR(CheckSensedUp({up_in_camera, sigma_deg}));
  up_ = Up{up_in_camera.normalized(), sigma_deg};
  return Ok();
}

Status PlaceBelief::Predict(double seconds) {
  if (!has_moved_) {
    const double num_links = std::min(kMaxNumLinks, options_.reach_links * seconds);
    for (Distribution* each : {&before_view_, &with_view_}) graph_->Spread(num_links, &each->at_image);
  } else if (graph_->ViewDistance(way_m_, 0) >= 1 ||
             graph_->ViewDistance(Eigen::Vector2d::Zero(), turn_left_rad_) >= 1) {
    // Shorter ways would be lost between the survey's images: they add up first.
    const double radius_m =
        std::hypot(graph_->radius(), options_.way_sigma_m, options_.way_sigma_ratio * way_m_.norm());
    const double radius_deg = std::hypot(graph_->radius_deg(), options_.turn_sigma_deg,
                                         options_.turn_sigma_ratio * DegFromRad(std::abs(turn_left_rad_)));
    CAIRN_RETURN_IF_ERROR(graph_->Drive(way_m_, turn_left_rad_, radius_m, radius_deg,
                                        {&before_view_.at_image, &with_view_.at_image}));
    way_m_.setZero();
    turn_left_rad_ = 0;
  }
  for (Distribution* each : {&before_view_, &with_view_}) LeaveAndReturn(seconds, each);
  return Ok();
}

void PlaceBelief::LeaveAndReturn(double seconds, Distribution* distribution) const {
  const double leaves = Within(seconds, options_.leave_ratio),
               returns = Within(seconds, options_.return_ratio),
               kidnapped = Within(seconds, options_.kidnapped_ratio);
  auto& [at_image, elsewhere] = *distribution;
  const double in_map = std::accumulate(at_image.begin(), at_image.end(), 0.0);
  const double stays = (1 - leaves) * (1 - kidnapped);
  const double arriving =
      ((1 - leaves) * kidnapped * in_map + returns * elsewhere) / static_cast<double>(at_image.size());
  for (double& p : at_image) p = stays * p + arriving;
  elsewhere = (1 - returns) * elsewhere + leaves * in_map;
}

Status PlaceBelief::See(const Query& query, const Localization& found) {
  return WithoutExceptions("place belief", [&]() -> Status {
    if (found.possible_probabilities.size() != found.possible_poses.size())
      return MakeError(ErrorCode::kInvalidArgument, "{} possible poses with {} probabilities",
                       found.possible_poses.size(), found.possible_probabilities.size());
    const double elapsed_s = std::exchange(elapsed_s_, std::nullopt).value_or(1);
    const auto up = std::exchange(up_, std::nullopt);
    const bool is_first = !std::exchange(has_seen_, true);
    const double seconds = is_first ? 1 : elapsed_s;  // all that the first shows is new
    if (is_first) {  // how it drove before is no way from one place to another
      way_m_.setZero();
      turn_left_rad_ = 0;
      has_moved_ = false;
    } else {
      CAIRN_RETURN_IF_ERROR(Predict(seconds));
    }
    // What shows nothing shows it wherever it is.
    if (found.reason != NoFix::kTooFewFeatures) {
      std::vector<Pose> poses =
          found.has_fix() ? std::vector<Pose>{found.cam_from_world} : found.possible_poses;
      for (Pose& pose : poses) pose = map_->head().camera_from_given * pose;
      if (poses.empty()) {
        CAIRN_ASSIGN_OR_RETURN(const Evidence evidence, OfLikeness(query));
        Weigh(evidence, NewRatio(seconds));
      } else {
        const std::vector<double> probabilities =
            found.has_fix() ? std::vector<double>{found.probability} : found.possible_probabilities;
        CAIRN_ASSIGN_OR_RETURN(const Evidence evidence, OfFix(poses, probabilities, up));
        Weigh(evidence, NewRatio(poses, seconds));
      }
      driven_views_ = 0;
    }
    has_moved_ = false;
    Publish();
    return Ok();
  });
}

Result<PlaceBelief::Evidence> PlaceBelief::OfFix(const std::vector<Pose>& poses,
                                                 const std::vector<double>& probabilities,
                                                 const std::optional<Up>& up) const {
  const auto num = static_cast<double>(believed_.at_image.size());
  const double of_none =
      std::max(1e-12, 1 - std::accumulate(probabilities.begin(), probabilities.end(), 0.0));
  const double best = *std::max_element(probabilities.begin(), probabilities.end());
  Evidence evidence;
  CAIRN_ASSIGN_OR_RETURN(evidence.places, graph_->PlacesAround(poses));
  double num_of_places = 0;
  for (const PlaceGraph::Place& place : evidence.places)
    num_of_places += static_cast<double>(place.images.size());
  // All in units of a fix with these odds elsewhere, which is at this place as often as at any other: the
  // odds are against being elsewhere.  So is a wrong one of another place of the map, which is as rare as
  // they say.
  const double by_chance = num_of_places / static_cast<double>(poses.size()) / num;
  evidence.elsewhere = by_chance;
  evidence.at_image.assign(believed_.at_image.size(),
                           options_.wrong_fix_ratio / options_.foreign_fix_ratio * by_chance);
  for (size_t k = 0; k < poses.size(); ++k) {
    // Within max_fix_odds of the best they are alike: which of them is somewhat likelier is the same for all
    // images of a corridor, by how each was surveyed, and would add up.
    const double alike = std::min(best, options_.max_fix_odds * probabilities[k]);
    const double odds = std::min(options_.max_fix_odds, alike / of_none);
    const double right = odds * UprightRatio(poses[k], up) / static_cast<double>(poses.size());
    const std::vector<int32_t>& around = evidence.places[k].images;
    for (const int32_t image : around) evidence.at_image[image] += right;
    // Of a look-alike it has the odds of a right one.
    std::vector<char> is_rival(evidence.at_image.size());
    for (const int32_t image : around) {
      for (const int32_t rival : graph_->LookAlikes(image)) is_rival[rival] = 1;
    }
    for (size_t i = 0; i < is_rival.size(); ++i) {
      if (is_rival[i] != 0)
        evidence.at_image[i] += options_.look_alike_fix_ratio / options_.fix_ratio * right;
    }
  }
  return evidence;
}

double PlaceBelief::UprightRatio(const Pose& cam_from_world, const std::optional<Up>& up) const {
  if (!up) return 1;
  const MapHead& head = map_->head();
  const Eigen::Vector3d sensed = head.camera_from_given.rotation * up->direction;
  const Eigen::Vector3d stated =
      cam_from_world.rotation * (head.floor_from_world.rotation.conjugate() * Eigen::Vector3d::UnitZ());
  const double angle_deg = DegFromRad(std::atan2(sensed.cross(stated).norm(), sensed.dot(stated)));
  const double sigmas = angle_deg / std::hypot(up->sigma_deg, options_.map_up_sigma_deg);
  return std::exp(-0.5 * sigmas * sigmas);
}

Result<PlaceBelief::Evidence> PlaceBelief::OfLikeness(const Query& query) const {
  RetrieveOptions all;
  all.max_num_candidates = static_cast<int>(believed_.at_image.size());
  all.min_score_ratio = 0;
  CAIRN_ASSIGN_OR_RETURN(const auto candidates, RetrieveByWords(*map_, query, all));
  Evidence evidence{.at_image = std::vector<double>(believed_.at_image.size(), 1.0),
                    .elsewhere = 1 - options_.foreign_fix_ratio};
  for (const Candidate& candidate : candidates) {
    // [Mariottini11 §IV] as ProbabilitiesOfScores
    evidence.at_image[candidate.image] +=
        options_.likeness_weight * std::pow(candidate.score / candidates.front().score, 4);
  }
  const double mean = std::accumulate(evidence.at_image.begin(), evidence.at_image.end(), 0.0) /
                      static_cast<double>(evidence.at_image.size());
  const double no_fix = 1 - options_.fix_ratio - options_.wrong_fix_ratio;
  for (double& value : evidence.at_image) value *= no_fix / mean;
  return evidence;
}

double PlaceBelief::NewRatio(const std::vector<Pose>& poses, double seconds) {
  // Of the same places in another order nothing is new.
  double distance = last_poses_.empty() ? 1 : std::numeric_limits<double>::infinity();
  for (const Pose& last : last_poses_) {
    for (const Pose& pose : poses) distance = std::min(distance, graph_->ViewDistance(pose, last));
  }
  const double is_new = distance - counted_views_;
  // Fixes around one place differ by their errors: only how far they are from it in all counts.
  counted_views_ = std::max(counted_views_, distance);
  if (distance >= 1) {
    last_poses_ = poses;
    counted_views_ = 0;
  }
  return std::clamp(is_new, std::min(1.0, options_.least_new_ratio * seconds), 1.0);
}

double PlaceBelief::NewRatio(double seconds) const {
  if (!has_moved_) return std::min(1.0, seconds);
  return std::clamp(driven_views_, std::min(1.0, options_.least_new_ratio * seconds), 1.0);
}

void PlaceBelief::Weigh(const Evidence& evidence, double new_ratio) {
  constexpr double kWhole = 1 + 1e-9;  // twenty twentieths are one view
  if (view_ratio_ + new_ratio > kWhole) {
    Publish();
    before_view_ = with_view_ = believed_;
    view_ratio_ = 0;
  }
  view_ratio_ += new_ratio;
  auto& [at_image, elsewhere] = with_view_;
  elsewhere *= std::pow(evidence.elsewhere, new_ratio);
  double sum = elsewhere;
  for (size_t i = 0; i < at_image.size(); ++i) {
    at_image[i] *= std::pow(evidence.at_image[i], new_ratio);
    sum += at_image[i];
  }
  elsewhere /= sum;
  for (double& p : at_image) p /= sum;
  // How probable a place is does not depend on how densely it was surveyed: where in it a fix is comes after.
  for (const PlaceGraph::Place& place : evidence.places) {
    double of_place = 0;
    for (const int32_t image : place.images) of_place += std::exchange(at_image[image], 0);
    for (const auto& [image, share] : place.nearest) at_image[image] += share * of_place;
  }
}

void PlaceBelief::Publish() {
  const auto mix = [&](double before, double with) {
    return options_.misled_ratio * before + (1 - options_.misled_ratio) * with;
  };
  believed_.elsewhere = mix(before_view_.elsewhere, with_view_.elsewhere);
  for (size_t i = 0; i < believed_.at_image.size(); ++i)
    believed_.at_image[i] = mix(before_view_.at_image[i], with_view_.at_image[i]);
}

Result<std::vector<PlaceHypothesis>> PlaceBelief::Hypotheses(int max_num) const {
  std::vector<double> left = believed_.at_image;
  std::vector<int32_t> order(left.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int32_t a, int32_t b) { return left[a] > left[b]; });
  std::vector<PlaceHypothesis> hypotheses;
  for (const int32_t image : order) {
    if (static_cast<int>(hypotheses.size()) >= max_num) break;
    // Of a place the image whose surroundings are likeliest, so that neighbours of alike probability are one.
    if (left[image] <= 0) continue;
    PlaceHypothesis hypothesis{.image = image, .probability = std::exchange(left[image], 0)};
    for (const int32_t neighbour : graph_->SamePlace(image))
      hypothesis.probability += std::exchange(left[neighbour], 0);
    CAIRN_ASSIGN_OR_RETURN(const auto row, map_->Image(image));
    hypothesis.image_id = row->image_id;
    hypothesis.name = row->name;
    hypotheses.push_back(std::move(hypothesis));
  }
  std::stable_sort(hypotheses.begin(), hypotheses.end(),
                   [](const auto& a, const auto& b) { return a.probability > b.probability; });
  return hypotheses;
}

double PlaceBelief::ProbabilityAround(const Pose& cam_from_world) const {
  double sum = 0;
  for (const int32_t image : graph_->ImagesNear(map_->head().camera_from_given * cam_from_world))
    sum += believed_.at_image[image];
  return sum;
}

int32_t PlaceBelief::NextTellingImage(int32_t from) const { return graph_->NextTellingImage(from); }

const std::vector<int32_t>& PlaceBelief::Neighbours(int32_t image) const { return graph_->Neighbours(image); }

}  // namespace cairn
