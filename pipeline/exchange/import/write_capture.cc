#include "pipeline/exchange/import/write_capture.h"
#include "core/files/input_file.h"

#include <algorithm>
#include <filesystem>
#include <map>

#include "core/colmap/cameras_text.h"
#include "core/files/file.h"
#include "core/files/folder.h"
#include "pipeline/exchange/import/parts.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

Status MarkListed(const std::string& list_path, ImportedSurvey* survey) {
  CAIRN_ASSIGN_OR_RETURN(const std::string contents, ReadFile(list_path));
  std::map<std::string, ImportedImage*, std::less<>> by_name;
  for (ImportedImage& image : survey->images) by_name.emplace(image.name, &image);
  for (const ListLine& line : ListLines(contents, list_path)) {
    const auto image = by_name.find(line.text);
    if (image != by_name.end()) {
      image->second->is_query = true;
      continue;
    }
    const bool is_left_out = std::any_of(survey->left_out.begin(), survey->left_out.end(),
                                         [&](const Reject& reject) { return reject.name == line.text; });
    if (is_left_out) continue;
    return MakeError(ErrorCode::kNotFound, "{}: no image '{}'; names are as in {}", line.place, line.text,
                     survey->images.front().name);
  }
  return Ok();
}

// Names come from the data set's lists: none may lead out of the capture.
bool StaysBelow(const std::string& name) { return IsPathBelow(name) && name.find('\n') == std::string::npos; }

Status TransferImage(const ImportedImage& image, ImageTransfer transfer, const std::string& folder) {
  if (!StaysBelow(image.name)) {
    return MakeError(ErrorCode::kCorrupt, "image name '{}' leads out of the data set's folder", image.name);
  }
  const fs::path target = fs::path(folder) / image.name;
  std::error_code error;
  fs::create_directories(target.parent_path(), error);
  if (!error && transfer == ImageTransfer::kSymbolicLink) {
    const fs::path source = fs::canonical(image.path, error);
    if (!error) fs::create_symlink(source, target, error);
  } else if (!error && transfer == ImageTransfer::kHardLink) {
    const fs::path source = fs::canonical(image.path, error);
    if (!error) fs::create_hard_link(source, target, error);
  } else if (!error) {
    fs::copy_file(image.path, target, error);
  }
  if (!error) return Ok();
  return MakeError(ErrorCode::kIo, "{}: cannot be {}: {}{}", image.path,
                   transfer == ImageTransfer::kCopy ? "copied" : "linked", error.message(),
                   transfer == ImageTransfer::kCopy ? "" : "; --link copy copies the images");
}

std::vector<CaptureImage> ImagesOf(const ImportedSurvey& survey, bool are_queries) {
  std::vector<CaptureImage> images;
  for (const ImportedImage& image : survey.images) {
    if (image.is_query == are_queries) images.push_back({image.name, image.camera_id, image.cam_from_world});
  }
  return images;
}

Status WriteLists(const ImportedSurvey& survey, const std::string& folder) {
  CAIRN_RETURN_IF_ERROR(WriteCamerasText(folder + "/cameras.txt", survey.cameras));
  CAIRN_RETURN_IF_ERROR(WriteImagesText(folder + "/images.txt", ImagesOf(survey, false)));
  const std::vector<CaptureImage> queries = ImagesOf(survey, true);
  if (!queries.empty()) CAIRN_RETURN_IF_ERROR(WriteImagesText(folder + "/queries.txt", queries));
  std::string left_out;
  for (const Reject& reject : survey.left_out) left_out += reject.name + "\t" + reject.reason + "\n";
  return left_out.empty() ? Ok() : WriteFileAtomically(folder + "/left_out.txt", left_out);
}

}  // namespace

Status ChooseQueries(const HoldOut& hold_out, ImportedSurvey* survey) {
  if (hold_out.every > 0 && !hold_out.queries_path.empty())
    return MakeError(ErrorCode::kInvalidArgument, "--every and --queries exclude each other");
  if (hold_out.every > 0 || !hold_out.queries_path.empty()) {
    for (ImportedImage& image : survey->images) image.is_query = false;
  }
  if (hold_out.every > 0) {
    for (size_t i = hold_out.every - 1; i < survey->images.size(); i += hold_out.every)
      survey->images[i].is_query = true;
  }
  if (!hold_out.queries_path.empty()) CAIRN_RETURN_IF_ERROR(MarkListed(hold_out.queries_path, survey));
  const bool has_survey = std::any_of(survey->images.begin(), survey->images.end(),
                                      [](const ImportedImage& image) { return !image.is_query; });
  if (has_survey) return Ok();
  return MakeError(ErrorCode::kNoData, "all {} images are queries: nothing is left to survey",
                   survey->images.size());
}

Status WriteImportedCapture(const ImportedSurvey& survey, ImageTransfer transfer, const std::string& path,
                            Progress& progress) {
  progress.Begin("import", static_cast<int64_t>(survey.images.size()), "images");
  const Status status = ReplaceFolderAtomically(path, "a capture", [&](const std::string& folder) -> Status {
    for (const ImportedImage& image : survey.images) {
      if (progress.Cancelled()) return MakeError(ErrorCode::kCancelled, "importing was stopped");
      CAIRN_RETURN_IF_ERROR(TransferImage(image, transfer, folder + "/images"));
      progress.Advance();
    }
    return WriteLists(survey, folder);
  });
  progress.End();
  return status;
}

}  // namespace cairn::pipeline
