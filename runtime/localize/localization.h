#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/geometry/pose.h"

namespace cairn {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

// Where the camera is believed to be: in the frame in which poses are reported.
struct PosePrior {
  Pose cam_from_world;
  double sigma_m = 1;     // of its place, per axis
  double sigma_deg = 10;  // of its rotation
};

// How a camera moves while an image is read, from the top row to the bottom row (a rolling shutter): the
// perturbation of its pose (refine.h), rotation (rad), translation (m), and standard deviations of what is
// not known of it.
struct ReadoutMotion {
  Vector6d motion = Vector6d::Zero();
  Vector6d sigmas = Vector6d::Zero();
  bool is_none() const { return motion.isZero(0) && sigmas.isZero(0); }
};

// Which way is up, as an accelerometer says while the robot does not speed up or brake, or an IMU.
struct SensedUp {
  Eigen::Vector3d direction = -Eigen::Vector3d::UnitY();  // in the camera's frame (a rig's), of any length
  double sigma_deg = 1;                                   // per axis
};
// Errors: InvalidArgument where it is no direction, or not as uncertain as anything.
Status CheckSensedUp(const SensedUp& up);

// Why there is no fix.
enum class NoFix {
  kNone,            // there is one
  kTooFewFeatures,  // blank, dark or blurred image
  kNoCandidates,    // nothing in the map looks like it
  kTooFewMatches,   // few landmarks recognised
  kNoPose,          // the matches agree on no pose
  kTooFewInliers,   // too few of them do
  kPoorSpread,      // they lie close together in the image
  kUncertain,       // they leave the pose too uncertain
  kFarFromSurvey,   // they put the camera where nobody surveyed
  kAmbiguous,       // another pose is nearly as good
  kImprobable,      // most of what an image from there would show is missing
  kTilted,          // up is not where it was sensed
  kOverBudget,      // what LocalizerOptions::budget_ms allows was done before a fix was sure
};
// Stable lower-case name ("too_few_matches"); "none" for kNone.
const char* NoFixName(NoFix reason);

// Where landmarks to match came from.
enum class Scope { kPrior, kRegions, kImages, kAll, kTrack, kVotes };
const char* ScopeName(Scope scope);  // "prior", "regions", "images", "all", "track", "votes"

// A fix, or the reason for none.
struct Localization {
  NoFix reason = NoFix::kNoCandidates;
  std::string message;  // why there is no fix: found and needed
  bool has_fix() const { return reason == NoFix::kNone; }
  // Whether it says where the image may have been taken: a fix, or one of several places.
  bool has_places() const { return has_fix() || !possible_poses.empty(); }

  // With a fix.  The pose is in the frame in which the capture states poses (the map's camera_from_given
  // is applied).  Of a rig it is the rig's.
  Pose cam_from_world;
  // Rotation (rad), translation (m); of the left perturbation of cam_from_world: the true pose is
  // (Exp(rotation), translation) * cam_from_world.
  Matrix6d covariance = Matrix6d::Identity();
  // By how much one standard deviation of the map's scale moves the translation, metres: the outer product is
  // part of the covariance.  The scale errs once: every fix of the map by the same multiple, so that it does
  // not average out, and no difference of near fixes shows it.  Zero where poses were stated, or no metres.
  Eigen::Vector3d scale_sigma_m = Eigen::Vector3d::Zero();
  // P(the fix is right): by how much of what an image from there should show is found, and by what other
  // places explain (place_evidence.h).  Without a fix: 0, but for kImprobable, and for kAmbiguous, that one
  // of the possible poses is right.
  double probability = 0;
  RegionIdx region = -1;  // the region with most inliers; -1: they belong to none
  Scope scope = Scope::kAll;

  // With kAmbiguous: the poses that explain it alike, the best first; as cam_from_world.  And P(each is
  // right), of one pose in many: their sum is `probability`.
  std::vector<Pose> possible_poses;
  std::vector<double> possible_probabilities;

  double work_ms = 0;  // what the answer took: WorkBudget, not a clock
  int num_features = 0;
  int num_matches = 0;              // without knowing the pose
  int num_unguided_inliers = 0;     // of them
  int num_inliers = 0;              // in all
  std::vector<ImageId> candidates;  // survey images, most alike first
  // RegionTracker, lost: regions with enough of their landmarks in view, most first.
  std::vector<RegionIdx> voted_regions;
};

}  // namespace cairn
