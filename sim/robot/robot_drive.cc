#include "sim/robot/robot_drive.h"

#include <algorithm>
#include <cmath>

#include "core/geometry/pose.h"
#include "core/vocabulary/document_scores.h"
#include "runtime/map/appearance_map.h"
#include "sim/survey/drive_way.h"

namespace cairn::sim {
namespace {

class Driver {
 public:
  Driver(const Map& map, const PlaceModel& model, Robot robot, int32_t goal_image,
         const std::optional<Kidnapping>& kidnapping, const RobotDriveOptions& options)
      : map_(map), model_(model), robot_(std::move(robot)), kidnapping_(kidnapping), options_(options) {
    drive_.goal_image = goal_image;
    drive_.start = robot_.pose();
    goal_node_ = model.appearance().node_of_image[goal_image];
  }

  // Errors are those of the map's file; what happens to the robot is part of the drive.
  Result<RobotDrive> Run() {
    CAIRN_ASSIGN_OR_RETURN(const RobotTarget goal, RobotTargetOf(map_, drive_.goal_image));
    drive_.goal = goal.pose;
    if (Status status = LookAnew("start"); !status.ok()) {
      drive_.error = status.error();
    } else if (status = FollowWays(goal); !status.ok()) {
      if (status.error().code == ErrorCode::kCorrupt || status.error().code == ErrorCode::kIo)
        return status.error();
      drive_.error = status.error();
    }
    drive_.goal_error_m = (robot_.pose().position - goal.pose.position).norm();
    drive_.goal_error_deg =
        std::abs(DegFromRad(WrapAngle(robot_.pose().heading_rad - goal.pose.heading_rad)));
    return std::move(drive_);
  }

 private:
  Status FollowWays(const RobotTarget& goal) {
    while (num_legs_ < options_.max_num_legs) {
      if (way_.LeadsToGoal()) {
        DriveLeg& leg = Go("go", goal, goal_node_, true);
        if (leg.arrived) return Ok();
        CAIRN_RETURN_IF_ERROR(Relocalize(leg.why));
        continue;
      }
      const NodeIdx node = way_.nodes()[way_.next()];
      CAIRN_ASSIGN_OR_RETURN(const RobotTarget target, TargetOfNode(node));
      DriveLeg& leg = Go("go", target, node, false);
      if (!leg.arrived) {
        CAIRN_RETURN_IF_ERROR(GiveUp(&leg));
        continue;
      }
      way_.Arrive();
      const Features seen = robot_.Look();
      trail_.push_back({TargetOfFeatures(seen), robot_.pose()});
      const HypothesisVerdict verdict = hypotheses_->Observe(model_.Look(seen.descriptors));
      leg.verdict = VerdictName(verdict);
      Note(&leg);
      if (verdict == HypothesisVerdict::kLost) CAIRN_RETURN_IF_ERROR(Relocalize("an image of elsewhere"));
      if (verdict == HypothesisVerdict::kSwitch) CAIRN_RETURN_IF_ERROR(Switch());
    }
    return MakeError(ErrorCode::kLost, "drive: not at the goal after {} images", num_legs_);
  }

  // Its current place becomes its start.
  Status LookAnew(const char* kind) {
    robot_.PutAt(robot_.pose());
    const Features seen = robot_.Look();
    DriveLeg leg;
    leg.kind = kind;
    leg.pose = leg.target = robot_.pose();
    drive_.legs.push_back(leg);
    if (seen.keypoints.empty()) {
      return MakeError(ErrorCode::kNoData,
                       "drive: an image without features at {:.2f}, {:.2f}; turn the camera to something "
                       "with more texture",
                       robot_.pose().position.x(), robot_.pose().position.y());
    }
    PlaceScores scores = model_.Look(seen.descriptors);
    CAIRN_RETURN_IF_ERROR(KeepSeen(seen, &scores));
    CAIRN_ASSIGN_OR_RETURN(hypotheses_,
                           StartHypotheses::Make(model_, scores, goal_node_, options_.hypotheses));
    trail_ = {{TargetOfFeatures(seen), robot_.pose()}};
    Note(&drive_.legs.back());
    return TakeWay(hypotheses_->hypotheses()[hypotheses_->followed()].path, seen);
  }

