#include "core/line/stage_report.h"

#include <algorithm>

#include <fmt/format.h>

namespace cairn {
namespace {

constexpr int64_t kMostNamed = 10;

// The reason without "PATH/NAME: " before it.
std::string PlainReason(const Reject& reject) {
  const size_t colon = reject.reason.find(": ");
  if (colon == std::string::npos || reject.name.empty()) return reject.reason;
  return reject.reason.compare(0, colon, reject.name) == 0 ||
                 std::string_view(reject.reason).substr(0, colon).ends_with("/" + reject.name)
             ? reject.reason.substr(colon + 2)
             : reject.reason;
}

}  // namespace

void AddRejects(const std::string& what, const std::vector<Reject>& rejects, StageReport* report) {
  std::vector<StageReport::Rejected>& groups = report->rejected;
  for (const Reject& reject : rejects) {
    const std::string reason = PlainReason(reject);
    auto group = std::find_if(groups.begin(), groups.end(), [&](const StageReport::Rejected& g) {
      return g.what == what && g.reason == reason;
    });
    if (group == groups.end()) group = groups.insert(groups.end(), {what, reason, 0, {}});
    group->count++;
    group->names.push_back(reject.name);
  }
}

std::vector<std::string> RejectLines(const std::string& what, const std::vector<Reject>& rejects) {
  StageReport report;
  AddRejects(what, rejects, &report);
  std::vector<std::string> lines;
  for (const StageReport::Rejected& group : report.rejected) {
    if (group.count > kMostNamed) {
      lines.push_back(fmt::format("rejected {} {}, {} to {}: {}", group.count, what, group.names.front(),
                                  group.names.back(), group.reason));
      continue;
    }
    for (const std::string& name : group.names)
      lines.push_back(fmt::format("rejected {}: {}", name, group.reason));
  }
  return lines;
}

void AddDropped(const std::string& what, const DropCounts& dropped, StageReport* report) {
  for (const auto& [reason, count] : dropped) {
    if (count > 0) report->rejected.push_back({what, reason, static_cast<int64_t>(count), {}});
  }
}

}  // namespace cairn
