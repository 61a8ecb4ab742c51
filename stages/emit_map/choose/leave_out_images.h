#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/blocks/map_rows.h"
#include "core/features/features.h"
#include "core/world/appearance.h"
#include "core/world/decomposition.h"
#include "core/world/feature_class.h"
#include "core/world/world.h"

namespace cairn::emit_map {

// A survey image used as a robot's query: its features, and its true pose.
struct TrialImage {
  Camera camera;
  Pose cam_from_world;
  Features features;
  int session = -1;  // position in Classes::sessions; -1: of none
};

// Which images are left out of the survey together, and which of them a map of the rest is tried on.
// Positions in Classes::images, ascending.
struct LeftOutImages {
  std::vector<size_t> left_out;
  std::vector<size_t> tried;
};

// With every image that is tried goes all that a robot's image is not as near as, the images of its view
// (core/promise/view_distance.h): images taken one after the other see the same things, and single left-out
// images were found to be too easy.  At most about `max_num_images` are tried, spread over the survey, in as
// many rounds as it takes to leave out no more than one image in four at a time; at most `kMaxNumRounds`.
// Errors: NoData (fewer than twelve survey images).
inline constexpr size_t kMinNumSurveyImages = 12;
inline constexpr size_t kMaxNumRounds = 6;
// `never_tried`: positions of images that are no robot's (LandmarkImages); they are left out with others.
Result<std::vector<LeftOutImages>> ChooseLeftOut(const Classes& classes, size_t max_num_images,
                                                 const std::set<size_t>& never_tried = {});

// Positions of the images whose features are landmarks of an earlier map (core/capture/capture_features.h): a
// map recognises itself.  `matches_path`: matches.db.  Errors: those of OpenColmapDatabase.
Result<std::set<size_t>> LandmarkImages(const Classes& classes, const std::string& matches_path);

// Positions of the images whose views a later session's show (core/promise/later_views.h): they show what has
// changed since as it was, and in the light of then.  None where fewer than kMinNumToday other images would
// be left to try.
inline constexpr size_t kMinNumToday = 24;
std::set<size_t> ImagesOfThePast(const Classes& classes);

// Both: what a map is not tried on.  Errors: as LandmarkImages.
Result<std::set<size_t>> NeverTried(const Classes& classes, const std::string& matches_path);

// Shares out images among the rounds in which they are left out, first fit.
class LeftOutRounds {
 public:
  explicit LeftOutRounds(size_t num_survey_images) : num_survey_images_(num_survey_images) {}

  // Whether so many may be left out at a time: one in four.
  bool MayLeaveOut(const std::set<size_t>& images) const;
  // False where no round has room for them, or they are too many for any.
  bool Add(const std::vector<size_t>& tried, const std::set<size_t>& left_out);
  std::vector<LeftOutImages> Rounds() const;

 private:
  size_t num_survey_images_;
  std::vector<std::vector<size_t>> tried_;  // per round
  std::vector<std::set<size_t>> left_out_;  // likewise
};

// The survey without some of its images, so that a map can be tried on these before any held-out
// image is used.
struct LeftOutSurvey {
  Classes classes;  // without the images' observations; classes left with fewer than two are left out
  std::vector<TrialImage> images;
};

// The descriptors of classes that the left-out images saw are computed from the other images alone; positions
// are kept (one ray of many).  `matches_path`: matches.db, for the features.  Errors: those of
// OpenColmapDatabase.
Result<LeftOutSurvey> LeaveOutImages(const Classes& classes, const std::string& matches_path,
                                     const LeftOutImages& which);

// What a map is made of besides its classes, all of one survey.
struct SurveyParts {
  World world;
  Decomposition decomposition;
  std::optional<Appearance> appearance;
};

// The parts without what `classes`, those of a LeftOutSurvey, lack: images of stations, features of the world
// and of regions (renumbered, in their order), and kept nodes of the appearance graph whose images are all
// left out, for which their neighbours are kept.  Stations, areas and regions stay.  O(parts).
SurveyParts PartsOf(const Classes& classes, SurveyParts parts);

// How a left-out image fared in a map.
struct LeftOutResult {
  bool is_right = false;  // localized within the limits
  double error_m = 0;     // and how far off; 0 unless right
  int num_inliers = 0;    // 0 unless right
};

// The results of maps on left-out images.
struct LeftOutTrial {
  std::vector<LeftOutResult> images;

  void Add(const LeftOutTrial& other);
  int NumTried() const { return static_cast<int>(images.size()); }
  int NumRight() const;
  // Over all images: inliers of those localized right, at most 50, over 50; else 0.
  double MeanMargin() const;
  double MedianErrorM() const;  // of those localized right; 0 where there are none
};

// How many times as large the errors of `trial` are as those of `reference`, on the same images in the same
// order: the geometric mean over the images that both localize right; 1 where there are none.  Unlike a ratio
// of medians, it changes by little where few images change.  Smaller errors count as `least_error_m`.
// REQUIRES: least_error_m > 0
double ErrorRatio(const LeftOutTrial& trial, const LeftOutTrial& reference, double least_error_m);

struct LeftOutLimits {
  double max_error_m = 0.1;
  double max_error_deg = 5;
};
// Localizes the images in a map of the survey that lacks them; results in their order.  Same result for any
// number of threads. Errors: InvalidArgument (CheckMapRows), Corrupt.
Result<LeftOutTrial> TryLeftOutImages(MapRows rows, const std::vector<TrialImage>& images,
                                      const LeftOutLimits& limits, int num_threads);

}  // namespace cairn::emit_map