  // Replaces scores by numbers of matches over the largest one, and by 0 for places whose images do not show
  // what the robot sees; keeps the scores if no image does.
  Status KeepSeen(const Features& seen, PlaceScores* scores) {
    if (options_.min_start_inliers == 0) return Ok();
    std::vector<NodeIdx> order = BestFirst(scores->scores);
    if (static_cast<int>(order.size()) > options_.max_num_start_checks)
      order.resize(options_.max_num_start_checks);
    std::vector<double> kept(scores->scores.size(), 0);
    double most = 0;
    for (const NodeIdx node : order) {
      CAIRN_ASSIGN_OR_RETURN(const RobotTarget target, TargetOfNode(node));
      const int num_agreeing = robot_.NumAgreeing(seen, target.target);
      if (num_agreeing < options_.min_start_inliers) continue;
      kept[node] = num_agreeing;
      most = std::max(most, kept[node]);
    }
    if (most == 0) return Ok();
    for (double& score : kept) score /= most;
    scores->scores = std::move(kept);
    return Ok();
  }

  // Whether the robot sees what the image at `index` of the way shows; past the last index: the goal's image.
  Result<bool> SeesNode(const Features& seen, size_t index) const {
    if (options_.min_start_inliers == 0) return false;
    CAIRN_ASSIGN_OR_RETURN(const RobotTarget target, index < way_.nodes().size()
                                                         ? TargetOfNode(way_.nodes()[index])
                                                         : RobotTargetOf(map_, drive_.goal_image));
    return robot_.NumAgreeing(seen, target.target) >= options_.min_start_inliers;
  }

  Result<RobotTarget> TargetOfNode(NodeIdx node) const {
    return RobotTargetOf(map_, model_.appearance().node_images[node].front());
  }

  Status Relocalize(const std::string& why) {
    if (drive_.num_relocalizations == options_.max_num_relocalizations) {
      return MakeError(ErrorCode::kLost, "drive: lost for the {}th time at {:.2f}, {:.2f}: {}",
                       drive_.num_relocalizations + 1, robot_.pose().position.x(), robot_.pose().position.y(),
                       why);
    }
    ++drive_.num_relocalizations;
    return LookAnew("relocalize");
  }

  // An image of the way is not where it should be if the followed start were right: another start is tried,
  // as long as there is one.  An image that was seen but not reached is where it should be, so it is no
  // evidence against the start; it is skipped where the robot sees what the next one shows, but never two in
  // a row: the robot may be off its way.
  Status GiveUp(DriveLeg* leg) {
    if (leg->seen) {
      Note(leg);
      unreached_ = leg->node;
      bool is_dispensable = false;
      if (way_.MayLeaveOut()) {
        CAIRN_ASSIGN_OR_RETURN(is_dispensable, SeesNode(robot_.Look(), way_.next() + 1));
      }
      if (!is_dispensable) return Relocalize(leg->why);
      way_.LeaveOut();
      return Ok();
    }
    const bool has_other = options_.hypotheses.switching && hypotheses_->Refute();
    leg->verdict = VerdictName(has_other ? HypothesisVerdict::kSwitch : HypothesisVerdict::kLost);
    const std::string why = leg->why;
    Note(leg);
    if (!has_other) return Relocalize(why);
    trail_.push_back({});  // of this place, from which it goes back
    return Switch();
  }

  // Goes back to the start over its own images, or on from where it would be by now.
  Status Switch() {
    ++drive_.num_switches;
    const int followed = hypotheses_->followed();
    if (options_.hypotheses.on_switch == "replan") {
      const std::optional<NodePath> path = hypotheses_->Replan(followed);
      if (!path) return Relocalize("no way from where the robot would be");
      return TakeWay(*path, robot_.Look());
    }
    // [Mariottini11 §VI] "the images stored up to T to servo back to the initial image"
    for (size_t i = trail_.size() - 1; i-- > 0;) {
      const DriveLeg& leg = Go("retrace", trail_[i], -1, false);
      if (!leg.arrived) return Relocalize(leg.why);
    }
    trail_.resize(1);
    hypotheses_->Restart();
    return TakeWay(hypotheses_->hypotheses()[followed].path, robot_.Look());
  }

  // Begins at the first image, unless what the second one shows is seen from here; skips the image that it
  // could not reach before, where what comes after that is seen.
  Status TakeWay(const NodePath& path, const Features& seen) {
    std::vector<NodeIdx> nodes = path.nodes;
    if (nodes.size() > 1) nodes.pop_back();  // the goal's image itself comes last
    way_ = DriveWay(std::move(nodes));
    way_.BeginAt(std::min<size_t>(1, path.nodes.size()));
    if (path.nodes.size() < 2 || options_.min_start_inliers == 0) return Ok();
    CAIRN_ASSIGN_OR_RETURN(const bool second_is_seen, SeesNode(seen, 1));
    if (!second_is_seen) way_.BeginAt(0);
    if (way_.LeadsToGoal() || way_.nodes()[way_.next()] != unreached_) return Ok();
    CAIRN_ASSIGN_OR_RETURN(const bool is_dispensable, SeesNode(seen, way_.next() + 1));
    if (is_dispensable) way_.BeginAt(way_.next() + 1);
    return Ok();
  }

