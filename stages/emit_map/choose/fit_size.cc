#include "stages/emit_map/choose/fit_size.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>

#include "core/blocks/map_rows.h"
#include "stages/emit_map/choose/fewest_size.h"

namespace cairn::emit_map {
namespace {

namespace fs = std::filesystem;

constexpr std::array<int, 4> kBits = {5, 4, 3, 2};
// Fewer bits must be better by this much: with few bits, other things look like landmarks.
constexpr double kClearMargin = 0.03;
// The search for a size ends at this part of the limit.
constexpr double kNearLimitRatio = 0.995;
constexpr int kMaxNumMeasurements = 10;
// So often a map with its promise is made; the first is mostly a little too large.
constexpr int kMaxNumPromises = 4;
constexpr int64_t kPromiseMargin = 200;  // half a per cent
// ChooseFewest tries numbers of landmarks that grow by this factor, and so many more to each side of the
// first that will do.
constexpr double kLadderFactor = 1.3;
constexpr double kFewestLandmarks = 50;
constexpr size_t kNumBeside = 2;
// With two, as many images were localized with the same errors on five surveys, but by fewer matches: the
// demo lost two of its hardest held-out images.
constexpr int kFewestBits = 3;
// Placeholders for figures of the self-test, which are added later: more than check_map has, with
// longer names.
constexpr int kNumFigures = 30;
constexpr size_t kFigureNameBytes = 26;
constexpr size_t kCheckMapOptionsBytes = 2048, kLeaveOutOptionsBytes = 64;
constexpr int kMaxNumBins = 8;  // of CalibrationCurve

// Bytes of the file including its self-test.
Result<int64_t> SealedBytes(MapRows rows, const std::string& scratch_path) {
  for (int i = 0; i < kNumFigures; ++i)
    rows.self_test[fmt::format("{:a>{}}", i, kFigureNameBytes)] = 1.0 / (i + 3);
  rows.stage_options["check_map"] = std::string(kCheckMapOptionsBytes, 'a');
  rows.stage_options["leave_out"] = std::string(kLeaveOutOptionsBytes, 'a');
  if (rows.findings.promise) {
    rows.findings.promise->held_out.clear();
    for (int i = 0; i < kMaxNumBins; ++i)
      rows.findings.promise->held_out.push_back({1.0 / (kMaxNumBins + 1 - i), 1000, 1000, 0.9});
  }
  rows.findings.self_test_regions.clear();
  for (RegionIdx region = kOutsideRegions; region < static_cast<RegionIdx>(rows.regions.size()); ++region)
    rows.findings.self_test_regions.push_back(
        {region, 1000, 1000, 1000, RegionSelfTest::Errors{0.1, 0.2, 0.3, 0.4}});
  CAIRN_RETURN_IF_ERROR(WriteMapRows(rows, scratch_path));
  std::error_code error;
  const auto num_bytes = static_cast<int64_t>(fs::file_size(scratch_path, error));
  fs::remove(scratch_path, error);
  return num_bytes;
}

class SizeFitter {
 public:
  SizeFitter(const EmitKept& emit, std::string scratch_path, Progress& progress)
      : emit_(emit), scratch_path_(std::move(scratch_path)), progress_(progress) {}

  // The largest number of first classes of `order` that fit into so many bytes; 0: not even one.
  Result<size_t> MostThatFit(const Classes& classes, const std::vector<size_t>& order, int bits,
                             int64_t max_bytes, int64_t* num_bytes) {
    const auto measure = [&](size_t n) -> Result<int64_t> {
      CAIRN_ASSIGN_OR_RETURN(MapRows rows,
                             emit_(classes, FirstOf(order, n, classes.classes.size()), bits, nullptr));
      return SealedBytes(std::move(rows), scratch_path_);
    };
    CAIRN_ASSIGN_OR_RETURN(int64_t fewest_bytes, measure(1));
    least_bytes_ = std::min(least_bytes_, fewest_bytes);
    if (fewest_bytes > max_bytes) return size_t{0};
    CAIRN_ASSIGN_OR_RETURN(int64_t most_bytes, measure(order.size()));
    *num_bytes = most_bytes;
    if (most_bytes <= max_bytes) return order.size();
    // Bytes grow roughly in proportion: aim a little below the limit, then narrow down.
    size_t fits = 1, too_many = order.size();
    *num_bytes = fewest_bytes;
    for (int i = 0; i < kMaxNumMeasurements && too_many - fits > 1; ++i) {
      if (progress_.Cancelled())
        return MakeError(ErrorCode::kCancelled, "fitting the map's size was stopped");
      const double per_landmark =
          static_cast<double>(most_bytes - fewest_bytes) / static_cast<double>(too_many - fits);
      const double room =
          (1 + kNearLimitRatio) / 2 * static_cast<double>(max_bytes) - static_cast<double>(fewest_bytes);
      const auto step = static_cast<int64_t>(room / per_landmark);
      const size_t n =
          fits + static_cast<size_t>(std::clamp<int64_t>(step, 1, static_cast<int64_t>(too_many - fits) - 1));
      CAIRN_ASSIGN_OR_RETURN(const int64_t bytes, measure(n));
      if (bytes > max_bytes) {
        too_many = n;
        most_bytes = bytes;
        continue;
      }
      fits = n;
      *num_bytes = fewest_bytes = bytes;
      if (static_cast<double>(bytes) >= kNearLimitRatio * static_cast<double>(max_bytes)) break;
    }
    return fits;
  }

