#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/base/pooled.h"
#include "core/camera/camera.h"
#include "core/features/features.h"
#include "runtime/localize/localization.h"
#include "runtime/localize/localizer_options.h"
#include "runtime/map/map.h"

namespace cairn {

// runtime/localize/measurement.h, estimate.h and place_evidence.h:
struct Query;
struct Sighting;
struct UpMeasurement;
struct Correspondence;
struct PoseMeasurement;
struct PoseEstimate;
struct PlaceEvidence;
struct LandmarkSet;  // runtime/map/landmark_set.h
class WorkBudget;    // core/work/work_budget.h

// An image that a camera of a rig takes at the same time as the others take theirs.
struct RigImage {
  cv::Mat grey;
  Camera camera;
  Pose cam_from_rig;  // frames of cameras are those in which the capture states poses
};
struct RigFeatures {
  Features features;
  Camera camera;
  Pose cam_from_rig;
};

// Finds where a camera is.  One per thread; the map is shared.  Not for concurrent calls.
class Localizer {
 public:
  explicit Localizer(std::shared_ptr<const Map> map, const LocalizerOptions& options = {});

  // From 8-bit grey pixels of the camera's size.  Same image, same result.  Errors: InvalidArgument (not
  // 8-bit grey; a camera that is invalid or of another size); Corrupt, Io (a part of the map that is needed
  // is damaged or cannot be read).  An image that cannot be localized is no error: see Localization::reason.
  // `up`: no pose that tilts the camera, and, where it is known well, poses from two landmarks, not three;
  // errors: as CheckSensedUp.
  // No exception leaves it.
  Result<Localization> Localize(const cv::Mat& grey, const Camera& camera,
                                const std::optional<PosePrior>& prior = std::nullopt,
                                const std::optional<SensedUp>& up = std::nullopt);

  // The same from features that were already extracted (rows of descriptors belong to keypoints).
  Result<Localization> LocalizeFeatures(Features features, const Camera& camera,
                                        const std::optional<PosePrior>& prior = std::nullopt,
                                        const std::optional<SensedUp>& up = std::nullopt);

  // One fix of what several cameras see at once: poses, prior and up are the rig's.  Landmarks that each
  // recognizes by itself are matched; poses come from those of all of them (generalised P3P), and a camera
  // that recognizes nothing is searched for what the others' pose puts into its image.  Errors: as Localize,
  // of any image; InvalidArgument without images or with a pose on the rig that is none.
  Result<Localization> LocalizeRig(const std::vector<RigImage>& images,
                                   const std::optional<PosePrior>& prior = std::nullopt,
                                   const std::optional<SensedUp>& up = std::nullopt);
  Result<Localization> LocalizeRigFeatures(std::vector<RigFeatures> images,
                                           const std::optional<PosePrior>& prior = std::nullopt,
                                           const std::optional<SensedUp>& up = std::nullopt);

  // The steps of Localize, for callers that know more than one image (RegionTracker).  The features of an
  // image, with their rays and packed descriptors.  Errors: as Localize.
  // `work`: what is left for its answer; null: LocalizerOptions::budget_ms.  Where that is not enough for all
  // features of the image they are those that it is enough for (core/work/affordable_sift.h), or none.
  using Budget = std::shared_ptr<WorkBudget>;
  Result<Query> QueryFromImage(const cv::Mat& grey, const Camera& camera, Budget work = nullptr) const;
  Result<Query> QueryFromFeatures(Features features, const Camera& camera, Budget work = nullptr) const;
  // In two steps, a third of the time: its coarse features (SiftScales), then of its fine ones those that are
  // wanted.
  Result<Query> CoarseQueryFromImage(const cv::Mat& grey, const Camera& camera, Budget work = nullptr) const;
  // At most so many, the strongest, and no more than SiftOptions::max_num_features with those that it has;
  // none where there is no work left for them.
  // Errors: as Localize.
  Status AddFineFeatures(const cv::Mat& grey, int max_num,
                         const std::function<bool(const Keypoint&)>& is_wanted, Query* query) const;
  // What else is known of the moment when it was taken.  Errors: as CheckSensedUp.
  Status SetUp(const SensedUp& up, Query* query) const;
  Result<Localization> LocalizeQuery(const Sighting& query, const std::optional<PosePrior>& prior) const;
  // The same, but these landmarks (ascending), of regions that were voted for, are matched before all others.
  Result<Localization> LocalizeVoted(const Query& query, std::span<const LandmarkIdx> voted) const;
  // Localizes among these landmarks (ascending) only, and those of look-alikes that the prior does
  // not exclude.
  Result<Localization> LocalizeAmong(const Query& query, Scope scope, std::span<const LandmarkIdx> landmarks,
                                     const std::optional<PosePrior>& prior) const;

  // A fix made more exact by what the query shows of these landmarks where it puts them: the same fix where
  // that is less than what it was made of.  Nothing else about it changes.
  Result<Localization> Sharpen(const Query& query, const LandmarkSet& landmarks, Localization fix) const;

  const LocalizerOptions& options() const { return options_; }
  // For one answer, to an image or a frame.
  Budget MakeBudget() const;

