#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "core/base/error.h"
#include "core/features/sift.h"
#include "runtime/localize/accept.h"
#include "runtime/localize/estimate.h"
#include "runtime/localize/match.h"
#include "runtime/localize/measurement.h"
#include "runtime/localize/refine.h"
#include "runtime/localize/retrieve.h"
#include "runtime/map/map.h"

namespace cairn {

// The options of every piece of localization, in the order in which they act.
struct LocalizerOptions {
  SiftOptions sift;
  MeasurementOptions measurement;
  RetrieveOptions retrieve;
  MatchOptions match;
  EstimateOptions estimate;
  RefineOptions refine;
  AcceptOptions accept;
  // Landmarks to match first: of the candidates' regions, or of the candidate images themselves; "auto":
  // regions, unless the map keeps landmarks that no region has.
  std::string first_landmarks = "auto";
  // A fix with at least this many inliers found without the pose is taken at once; with fewer, the other sets
  // of landmarks are tried too, and the fix with the most inliers counts: look-alikes give
  // few.  REQUIRES: >= 0
  int sure_num_unguided_inliers = 20;
  // Where the map knows that the place of a fix looks like others that lie elsewhere [Mariottini11 §V], try
  // these too, unless a prior excludes them: the fix is withheld as long as one of them explains the image
  // nearly as well (max_second_pose_ratio).
  bool exclude_look_alikes = true;
  // Try all landmarks of the map when those fail, if they are not more than this.  REQUIRES: >= 0
  bool fall_back_to_all = true;
  int fall_back_max_num_landmarks = 200000;
};
OptionTable DescribeOptions(LocalizerOptions* options);

// Where landmarks to match came from.
enum class Scope { kPrior, kRegions, kImages, kAll, kTrack };
const char* ScopeName(Scope scope);  // "prior", "regions", "images", "all", "track"

// A fix, or the reason for none.
struct Localization {
  NoFix reason = NoFix::kNoCandidates;
  std::string message;  // why there is no fix: found and needed
  bool has_fix() const { return reason == NoFix::kNone; }

  // With a fix.  The pose is in the frame in which the capture states poses (the map's camera_from_given
  // is applied).
  Pose cam_from_world;
  // Rotation (rad), translation (m); of the left perturbation of cam_from_world: the true pose is
  // (Exp(rotation), translation) * cam_from_world.
  Matrix6d covariance = Matrix6d::Identity();
  RegionIdx region = -1;  // the region with most inliers; -1: they belong to none
  Scope scope = Scope::kAll;

  int num_features = 0;
  int num_matches = 0;              // without knowing the pose
  int num_unguided_inliers = 0;     // of them
  int num_inliers = 0;              // in all
  std::vector<ImageId> candidates;  // survey images, most alike first
};

// Finds where a camera is.  One per thread; the map is shared.  Not for concurrent calls.
class Localizer {
 public:
  explicit Localizer(std::shared_ptr<const Map> map, const LocalizerOptions& options = {});

  // From 8-bit grey pixels of the camera's size.  Same image, same result.  Errors: InvalidArgument (not
  // 8-bit grey; a camera that is invalid or of another size); Corrupt, Io (a part of the map that is needed
  // is damaged or cannot be read).  An image that cannot be localized is no error: see Localization::reason.
  // No exception leaves it.
  Result<Localization> Localize(const cv::Mat& grey, const Camera& camera,
                                const std::optional<PosePrior>& prior = std::nullopt);

  // The same from features that were already extracted (rows of descriptors belong to keypoints).
  Result<Localization> LocalizeFeatures(Features features, const Camera& camera,
                                        const std::optional<PosePrior>& prior = std::nullopt);

  // The steps of Localize, for callers that know more than one image (RegionTracker).  The features of an
  // image, with their rays and packed descriptors.  Errors: as Localize.
  Result<Query> QueryFromImage(const cv::Mat& grey, const Camera& camera) const;
  Result<Query> QueryFromFeatures(Features features, const Camera& camera) const;
  Result<Localization> LocalizeQuery(const Query& query, const std::optional<PosePrior>& prior) const;
  // Localizes among these landmarks (ascending) only, and those of look-alikes that the prior does
  // not exclude.
  Result<Localization> LocalizeAmong(const Query& query, Scope scope, std::vector<LandmarkIdx> landmarks,
                                     const std::optional<PosePrior>& prior) const;

  const LocalizerOptions& options() const { return options_; }

 private:
  struct Attempt;
  // The last step of every fix: look-alikes are excluded, and the pose is put into the given frame.
  Result<Localization> Answer(const Query& query, const std::optional<PosePrior>& prior,
                              Localization localization) const;
  Result<std::vector<Attempt>> MakeAttempts(const Query& query, const std::optional<PosePrior>& prior,
                                            std::vector<ImageId>* candidate_ids) const;
  Result<Localization> Try(const Query& query, const Attempt& attempt) const;
  Result<Localization> Refine(const Query& query, const LandmarkSet& matched,
                              std::vector<Correspondence> matches, const Pose& cam_from_world,
                              Localization localization) const;
  // `best`, unless a look-alike of its place explains the image nearly as well.
  Result<Localization> ExcludeLookAlikes(const Query& query, const std::optional<PosePrior>& prior,
                                         Localization best) const;
  bool IsAmbiguous(const std::vector<PoseMeasurement>& measurements, const PoseEstimate& first) const;

  std::shared_ptr<const Map> map_;
  LocalizerOptions options_;
};

}  // namespace cairn
