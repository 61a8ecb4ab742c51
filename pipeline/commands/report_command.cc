#include "pipeline/commands/commands.h"

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include <spdlog/spdlog.h>
#include <nlohmann/json.hpp>

#include "core/files/file.h"
#include "core/files/output_path.h"
#include "core/line/json_report.h"
#include "core/map/map_file.h"
#include "core/world/feature_class.h"
#include "pipeline/explain/block_bytes.h"
#include "pipeline/report/ambiguity_svg.h"
#include "pipeline/report/floor_svg.h"
#include "pipeline/report/reconstruction_data.h"
#include "pipeline/report/report_data.h"
#include "pipeline/report/report_inputs.h"
#include "pipeline/report/report_page.h"
#include "stages/reconstruct/verdict/draw_verdict.h"
#include "stages/reconstruct/verdict/verdict_json.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kCheckWords = "what cairn check --details wrote";
constexpr const char* kBuildWords = "the report that cairn compile wrote";
constexpr const char* kReconstructionWords = "what the stage reconstruct wrote";
constexpr const char* kDriveWords = "what cairn drive -o wrote";

struct ReportArguments {
  std::string map_path;
  std::string output_path;
  std::string build_report_path;
  std::string build_dir;
  std::string check_path;
  std::string drive_path;
  std::string compare_path;
  std::string svg_dir;
  bool print = false;
};

Error NotWhatWasExpected(const std::string& path, const char* what) {
  return MakeError(ErrorCode::kCorrupt, "{}: its keys or their types are not those of {}", path, what);
}

// Opens a map and checks every byte, as `cairn verify` does: a report must describe the map that was made.
Result<MapFile> OpenWholeMap(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(MapFile file, MapFile::Open(path, {}));
  CAIRN_RETURN_IF_ERROR(CheckFileHash(path));
  return file;
}

std::vector<std::pair<std::string, int64_t>> BytesByKind(const MapFile& file, int64_t num_bytes) {
  const std::map<std::string, int64_t> of_blocks = BytesPerBlockKind(file.directory());
  std::vector<std::pair<std::string, int64_t>> bytes(of_blocks.begin(), of_blocks.end());
  for (const auto& [kind, of_kind] : of_blocks) num_bytes -= of_kind;
  bytes.emplace_back("head, options, findings", num_bytes);
  return bytes;
}

// The given file, or the one beside the map if it is there.
std::string Beside(const ReportArguments& arguments, const std::string& given, const char* extension) {
  if (!given.empty()) return given;
  const fs::path path = fs::path(arguments.map_path).replace_extension(extension);
  std::error_code error;
  return fs::exists(path, error) ? path.string() : "";
}

Result<std::vector<double>> ReprojectionErrors(const std::string& build_dir) {
  std::vector<double> errors;
  std::error_code error;
  if (build_dir.empty() || !fs::exists(build_dir + "/classes.db", error)) return errors;
  CAIRN_ASSIGN_OR_RETURN(const Classes classes, ReadClasses(build_dir + "/classes.db"));
  for (const FeatureClass& feature_class : classes.classes)
    errors.push_back(feature_class.reprojection_error_px);
  return errors;
}

// What was measured with maps of other sizes, if `cairn pareto` was run.
Result<std::vector<ParetoPoint>> ReadPareto(const std::string& path) {
  if (path.empty()) return std::vector<ParetoPoint>();
  CAIRN_ASSIGN_OR_RETURN(const std::string csv, ReadFile(path));
  return ParseParetoCsv(csv, path);
}

// The given check, or that in the build folder if it is still a check of this map.
Result<std::optional<Json>> ReadCheck(const ReportArguments& arguments, const std::string& build_dir,
                                      const MapRows& rows) {
  std::error_code error;
  const bool is_given = !arguments.check_path.empty();
  const std::string path = is_given ? arguments.check_path : build_dir + "/check.json";
  if (!is_given && (build_dir.empty() || !fs::exists(path, error))) return std::optional<Json>();
  CAIRN_ASSIGN_OR_RETURN(std::optional<Json> check, ReadJsonReport(path, kCheckWords));
  if (!check->contains("images")) {
    if (!is_given) return std::optional<Json>();
    return MakeError(ErrorCode::kNoData, "{}: has no held-out images; cairn check takes them with --queries",
                     path);
  }
  if (!IsCheckReport(*check)) return NotWhatWasExpected(path, kCheckWords);
  if (IsCheckOf(*check, rows)) return check;
  if (is_given) {
    // A check of the same map with other images is allowed.
    spdlog::warn("{}: its figures are not those of the self-test in {}", path, arguments.map_path);
    return check;
  }
  spdlog::warn("{}: is of another compilation than {}; its held-out images are not shown", path,
               arguments.map_path);
  return std::optional<Json>();
}

