#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "core/blocks/map_rows.h"
#include "pipeline/explain/advise.h"
#include "pipeline/explain/pareto_points.h"
#include "stages/reconstruct/verdict/verdict.h"

namespace cairn::pipeline {

// Everything that the page of a report shows, as one JSON object; floor.js and the other scripts draw it.
// Lists are by column and numbers rounded (places to 1 cm), so that a map of 100,000 landmarks gives a
// few megabytes.
struct ReportInputs {
  const MapRows* rows = nullptr;
  int64_t num_bytes = 0;                                     // of the file
  std::vector<std::pair<std::string, int64_t>> block_bytes;  // by kind of block, and the rest
  std::vector<double> reprojection_errors_px;                // of the classes; none: not known
  const nlohmann::ordered_json* build_report = nullptr;      // NAME.report.json; may be null
  const nlohmann::ordered_json* check = nullptr;             // what check-map --details wrote; may be null
  const nlohmann::ordered_json* drive = nullptr;             // what drive -o wrote; may be null
  const reconstruct::Verdict* reconstruction = nullptr;      // of its images; null: they had poses
  const MapRows* compared = nullptr;                         // the map to compare with; may be null
  int64_t compared_bytes = 0;
  std::string compared_name;        // its file
  std::vector<Advice> advice;       // ReportAdvice
  std::vector<ParetoPoint> pareto;  // the place's maps of other sizes; none: not known
};

// What would make the map better, from all the other inputs (pipeline/explain/advise.h).
std::vector<Advice> ReportAdvice(const ReportInputs& inputs);

// REQUIRES: IsBuildReport, IsCheckReport, IsDrive (report_inputs.h)
nlohmann::ordered_json ReportData(const ReportInputs& inputs);

}  // namespace cairn::pipeline
