#include "stages/reconstruct/command.h"

#include <filesystem>

#include <spdlog/spdlog.h>
#include <nlohmann/json.hpp>

#include "core/colmap/cameras_text.h"
#include "core/files/file.h"
#include "core/files/folder.h"
#include "core/files/write_error.h"
#include "stages/reconstruct/reconstruct.h"
#include "stages/reconstruct/verdict/draw_verdict.h"
#include "stages/reconstruct/verdict/verdict_json.h"
#include "stages/reconstruct/verdict/verdict_text.h"

namespace cairn::reconstruct {
namespace {

namespace fs = std::filesystem;

constexpr const char* kReportFile = "reconstruction.json";
constexpr const char* kPictureFile = "reconstruction.svg";

struct Arguments {
  std::string matches;
  std::string capture;
  std::string output;
  ReconstructOptions options;
  OptionArguments option_arguments;
};

std::string ReportJson(const ReconstructResult& result) {
  nlohmann::ordered_json report = {{"num_images", result.images.size()},
                                   {"num_queries", result.queries.size()},
                                   {"model_sizes", result.model_sizes},
                                   {"num_points", result.num_points},
                                   {"mean_error_px", result.mean_error_px}};
  report["scale_from"] = result.frame.source;
  report["scale_sigma_ratio"] = result.frame.scale_sigma_ratio;
  report["scales"] = nlohmann::ordered_json::array();
  for (const ScaleFound& scale : result.scales) {
    report["scales"].push_back(
        {{"source", scale.source}, {"span_m", scale.span_m}, {"sigma_ratio", scale.sigma_ratio}});
  }
  report["residuals"] = nlohmann::ordered_json::array();
  for (const AlignmentResidual& residual : result.residuals) {
    report["residuals"].push_back(
        {{"name", residual.name}, {"residual_m", residual.residual_m}, {"is_off", residual.is_off}});
  }
  if (!result.sessions.empty()) report["sessions"] = nlohmann::ordered_json::array();
  for (const RegisteredSession& session : result.sessions) {
    report["sessions"].push_back({{"name", session.name},
                                  {"num_images", session.num_images},
                                  {"num_joined", session.num_joined},
                                  {"num_supported", session.num_supported}});
  }
  report["rejects"] = nlohmann::ordered_json::array();
  for (const Reject& reject : result.rejects)
    report["rejects"].push_back({{"name", reject.name}, {"reason", reject.reason}});
  report["verdict"] = VerdictJson(result.verdict);
  return report.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

// The name of the capture's folder.
std::string TitleOf(const Capture& capture) {
  std::error_code error;
  const fs::path root = fs::weakly_canonical(capture.root, error);
  return root.filename().string();
}

// A link to what the capture has, if it is there.
Status LinkTo(const std::string& given, const std::string& name, const std::string& folder) {
  std::error_code error;
  if (!fs::exists(given, error)) return Ok();
  const fs::path target = fs::canonical(given, error);
  if (!error) fs::create_symlink(target, folder + "/" + name, error);
  if (!error) return Ok();
  return WriteError(folder + "/" + name, fmt::format("the link to {} cannot be made", given), error.value());
}

// Writes the result as a capture: the image lists, and links to the images and features.
Status WritePosesFolder(const ReconstructResult& result, const Capture& capture, const std::string& folder) {
  CAIRN_RETURN_IF_ERROR(WriteCamerasText(folder + "/cameras.txt", result.cameras));
  CAIRN_RETURN_IF_ERROR(WriteImagesText(folder + "/images.txt", result.images));
  if (!result.queries.empty())
    CAIRN_RETURN_IF_ERROR(WriteImagesText(folder + "/queries.txt", result.queries));
  CAIRN_RETURN_IF_ERROR(
      WriteFileAtomically(folder + "/" + kCaptureFrameFile, CaptureFrameJson(result.frame)));
  CAIRN_RETURN_IF_ERROR(WriteFileAtomically(folder + "/" + kReportFile, ReportJson(result)));
  CAIRN_RETURN_IF_ERROR(
      WriteFileAtomically(folder + "/" + kPictureFile, DrawVerdict(result.verdict, TitleOf(capture))));
  CAIRN_RETURN_IF_ERROR(LinkTo(capture.images_folder, "images", folder));
  if (capture.features.empty()) return Ok();
  for (const char* name : {kFeaturesFile, kFeaturesFolder})
    CAIRN_RETURN_IF_ERROR(LinkTo(capture.root + "/" + name, name, folder));
  return Ok();
}

std::string ResidualText(const ReconstructResult& result) {
  double total = 0, most = 0;
  int num_off = 0;
  std::string off;
  for (const AlignmentResidual& residual : result.residuals) {
    total += residual.residual_m;
    most = std::max(most, residual.residual_m);
    if (!residual.is_off) continue;
    off += fmt::format("{}{} ({:.2f} m)", ++num_off == 1 ? "" : ", ", residual.name, residual.residual_m);
  }
  return fmt::format("residual mean {:.3f} m, max {:.3f} m over {}; off: {}",
                     total / static_cast<double>(result.residuals.size()), most, result.residuals.size(),
                     off.empty() ? "none" : off);
}

std::string ResultText(const ReconstructResult& result) {
  const size_t num_registered = result.images.size() + result.queries.size();
  std::string text = fmt::format(
      "reconstruct: {} of {} images registered ({} held out), {} points, error {:.2f} px, models of {} "
      "images\n",
      num_registered, num_registered + result.rejects.size(), result.queries.size(), result.num_points,
      result.mean_error_px, fmt::join(result.model_sizes, ", "));
  for (const auto& [camera_id, camera] : result.cameras) {
    text += fmt::format("reconstruct: camera {}: {} {:.2f}\n", camera_id, CameraModelName(camera.model),
                        fmt::join(camera.params, " "));
  }
  for (const RegisteredSession& session : result.sessions) {
    text += fmt::format(
        "reconstruct: {} of {} images of {} are joined to the other captures, {} of them by what they see of "
        "these\n",
        session.num_joined, session.num_images, session.name, session.num_supported);
  }
  if (result.frame.unit == "arbitrary") {
    text += "reconstruct: no scale: the unit is arbitrary\n";
  } else if (result.sessions.empty()) {
    text += fmt::format("reconstruct: scale from {} (+- {:.1f} %), {}\n", result.frame.source,
                        100 * result.frame.scale_sigma_ratio, ResidualText(result));
    for (const ScaleFound& scale : result.scales) {
      text += fmt::format("reconstruct: images' places span {:.4g} m (+- {:.1f} %) by {}\n", scale.span_m,
                          100 * scale.sigma_ratio, scale.told_by);
    }
  }
  if (result.frame.anchor) {
    text += fmt::format("reconstruct: east, north, up at {:.7f}, {:.7f}, {:.2f} m\n",
                        result.frame.anchor->latitude_deg, result.frame.anchor->longitude_deg,
                        result.frame.anchor->altitude_m);
  }
  for (const std::string& line : VerdictLines(result.verdict)) text += "reconstruct: " + line + "\n";
  return text;
}

// Reconstructs in `folder` and leaves only the result there.
Result<ReconstructResult> ReconstructInto(const Arguments& arguments, const Capture& capture,
                                          const MapperInput& input, const std::string& folder,
                                          int num_threads, Progress& progress) {
  const std::string work = folder + "/work";
  std::error_code error;
  if (!fs::create_directory(work, error)) return WriteError(work, "cannot be created", error.value());
  CAIRN_ASSIGN_OR_RETURN(ReconstructResult result,
                         Reconstruct(input, capture, arguments.options, work, num_threads, progress));
  fs::remove_all(work, error);
  CAIRN_RETURN_IF_ERROR(WritePosesFolder(result, capture, folder));
  return result;
}

Status Run(const Arguments& arguments, const CommandEnvironment& environment) {
  CAIRN_RETURN_IF_ERROR(arguments.option_arguments.Apply());
  CAIRN_ASSIGN_OR_RETURN(const Capture capture, ReadCapture(arguments.capture));
  if (capture.has_poses) {
    spdlog::warn("{}: has poses of its own (images.txt), which the reconstruction ignores", capture.root);
  }
  CAIRN_ASSIGN_OR_RETURN(const MapperInput input, ReadMapperInput(arguments.matches));
  ReconstructResult result;
  CAIRN_RETURN_IF_ERROR(ReplaceFolderAtomically(
      arguments.output, "a folder of poses", [&](const std::string& folder) -> Status {
        CAIRN_ASSIGN_OR_RETURN(result, ReconstructInto(arguments, capture, input, folder,
                                                       environment.num_threads, *environment.progress));
        return Ok();
      }));
  for (const std::string& warning : result.warnings) spdlog::warn("{}", warning);
  for (const std::string& line : RejectLines("images", result.rejects)) spdlog::warn("{}", line);
  const auto num_posed = static_cast<int64_t>(result.images.size() + result.queries.size());
  environment.report->in = {{"images", num_posed + static_cast<int64_t>(result.rejects.size())}};
  environment.report->out = {{"images", static_cast<int64_t>(result.images.size())},
                             {"held out", static_cast<int64_t>(result.queries.size())},
                             {"loops", static_cast<int64_t>(result.verdict.loops.size())}};
  AddRejects("images", result.rejects, environment.report);
  *environment.out << ResultText(result)
                   << fmt::format("reconstruct: seen from above: {}/{}\n", arguments.output, kPictureFile);
  return Ok();
}

}  // namespace

Command ReconstructCommand() {
  const auto arguments = std::make_shared<Arguments>();
  return {.name = "reconstruct",
          .summary = "Find the poses of a capture without any (stage 2b)",
          .add_arguments =
              [arguments](ArgumentParser& parser) {
                parser.Add("matches", arguments->matches, "COLMAP database with verified matches")
                    .Required()
                    .Type("matches.db");
                parser.Add("--capture", arguments->capture, "Capture folder: the images and their EXIF")
                    .Required()
                    .Type("CAPTURE");
                parser
                    .Add("-o,--output", arguments->output,
                         "Folder to write: a capture with poses (COLMAP text layout)")
                    .Required()
                    .Type("poses/");
                arguments->option_arguments.Add(parser, DescribeOptions(&arguments->options));
              },
          .run = [arguments](const CommandEnvironment& environment) { return Run(*arguments, environment); }};
}

}  // namespace cairn::reconstruct