  // Per class, whether it is among the first n of an order.
  static std::vector<char> FirstOf(const std::vector<size_t>& order, size_t n, size_t num_classes) {
    std::vector<char> keep(num_classes, 0);
    for (size_t i = 0; i < std::min(n, order.size()); ++i) keep[order[i]] = 1;
    return keep;
  }

  int64_t least_bytes() const { return least_bytes_; }

 private:
  const EmitKept& emit_;
  std::string scratch_path_;
  Progress& progress_;
  int64_t least_bytes_ = std::numeric_limits<int64_t>::max();
};

std::vector<size_t> Pool(const std::vector<char>& may_keep) {
  std::vector<size_t> pool;
  for (size_t i = 0; i < may_keep.size(); ++i) {
    if (may_keep[i] != 0) pool.push_back(i);
  }
  return pool;
}

// Whether more images are localized, or as many by a clearly wider margin.
bool IsBetter(const LeftOutTrial& a, const LeftOutTrial& b) {
  if (a.NumRight() != b.NumRight()) return a.NumRight() > b.NumRight();
  return a.MeanMargin() > b.MeanMargin() + kClearMargin;
}

// Ascending numbers of bits, the last of which is the most that may be used.
std::vector<int> FewestBitsFirst(int most) {
  std::vector<int> bits_to_try;
  for (int bits = std::min(kFewestBits, most); bits < most; ++bits) bits_to_try.push_back(bits);
  bits_to_try.push_back(most);
  return bits_to_try;
}

// Numbers of landmarks to try, ascending, from so many on; the last is all.
std::vector<size_t> Ladder(size_t num_classes, size_t least) {
  std::vector<size_t> sizes;
  for (double size = std::max(kFewestLandmarks, static_cast<double>(least));
       size < static_cast<double>(num_classes); size *= kLadderFactor)
    sizes.push_back(static_cast<size_t>(size));
  sizes.push_back(num_classes);
  return sizes;
}

// The fewest landmarks that will do, of what is found by bisection and beside it; nothing where not even the
// last size will do.  What chance decides is known when more sizes have been tried: then the bisection is
// made anew, of what is known and what it still asks for.
Result<std::optional<size_t>> FewestOf(const std::vector<size_t>& sizes, const SizeTerms& terms,
                                       const std::function<Result<TriedSize>(size_t)>& try_size) {
  std::map<size_t, TriedSize> tried;  // by index of sizes
  const auto try_once = [&](size_t i) -> Status {
    if (!tried.contains(i)) {
      CAIRN_ASSIGN_OR_RETURN(tried[i], try_size(sizes[i]));
    }
    return Ok();
  };
  const auto trials = [&] {
    std::vector<TriedSize> ascending;
    for (const auto& [i, size] : tried) ascending.push_back(size);
    return WithoutChance(ascending);
  };
  const auto does = [&](size_t i) {
    const auto position = static_cast<size_t>(std::distance(tried.begin(), tried.find(i)));
    return FewestThatDo({trials()[position]}, terms).has_value();
  };
  size_t num_tried = 0;
  do {
    num_tried = tried.size();
    size_t too_few = 0, enough = sizes.size();
    while (too_few < enough) {
      const size_t middle = (too_few + enough) / 2;
      CAIRN_RETURN_IF_ERROR(try_once(middle));
      if (does(middle)) {
        enough = middle;
      } else {
        too_few = middle + 1;
      }
    }
    if (enough == sizes.size()) return std::optional<size_t>();
    const size_t last = std::min(sizes.size() - 1, enough + kNumBeside);
    for (size_t i = enough - std::min(enough, kNumBeside); i <= last; ++i) CAIRN_RETURN_IF_ERROR(try_once(i));
  } while (tried.size() > num_tried);
  return FewestThatDo(trials(), terms);
}

}  // namespace

Result<FittedSize> FitSize(const Classes& classes, const std::vector<char>& may_keep,
                           const std::string& matches_path, const EmitKept& emit,
                           const FitSizeOptions& options, const std::string& scratch_path, int num_threads,
                           Progress& progress) {
  SizeFitter fitter(emit, scratch_path, progress);
  const std::vector<size_t> pool = Pool(may_keep);
  std::vector<int> bits_tried;
  for (const int bits : kBits) {
    if (bits < options.descriptor_bits) bits_tried.push_back(bits);
  }
  bits_tried.insert(bits_tried.begin(), options.descriptor_bits);

  std::optional<MatchModel> model(std::in_place, classes, ViewOptions(), num_threads);
  const std::vector<size_t> order = OrderOf(classes, *model, pool, {}, num_threads).First(pool.size());
  const PromiseMaker maker(classes, *model, num_threads);
  model.reset();  // it takes as much memory as the promises
  std::vector<size_t> num_that_fit;
  int64_t num_bytes = 0;
  for (const int bits : bits_tried) {
    CAIRN_ASSIGN_OR_RETURN(const size_t n,
                           fitter.MostThatFit(classes, order, bits, options.max_bytes, &num_bytes));
    num_that_fit.push_back(n);
    if (n == pool.size()) break;  // all fit: no reason for fewer bits
  }
  if (*std::max_element(num_that_fit.begin(), num_that_fit.end()) == 0) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "emit_map: max_bytes = {}, but {} {} with a single landmark: the rest are {} images and "
                     "their appearance graph, stations, options and findings",
                     options.max_bytes, kLeastPossible, fitter.least_bytes(), classes.images.size());
  }

  FittedSize fitted;
  fitted.descriptor_bits = bits_tried[0];
  if (num_that_fit[0] == pool.size()) {  // nothing has to be chosen
    fitted.keep = may_keep;
    fitted.num_bytes = num_bytes;
    return fitted;
  }

  progress.Begin("trying what to keep", static_cast<int64_t>(kMaxNumRounds + 1 + num_that_fit.size()),
                 "steps");
  CAIRN_ASSIGN_OR_RETURN(Trials trials,
                         Trials::Make(classes, may_keep, {}, matches_path, options.max_num_left_out,
                                      options.limits, emit, num_threads, progress));
  CAIRN_ASSIGN_OR_RETURN(fitted.trial_of_all, trials.Try(pool.size(), options.descriptor_bits));
  progress.Advance();
  size_t best = num_that_fit.size();
  for (size_t i = 0; i < num_that_fit.size(); ++i) {
    if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "choosing landmarks was stopped");
    progress.Advance();
    if (num_that_fit[i] == 0) continue;
    CAIRN_ASSIGN_OR_RETURN(const LeftOutTrial trial, trials.Try(num_that_fit[i], bits_tried[i]));
    if (best < num_that_fit.size() && !IsBetter(trial, fitted.trial)) continue;
    best = i;
    fitted.trial = trial;
    fitted.descriptor_bits = bits_tried[i];
  }
  progress.End();
  // What the promise and its regions take is known when they are made: then fewer landmarks fit.
  int64_t room = options.max_bytes;
  size_t n = num_that_fit[best];
  for (int round = 0; round < kMaxNumPromises && n > 0; ++round) {
    fitted.keep = SizeFitter::FirstOf(order, n, classes.classes.size());
    fitted.promises =
        maker.Promise(fitted.keep, PromiseMaker::BasisOf(trials.fared(), options.promise), options.promise);
    CAIRN_ASSIGN_OR_RETURN(MapRows rows,
                           emit(classes, fitted.keep, fitted.descriptor_bits, &*fitted.promises));
    CAIRN_ASSIGN_OR_RETURN(fitted.num_bytes, SealedBytes(std::move(rows), scratch_path));
    if (fitted.num_bytes <= options.max_bytes) return fitted;
    // And a little: regions of fewer landmarks are others, and may take more.
    room -= fitted.num_bytes - options.max_bytes + options.max_bytes / kPromiseMargin;
    CAIRN_ASSIGN_OR_RETURN(n, fitter.MostThatFit(classes, order, fitted.descriptor_bits, room, &num_bytes));
  }
  // There is no room for a promise.
  fitted.promises.reset();
  CAIRN_ASSIGN_OR_RETURN(
      n, fitter.MostThatFit(classes, order, fitted.descriptor_bits, options.max_bytes, &fitted.num_bytes));
  fitted.keep = SizeFitter::FirstOf(order, n, classes.classes.size());
  return fitted;
}

