#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/progress.h"
#include "core/blocks/map_rows.h"
#include "core/promise/expected_matches.h"
#include "core/promise/landmark_order.h"
#include "core/promise/landmark_sights.h"
#include "core/promise/promise_model.h"
#include "core/world/feature_class.h"
#include "stages/emit_map/choose/leave_out_images.h"
#include "stages/emit_map/choose/make_promises.h"

namespace cairn::emit_map {

// Makes the whole map, without its self-test, with the landmarks that `keep` marks (per class of these), this
// many bits per descriptor value and, where they are given, these promises: EmitMap and all that is added to
// a map after it.  Called from several threads at once.
using EmitKept = std::function<Result<MapRows>(const Classes& classes, const std::vector<char>& keep,
                                               int descriptor_bits, const Promises* promises)>;

// Per class, whether it is among these.
std::vector<char> MarkThese(const std::vector<size_t>& chosen, size_t num_classes);

// Maps of parts of the survey, each tried on survey images that it lacks (leave_out_images.h).  A map has the
// first n classes of LandmarkOrder.
class Trials {
 public:
  // At most about `max_num_left_out` images are tried, times the number of sessions up to three: more
  // sessions localize better, and what less does to that is seen in few images.  `may_keep`: per class,
  // whether a map may have it; `first`: positions of those that come first in LandmarkOrder.  Advances
  // `progress` by kMaxNumRounds.  Errors: those of ChooseLeftOut,
  // LeaveOutImages; Cancelled.
  static Result<Trials> Make(const Classes& classes, const std::vector<char>& may_keep,
                             const std::vector<size_t>& first, const std::string& matches_path,
                             size_t max_num_left_out, const LeftOutLimits& limits, const EmitKept& emit,
                             int num_threads, Progress& progress);

  // One result per tried image; images of a part that has no class at all are not localized.  What was
  // expected of each image is kept beside it.
  Result<LeftOutTrial> Try(size_t n, int descriptor_bits);

  // Of all maps tried so far: what was expected of each image, and how it fared.
  const std::vector<PromiseTrial>& fared() const { return fared_; }

 private:
  struct Part {
    std::unique_ptr<LeftOutSurvey> survey;
    std::vector<size_t> pool;
    std::optional<LandmarkOrder> order;
    std::optional<LandmarkSights> sights;
    double depth = 0;
    std::vector<std::vector<ClassMatch>> matches;  // per tried image
  };

  Trials(const EmitKept& emit, const LeftOutLimits& limits, int num_threads)
      : emit_(&emit), limits_(limits), num_threads_(num_threads) {}

  // Several parts at once, each with its share of the threads; the first part's error.
  Status ForParts(const std::function<Status(Part& part, size_t p, int num_threads)>& body);

  const EmitKept* emit_;
  LeftOutLimits limits_;
  int num_threads_;
  std::vector<Part> parts_;
  std::vector<PromiseTrial> fared_;
};

}  // namespace cairn::emit_map
