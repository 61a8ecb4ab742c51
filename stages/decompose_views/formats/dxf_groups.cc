#include "stages/decompose_views/formats/dxf_groups.h"

#include <cmath>

#include "core/base/text.h"

namespace cairn::decompose_views {

bool DxfGroups::NextLine(std::string_view* line) {
  if (place_.offset >= text_.size()) return false;
  const size_t end = text_.find('\n', place_.offset);
  const size_t next = end == std::string_view::npos ? text_.size() : end + 1;
  *line = Trim(text_.substr(place_.offset, next - place_.offset));
  place_ = {next, place_.line + 1};
  return true;
}

Result<DxfGroup> DxfGroups::Next() {
  constexpr int kComment = 999;
  for (;;) {
    DxfGroup group;
    std::string_view code;
    const bool has_code = NextLine(&code);
    if (has_code && !ParseNumber(code, &group.code)) {
      return Corrupt(what_, "line {}: {:?} is no group code of DXF (a number)", place_.line,
                     code.substr(0, 40));
    }
    if (!has_code || !NextLine(&group.value)) {
      return Corrupt(what_, "a DXF that is cut short: it ends after line {}, without an EOF; copy it again",
                     place_.line);
    }
    group.line = place_.line;
    if (group.code != kComment) return group;
  }
}

Result<double> DxfGroups::Number(const DxfGroup& group) const {
  std::string_view text = group.value;
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  if (!ParseNumber(text, &value) || !std::isfinite(value)) {
    return Corrupt(what_, "line {}: {:?} is not a finite number (group {})", group.line,
                   group.value.substr(0, 40), group.code);
  }
  return value;
}

Result<int> DxfGroups::Integer(const DxfGroup& group) const {
  int value = 0;
  if (!ParseNumber(group.value, &value)) {
    return Corrupt(what_, "line {}: {:?} is not a whole number (group {})", group.line,
                   group.value.substr(0, 40), group.code);
  }
  return value;
}

}  // namespace cairn::decompose_views
