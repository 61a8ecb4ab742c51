#include "core/map/left_out_folder.h"

#include <algorithm>

#include "core/base/text.h"
#include "core/files/file.h"

namespace cairn {
namespace {

constexpr std::string_view kNone = "none: ";

std::string SummaryPath(const std::string& folder) { return folder + "/left_out.txt"; }

}  // namespace

LeftOutFolder::Round LeftOutRound(const std::string& folder, size_t round) {
  const std::string stem = folder + "/" + std::to_string(round);
  return {stem + ".cairn", stem + ".txt"};
}

Status WriteLeftOutSummary(const std::string& folder, int num_runs, size_t num_rounds) {
  return WriteFileAtomically(SummaryPath(folder), fmt::format("{} {}\n", num_runs, num_rounds));
}

Status WriteNothingLeftOut(const std::string& folder, const std::string& reason) {
  std::string line = reason;
  std::replace(line.begin(), line.end(), '\n', ' ');
  return WriteFileAtomically(SummaryPath(folder), fmt::format("{}{}\n", kNone, line));
}

Result<LeftOutFolder> ReadLeftOutFolder(const std::string& folder) {
  const std::string path = SummaryPath(folder);
  Result<std::string> text = ReadFile(path);
  if (!text.ok() && text.error().code == ErrorCode::kNotFound) {
    return MakeError(ErrorCode::kNotFound,
                     "{}: there is no {}; give the folder that cairn stage leave-out made", folder, path);
  }
  if (!text.ok()) return text.error();
  if (text->ends_with('\n')) text->pop_back();
  LeftOutFolder left_out;
  if (text->starts_with(kNone)) {
    left_out.why_none = text->substr(kNone.size());
    return left_out;
  }
  constexpr int kMaxNumRounds = 1000;
  const size_t space = text->find(' ');
  int num_rounds = 0;
  if (space == std::string::npos || !ParseNumber(text->substr(0, space), &left_out.num_runs) ||
      !ParseNumber(text->substr(space + 1), &num_rounds) || left_out.num_runs < 1 || num_rounds < 1 ||
      num_rounds > kMaxNumRounds) {
    return MakeError(ErrorCode::kCorrupt,
                     "{}: expected two numbers, of runs and of rounds, found '{}'; make the folder anew",
                     path, *text);
  }
  for (size_t round = 0; round < static_cast<size_t>(num_rounds); ++round)
    left_out.rounds.push_back(LeftOutRound(folder, round));
  return left_out;
}

}  // namespace cairn