Result<FittedSize> ChooseFewest(const Classes& classes, const std::string& matches_path, const EmitKept& emit,
                                const FitSizeOptions& options, int num_threads, Progress& progress,
                                const std::vector<size_t>& first) {
  FittedSize fitted{.keep = std::vector<char>(classes.classes.size(), 1),
                    .descriptor_bits = options.descriptor_bits};
  const std::vector<size_t> sizes = Ladder(classes.classes.size(), first.size());
  const auto num_halvings = static_cast<size_t>(std::ceil(std::log2(sizes.size() + 1)));
  progress.Begin("trying how few landmarks will do",
                 static_cast<int64_t>(kMaxNumRounds + 2 * num_halvings + 2 * kNumBeside + 3), "steps");
  Result<Trials> trials = Trials::Make(classes, fitted.keep, first, matches_path, options.max_num_left_out,
                                       options.limits, emit, num_threads, progress);
  if (!trials.ok()) {
    if (trials.error().code != ErrorCode::kNoData) return trials.error();
    progress.End();
    return fitted;
  }
  const auto attempt = [&](size_t n, int bits) -> Result<LeftOutTrial> {
    if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "choosing landmarks was stopped");
    Result<LeftOutTrial> trial = trials->Try(n, bits);
    progress.Advance();
    return trial;
  };
  CAIRN_ASSIGN_OR_RETURN(fitted.trial_of_all, attempt(classes.classes.size(), options.descriptor_bits));
  fitted.trial = fitted.trial_of_all;
  if (fitted.trial_of_all.NumRight() < kMinNumRight) {
    progress.End();
    return fitted;
  }
  // Half an image is lost by chance: sizes around one that localizes them all pull it down.
  const double num_right = fitted.trial_of_all.NumRight();
  const double may_be_lost = std::max(0.5, std::round((1 - options.min_recall_ratio) * num_right));
  const SizeTerms terms{.min_num_right = num_right - may_be_lost,
                        .max_log_error_ratio = std::log(options.max_error_ratio)};
  size_t num_kept = classes.classes.size();
  for (const int bits :
       first.empty() ? FewestBitsFirst(options.descriptor_bits) : std::vector<int>{options.descriptor_bits}) {
    const auto try_size = [&](size_t n) -> Result<TriedSize> {
      LeftOutTrial trial = fitted.trial_of_all;
      if (n != classes.classes.size() || bits != options.descriptor_bits) {
        CAIRN_ASSIGN_OR_RETURN(trial, attempt(n, bits));
      }
      TriedSize tried{.trial = {n, trial.NumRight(),
                                std::log(ErrorRatio(trial, fitted.trial_of_all, options.least_error_m))},
                      .is_right = {}};
      for (const LeftOutResult& image : trial.images) tried.is_right.push_back(image.is_right ? 1 : 0);
      return tried;
    };
    CAIRN_ASSIGN_OR_RETURN(const std::optional<size_t> fewest, FewestOf(sizes, terms, try_size));
    if (!fewest) continue;
    num_kept = *fewest;
    fitted.descriptor_bits = bits;
    CAIRN_ASSIGN_OR_RETURN(fitted.trial, attempt(num_kept, bits));
    break;
  }
  // The maps that were tried make room for what the whole survey takes.
  const PromiseBasis basis = PromiseMaker::BasisOf(Trials(*std::move(trials)).fared(), options.promise);
  std::optional<MatchModel> model(std::in_place, classes, ViewOptions(), num_threads);
  const std::vector<size_t> chosen =
      num_kept < classes.classes.size()
          ? OrderOf(classes, *model, Pool(fitted.keep), first, num_threads).First(num_kept)
          : Pool(fitted.keep);
  const PromiseMaker maker(classes, *model, num_threads);
  model.reset();  // it takes as much memory as the promises
  fitted.keep = maker.Complete(chosen, basis.model, options.promise);
  fitted.promises = maker.Promise(fitted.keep, basis, options.promise);
  progress.Advance();
  progress.End();
  return fitted;
}

SizeGuarantee GuaranteeOf(const MapRows& rows) {
  SizeGuarantee guarantee;
  for (size_t i = 0; i < rows.regions.size(); ++i) {
    const int num = static_cast<int>(rows.regions[i].landmarks.size());
    guarantee.min_common_landmarks = i == 0 ? num : std::min(guarantee.min_common_landmarks, num);
  }
  const std::vector<int> num_seen = LandmarksSeenAt(rows);
  guarantee.num_stations_below_k = static_cast<int>(
      std::count_if(num_seen.begin(), num_seen.end(), [&](int num) { return num < rows.k; }));
  return guarantee;
}

}  // namespace cairn::emit_map
