#include "stages/emit_map/command.h"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include <spdlog/spdlog.h>

#include "core/capture/sessions.h"
#include "core/features/features.h"
#include "core/files/database.h"
#include "core/files/file.h"
#include "core/files/temporary.h"
#include "core/line/program_version.h"
#include "core/plan/views_database.h"
#include "core/world/dropped_items.h"
#include "stages/emit_map/choose/choose_after.h"
#include "stages/emit_map/choose/fit_size.h"
#include "stages/emit_map/count_drops.h"
#include "stages/emit_map/emit_map.h"
#include "stages/emit_map/learn_fix_noise.h"
#include "stages/emit_map/learn_visual_errors.h"
#include "stages/emit_map/model_landmarks.h"
#include "stages/emit_map/previous/settle_rows.h"
#include "stages/emit_map/quantize_descriptors.h"
#include "stages/emit_map/survey_files.h"

namespace cairn::emit_map {
namespace {

struct Arguments {
  std::string matches_path;
  SurveyFiles files;
  std::string views_path;
  std::string frame_path;
  std::string sessions_path;
  std::string name;
  std::vector<std::string> stage_options;  // "STAGE=FILE.toml"
  std::string output_path;
  EmitMapOptions options;
  OptionArguments option_arguments;
};

// Images that extract-features rejected: from its table in features.db and files made from it.
Result<int64_t> CountRejects(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(SQLite::Database database, OpenDatabaseReadOnly(path));
  return WithDatabaseErrors(path, [&]() -> Result<int64_t> {
    if (!HasTable(database, "cairn_rejects")) return int64_t{0};
    return database.execAndGet("SELECT count(*) FROM cairn_rejects").getInt64();
  });
}

// The origin and the frame of a map, which do not depend on the landmarks that it keeps.
Result<MapHead> ReadProvenance(const Arguments& arguments, uint64_t seed) {
  MapHead head;
  head.name = arguments.name;
  head.writer = std::string("cairn ") + ProgramVersion();
  head.seed = seed;
  for (const auto& [name, path] : {std::pair("classes.db", arguments.files.classes_path),
                                   std::pair("world.db", arguments.files.world_path),
                                   std::pair("regions.db", arguments.files.regions_path),
                                   std::pair("vocabulary.db", arguments.files.vocabulary_path)}) {
    CAIRN_ASSIGN_OR_RETURN(head.input_hashes[name], HashFile(path));
  }
  if (!arguments.files.appearance_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(head.input_hashes["appearance.db"], HashFile(arguments.files.appearance_path));
  }
  if (!arguments.views_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(head.input_hashes["views.db"], HashFile(arguments.views_path));
  }
  if (!arguments.options.previous.empty()) {
    CAIRN_ASSIGN_OR_RETURN(head.input_hashes["previous.cairn"], HashFile(arguments.options.previous));
  }
  for (const std::string& text : arguments.stage_options) {
    const size_t equals = text.find('=');
    if (equals == 0 || equals == std::string::npos) {
      return MakeError(ErrorCode::kInvalidArgument, "--stage-options {}: expected STAGE=FILE.toml", text);
    }
    CAIRN_ASSIGN_OR_RETURN(head.stage_options[text.substr(0, equals)], ReadFile(text.substr(equals + 1)));
  }
  if (!arguments.frame_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(head.frame, ReadCaptureFrame(arguments.frame_path));
  }
  if (!arguments.sessions_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(head.sessions, ReadSessionsText(arguments.sessions_path));
  }
  return head;
}

// What all earlier stages have dropped.  Images that were not read have no image_id and count in the
// total only.
Result<std::vector<DroppedItem>> ReadAllDropped(const Arguments& arguments) {
  std::vector<DroppedItem> all;
  const auto add = [&](const std::string& path, const char* table) -> Status {
    if (path.empty() || !IsSqliteFile(path)) return Ok();
    CAIRN_ASSIGN_OR_RETURN(std::vector<DroppedItem> items, ReadDroppedItems(path, table));
    std::move(items.begin(), items.end(), std::back_inserter(all));
    return Ok();
  };
  CAIRN_RETURN_IF_ERROR(add(arguments.matches_path, kColmapDroppedItemsTable));
  for (const std::string& path :
       {arguments.files.classes_path, arguments.files.world_path, arguments.files.regions_path})
    CAIRN_RETURN_IF_ERROR(add(path, kDroppedItemsTable));
  if (arguments.matches_path.empty()) return all;
  CAIRN_ASSIGN_OR_RETURN(const int64_t num_rejects, CountRejects(arguments.matches_path));
  all.insert(all.end(), num_rejects, {.reason = DropReason::kUnreadable});
  return all;
}

// What emit-map reads.
struct Inputs : SurveyData {
  std::optional<Views> views;
  MapHead provenance;
  std::vector<DroppedItem> dropped;
  std::optional<PreviousMap> previous;
};

Result<Inputs> ReadInputs(const Arguments& arguments, uint64_t seed) {
  Inputs inputs;
  CAIRN_ASSIGN_OR_RETURN(static_cast<SurveyData&>(inputs), ReadSurveyFiles(arguments.files));
  if (!arguments.views_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(inputs.views, ReadViews(arguments.views_path));
  }
  CAIRN_ASSIGN_OR_RETURN(inputs.provenance, ReadProvenance(arguments, seed));
  CAIRN_ASSIGN_OR_RETURN(inputs.dropped, ReadAllDropped(arguments));
  if (!arguments.options.previous.empty()) {
    CAIRN_ASSIGN_OR_RETURN(MapRows rows, ReadMapRows(arguments.options.previous));
    Result<PreviousMatches> matches = MatchPrevious(inputs.classes, rows, arguments.options.previous);
    if (matches.ok()) {
      // Of mostly other images, landmarks have other bytes anyway: each is where the whole survey has it.
      if (IsMostlyNew(inputs.classes, rows)) std::fill(matches->holds.begin(), matches->holds.end(), 0);
      inputs.previous = {std::move(rows), *std::move(matches)};
    } else {  // no reason to lose what the stages before took hours for
      spdlog::warn("previous = {}; the map is made anew", matches.error().message);
    }
  }
  return inputs;
}

Status AddDrops(const std::vector<DroppedItem>& dropped, const Inputs& inputs, MapRows* rows) {
  std::vector<DroppedItem> counted = dropped;
  if (rows->algorithm == kPromiseAlgorithm) {  // what stage 5's regions leave out is in these all the same
    std::erase_if(counted, [](const DroppedItem& item) {
      return std::string_view(DescribeDropReason(item.reason).stage) == "decompose_regions";
    });
  }
  CAIRN_ASSIGN_OR_RETURN(rows->findings.drops, CountDrops(inputs.classes, inputs.parts.world, counted));
  for (const DroppedItem& item : counted) {
    if (DescribeDropReason(item.reason).kind == DropKind::kStation)
      rows->stations[item.item_id].is_covered = false;
  }
  if (inputs.previous) SettleDrops(inputs.previous->rows, rows);
  return Ok();
}

// Adds the classes that are left out of those that may be kept to what earlier stages dropped.
std::vector<DroppedItem> DroppedWith(const Inputs& inputs, const std::vector<char>& may_keep,
                                     const std::vector<char>& keep, DropReason reason) {
  std::vector<DroppedItem> dropped = inputs.dropped;
  for (size_t i = 0; i < keep.size(); ++i) {
    if (may_keep[i] != 0 && keep[i] == 0)
      dropped.push_back({.reason = reason, .item_id = inputs.classes.classes[i].class_id});
  }
  return dropped;
}

// The whole map except its self-test.  `classes` and `parts` may be those of a part of the survey, which no
// earlier map is of.
Result<MapRows> MakeRows(const Inputs& inputs, const Classes& classes, const SurveyParts& parts,
                         EmitMapOptions options, const std::vector<char>* keep, const Promises* promises,
                         int num_threads) {
  const bool is_whole = classes.images.size() == inputs.classes.images.size();
  const PreviousMap* previous = is_whole && inputs.previous ? &*inputs.previous : nullptr;
  CAIRN_ASSIGN_OR_RETURN(MapRows rows,
                         EmitMap(classes, parts.world, parts.decomposition, inputs.vocabulary, options,
                                 parts.appearance ? &*parts.appearance : nullptr, keep, promises, previous));
  rows.name = inputs.provenance.name;
  rows.writer = inputs.provenance.writer;
  rows.instruction_set = inputs.provenance.instruction_set;
  rows.seed = inputs.provenance.seed;
  rows.input_hashes = inputs.provenance.input_hashes;
  rows.stage_options = inputs.provenance.stage_options;
  options.previous.clear();  // its hash is among the inputs
  rows.stage_options["emit_map"] = OptionsToml(DescribeOptions(&options));
  rows.frame = inputs.provenance.frame;
  rows.sessions = inputs.provenance.sessions;
  AddChanges(inputs.classes, &rows);
  if (is_whole) {  // the map itself, not one to be tried
    if (const std::optional<FixNoise> noise = LearnFixNoise(classes, rows, num_threads)) {
      rows.covariance_scale = noise->covariance_scale;
      rows.keypoint_correlation = noise->keypoint_correlation;
    }
  }
  if (options.visual_map) {
    CAIRN_ASSIGN_OR_RETURN(rows.visual_map, ModelLandmarks(classes, rows, options, num_threads));
    CAIRN_ASSIGN_OR_RETURN(rows.visual_map.errors,
                           LearnVisualErrors(classes, rows, rows.visual_map, num_threads));
  }
  if (inputs.views) CAIRN_RETURN_IF_ERROR(AddViews(*inputs.views, options.view_regions, &rows));
  if (previous != nullptr) KeepClassIds(classes, previous->rows, previous->matches, &rows);
  return rows;
}

double LeastErrorM(const EmitMapOptions& options) {
  return options.least_error_ratio * options.left_out_max_error_m;
}

std::string RecallText(const FittedSize& fitted, const EmitMapOptions& options, const CaptureFrame& frame) {
  if (fitted.trial_of_all.NumTried() == 0) return "no survey image was left out to try it on";
  const double least_error_m = LeastErrorM(options);
  return fmt::format(
      "of {} left-out survey images {} are localized, {} with everything; median error {}, {} with "
      "everything; image by image {:.2f} times as large, where less than {} counts as that",
      fitted.trial.NumTried(), fitted.trial.NumRight(), fitted.trial_of_all.NumRight(),
      ShortLength(frame, fitted.trial.MedianErrorM()), ShortLength(frame, fitted.trial_of_all.MedianErrorM()),
      ErrorRatio(fitted.trial, fitted.trial_of_all, least_error_m), ShortLength(frame, least_error_m));
}

std::string GuaranteeText(const MapRows& rows, const FittedSize& fitted, const EmitMapOptions& options) {
  if (options.max_bytes == 0) {
    return fmt::format("emit_map: the fewest landmarks: {} bits a descriptor value; {}\n",
                       fitted.descriptor_bits, RecallText(fitted, options, rows.frame));
  }
  if (fitted.promises) {
    return fmt::format("emit_map: at most {} bytes: {} bits a descriptor value; {}\n", options.max_bytes,
                       fitted.descriptor_bits, RecallText(fitted, options, rows.frame));
  }
  const SizeGuarantee guarantee = GuaranteeOf(rows);
  return fmt::format(
      "emit_map: at most {} bytes: {} bits a descriptor value; at least {} common landmarks in every region; "
      "{} of {} stations see fewer than k = {}; {}\n",
      options.max_bytes, fitted.descriptor_bits, guarantee.min_common_landmarks,
      guarantee.num_stations_below_k, rows.stations.size(), rows.k,
      fitted.trial_of_all.NumTried() == 0 ? "everything fits" : RecallText(fitted, options, rows.frame));
}

std::string FixNoiseText(const MapRows& rows) {
  if (rows.covariance_scale == 0) {
    return "emit_map: too few survey images to leave runs of them out: how far fixes are off is taken from "
           "how "
           "keypoints err\n";
  }
  const auto wider = [&](double num_inliers) {
    return std::sqrt(rows.covariance_scale * (1 + 0.5 * num_inliers * rows.keypoint_correlation));
  };
  return fmt::format(
      "emit_map: left-out runs of the survey: a fix of 30 landmarks is {:.1f} times as far off as "
      "independent "
      "keypoints would make it, one of 300 {:.1f} times; its covariance says so\n",
      wider(30), wider(300));
}

std::string PromiseText(const MapPromise& promise, const CaptureFrame& frame) {
  const PromiseTerms& terms = promise.terms;
  return fmt::format(
      "emit_map: the promise: {:.0f} % of the images find at least {} landmarks and are localized within "
      "{:.3g} "
      "{}, {:.3g} deg; kept at {} of {} places and headings; no map with fewer than {} landmarks keeps it at "
      "all of these\n",
      100 * terms.probability, terms.min_matches, terms.max_error_m, LengthUnit(frame), terms.max_error_deg,
      promise.NumKept(), promise.nodes.size(), promise.landmarks_lower_bound);
}

PromiseOptions PromiseOptionsOf(const EmitMapOptions& options) {
  return {.terms = {.min_matches = options.promise_matches,
                    .max_error_m = options.left_out_max_error_m,
                    .max_error_deg = options.left_out_max_error_deg,
                    .probability = options.promise_probability},
          .max_region_landmarks = static_cast<size_t>(options.max_region_landmarks)};
}

std::string AfterText(const MapRows& rows, const PreviousMap& previous) {
  std::set<ClassId> before;
  for (const MapLandmark& landmark : previous.rows.landmarks) before.insert(landmark.class_id);
  const auto num_kept = static_cast<size_t>(
      std::count_if(rows.landmarks.begin(), rows.landmarks.end(),
                    [&](const MapLandmark& landmark) { return before.contains(landmark.class_id); }));
  const auto num_moved = std::count(previous.matches.holds.begin(), previous.matches.holds.end(), 0) -
                         std::count(previous.matches.landmark_of_class.begin(),
                                    previous.matches.landmark_of_class.end(), kNotBefore);
  return fmt::format(
      "emit_map: after the previous map: of its {} landmarks {} stay, {} of them with another place or look; "
      "{} are new\n",
      previous.rows.landmarks.size(), num_kept, num_moved, rows.landmarks.size() - num_kept);
}

// With the earlier map's landmarks, their bits; a bit is a bit.
int BitsAfter(const EmitMapOptions& options, const std::vector<size_t>& first, const Inputs& inputs) {
  if (inputs.classes.descriptor_kind.type == DescriptorType::kBinary) return 1;
  if (first.empty() || !inputs.previous->rows.descriptor_code) return options.descriptor_bits;
  return std::min(options.descriptor_bits, BitsOfStep(inputs.previous->rows.descriptor_code->step));
}

// The rows of the map with the landmarks that trials choose, and what they found.
Result<std::pair<MapRows, std::string>> MakeRowsByTrial(const Arguments& arguments, const Inputs& inputs,
                                                        const CommandEnvironment& environment) {
  const EmitMapOptions& options = arguments.options;
  if (arguments.matches_path.empty()) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "emit_map: {} needs --matches: landmarks are chosen by the features of the survey's images; "
        "landmarks = \"all\" and \"regions\" without max_bytes do not",
        options.max_bytes > 0 ? "max_bytes" : "landmarks = \"fewest\"");
  }
  CAIRN_ASSIGN_OR_RETURN(const std::vector<char> may_keep, KeptClasses(inputs.classes, inputs.parts.world,
                                                                       inputs.parts.decomposition, options));
  const DropReason reason = options.max_bytes > 0 ? DropReason::kOverBudget : DropReason::kNotNeeded;
  const EmitKept emit = [&](const Classes& classes, const std::vector<char>& keep, int descriptor_bits,
                            const Promises* promises) -> Result<MapRows> {
    const bool is_whole = classes.images.size() == inputs.classes.images.size();
    EmitMapOptions of_this = options;
    of_this.descriptor_bits = descriptor_bits;
    of_this.visual_map = options.visual_map && is_whole;
    CAIRN_ASSIGN_OR_RETURN(MapRows rows,
                           MakeRows(inputs, classes, is_whole ? inputs.parts : PartsOf(classes, inputs.parts),
                                    of_this, &keep, promises, environment.num_threads));
    if (is_whole) CAIRN_RETURN_IF_ERROR(AddDrops(DroppedWith(inputs, may_keep, keep, reason), inputs, &rows));
    return rows;
  };
  const bool is_after = inputs.previous && options.max_bytes == 0;
  if (is_after && inputs.previous->rows.findings.promise &&
      !IsMostlyNew(inputs.classes, inputs.previous->rows)) {
    const ChosenAfter chosen =
        ChooseAfter(inputs.classes, may_keep, inputs.previous->rows, inputs.previous->matches,
                    PromiseOptionsOf(options), environment.num_threads);
    CAIRN_ASSIGN_OR_RETURN(MapRows rows,
                           emit(inputs.classes, chosen.keep, options.descriptor_bits, &chosen.promises));
    std::string text = AfterText(rows, *inputs.previous) + PromiseText(chosen.promises.findings, rows.frame);
    return std::pair(std::move(rows), std::move(text));
  }
  const std::vector<size_t> first =
      is_after ? StillThere(may_keep, inputs.previous->matches) : std::vector<size_t>();
  const FitSizeOptions fit_options{.max_bytes = options.max_bytes,
                                   .descriptor_bits = BitsAfter(options, first, inputs),
                                   .limits = {options.left_out_max_error_m, options.left_out_max_error_deg},
                                   .min_recall_ratio = options.min_recall_ratio,
                                   .max_error_ratio = options.max_error_ratio,
                                   .least_error_m = LeastErrorM(options),
                                   .promise = PromiseOptionsOf(options)};
  CAIRN_ASSIGN_OR_RETURN(
      const FittedSize fitted,
      options.max_bytes > 0
          ? FitSize(inputs.classes, may_keep, arguments.matches_path, emit, fit_options,
                    TemporaryPath(arguments.output_path), environment.num_threads, *environment.progress)
          : ChooseFewest(inputs.classes, arguments.matches_path, emit, fit_options, environment.num_threads,
                         *environment.progress, first));
  CAIRN_ASSIGN_OR_RETURN(MapRows rows, emit(inputs.classes, fitted.keep, fitted.descriptor_bits,
                                            fitted.promises ? &*fitted.promises : nullptr));
  std::string text = GuaranteeText(rows, fitted, arguments.options);
  if (is_after) text = AfterText(rows, *inputs.previous) + text;
  if (fitted.promises) text += PromiseText(fitted.promises->findings, rows.frame);
  return std::pair(std::move(rows), std::move(text));
}

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  EmitMapOptions checked = arguments.options;
  CAIRN_RETURN_IF_ERROR(CheckOptions(DescribeOptions(&checked)));
  const bool is_by_trial = arguments.options.max_bytes > 0 || arguments.options.landmarks == "fewest";
  if (!is_by_trial) {
    CAIRN_RETURN_IF_ERROR(arguments.option_arguments.RefuseGiven(
        {"left_out_max_error_m", "left_out_max_error_deg", "promise_matches", "promise_probability",
         "max_region_landmarks"},
        "is only read where landmarks is fewest or max_bytes is not 0; leave it out"));
  }
  CAIRN_RETURN_IF_ERROR(CheckMemoryForSurvey(is_by_trial ? "choosing the landmarks" : "making a map",
                                             arguments.files, is_by_trial, environment.memory_mib));
  CAIRN_ASSIGN_OR_RETURN(const Inputs inputs, ReadInputs(arguments, environment.seed));
  const DescriptorKind& kind = inputs.classes.descriptor_kind;
  if (!kind.is_sift() && arguments.options.descriptor_code == "transform") {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "emit_map: descriptor_code = \"transform\" is made for SIFT's cells, and the survey's descriptors "
        "are of the kind '{}'; leave it out",
        ToString(kind));
  }
  MapRows rows;
  std::string guarantee;
  if (is_by_trial) {
    CAIRN_ASSIGN_OR_RETURN(std::tie(rows, guarantee), MakeRowsByTrial(arguments, inputs, environment));
  } else {
    CAIRN_ASSIGN_OR_RETURN(rows, MakeRows(inputs, inputs.classes, inputs.parts, arguments.options, nullptr,
                                          nullptr, environment.num_threads));
    CAIRN_RETURN_IF_ERROR(AddDrops(inputs.dropped, inputs, &rows));
  }
  CAIRN_RETURN_IF_ERROR(WriteMapRows(rows, arguments.output_path));
  environment.report->in = {{"classes", static_cast<int64_t>(inputs.classes.classes.size())}};
  environment.report->out = {
      {"landmarks", static_cast<int64_t>(rows.landmarks.size())},
      {"regions", static_cast<int64_t>(rows.regions.size())},
      {"bytes", static_cast<int64_t>(std::filesystem::file_size(arguments.output_path))}};
  *environment.out << fmt::format(
      "emit_map: {} landmarks of {} classes in {} regions, {} images, {} words, {:.2f} MB\n",
      rows.landmarks.size(), inputs.classes.classes.size(), rows.regions.size(), rows.images.size(),
      rows.vocabulary.num_words(),
      static_cast<double>(std::filesystem::file_size(arguments.output_path)) / 1e6);
  *environment.out << guarantee << FixNoiseText(rows);
  return Ok();
}

}  // namespace

