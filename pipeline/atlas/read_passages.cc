#include "pipeline/atlas/read_passages.h"

#include <cmath>
#include <string_view>

#include "core/base/text.h"
#include "core/files/file.h"
#include "runtime/atlas/atlas_route.h"
#include "runtime/drive/route.h"

namespace cairn::pipeline {
namespace {

struct Site {
  const AtlasRows& atlas;
  const std::vector<std::shared_ptr<const Map>>& maps;
};

Result<AtlasImage> FindImageIn(const Site& site, const std::string& name) {
  CAIRN_ASSIGN_OR_RETURN(const int32_t map, MapOfImage(site.atlas, name));
  CAIRN_ASSIGN_OR_RETURN(const int32_t image,
                         FindImage(*site.maps[map], name.substr(site.atlas.maps[map].name.size() + 1)));
  return AtlasImage{map, image};
}

Result<AtlasPassage> ParsePassage(std::string_view line, const Site& site) {
  const std::vector<std::string> fields = SplitFields(line, ',');
  if ((fields.size() != 3 && fields.size() != 4) || fields[0].empty()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "'{}' is no passage; expected NAME, MAP/IMAGE, MAP/IMAGE and, if it is not 1, its cost",
                     line);
  }
  AtlasPassage passage{.name = fields[0]};
  CAIRN_ASSIGN_OR_RETURN(passage.from, FindImageIn(site, fields[1]));
  CAIRN_ASSIGN_OR_RETURN(passage.to, FindImageIn(site, fields[2]));
  if (fields.size() == 4 &&
      (!ParseNumber(fields[3], &passage.cost) || !std::isfinite(passage.cost) || passage.cost < 0)) {
    return MakeError(ErrorCode::kInvalidArgument, "'{}' is no cost of a passage; expected a number >= 0",
                     fields[3]);
  }
  return passage;
}

}  // namespace

Result<std::vector<AtlasPassage>> ReadPassages(const std::string& path, const AtlasRows& atlas,
                                               const std::vector<std::shared_ptr<const Map>>& maps) {
  CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  std::vector<AtlasPassage> passages;
  size_t number = 0;
  for (const std::string_view line : SplitLines(text)) {
    ++number;
    if (Trim(line).empty() || Trim(line).front() == '#') continue;
    Result<AtlasPassage> passage = ParsePassage(line, {atlas, maps});
    if (!passage.ok())
      return MakeError(passage.error().code, "{}:{}: {}", path, number, passage.error().message);
    passages.push_back(*std::move(passage));
  }
  return passages;
}

}  // namespace cairn::pipeline