  DriveLeg& Go(const char* kind, const RobotTarget& target, NodeIdx node, bool is_goal) {
    if (kidnapping_ && kidnapping_->before_leg == num_legs_) robot_.PutAt(kidnapping_->pose);
    ++num_legs_;
    const PlanarPose before = robot_.pose();
    RobotLeg went = robot_.GoTo(target, is_goal);
    DriveLeg leg{.kind = kind, .node = node, .target = target.pose, .pose = robot_.pose()};
    leg.arrived = went.arrived;
    leg.seen = went.seen;
    leg.why = went.why;
    leg.steps = std::move(went.steps);
    Eigen::Vector2d last = before.position;
    for (const RobotStep& step : leg.steps) {
      drive_.way_m += (step.pose.position - last).norm();
      last = step.pose.position;
    }
    drive_.way_m += (robot_.pose().position - last).norm();
    drive_.legs.push_back(std::move(leg));
    return drive_.legs.back();
  }

  void Note(DriveLeg* leg) const {
    leg->followed = hypotheses_->followed();
    for (const StartHypothesis& hypothesis : hypotheses_->hypotheses()) {
      const auto image = map_.Image(model_.appearance().node_images[hypothesis.start].front());
      leg->hypotheses.push_back({hypothesis.start,
                                 image.ok() ? PlanarPoseOf((*image)->cam_from_world) : PlanarPose(),
                                 hypothesis.posterior, hypothesis.path.nodes});
    }
  }

  const Map& map_;
  const PlaceModel& model_;
  Robot robot_;
  const std::optional<Kidnapping> kidnapping_;
  const RobotDriveOptions& options_;
  NodeIdx goal_node_ = -1;
  RobotDrive drive_;
  std::optional<StartHypotheses> hypotheses_;
  std::vector<RobotTarget> trail_;  // its own images since the start, beginning with that one
  DriveWay way_;                    // without the goal, unless it is the start
  NodeIdx unreached_ = -1;          // seen last but not reached
  int num_legs_ = 0;
};

}  // namespace

OptionTable DescribeOptions(RobotDriveOptions* o) {
  OptionTable table = {
      {"max_num_legs", &o->max_num_legs, "most images that the robot goes to", 1},
      {"max_num_relocalizations", &o->max_num_relocalizations,
       "how often it may localize itself again after it got lost", 0},
      {"min_start_inliers", &o->min_start_inliers,
       "matches with a place's image that must agree on one motion for the place to be a possible start; 0: "
       "words decide",
       0},
      {"max_num_start_checks", &o->max_num_start_checks,
       "places that are checked in this way, those that score best", 1},
  };
  for (const OptionTable& part :
       {DescribeOptions(&o->robot), DescribeOptions(&o->servo), DescribeOptions(&o->hypotheses)}) {
    table.insert(table.end(), part.begin(), part.end());
  }
  return table;
}

Result<RobotDrive> DriveToImage(const Map& map, const PlaceModel& model, const Building& building,
                                const Camera& camera, double camera_height_m, const PlanarPose& start,
                                int32_t goal_image, const std::optional<Kidnapping>& kidnapping,
                                const RobotDriveOptions& options, uint64_t seed) {
  RobotDriveOptions checked = options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  for (const PlanarPose& pose : {start, kidnapping ? kidnapping->pose : start}) {
    if (!(ClearanceM(building, pose.position.x(), pose.position.y()) > 0)) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "drive: no place to stand at {:g}, {:g}: in a wall, in furniture or outside of the "
                       "building",
                       pose.position.x(), pose.position.y());
    }
  }
  if (goal_image < 0 || goal_image >= static_cast<int32_t>(model.appearance().node_of_image.size()) ||
      model.appearance().node_of_image[goal_image] < 0) {
    return MakeError(ErrorCode::kNotFound, "drive: the goal image is not in the map's appearance graph");
  }
  CAIRN_ASSIGN_OR_RETURN(
      Robot robot, Robot::Create(building, camera, camera_height_m, options.robot, options.servo, seed));
  robot.PutAt(start);
  return Driver(map, model, std::move(robot), goal_image, kidnapping, options).Run();
}

}  // namespace cairn::sim
