#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/camera/camera.h"
#include "core/geometry/pose.h"
#include "core/promise/session_evidence.h"
#include "core/promise/view_distance.h"
#include "core/world/feature_class.h"

namespace cairn {

// A class from a survey image.
struct ExpectedMatch {
  int32_t view = 0;  // position in ExpectedMatches::views
  // That the class is there now, and that a robot about one view's radius from there finds it again.
  float probability = 0;
};

// logit P(seen) = sum of weights x features; see expected_matches.cc for the features.
inline constexpr int kNumMatchFeatures = 7;
using MatchWeights = std::array<double, kNumMatchFeatures>;

struct ExpectedMatches {
  std::vector<int32_t> views;  // positions in Classes::images
  double depth = 1;            // median distance of what survey images see, m or the map's units
  std::vector<std::vector<ExpectedMatch>> of_class;  // per class of Classes::classes, ascending images
  MatchWeights weights{};
  int64_t num_learnt_from = 0;  // pairs of a class and an image
};

// A class, and the probability that a robot's image finds it.
struct ClassMatch {
  uint32_t i = 0;  // position in Classes::classes
  float probability = 0;
};

// Learns from the survey when a class that others saw is seen: for every image and every class in its view,
// from the sights in other views alone.  Same result for any number of threads.
class MatchModel {
 public:
  // O(classes * images that could see them).  `classes` must outlive it.
  MatchModel(const Classes& classes, const ViewOptions& options, int num_threads);
  ~MatchModel();
  MatchModel(MatchModel&&) noexcept;
  MatchModel& operator=(MatchModel&&) noexcept;

  // Of the survey's views.
  ExpectedMatches OfViews(int num_threads) const;

  // Where the survey's images are when an image is taken at a pose.
  enum class Where {
    kThere,   // exactly there: the pose is known
    kNearby,  // about one view's radius from there
  };
  // An image that is taken somewhere.
  struct Look {
    const Camera* camera = nullptr;
    Pose cam_from_world;
    int session = -1;  // when this session's were taken; -1: at any time
  };
  // Per look, the classes that it may find, ascending.  Const and safe from any thread.
  std::vector<std::vector<ClassMatch>> At(const std::vector<Look>& looks, Where where, int num_threads) const;

  const ViewDistance& distance() const;
  const SessionEvidence& evidence() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

// MatchModel::OfViews.
ExpectedMatches LearnMatches(const Classes& classes, const ViewOptions& options, int num_threads);

}  // namespace cairn
