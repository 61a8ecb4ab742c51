#include "stages/match_features/pairs/pair_list.h"

#include <algorithm>
#include <map>
#include <sstream>

#include "core/files/file.h"
#include "core/options/options.h"

namespace cairn::match_features {
namespace {

// Index of an image, -1 for one without features.
Result<int> FindImage(const std::string& name, const std::map<std::string, int>& idx_of_name,
                      const std::string& where) {
  if (const auto it = idx_of_name.find(name); it != idx_of_name.end()) return it->second;
  std::vector<std::string> names;
  for (const auto& [known, idx] : idx_of_name) names.push_back(known);
  const std::string nearest = NearestWord(name, names);
  return MakeError(ErrorCode::kInvalidArgument, "{}: the database has no image '{}'{}", where, name,
                   nearest.empty() ? "; names are relative to the capture's image folder"
                                   : fmt::format("; did you mean '{}'?", nearest));
}

}  // namespace

Result<PairList> ReadPairList(const std::string& path, const MatchImages& images) {
  CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  std::map<std::string, int> idx_of_name;
  for (const auto& [name, image_id] : images.without_features) idx_of_name[name] = -1;
  for (size_t i = 0; i < images.images.size(); ++i) idx_of_name[images.images[i].name] = static_cast<int>(i);

  PairList list;
  std::istringstream lines(text);
  int line_number = 0;
  for (std::string line; std::getline(lines, line);) {
    const std::string where = fmt::format("{}, line {}", path, ++line_number);
    std::istringstream words(line);
    std::vector<std::string> names;
    for (std::string word; words >> word;) names.push_back(word);
    if (names.empty() || names[0].starts_with('#')) continue;
    if (names.size() != 2) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "{}: {} word(s), expected the names of two images with a space between them (names "
                       "themselves cannot have spaces here)",
                       where, names.size());
    }
    CAIRN_ASSIGN_OR_RETURN(const int idx1, FindImage(names[0], idx_of_name, where));
    CAIRN_ASSIGN_OR_RETURN(const int idx2, FindImage(names[1], idx_of_name, where));
    if (names[0] == names[1]) {
      return MakeError(ErrorCode::kInvalidArgument, "{}: '{}' is paired with itself", where, names[0]);
    }
    if (idx1 < 0 || idx2 < 0) {
      ++list.num_without_features;
    } else {
      list.pairs.emplace_back(std::min(idx1, idx2), std::max(idx1, idx2));
    }
  }
  if (list.pairs.empty()) {
    return MakeError(ErrorCode::kNoData, "{}: names no pair of images with features ({} pair(s) without)",
                     path, list.num_without_features);
  }
  std::sort(list.pairs.begin(), list.pairs.end());
  list.pairs.erase(std::unique(list.pairs.begin(), list.pairs.end()), list.pairs.end());
  return list;
}

}  // namespace cairn::match_features
