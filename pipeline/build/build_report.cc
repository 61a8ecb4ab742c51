#include "pipeline/build/build_report.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <sstream>
#include <vector>

#include <fmt/ranges.h>
#include <toml++/toml.h>

#include "core/files/file.h"
#include "core/line/json_report.h"
#include "core/line/program_version.h"
#include "core/options/toml_options.h"
#include "pipeline/build/folder_lock.h"
#include "pipeline/build/line.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int kBuildReportVersion = 1;
struct StageFile {
  size_t place = 0;  // in the line
  std::string name;  // of what the stage wrote: "features.db"
  Json report;
  bool operator<(const StageFile& other) const {
    return std::tie(place, name) < std::tie(other.place, other.name);
  }
};

Result<Json> ReadJson(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(Json document, ReadJsonReport(path, "a stage's report"));
  if (document.contains("stage") && document["stage"].is_string()) return document;
  return MakeError(ErrorCode::kCorrupt, "{}: not a stage's report; remove it", path);
}

// The reports of the stages that the line has, in its order.
Result<std::vector<StageFile>> ReadStageFiles(const BuildRun& run) {
  std::vector<StageFile> files;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(run.build_dir, error)) {
    std::string name = entry.path().filename().string();
    if (!name.ends_with(kReportSuffix)) continue;
    CAIRN_ASSIGN_OR_RETURN(Json report, ReadJson(entry.path().string()));
    const std::string stage = report["stage"];
    name.resize(name.size() - std::string_view(kReportSuffix).size());
    if ((stage == "simulate" && !run.simulated) || (stage == "import" && !run.footage.contains(name)) ||
        (stage == "join_captures" && !run.joined) || (stage == "reconstruct" && !run.reconstructed) ||
        (stage == "decompose_views" && !run.has_floor_plan) || (stage == "leave_out" && !run.leaves_out))
      continue;
    const size_t place = std::find_if(std::begin(kLine), std::end(kLine),
                                      [&](const LineStage& of_line) { return stage == of_line.name; }) -
                         std::begin(kLine);
    files.push_back({place, name, std::move(report)});
  }
  std::sort(files.begin(), files.end());
  return files;
}

// A stage's options as JSON; none where it has no file.
Result<Json> StageOptionsJson(const std::string& build_dir, const std::string& stage) {
  const std::string path = fmt::format("{}/options/{}.toml", build_dir, stage);
  std::error_code error;
  if (!fs::exists(path, error)) return Json::object();
  CAIRN_ASSIGN_OR_RETURN(const toml::table table, ReadTomlFile(path));
  std::ostringstream text;
  text << toml::json_formatter(table);
  return Json::parse(text.str());
}

std::string Thousands(int64_t number) {
  std::string digits = std::to_string(number);
  for (auto at = static_cast<int64_t>(digits.size()) - 3; at > (number < 0 ? 1 : 0); at -= 3)
    digits.insert(at, ",");
  return digits;
}

std::string CountsText(const Json& counts) {
  std::vector<std::string> texts;
  for (const auto& [what, count] : counts.items())
    texts.push_back(Thousands(count.get<int64_t>()) + " " + what);
  return fmt::format("{}", fmt::join(texts, ", "));
}

std::string FlowText(const Json& report) {
  const std::string in = CountsText(report["in"]), out = CountsText(report["out"]);
  const std::string taken_over = CountsText(report["taken_over"]);
  return fmt::format("{}{}{}{}", in, in.empty() || out.empty() ? "" : " -> ", out,
                     taken_over.empty() ? "" : " (" + taken_over + " taken over)");
}

// All files of one stage: several where it is sharded.  Each film or bag has a row of its own.
struct StageRow {
  std::string stage, state;
  double seconds = 0;
  int64_t peak_memory_bytes = 0;
  const Json* whole = nullptr;  // the file with the shortest name: shards have longer ones
};

std::vector<StageRow> StageRows(const Json& report) {
  std::vector<StageRow> rows;
  for (const Json& file : report["stages"]) {
    if (rows.empty() || rows.back().stage != file["stage"] || file["stage"] == "import")
      rows.push_back({file["stage"], file["state"]});
    StageRow& row = rows.back();
    if (file["state"] == "ran") row.state = "ran";
    row.seconds += file["seconds"].get<double>();
    row.peak_memory_bytes = std::max(row.peak_memory_bytes, file["peak_memory_bytes"].get<int64_t>());
    const auto name_size = [](const Json& f) { return f["file"].get_ref<const std::string&>().size(); };
    if (row.whole == nullptr || name_size(file) < name_size(*row.whole)) row.whole = &file;
  }
  return rows;
}

}  // namespace

Result<Json> MakeBuildReport(const BuildRun& run) {
  CAIRN_ASSIGN_OR_RETURN(const std::vector<StageFile> files, ReadStageFiles(run));
  Json report = {{"version", kBuildReportVersion},
                 {"program", std::string("cairn ") + ProgramVersion()},
                 {"recipe", run.recipe},
                 {"map", run.map},
                 {"seed", run.seed},
                 {"result", run.error         ? "failed"
                            : run.ran.empty() ? "up_to_date"
                                              : "compiled"},
                 {"seconds", std::round(run.seconds * 1000) / 1000}};
  if (run.error) {
    report["error"] = {{"code", static_cast<int>(run.error->code)},
                       {"name", ErrorCodeName(run.error->code)},
                       {"message", run.error->message}};
  }
  const char* idle = run.whole_line && !run.error ? "up_to_date" : "not_run";
  report["stages"] = Json::array();
  for (const StageFile& file : files) {
    Json stage = {{"stage", file.report["stage"]},
                  {"file", file.name},
                  {"state", run.ran.contains(file.name) ? "ran" : idle}};
    stage.update(file.report);
    CAIRN_ASSIGN_OR_RETURN(stage["options"], StageOptionsJson(run.build_dir, file.report["stage"]));
    report["stages"].push_back(std::move(stage));
  }
  return report;
}

std::string BuildReportTable(const Json& report) {
  std::string table = fmt::format("{:<18} {:>9} {:>9}  {}\n", "stage", "seconds", "memory", "in -> out");
  const std::string indent(40, ' ');
  for (const StageRow& row : StageRows(report)) {
    std::string state = row.state == "ran" ? "" : row.state == "not_run" ? "  [not run]" : "  [up to date]";
    const Json& whole = *row.whole;
    table += fmt::format("{:<18} {:>9.2f} {:>6.0f} MB  {}{}\n", row.stage, row.seconds,
                         static_cast<double>(row.peak_memory_bytes) / 1e6, FlowText(whole), state);
    for (const Json& rejected : whole["rejected"]) {
      table += fmt::format("{}- {} {}: {}\n", indent, Thousands(rejected["count"].get<int64_t>()),
                           rejected["what"].get<std::string>(), rejected["reason"].get<std::string>());
    }
  }
  return table;
}

}  // namespace cairn::pipeline