std::string ReconstructionPath(const std::string& build_dir) {
  return build_dir + "/poses/reconstruction.json";
}

// How the images were joined, if the build folder has it and it is of this map.
Result<std::optional<reconstruct::Verdict>> ReadReconstruction(const ReportArguments& arguments,
                                                               const std::string& build_dir,
                                                               const MapRows& rows) {
  const std::string path = ReconstructionPath(build_dir);
  std::error_code error;
  if (!rows.frame.is_reconstructed || build_dir.empty() || !fs::exists(path, error))
    return std::optional<reconstruct::Verdict>();
  CAIRN_ASSIGN_OR_RETURN(const Json json, ReadJsonReport(path, kReconstructionWords));
  if (!json.contains("verdict")) return std::optional<reconstruct::Verdict>();  // of an earlier version
  Result<reconstruct::Verdict> verdict = reconstruct::ParseVerdict(json["verdict"]);
  if (!verdict.ok()) {
    return MakeError(ErrorCode::kCorrupt, "{}: {}: it is not {}; remove it, and compile again", path,
                     verdict.error().message, kReconstructionWords);
  }
  if (IsReconstructionOf(*verdict, rows)) return std::optional(*std::move(verdict));
  spdlog::warn("{}: is of another compilation than {}; it is not shown", path, arguments.map_path);
  return std::optional<reconstruct::Verdict>();
}

std::string FloorPicture(const std::string& folder) { return folder + "/floor.svg"; }
std::string AmbiguityPicture(const std::string& folder) { return folder + "/ambiguity.svg"; }
std::string ReconstructionPicture(const std::string& folder) { return folder + "/reconstruction.svg"; }

// Checks that the page and the pictures can be written, and that none of them is an input file, given
// or found.
Status CheckPageAndPictures(const ReportArguments& arguments, const std::vector<std::string>& inputs) {
  CAIRN_RETURN_IF_ERROR(CheckCanBeReplaced(arguments.output_path));
  CAIRN_RETURN_IF_ERROR(CheckOutputIsNoInput(arguments.output_path, inputs));
  if (arguments.svg_dir.empty()) return Ok();
  for (const std::string& picture : {FloorPicture(arguments.svg_dir), AmbiguityPicture(arguments.svg_dir),
                                     ReconstructionPicture(arguments.svg_dir)}) {
    if (IsSameFile(picture, arguments.output_path))
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}: is the name of the page and of a picture; choose another name", picture);
    CAIRN_RETURN_IF_ERROR(CheckOutputIsNoInput(picture, inputs));
  }
  return Ok();
}

Status WritePictures(const std::string& folder, const ReportInputs& inputs) {
  const MapRows& rows = *inputs.rows;
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return MakeError(ErrorCode::kIo, "{}: cannot be created: {}", folder, error.message());
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(FloorPicture(folder), FloorSvg(rows)));
  if (inputs.reconstruction != nullptr) {
    CAIRN_RETURN_IF_ERROR(WriteFileAtomically(ReconstructionPicture(folder),
                                              reconstruct::DrawVerdict(*inputs.reconstruction, rows.name)));
  }
  const Result<std::string> ambiguity = AmbiguitySvg(rows);
  return ambiguity.ok() ? WriteFileAtomically(AmbiguityPicture(folder), *ambiguity) : Ok();
}

