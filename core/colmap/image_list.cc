#include "core/colmap/image_list.h"

#include <algorithm>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/printable.h"
#include "core/base/text.h"
#include "core/files/file.h"

namespace cairn {
namespace {

// Whether the words are triples of numbers: X Y POINT3D_ID of keypoints.
bool IsPointsLine(const std::vector<std::string>& words) {
  double value = 0;
  return words.size() % 3 == 0 && std::all_of(words.begin(), words.end(), [&](const std::string& word) {
           return ParseNumber(word, &value);
         });
}

}  // namespace

Status CheckListedName(const std::string& path, const std::string& name) {
  if (!HasControlCharacter(name)) return Ok();
  return MakeError(
      ErrorCode::kInvalidArgument,
      "{}: cannot list the image '{}': its name has a control character, such as a line end; rename it", path,
      name);
}

Status VisitImageList(const std::string& path, const std::function<void(ListedImage)>& visit) {
  CAIRN_ASSIGN_OR_RETURN(const std::string contents, ReadFile(path));
  int line_number = 0;
  bool follows_image = false;
  for (const std::string_view line : SplitLines(contents)) {
    ++line_number;
    const std::vector<std::string> words = SplitWords(line);
    const bool is_points_line = follows_image && IsPointsLine(words);
    follows_image = false;
    if (words.empty() || words[0][0] == '#' || is_points_line) continue;
    Result<ModelImage> image = ParseImageLine(line);
    if (!image.ok())
      return MakeError(image.error().code, "{}:{}: {}", path, line_number, image.error().message);
    visit({.line_number = line_number,
           .pose_text = fmt::format("{}", fmt::join(words.begin() + 1, words.begin() + 8, " ")),
           .image = *std::move(image)});
    follows_image = true;
  }
  return Ok();
}

}  // namespace cairn
