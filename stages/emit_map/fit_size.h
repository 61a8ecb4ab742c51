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

// Chooses what a map of at most so many bytes keeps: which classes, and in how many bits their descriptors,
// so that survey images which the map does not know are localized as often as can be, then as well.
// Candidates are the first classes of OrderByUse for few or many landmarks an image, and fewer bits for more
// landmarks; each is tried on left-out images (leave_out_images.h), and the best one is made from the whole
// survey.
struct FitSizeOptions {
  int64_t max_bytes = 0;    // of the sealed map's file
  int descriptor_bits = 5;  // at most
  int max_num_left_out = 60;
  LeftOutLimits limits;
};

// The whole map, its self-test to come, with the landmarks that `keep` marks (per class of these) in so many
// bits a descriptor's value; EmitMap and all that is put into a map after it.
using EmitKept = std::function<Result<MapRows>(const Classes& classes, const std::vector<char>& keep,
                                               int descriptor_bits)>;

// In the message of the error that no map of so few bytes is possible.
inline constexpr const char* kLeastPossible = "the least possible is";

struct FittedSize {
  std::vector<char> keep;  // per class
  int descriptor_bits = 0;
  int64_t num_bytes = 0;  // with room for the self-test
  // On the left-out images: this choice, and the map of everything that may be kept.  None are tried where
  // everything fits.
  LeftOutTrial trial, trial_of_all;
};

// `may_keep`: per class, what the map would keep without a limit.  `scratch_path`: where a file can be
// written to be measured; none is left.  Errors: InvalidArgument when not even a map of one landmark fits
// (states the least bytes possible, and what takes them); those of LeaveOutImages and `emit`; Cancelled.
Result<FittedSize> FitSize(const Classes& classes, const std::vector<char>& may_keep,
                           const std::string& matches_path, const EmitKept& emit,
                           const FitSizeOptions& options, const std::string& scratch_path, int num_threads,
                           Progress& progress);

// What a map promises: the fewest common landmarks of any region, and the stations that see fewer than k.
struct SizeGuarantee {
  int min_common_landmarks = 0;
  int num_stations_below_k = 0;
};
SizeGuarantee GuaranteeOf(const MapRows& rows);

}  // namespace cairn::emit_map
