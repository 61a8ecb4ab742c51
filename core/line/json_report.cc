#include "core/line/json_report.h"

#include <nlohmann/json.hpp>

#include "core/files/file.h"

namespace cairn {
namespace {

constexpr int kMaxDepth = 100;

}  // namespace

Result<nlohmann::ordered_json> ReadJsonReport(const std::string& path, const std::string& what) {
  using Json = nlohmann::ordered_json;
  CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  const auto is_kept = [](int depth, Json::parse_event_t, Json&) { return depth <= kMaxDepth; };
  Json json = Json::parse(text, is_kept, false);
  if (json.is_object()) return json;
  return MakeError(ErrorCode::kCorrupt, "{}: not a JSON object; expected {}", path, what);
}

}  // namespace cairn