Status RunReport(const ReportArguments& arguments, const CommandEnvironment& environment) {
  if (arguments.print && !(arguments.drive_path.empty() && arguments.compare_path.empty())) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "--print does not show --drive and --compare, which need the page's scripts; leave one out");
  }
  const std::string build_dir = Beside(arguments, arguments.build_dir, ".build");
  const std::string build_path = Beside(arguments, arguments.build_report_path, ".report.json");
  const std::string pareto_path = Beside(arguments, "", ".pareto.csv");
  CAIRN_RETURN_IF_ERROR(CheckPageAndPictures(
      arguments,
      {arguments.map_path, arguments.compare_path, arguments.check_path, arguments.drive_path, build_path,
       pareto_path, build_dir + "/check.json", build_dir + "/classes.db", ReconstructionPath(build_dir)}));
  std::error_code error;
  if (!arguments.build_dir.empty() && !fs::is_directory(build_dir, error))
    return MakeError(ErrorCode::kNotFound, "--build-dir {}: no such folder", build_dir);
  CAIRN_ASSIGN_OR_RETURN(const MapFile file, OpenWholeMap(arguments.map_path));
  CAIRN_ASSIGN_OR_RETURN(const MapRows rows, ReadMapRows(file));
  ReportInputs inputs{.rows = &rows, .num_bytes = static_cast<int64_t>(fs::file_size(arguments.map_path))};
  inputs.block_bytes = BytesByKind(file, inputs.num_bytes);
  CAIRN_ASSIGN_OR_RETURN(inputs.reprojection_errors_px, ReprojectionErrors(build_dir));
  CAIRN_ASSIGN_OR_RETURN(inputs.pareto, ReadPareto(pareto_path));
  std::optional<Json> build, drive;
  if (!build_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(build, ReadJsonReport(build_path, kBuildWords));
    if (!IsBuildReport(*build)) return NotWhatWasExpected(build_path, kBuildWords);
    inputs.build_report = &*build;
  }
  CAIRN_ASSIGN_OR_RETURN(const std::optional<Json> check, ReadCheck(arguments, build_dir, rows));
  if (check) inputs.check = &*check;
  CAIRN_ASSIGN_OR_RETURN(const std::optional<reconstruct::Verdict> reconstruction,
                         ReadReconstruction(arguments, build_dir, rows));
  if (reconstruction) inputs.reconstruction = &*reconstruction;
  if (!arguments.drive_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(drive, ReadJsonReport(arguments.drive_path, kDriveWords));
    if (!IsDrive(*drive)) return NotWhatWasExpected(arguments.drive_path, kDriveWords);
    inputs.drive = &*drive;
  }
  std::optional<MapRows> compared;
  if (!arguments.compare_path.empty()) {
    CAIRN_ASSIGN_OR_RETURN(const MapFile compared_file, OpenWholeMap(arguments.compare_path));
    CAIRN_ASSIGN_OR_RETURN(compared, ReadMapRows(compared_file));
    if (compared->frame.unit != rows.frame.unit)
      return MakeError(ErrorCode::kInvalidArgument,
                       "{} is in units of '{}', {} of '{}': they have no common floor",
                       arguments.compare_path, compared->frame.unit, arguments.map_path, rows.frame.unit);
    inputs.compared = &*compared;
    inputs.compared_bytes = static_cast<int64_t>(fs::file_size(arguments.compare_path));
    inputs.compared_name = fs::path(arguments.compare_path).filename().string();
  }
  inputs.advice = ReportAdvice(inputs);
  const Json data = ReportData(inputs);
  const std::string page = arguments.print ? PrintedReportPage(inputs, data) : ReportPage(inputs, data);
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(arguments.output_path, page));
  if (!arguments.svg_dir.empty()) CAIRN_RETURN_IF_ERROR(WritePictures(arguments.svg_dir, inputs));
  *environment.out << fmt::format("{}: {} bytes; open it in a browser\n", arguments.output_path, page.size());
  return Ok();
}

}  // namespace

Command ReportCommand() {
  auto arguments = std::make_shared<ReportArguments>();
  return {
      .name = "report",
      .summary = "Write a page that shows what a map covers, how well, and what to survey next",
      .add_arguments =
          [arguments](ArgumentParser& parser) {
            parser.Add("map", arguments->map_path, "Map").Required().Type("MAP");
            parser.Add("-o,--output", arguments->output_path, "Page to write; it needs no network")
                .Required()
                .Type("FILE.html");
            parser
                .Add("--build-report", arguments->build_report_path,
                     "Seconds and memory of the stages [NAME.report.json beside the map, if it is there]")
                .Type("FILE.json");
            parser
                .Add("--build-dir", arguments->build_dir,
                     "Build folder, for reprojection errors and how the images were joined [NAME.build "
                     "beside the map, if it is there]")
                .Type("FOLDER");
            parser
                .Add("--check", arguments->check_path,
                     "What cairn check --details wrote: held-out images on the floor, with their "
                     "errors or why they were not localized [check.json in the build folder, if it is "
                     "of this map]")
                .Type("FILE.json");
            parser.Add("--drive", arguments->drive_path, "What cairn drive -o wrote: replayed on the floor")
                .Type("RUN.json");
            parser
                .Add("--compare", arguments->compare_path,
                     "Another map of the place, in the same frame: what changed from it to MAP")
                .Type("OLD");
            parser.AddFlag("--print", arguments->print,
                           "Write a page for paper: pictures and tables, no scripts");
            parser.Add("--svg", arguments->svg_dir, "Write the pictures there too, as SVG").Type("FOLDER");
          },
      .run =
          [arguments](const CommandEnvironment& environment) { return RunReport(*arguments, environment); },
  };
}

}  // namespace cairn::pipeline
