#include "runtime/drive/sure_tracker.h"

#include <string>
#include <utility>
#include <vector>

#include "core/base/no_throw.h"
#include "runtime/localize/measurement.h"

namespace cairn {

OptionTable DescribeOptions(SureTrackerOptions* o) {
  OptionTable table = {
      {.name = "min_place_probability",
       .value = &o->min_place_probability,
       .help = "publish a fix only where its place has this probability by all frames so far; 0: every fix",
       .min = 0,
       .max = 1 - 1e-9},
      {"look_anew_s", &o->look_anew_s,
       "while it is sure, look at a frame without what is expected once in so many seconds", 0}};
  for (Option& option : DescribeOptions(&o->belief)) {
    option.name = "place_" + option.name;
    table.push_back(std::move(option));
  }
  std::vector<std::string> of_belief = NamesOf(table);
  std::erase(of_belief, "min_place_probability");
  AddCondition({"min_place_probability", {"not 0"}}, of_belief, &table);
  return table;
}

namespace {

// Errors: InvalidArgument (out of range, or changed and without effect).
Status CheckSureTracker(const SureTrackerOptions& options) {
  SureTrackerOptions checked = options, defaults;
  const OptionTable table = DescribeOptions(&checked), of_defaults = DescribeOptions(&defaults);
  CAIRN_RETURN_IF_ERROR(CheckOptions(table));
  for (size_t i = 0; i < table.size(); ++i) {
    if (OptionValueText(table[i]) != OptionValueText(of_defaults[i]))
      CAIRN_RETURN_IF_ERROR(CheckIsRead(table[i], table));
  }
  return Ok();
}

}  // namespace

Localization PublishIfSure(Localization found, double place_probability, double min_place_probability) {
  if (!found.has_fix()) return found;
  found.probability = place_probability;
  if (place_probability >= min_place_probability) return found;
  found.reason = NoFix::kImprobable;
  found.message = fmt::format("of all images so far its place has a probability of {:.3f}, {} is needed",
                              place_probability, min_place_probability);
  return found;
}

SureTracker::SureTracker(std::shared_ptr<const Map> map, const LocalizerOptions& localizer_options,
                         const RegionTrackerOptions& tracker_options, const SureTrackerOptions& options)
    : map_(std::move(map)),
      localizer_options_(localizer_options),
      tracker_options_(tracker_options),
      options_(options),
      localizer_(map_, localizer_options),
      tracker_(std::in_place, map_, localizer_options, tracker_options) {}

Result<SureTracker> SureTracker::Make(std::shared_ptr<const Map> map,
                                      const LocalizerOptions& localizer_options,
                                      const RegionTrackerOptions& tracker_options,
                                      const SureTrackerOptions& options) {
  return WithoutExceptions("sure tracker", [&]() -> Result<SureTracker> {
    CAIRN_RETURN_IF_ERROR(CheckSureTracker(options));
    if (options.min_place_probability > 0 && localizer_options.budget_ms > 0)
      return MakeError(ErrorCode::kUnsupported,
                       "budget_ms bounds the work of a fix, and a belief over places (min_place_probability) "
                       "takes more; leave one of them out");
    SureTracker tracker(map, localizer_options, tracker_options, options);
    if (options.min_place_probability > 0) {
      CAIRN_ASSIGN_OR_RETURN(tracker.belief_, PlaceBelief::Make(std::move(map), options.belief));
    }
    return tracker;
  });
}

Status SureTracker::CheckBelieves() const {
  if (belief_) return Ok();
  return MakeError(ErrorCode::kInvalidArgument,
                   "min_place_probability is 0: every fix is published, and nothing reads times; "
                   "set it, 0.9 say");
}

Status SureTracker::Move(const Eigen::Vector2d& way_m, double turn_left_rad) {
  CAIRN_RETURN_IF_ERROR(tracker_->Move(way_m, turn_left_rad));
  return belief_ ? belief_->Move(way_m, turn_left_rad) : Ok();
}

Status SureTracker::Move(const UncertainPose& next_from_last) {
  CAIRN_RETURN_IF_ERROR(tracker_->Move(next_from_last));
  if (!belief_ || !IsMetric(map_->head().frame)) return Ok();  // without a unit it follows links
  const FloorMotion over_floor = OverFloor(next_from_last.pose);
  return belief_->Move(over_floor.way_m, over_floor.turn_left_rad);
}

Status SureTracker::Elapse(double seconds) {
  CAIRN_RETURN_IF_ERROR(CheckBelieves());
  CAIRN_RETURN_IF_ERROR(belief_->Elapse(seconds));
  elapsed_s_ = elapsed_s_.value_or(0) + seconds;
  return Ok();
}

Status SureTracker::SenseUp(const Eigen::Vector3d& up_in_camera, double sigma_deg) {
  const SensedUp up{up_in_camera, sigma_deg};
  CAIRN_RETURN_IF_ERROR(CheckSensedUp(up));
  up_ = up;
  return Ok();
}

Result<Localization> SureTracker::Track(const cv::Mat& grey, const Camera& camera) {
  return WithoutExceptions("sure tracker", [&]() -> Result<Localization> {
    QueryFrame frame(localizer_, grey, camera);
    return TrackFrame(&frame);
  });
}

Result<Localization> SureTracker::TrackFeatures(Features features, const Camera& camera) {
  return WithoutExceptions("sure tracker", [&]() -> Result<Localization> {
    QueryFrame frame(localizer_, std::move(features), camera);
    return TrackFrame(&frame);
  });
}

Result<Localization> SureTracker::TrackFrame(QueryFrame* frame) {
  return WithoutExceptions("sure tracker", [&]() -> Result<Localization> {
    const std::optional<SensedUp> up = std::exchange(up_, std::nullopt);
    if (up) frame->set_up(*up);
    CAIRN_ASSIGN_OR_RETURN(Localization found, tracker_->TrackFrame(frame));
    if (!belief_) return found;
    if (elapsed_s_) {
      since_look_s_ += *std::exchange(elapsed_s_, std::nullopt);
    } else {  // as PlaceBelief has it
      since_look_s_ += 1;
      CAIRN_RETURN_IF_ERROR(belief_->Elapse(1));
    }
    const bool is_followed = found.has_fix() && found.scope == Scope::kTrack;
    if (!is_followed || sure_probability_ == 0 || since_look_s_ >= options_.look_anew_s) {
      if (up) CAIRN_RETURN_IF_ERROR(belief_->SenseUp(up->direction, up->sigma_deg));
      CAIRN_ASSIGN_OR_RETURN(const Query* query, frame->WithAllFeatures());
      CAIRN_ASSIGN_OR_RETURN(const Localization anew, LookAnew(*query, found));
      sure_probability_ = ProbabilityOf(found);
      const double elsewhere = ProbabilityOf(anew);
      if (is_followed && sure_probability_ < options_.min_place_probability &&
          elsewhere >= options_.min_place_probability) {  // it followed a look-alike
        tracker_.emplace(map_, localizer_options_, tracker_options_);
        CAIRN_ASSIGN_OR_RETURN(found, tracker_->TrackFrame(frame));
        sure_probability_ = ProbabilityOf(found);
      }
    }
    found = PublishIfSure(std::move(found), sure_probability_, options_.min_place_probability);
    if (!found.has_fix()) sure_probability_ = 0;
    return found;
  });
}

Result<Localization> SureTracker::LookAnew(const Query& query, const Localization& found) {
  Localization anew = found;
  if (found.scope == Scope::kTrack) {  // a prior from earlier frames would count them twice
    CAIRN_ASSIGN_OR_RETURN(anew, localizer_.LocalizeQuery(query, std::nullopt));
  }
  CAIRN_RETURN_IF_ERROR(belief_->See(query, anew));
  since_look_s_ = 0;
  return anew;
}

double SureTracker::ProbabilityOf(const Localization& found) const {
  return found.has_fix() ? belief_->ProbabilityAround(found.cam_from_world) : 0;
}

}  // namespace cairn
