#pragma once

#include <memory>
#include <optional>
#include <utility>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "core/base/error.h"
#include "core/options/options.h"
#include "runtime/drive/place_belief.h"
#include "runtime/localize/localizer.h"
#include "runtime/track/region_tracker.h"

namespace cairn {

// When a place is sure.
struct SureTrackerOptions {
  // A fix is published where its place has this probability, by all frames so far; one image alone is of that
  // place with 0.99 at most (PlaceBeliefOptions::misled_ratio).  0: every fix is published, and nothing is
  // believed.  REQUIRES: in [0, 1)
  double min_place_probability = 0;
  // While it is sure, a frame is looked at without what the tracker expects once in so many seconds: that
  // takes as long as a first fix.  REQUIRES: >= 0
  double look_anew_s = 1;
  PlaceBeliefOptions belief;
};
// Those of the belief as "place_fix_ratio" and so on.
OptionTable DescribeOptions(SureTrackerOptions* options);

// The fix with the probability of its place; none (kImprobable) where that is less than needed.  Without a
// fix as it is.
Localization PublishIfSure(Localization found, double place_probability, double min_place_probability);

// Follows a robot that may have woken up anywhere, and says where it is only when it is sure: RegionTracker
// finds poses from frame to frame, and PlaceBelief, from frames that are localized without what is expected,
// how probable their places are.  A tracker that follows a look-alike of where the robot is agrees with
// itself for ever; the belief does not.  Where the belief is sure of another place, the tracker begins anew
// there.  One per camera, not for concurrent calls.
class SureTracker {
 public:
  // Errors: InvalidArgument (an option, or one of the belief that nothing reads, as min_place_probability is
  // 0); with min_place_probability those of PlaceBelief::Make.
  static Result<SureTracker> Make(std::shared_ptr<const Map> map, const LocalizerOptions& localizer_options,
                                  const RegionTrackerOptions& tracker_options,
                                  const SureTrackerOptions& options);

  // How the camera moved since the last frame: as RegionTracker and PlaceBelief have it, which takes of a
  // motion in space what is over the floor (OverFloor).  Errors: the same.
  Status Move(const Eigen::Vector2d& way_m, double turn_left_rad);
  Status Move(const UncertainPose& next_from_last);
  // What else is known of the next frame besides its pixels: time as PlaceBelief has it, up as Localizer and
  // PlaceBelief do.  Errors: the same, and InvalidArgument for a time where min_place_probability is 0, as
  // nothing reads it.
  Status Elapse(double seconds);
  Status SenseUp(const Eigen::Vector3d& up_in_camera, double sigma_deg);

  // The next frame.  `probability` is that of the place by all frames so far; a fix whose place has too
  // little is none (kImprobable).  Errors: as RegionTracker and PlaceBelief; where the map's blocks turn out
  // to be damaged, the tracker may have taken the frame in already.
  Result<Localization> Track(const cv::Mat& grey, const Camera& camera);
  Result<Localization> TrackFeatures(Features features, const Camera& camera);
  Result<Localization> TrackFrame(QueryFrame* frame);

  std::optional<PosePrior> Prediction() const { return tracker_->Prediction(); }
  std::optional<UncertainPose> Believed() const { return tracker_->Believed(); }
  // None where every fix is published.
  const std::optional<PlaceBelief>& belief() const { return belief_; }

 private:
  SureTracker(std::shared_ptr<const Map> map, const LocalizerOptions& localizer_options,
              const RegionTrackerOptions& tracker_options, const SureTrackerOptions& options);
  Status CheckBelieves() const;
  // What the frame says without what the tracker expects; `found`: what it says with that.
  Result<Localization> LookAnew(const Query& query, const Localization& found);
  // P(the place of the fix).
  double ProbabilityOf(const Localization& found) const;

  std::shared_ptr<const Map> map_;
  LocalizerOptions localizer_options_;
  RegionTrackerOptions tracker_options_;
  SureTrackerOptions options_;
  Localizer localizer_;
  std::optional<RegionTracker> tracker_;
  std::optional<PlaceBelief> belief_;
  double since_look_s_ = 0;
  // Told of the next frame.
  std::optional<double> elapsed_s_;
  std::optional<SensedUp> up_;
  double sure_probability_ = 0;  // of the place that is followed; 0: it is not sure
};

}  // namespace cairn
