#include "core/options/find_option.h"

#include <vector>

namespace cairn {

Result<const Option*> FindOption(const OptionTable& table, const std::string& name,
                                 const std::string& if_none_is_near) {
  std::vector<std::string> names;
  for (const Option& option : table) {
    if (option.name == name) return &option;
    names.push_back(option.name);
  }
  const std::string nearest = NearestWord(name, names);
  return MakeError(ErrorCode::kInvalidArgument, "unknown option '{}'; {}", name,
                   nearest.empty() ? if_none_is_near : "did you mean '" + nearest + "'?");
}

}  // namespace cairn
