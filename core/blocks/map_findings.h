#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/error.h"
#include "core/base/ids.h"
#include "core/promise/promise_model.h"

namespace cairn {

// The region of held-out images that were taken at no station of any region.
inline constexpr RegionIdx kOutsideRegions = -1;

// How the held-out images of one region fared.
struct RegionSelfTest {
  struct Errors {
    double median_m = 0;
    double median_deg = 0;
    double p90_m = 0;
    double p90_deg = 0;
    friend bool operator==(const Errors&, const Errors&) = default;
  };
  RegionIdx region = kOutsideRegions;
  int num_held_out = 0;
  int num_localized = 0;
  int num_gross_errors = 0;      // of those localized: farther off than the self-test's limits
  std::optional<Errors> errors;  // of those localized; empty where none was localized

  // REQUIRES: num_held_out > 0
  double LocalizedRatio() const { return static_cast<double>(num_localized) / num_held_out; }
  // Share of the fixes that are right; 1 where there are no fixes.
  double PrecisionRatio() const {
    return num_localized > 0 ? 1 - static_cast<double>(num_gross_errors) / num_localized : 1;
  }
  friend bool operator==(const RegionSelfTest&, const RegionSelfTest&) = default;
};

// What a stage dropped for one reason (core/world/drop_reason.h; schemas/drops.md), in the words of the
// program that wrote the map.
struct DropCount {
  int reason_id = 0;
  std::string stage;
  std::string kind;
  std::string name;
  std::string text;
  int64_t num_dropped = 0;
  std::vector<int32_t> at_stations;  // per station: how many of them there; empty: none at any
  friend bool operator==(const DropCount&, const DropCount&) = default;
};

// How well a region's places can be told from others.
struct RegionEntropy {
  RegionIdx region = 0;
  double entropy = 0;  // mean of the images' at its stations, nats
  friend bool operator==(const RegionEntropy&, const RegionEntropy&) = default;
};

// What a robot can rely on that looks from about here (core/promise).
struct NodePromise {
  // Images by index: the survey image of the node, or the two between whose headings it lies.
  int32_t image = 0;
  int32_t other_image = 0;
  RegionIdx region = 0;      // whose landmarks alone keep the promise
  double probability = 0;    // that the terms hold
  double num_matches = 0;    // landmarks to expect matched
  double sigma_m = 0;        // of the camera's place by these: square root of its covariance's trace
  double most_probable = 0;  // the probability if all classes of the survey were landmarks
  friend bool operator==(const NodePromise&, const NodePromise&) = default;
};

// What the map promises, node by node, and how promises of its kind fared.
struct MapPromise {
  PromiseTerms terms;
  PromiseModel model;
  // A node answers for images this far around it, times kNodeReach (core/promise/promise_nodes.h).
  double radius_m = 0;
  double radius_deg = 0;
  // No map of this survey with fewer landmarks keeps the promise at the nodes where it can be kept.
  int64_t landmarks_lower_bound = 0;
  std::vector<NodePromise> nodes;
  std::vector<PromiseBin> left_out;  // survey images left out of the maps that were tried
  std::vector<PromiseBin> held_out;  // images of the self-test
  int NumKept() const;               // nodes whose probability is the terms' at least
  friend bool operator==(const MapPromise&, const MapPromise&) = default;
};

// Changes lie as near the origin as a map's landmarks have to, m.
inline constexpr double kMaxChangeExtentM = 2e5;

// Where the place changed from one survey to the next, by the features that vanished and those that appeared
// there (PlaceChange of core/world/feature_class.h).  Stored to a thousandth of the map's unit.
struct MapChange {
  int session = 0;  // by its place in the map's sessions: the first that shows it, never the first of all
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // mean of the features', world frame, metres
  double radius_m = 0;                                 // root mean square of their distances from it
  int32_t num_vanished = 0;
  int32_t num_appeared = 0;
  // Images by index, that show best what was there and what is there now; -1: none of the map.
  int32_t image_before = -1;
  int32_t image_after = -1;
  // By index, the change of the same session where what was there is now (it may be this one), and how many
  // features show that; -1, 0: nowhere.
  int32_t moved_to = -1;
  int32_t num_moved = 0;
  int64_t NumFeatures() const { return int64_t{num_vanished} + num_appeared; }
  friend bool operator==(const MapChange&, const MapChange&) = default;
};

// What the compilation found out about a map, for people who assess it (schemas/map_findings.sql).  A robot
// does not need it to localize.
struct MapFindings {
  std::vector<RegionSelfTest> self_test_regions;  // those with held-out images, ascending region
  std::vector<RegionEntropy> region_entropies;    // those with images of the appearance graph, ascending
  std::vector<DropCount> drops;                   // reasons that occurred, ascending
  std::optional<MapPromise> promise;              // of maps whose landmarks were chosen by trial
  std::vector<MapChange> changes;  // of maps of several surveys; ascending session, the largest first
  bool HasMoves() const;           // whether something moved from one change to another
  friend bool operator==(const MapFindings&, const MapFindings&) = default;
};

// How many of each the map has that findings are of.
struct MapSizes {
  size_t num_regions = 0;
  size_t num_stations = 0;
  size_t num_images = 0;
  size_t num_sessions = 0;
};

// Errors: InvalidArgument, naming the row: a row out of order, of a region, station, image or session that
// does not exist, or with impossible numbers.
Status CheckMapFindings(const MapFindings& findings, const MapSizes& sizes);

}  // namespace cairn
