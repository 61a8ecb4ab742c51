// 7-Scenes [Shotton13]: frame-NNNNNN.color.png and frame-NNNNNN.pose.txt (4 x 4, world_from_cam, metres) in
// folders seq-NN; TrainSplit.txt and TestSplit.txt list "sequenceN".
#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>

#include "core/base/text.h"
#include "core/files/file.h"
#include "pipeline/exchange/import/layouts.h"
#include "pipeline/exchange/import/parts.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> SortedEntries(const std::string& folder) {
  std::vector<fs::path> entries;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error))
    entries.push_back(entry.path());
  std::sort(entries.begin(), entries.end());
  return entries;
}

// Sequence folder -> whether it is held out.  Empty when there are no splits.
Result<std::map<std::string, bool>> ReadSplits(const std::string& source) {
  std::map<std::string, bool> splits;
  for (const bool is_test : {false, true}) {
    const std::string path = source + (is_test ? "/TestSplit.txt" : "/TrainSplit.txt");
    std::error_code error;
    if (!fs::exists(path, error)) continue;
    CAIRN_ASSIGN_OR_RETURN(const std::string contents, ReadFile(path));
    for (const ListLine& line : ListLines(contents, path)) {
      int number = 0;
      const std::string_view digits =
          line.text.substr(std::min(line.text.find_first_of("0123456789"), line.text.size()));
      if (!line.text.starts_with("sequence") || !ParseNumber(digits, &number)) {
        return MakeError(ErrorCode::kCorrupt, "{}: expected sequenceN, found '{}'", line.place, line.text);
      }
      splits[fmt::format("seq-{:02}", number)] = is_test;
    }
  }
  return splits;
}

// A frame's pose; nothing (with the reason in `left_out`) where tracking was lost.  Errors: a broken file.
Result<std::optional<Pose>> ReadPose(const std::string& path, const std::string& name,
                                     std::vector<Reject>* left_out) {
  CAIRN_ASSIGN_OR_RETURN(const std::string contents, ReadFile(path));
  std::vector<std::string> words = SplitWords(contents);
  for (std::string& word : words) {
    if (word.find('#') != std::string::npos) word = "nan";  // 1.#QNAN, -1.#IND: as Windows prints it
  }
  const auto numbers = ParseNumbers(words);
  if (!numbers.ok() || numbers->size() != 16) {
    return MakeError(ErrorCode::kCorrupt, "{}: expected a 4 x 4 matrix, found {}", path,
                     numbers.ok() ? fmt::format("{} numbers", numbers->size()) : numbers.error().message);
  }
  const Result<Pose> world_from_cam = PoseFromMatrix(*numbers);
  if (world_from_cam.ok()) return std::optional<Pose>(world_from_cam->Inverse());
  left_out->push_back({name, fmt::format("{}: {}", path, world_from_cam.error().message)});
  return std::optional<Pose>();
}

Status ReadSequence(const std::string& folder, const std::string& prefix, bool is_query,
                    ImportedSurvey* survey) {
  constexpr std::string_view kPoseSuffix = ".pose.txt";
  for (const fs::path& entry : SortedEntries(folder)) {
    const std::string file = entry.filename().string();
    if (!file.starts_with("frame-") || !file.ends_with(kPoseSuffix)) continue;
    const std::string stem = entry.string().substr(0, entry.string().size() - kPoseSuffix.size());
    std::error_code error;
    const std::string suffix = fs::exists(stem + ".color.jpg", error) ? ".color.jpg" : ".color.png";
    const std::string name = prefix + fs::path(stem).filename().string() + suffix;
    CAIRN_ASSIGN_OR_RETURN(const std::optional<Pose> pose, ReadPose(entry.string(), name, &survey->left_out));
    if (pose) survey->images.push_back({name, stem + suffix, 1, *pose, is_query});
  }
  return Ok();
}

}  // namespace

Result<ImportedSurvey> ReadSevenScenesSurvey(const std::string& source, const ImportOptions& options) {
  ImportedSurvey survey;
  if (options.camera.empty()) {
    Camera camera;
    camera.width = 640;
    camera.height = 480;
    camera.params = {525, 320, 240};
    survey.cameras = {{1, camera}};
    survey.notes.push_back(
        "7-Scenes states no calibration: f = 525 px and the middle of the image assumed (--camera)");
  }
  CAIRN_ASSIGN_OR_RETURN(const auto splits, ReadSplits(source));
  CAIRN_RETURN_IF_ERROR(ReadSequence(source, "", false, &survey));
  for (const fs::path& entry : SortedEntries(source)) {
    const std::string sequence = entry.filename().string();
    std::error_code error;
    if (!sequence.starts_with("seq-") || !fs::is_directory(entry, error)) continue;
    const auto split = splits.find(sequence);
    if (!splits.empty() && split == splits.end()) {
      survey.left_out.push_back({sequence, "in neither TrainSplit.txt nor TestSplit.txt"});
      continue;
    }
    CAIRN_RETURN_IF_ERROR(
        ReadSequence(entry.string(), sequence + "/", split != splits.end() && split->second, &survey));
  }
  return survey;
}

}  // namespace cairn::pipeline
