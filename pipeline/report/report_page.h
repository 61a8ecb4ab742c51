#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "pipeline/report/report_data.h"

namespace cairn::pipeline {

// A report as one HTML file that needs no network: the data, the page that draws it (page.html, page.css and
// the scripts), and the libraries that it draws with, which were embedded from the installed packages when
// cairn was built, with their notices.  No name in the data can become markup.
std::string ReportPage(const ReportInputs& inputs, const nlohmann::ordered_json& data);

// The same for paper: pictures and tables, no scripts.
std::string PrintedReportPage(const ReportInputs& inputs, const nlohmann::ordered_json& data);

}  // namespace cairn::pipeline