Command EmitMapCommand() {
  auto arguments = std::make_shared<Arguments>();
  return {
      .name = "emit-map",
      .summary = "Put landmarks, regions and vocabulary together into a map (stage 9)",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser
                .Add("--matches", arguments->matches_path,
                     "matches.db, to count which images and pairs were dropped [not counted]")
                .Type("matches.db");
            AddSurveyFiles("appearance.db: which images show the same, and which are kept [not in the map]",
                           parser, &arguments->files);
            parser
                .Add("--views", arguments->views_path,
                     "views.db: the floor plan and its view-invariant regions [not in the map]")
                .Type("views.db");
            parser
                .Add("--frame", arguments->frame_path,
                     "frame.json of the poses: unit and place on the Earth [metres, anywhere]")
                .Type("frame.json");
            parser
                .Add("--sessions", arguments->sessions_path,
                     "sessions.txt of the capture: image SESSION/NAME belongs to that survey [one survey]")
                .Type("sessions.txt");
            parser.Add("--name", arguments->name, "name of the map").Required().Type("NAME");
            parser
                .Add("--stage-options", arguments->stage_options,
                     "STAGE=FILE.toml, once per stage: options to record in the map")
                .Type("STAGE=FILE.toml");
            parser.Add("-o,--output", arguments->output_path, "map to write, not yet sealed")
                .Required()
                .Type("MAP");
            arguments->option_arguments.Add(parser, DescribeOptions(&arguments->options));
          },
      .run = [arguments](const CommandEnvironment& environment) { return Run(*arguments, environment); },
      .may_be_output = {"--name"},
  };
}

}  // namespace cairn::emit_map
