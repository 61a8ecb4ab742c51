#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/blocks/map_rows.h"
#include "core/world/feature_class.h"
#include "core/world/world.h"
#include "stages/emit_map/leave_out_images.h"

namespace cairn::emit_map {

// Chooses what a map of limited size keeps: which classes, and how many bits of their descriptors, so that as
// many survey images that are left out of the map as possible are localized, and then as accurately as
// possible.  Candidates are the first classes of OrderByUse for few or many landmarks per image, and fewer
// bits for more landmarks; each is tried on left-out images (leave_out_images.h), and the best one is made
// from the whole survey.
struct FitSizeOptions {
  int64_t max_bytes = 0;    // of the sealed map's file
  int descriptor_bits = 5;  // at most
  int max_num_left_out = 60;
  LeftOutLimits limits;
};

// Makes the whole map, without its self-test, with the landmarks that `keep` marks (per class of these) and
// this many bits per descriptor value: EmitMap and all that is added to a map after it.
using EmitKept = std::function<Result<MapRows>(const Classes& classes, const std::vector<char>& keep,
                                               int descriptor_bits)>;

// Part of the error message where no map of so few bytes is possible.
inline constexpr const char* kLeastPossible = "the least possible is";

struct FittedSize {
  std::vector<char> keep;  // per class
  int descriptor_bits = 0;
  int64_t num_bytes = 0;  // including space for the self-test
  // Trials on the left-out images: of this choice, and of the map of everything that may be kept.  No trials
  // are made where everything fits.
  LeftOutTrial trial, trial_of_all;
};

// `may_keep`: per class, whether the map would keep it without a limit.  `scratch_path`: where a file can be
// written to measure its size; it is removed.  Errors: InvalidArgument when not even a map of one landmark
// fits (states the smallest possible size, and what takes it); those of LeaveOutImages and `emit`; Cancelled.
Result<FittedSize> FitSize(const Classes& classes, const std::vector<char>& may_keep,
                           const std::string& matches_path, const EmitKept& emit,
                           const FitSizeOptions& options, const std::string& scratch_path, int num_threads,
                           Progress& progress);

// The guarantees of a map: the smallest number of common landmarks of any region, and the stations that see
// fewer than k.
struct SizeGuarantee {
  int min_common_landmarks = 0;
  int num_stations_below_k = 0;
};
SizeGuarantee GuaranteeOf(const MapRows& rows);

}  // namespace cairn::emit_map
