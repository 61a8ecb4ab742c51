#include "pipeline/report/report_page.h"

#include <string_view>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/picture/svg.h"
#include "pipeline/explain/inspect_drops.h"
#include "pipeline/explain/place_changes.h"
#include "pipeline/report/ambiguity_svg.h"
#include "pipeline/report/floor_svg.h"
#include "pipeline/report/reconstruction_data.h"
#include "report/chart_js.h"
#include "report/chart_notice.h"
#include "report/charts_js.h"
#include "report/compare_js.h"
#include "report/draw_js.h"
#include "report/drive_js.h"
#include "report/explain_js.h"
#include "report/floor_js.h"
#include "report/layers_js.h"
#include "report/leaflet_css.h"
#include "report/leaflet_js.h"
#include "report/leaflet_notice.h"
#include "report/page_css.h"
#include "report/page_html.h"
#include "report/page_js.h"
#include "report/reconstruction_js.h"
#include "report/stages_js.h"
#include "report/start_js.h"
#include "report/summary_js.h"
#include "stages/check_map/report.h"
#include "stages/reconstruct/verdict/draw_verdict.h"

namespace cairn::pipeline {
namespace {

constexpr int kMaxStationLines = 20;
constexpr int kMaxRegionLines = 60;
constexpr int kMaxChangeLines = 40;

// `text` with every `from` replaced.
std::string Replaced(std::string text, std::string_view from, std::string_view to) {
  for (size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size()))
    text.replace(at, from.size(), to);
  return text;
}

// Inside of a script element nothing may look like its end; in JSON and in strings of scripts `<\/` is `</`.
std::string InScript(std::string text) { return Replaced(std::move(text), "</", "<\\/"); }

// A `<` only occurs in strings there, and can be written as its character code.
std::string JsonInPage(const nlohmann::ordered_json& data) {
  return Replaced(data.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace), "<",
                  "\\u003c");
}

std::string Notices() {
  return fmt::format("Leaflet\n\n{}\n\nChart.js\n\n{}", kLeafletNoticeText, kChartNoticeText);
}

// One script: its parts share their names.
std::string Script() {
  std::string script;
  for (const char* part :
       {kPageJsText, kFloorJsText, kDrawJsText, kLayersJsText, kExplainJsText, kSummaryJsText,
        kReconstructionJsText, kStagesJsText, kChartsJsText, kCompareJsText, kDriveJsText, kStartJsText}) {
    script += part;
  }
  return script;
}

std::string ReconstructionPicture(const ReportInputs& inputs) {
  if (inputs.reconstruction == nullptr) return "";
  return reconstruct::DrawVerdict(*inputs.reconstruction, inputs.rows->name);
}

// The held-out images that failed, a line each: name, place, reason.
std::string FailedImagesText(const nlohmann::ordered_json& data) {
  std::string text;
  if (!data.contains("held_out")) return text;
  for (const auto& image : data["held_out"]) {
    const bool is_wrong = image.value("wrong", false);
    if (image.contains("found") && !is_wrong) continue;
    text +=
        fmt::format("{:<24} {:>8.2f}, {:>8.2f}  {}\n", image["name"].get<std::string>(),
                    image["at"][0].get<double>() / 100, image["at"][1].get<double>() / 100,
                    is_wrong ? fmt::format("wrong by {:.2f} {}, {:.1f} deg", image["error_m"].get<double>(),
                                           data["unit"].get<std::string>(), image["error_deg"].get<double>())
                             : image.value("message", "not localized"));
  }
  return text;
}

}  // namespace

std::string ReportPage(const ReportInputs& inputs, const nlohmann::ordered_json& data) {
  const std::vector<std::pair<std::string_view, std::string>> parts = {
      {"@TITLE@", EscapeXml(data["name"].get<std::string>())},
      {"@LEAFLET_CSS@", kLeafletCssText},
      {"@CSS@", kPageCssText},
      {"@RECONSTRUCTION@", ReconstructionPicture(inputs)},
      {"@WRITER@", EscapeXml(data["writer"].get<std::string>())},
      {"@NOTICES@", EscapeXml(Notices())},
      {"@DATA@", JsonInPage(data)},
      {"@LEAFLET_JS@", InScript(kLeafletJsText)},
      {"@CHART_JS@", InScript(kChartJsText)},
      {"@JS@", InScript(Script())}};
  // The template is read once, from front to back, so that no part is searched for the marks of another.
  const std::string_view page = kPageHtmlText;
  std::string html;
  size_t done = 0;
  for (const auto& [mark, text] : parts) {
    const size_t at = page.find(mark, done);
    html.append(page.substr(done, at - done)).append(text);
    done = at + mark.size();
  }
  return html.append(page.substr(done));
}

std::string PrintedReportPage(const ReportInputs& inputs, const nlohmann::ordered_json& data) {
  const MapRows& rows = *inputs.rows;
  const auto block = [](const std::string& title, const std::string& text) {
    return text.empty() ? "" : fmt::format("<h2>{}</h2>\n<pre>{}</pre>\n", EscapeXml(title), EscapeXml(text));
  };
  std::string html = fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{0}</title>\n<style>"
      "body {{ font: 12px \"DejaVu Sans\", sans-serif; margin: 1cm; }} "
      "svg {{ max-width: 100%; height: auto; }} h2 {{ break-after: avoid; }} "
      "pre {{ white-space: pre-wrap; }} figure {{ margin: 0; break-inside: avoid; }}"
      "</style></head><body>\n<h1>{0}</h1>\n",
      EscapeXml(rows.name));
  html += fmt::format("<p>{} bytes, {} landmarks, {} regions, {} stations; made by {}.</p>\n",
                      data["bytes"].get<int64_t>(), rows.landmarks.size(), rows.regions.size(),
                      rows.stations.size(), EscapeXml(rows.writer));
  html += "<figure>" + FloorSvg(rows) + "</figure>\n";
  if (const Result<std::string> svg = AmbiguitySvg(rows); svg.ok()) html += "<figure>" + *svg + "</figure>\n";
  html += block("What would make it better", AdviceText(inputs.advice));
  std::string self_test;
  for (const auto& [name, value] : rows.self_test) self_test += fmt::format("{:<26} {:.4g}\n", name, value);
  html += block("Self-test", self_test);
  html += block("Self-test by region",
                check_map::SelfTestRegionsText(rows.findings.self_test_regions, kMaxRegionLines, rows.frame));
  html += block("Held-out images not localized, or wrong", FailedImagesText(data));
  html += block("Changed places", PlaceChangesText(rows, rows.findings.changes, kMaxChangeLines));
  if (inputs.reconstruction != nullptr) {
    html += block("Reconstruction", ReconstructionText(*inputs.reconstruction));
    html += "<figure>" + ReconstructionPicture(inputs) + "</figure>\n";
  }
  html += block("What the stages dropped", DropsText(rows, kMaxStationLines));
  for (const auto& [stage, options] : rows.stage_options) html += block("Options of " + stage, options);
  return html + "</body></html>\n";
}

}  // namespace cairn::pipeline
