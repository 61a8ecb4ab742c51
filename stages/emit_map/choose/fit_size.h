#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/blocks/map_rows.h"
#include "core/world/feature_class.h"
#include "core/world/world.h"
#include "stages/emit_map/choose/leave_out_images.h"
#include "stages/emit_map/choose/make_promises.h"
#include "stages/emit_map/choose/trials.h"

namespace cairn::emit_map {

// Chooses which classes a map keeps, and how many bits of their descriptors, by trying maps of a part of the
// survey on survey images that are left out (leave_out_images.h).  Candidates are the first classes of
// LandmarkOrder (core/promise/landmark_order.h); what is chosen is then made from the whole survey.
struct FitSizeOptions {
  int64_t max_bytes = 0;         // of the sealed map's file
  int descriptor_bits = 5;       // at most
  size_t max_num_left_out = 48;  // of one session (Trials)
  LeftOutLimits limits;
  // ChooseFewest: of the left-out images that the map of everything localizes, the part that must stay
  // localized, and the largest growth of their errors (ErrorRatio).  REQUIRES: in [0, 1]; >= 1
  double min_recall_ratio = 0.99;
  double max_error_ratio = 1.1;
  double least_error_m = 0.001;  // smaller ones count as this.  REQUIRES: > 0
  PromiseOptions promise;
};

// Part of the error message where no map of so few bytes is possible.
inline constexpr const char* kLeastPossible = "the least possible is";

struct FittedSize {
  std::vector<char> keep;  // per class
  int descriptor_bits = 0;
  int64_t num_bytes = 0;  // FitSize: including space for the self-test
  // Trials on the left-out images: of this choice, and of the map of everything that may be kept.  No trials
  // are made where everything fits.
  LeftOutTrial trial, trial_of_all;
  // What the map promises, and its regions; nothing where no trials are made.
  std::optional<Promises> promises;
};

// The largest choice within max_bytes, with as many bits as localize most left-out images, and then with most
// inliers.  `may_keep`: per class, whether the map would keep it without a limit.  `scratch_path`: where a
// file can be written to measure its size; it is removed.  Errors: InvalidArgument when not even a map of one
// landmark fits (states the smallest possible size, and what takes it); those of LeaveOutImages and `emit`;
// Cancelled.
Result<FittedSize> FitSize(const Classes& classes, const std::vector<char>& may_keep,
                           const std::string& matches_path, const EmitKept& emit,
                           const FitSizeOptions& options, const std::string& scratch_path, int num_threads,
                           Progress& progress);

// The fewest landmarks with which left-out images are localized as often and nearly as well as with all of
// them (min_recall_ratio, max_error_ratio), in the fewest bits that allow it, and what else it takes to keep
// the promise at every node.  All, untried, where the survey is too small to try anything: fewer than twelve
// images, or fewer than `kMinNumRight` left-out ones that the map of everything localizes.  Errors: those of
// LeaveOutImages and `emit`; Cancelled.
// `first`: positions in classes.classes that are among them, in this order, because an earlier map has these;
// then descriptors have options.descriptor_bits, and no fewer.
inline constexpr int kMinNumRight = 8;
Result<FittedSize> ChooseFewest(const Classes& classes, const std::string& matches_path, const EmitKept& emit,
                                const FitSizeOptions& options, int num_threads, Progress& progress,
                                const std::vector<size_t>& first = {});

// The guarantees of a map: the smallest number of common landmarks of any region, and the stations that see
// fewer than k.
struct SizeGuarantee {
  int min_common_landmarks = 0;
  int num_stations_below_k = 0;
};
SizeGuarantee GuaranteeOf(const MapRows& rows);

}  // namespace cairn::emit_map