 private:
  Result<Query> QueryWithin(const cv::Mat& grey, const Camera& camera, bool coarse, Budget work) const;
  // Landmarks to match.
  struct Attempt {
    Scope scope = Scope::kAll;
    PooledVector<PooledVector<LandmarkIdx>> landmarks;  // with each image, ascending
    bool may_be_thinned = true;                         // where there is no work left for all of them
    size_t num_landmarks() const;                       // with all of them together
  };
  struct FollowedUp;
  struct PlaceToTry;
  static Attempt WithAllImages(Scope scope, std::span<const LandmarkIdx> landmarks, const Sighting& sighting);
  // `best`: what was found before.
  Result<Localization> LocalizeBetter(const Sighting& sighting, const std::optional<PosePrior>& prior,
                                      Localization best) const;
  Status CheckImage(const cv::Mat& grey, const Camera& camera) const;
  // Errors: InvalidArgument where it is no pose.
  Status PutOnRig(const Pose& cam_from_rig, Query* query) const;
  Result<Localization> LocalizeRigQueries(PooledVector<Query> queries, const std::optional<PosePrior>& prior,
                                          const std::optional<SensedUp>& up) const;
  // The prior of one of its cameras.
  PosePrior PriorOfImage(const PosePrior& prior, const Query& query) const;
  // The last step of every fix: look-alikes are excluded, and it is put into the given frame.
  Result<Localization> Answer(const Sighting& sighting, const std::optional<PosePrior>& prior,
                              Localization localization) const;
  // And the error of the map's scale is added to its covariance.
  void PutInGivenFrame(Localization* fix) const;
  Result<PooledVector<Attempt>> MakeAttempts(const Sighting& sighting, const std::optional<PosePrior>& prior,
                                             std::vector<ImageId>* candidate_ids) const;
  Result<Localization> Try(const Sighting& sighting, const Attempt& attempt) const;
  // What a first pose, of these matches, leads to.
  Result<FollowedUp> FollowUp(const Sighting& sighting, std::span<const Correspondence> matches,
                              const PoseEstimate& first, int64_t max_num_guided) const;
  // The landmarks that the images should show at a pose with these inliers, ascending; so many at most.
  Result<PooledVector<LandmarkIdx>> LandmarksToLookFor(const Sighting& sighting,
                                                       std::span<const Correspondence> inliers,
                                                       const Pose& rig_from_world, int64_t max_num) const;
  // How many they may be where so many poses are followed up: of each as many, or what they lead to does not
  // compare.
  static int64_t MaxNumGuided(const Sighting& sighting, size_t num_poses);
  // What the images show of what they should there.  `matched`: the landmarks that first poses come from.
  Result<PlaceEvidence> EvidenceOf(const Sighting& sighting, const LandmarkSet& matched,
                                   const FollowedUp& followed_up) const;
  // The fix of that of these first poses which leads to most, unless one at another place leads to nearly as
  // much.
  Result<Localization> Refine(const Sighting& sighting, const LandmarkSet& matched,
                              std::span<const Correspondence> matches, std::span<const PoseEstimate> firsts,
                              Localization localization) const;
  // These poses, and where the camera would be in the places that look like theirs, unless the prior excludes
  // it.
  Result<PooledVector<PlaceToTry>> WithLookAlikes(const Sighting& sighting, std::span<const Pose> poses,
                                                  const std::optional<PosePrior>& prior) const;
  // `best`, a fix or one of several places, unless look-alikes of these explain the image nearly as well.
  Result<Localization> ExcludeLookAlikes(const Sighting& sighting, const std::optional<PosePrior>& prior,
                                         Localization best) const;
  // A pose at another place that max_second_pose_ratio as many other matches agree on.
  std::optional<PoseEstimate> SecondPose(std::span<const PoseMeasurement> measurements,
                                         const PoseEstimate& first, const std::optional<UpMeasurement>& up,
                                         WorkBudget* work) const;
  // How many landmarks an image may be matched with.
  int64_t MaxNumMatched(const Query& query) const;

  std::shared_ptr<const Map> map_;
  LocalizerOptions options_;
};

// A frame to be localized: an image, of which all features are extracted when somebody asks for them, or
// features alone.
class QueryFrame {
 public:
  QueryFrame(const Localizer& localizer, const cv::Mat& grey, const Camera& camera)
      : localizer_(localizer), grey_(grey), camera_(camera), work_(localizer.MakeBudget()) {}
  QueryFrame(const Localizer& localizer, Features features, const Camera& camera)
      : localizer_(localizer),
        features_(std::move(features)),
        camera_(camera),
        work_(localizer.MakeBudget()) {}

  // Which way was up, of features that are known by now, too.  REQUIRES: CheckSensedUp
  void set_up(const SensedUp& up);
  const std::optional<SensedUp>& up() const { return up_; }
  // Query::readout where the frame has a pose, by what is believed or known by now.
  using ReadoutAt = std::function<ReadoutMotion(const Pose& cam_from_world)>;
  void set_readout(ReadoutAt readout) { readout_ = std::move(readout); }
  ReadoutMotion ReadoutOf(const Pose& cam_from_world) const {
    return readout_ ? readout_(cam_from_world) : ReadoutMotion();
  }
  // The image, as long as not all of its features are known; null after that, and where there is none.
  const cv::Mat* image() const { return grey_ && !query_ ? &*grey_ : nullptr; }
  const Camera& camera() const { return camera_; }
  // What its answer may cost.
  const Localizer::Budget& work() const { return work_; }
  // Errors: as Localizer::QueryFromImage, QueryFromFeatures.
  Result<const Query*> WithAllFeatures();
  // The same, whatever the budget: for a log, to which what is not there is gone.
  Result<const Query*> WithAllFeaturesForLog();

 private:
  Localizer localizer_;
  std::optional<cv::Mat> grey_;
  Features features_;
  Camera camera_;
  std::optional<SensedUp> up_;
  ReadoutAt readout_;
  Localizer::Budget work_;
  std::shared_ptr<const Query> query_;    // with all features, or those that there was work for
  std::shared_ptr<const Query> for_log_;  // with all features, where work is limited
};

}  // namespace cairn
