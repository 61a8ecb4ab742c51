#include "stages/check_map/report.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "core/geometry/floor_pose.h"
#include "core/world/decomposition.h"

namespace cairn::check_map {
namespace {

constexpr int kMaxRegionLines = 10;

// Value of a figure; nothing where no image was localized.
std::optional<double> Figure(const CheckMapReport& report, const std::string& name) {
  const auto figure = report.figures.find(name);
  if (figure == report.figures.end()) return std::nullopt;
  return figure->second;
}

std::string Text(const std::optional<double>& value, double unit, int digits) {
  return value ? fmt::format("{:.{}f}", *value / unit, digits) : "-";
}

// x, y (floor frame), heading in degrees.
nlohmann::json FloorJson(const Pose& cam_from_world, const MapRows& rows) {
  const FloorPose floor = FloorPoseOf(cam_from_world, rows.floor_from_world);
  return {floor.position.x(), floor.position.y(), floor.heading_deg};
}

nlohmann::json ImagesJson(const CheckMapReport& report, const PrintedReport& printed, bool with_errors,
                          bool with_times) {
  const MapRows& rows = *printed.rows;
  nlohmann::json images = nlohmann::json::array();
  for (const HeldOutResult& result : report.images) {
    nlohmann::json image = {{"name", result.name}};
    if (result.true_cam_from_world) {
      image["true_floor"] = FloorJson(*result.true_cam_from_world, rows);
      image["station"] = nullptr;
      if (result.station) image["station"] = *result.station;
    }
    if (!result.rejected.empty()) {
      image["rejected"] = result.rejected;
    } else {
      const Localization& localization = result.localization;
      image["reason"] = NoFixName(localization.reason);
      image["num_features"] = localization.num_features;
      image["num_matches"] = localization.num_matches;
      image["num_unguided_inliers"] = localization.num_unguided_inliers;
      image["num_inliers"] = localization.num_inliers;
      image["probability"] = localization.probability;
      image["scope"] = ScopeName(localization.scope);
      if (with_times) {
        image["sift_ms"] = result.sift_ms;
        image["total_ms"] = result.total_ms;
      }
      if (!localization.has_fix()) image["message"] = localization.message;
      if (localization.has_fix()) {
        image["region"] = localization.region;
        image["floor"] = FloorJson(localization.cam_from_world, rows);
      }
      if (localization.has_fix() && with_errors) {
        image["error_m"] = result.error_m;
        image["error_deg"] = result.error_deg;
        image["nees"] = result.nees;
        image["is_gross_error"] = IsGrossError(result, *printed.options);
      }
    }
    images.push_back(std::move(image));
  }
  return images;
}

int NumFixes(const CheckMapReport& report) {
  return static_cast<int>(Figure(report, "num_localized").value_or(0));
}

std::string Line(const std::string& name, const std::string& value) {
  return fmt::format("{:<22} {}\n", name, value);
}

// How the images and the floor plan agree.
std::string PlanText(const CheckMapReport& held_out) {
  const auto figure = [&](const char* name) { return Figure(held_out, name); };
  std::string text;
  if (!held_out.plan_verdict.empty()) text += Line("floor plan", held_out.plan_verdict);
  if (const auto free = figure("plan_images_free_ratio"))
    text += Line("survey in its rooms", Text(free, 0.01, 1) + " % of the images");
  if (const auto free = figure("plan_fixes_free_ratio"))
    text += Line("fixes in its rooms", Text(free, 0.01, 1) + " %");
  if (figure("num_scan_fixes")) {
    text +=
        Line("scans located", fmt::format("{}, {} of images with a fix", Text(figure("num_scan_fixes"), 1, 0),
                                          Text(figure("num_image_and_scan_fixes"), 1, 0)));
    text += Line("scans like images", fmt::format("{} % (any of their poses {} %)",
                                                  Text(figure("scan_first_agrees_ratio"), 0.01, 1),
                                                  Text(figure("scan_any_agrees_ratio"), 0.01, 1)));
  }
  return text;
}

// Most fixes are wrong as they stand, but a similarity between the frames of truth and map takes nearly all
// of their errors away: the poses of the images are in another frame than the map.
bool IsInAnotherFrame(const CheckMapReport& report) {
  constexpr double kMaxPrecision = 0.5, kMaxLeftRatio = 0.1;
  const auto precision = Figure(report, "precision_ratio"), error_m = Figure(report, "median_error_m"),
             left_m = Figure(report, "similarity_p90_error_m");
  return precision && error_m && left_m && *precision < kMaxPrecision && *left_m < kMaxLeftRatio * *error_m;
}

}  // namespace

std::string ReportText(const PrintedReport& report) {
  std::string text;
  const auto line = [&](const std::string& name, const std::string& value) { text += Line(name, value); };
  line("map", fmt::format("{}{}", report.rows->name, report.rows->sealed ? "" : " (unsealed)"));
  line("landmarks", fmt::format("{} ({})", report.rows->landmarks.size(), report.rows->landmark_choice));
  line(
      "regions",
      fmt::format("{} ({}{})", NumRegionsText(report.rows->regions.size(), report.rows->lower_bound),
                  report.rows->algorithm, report.rows->k > 0 ? fmt::format(", k = {}", report.rows->k) : ""));
  line("MB", fmt::format("{:.2f}", static_cast<double>(report.map_bytes) / 1e6));
  if (report.held_out != nullptr && !report.held_out->images.empty()) {
    const CheckMapReport& held_out = *report.held_out;
    const auto figure = [&](const char* name) { return Figure(held_out, name); };
    if (IsOfLeftOutRuns(held_out)) {
      line("left-out images", fmt::format("{}, in {} runs of the survey, in maps without them",
                                          held_out.images.size(), *figure(kLeftOutRunsFigure)));
    } else {
      line("held-out images", fmt::format("{}", held_out.images.size()));
    }
    line("localized", fmt::format("{} ({} %)", NumFixes(held_out), Text(figure("localized_ratio"), 0.01, 1)));
    if (figure("num_by_retrieval")) {
      line("with all images",
           fmt::format("{} ({} %), precision {} %", Text(figure("all_images_num_localized"), 1, 0),
                       Text(figure("all_images_localized_ratio"), 0.01, 1),
                       Text(figure("all_images_precision_ratio"), 0.01, 1)));
      line("by retrieval", fmt::format("{}, with all images {}", Text(figure("num_by_retrieval"), 1, 0),
                                       Text(figure("all_images_num_by_retrieval"), 1, 0)));
    }
    const CaptureFrame& frame = report.rows->frame;
    const auto length = [&](const std::optional<double>& value, int digits = 2) {
      return value ? ShortLength(frame, *value, digits) : "-";
    };
    line("median error",
         fmt::format("{}, {} deg", length(figure("median_error_m")), Text(figure("median_error_deg"), 1, 3)));
    line("90th percentile",
         fmt::format("{}, {} deg", length(figure("p90_error_m")), Text(figure("p90_error_deg"), 1, 3)));
    for (const auto& [prefix, name] :
         {std::pair("similarity", "after a similarity"), std::pair("rig", "and a camera offset")}) {
      const auto fitted = [&](const char* suffix) {
        return figure(fmt::format("{}_{}", prefix, suffix).c_str());
      };
      if (!fitted("scale")) continue;
      line(name,
           fmt::format("{}, {} deg; 90 %: {}, {} deg; scale {}{}", length(fitted("median_error_m")),
                       Text(fitted("median_error_deg"), 1, 3), length(fitted("p90_error_m")),
                       Text(fitted("p90_error_deg"), 1, 3), Text(fitted("scale"), 1, 4),
                       fitted("offset_m") ? fmt::format(", offset {}, {} deg", length(fitted("offset_m"), 1),
                                                        Text(fitted("offset_deg"), 1, 2))
                                          : ""));
    }
    line(fmt::format("within {}, 5 deg", ShortLength(frame, 0.05, 0)),
         Text(figure("within_5cm_5deg_ratio"), 0.01, 1) + " %");
    line(fmt::format("within {}, 2 deg", ShortLength(frame, 0.1, 0)),
         Text(figure("within_10cm_2deg_ratio"), 0.01, 1) + " %");
    line(fmt::format("within {}, 5 deg", ShortLength(frame, 0.1, 0)),
         Text(figure("within_10cm_5deg_ratio"), 0.01, 1) + " %");
    if (IsInAnotherFrame(held_out)) {
      line("precision",
           fmt::format("not known: the images' poses are in another frame than the map, as they stand {} of "
                       "{} fixes are far from them; what counts are the errors after a similarity",
                       Text(figure("num_gross_errors"), 1, 0), NumFixes(held_out)));
    } else {
      line("precision", fmt::format("{} % ({} wrong fixes)", Text(figure("precision_ratio"), 0.01, 1),
                                    Text(figure("num_gross_errors"), 1, 0)));
    }
    if (!IsInAnotherFrame(held_out)) {
      line("P(right)",
           fmt::format("mean {} %; {} fixes of {:g} % or more, {} of them wrong",
                       Text(figure("mean_probability"), 0.01, 1), Text(figure("num_nearly_certain"), 1, 0),
                       100 * kNearlyCertain, Text(figure("num_nearly_certain_gross_errors"), 1, 0)));
    }
    line("NEES", fmt::format("mean {}, median {} (95 % band of the mean {} to {})",
                             Text(figure("mean_nees"), 1, 2), Text(figure("median_nees"), 1, 2),
                             Text(figure("nees_low"), 1, 2), Text(figure("nees_high"), 1, 2)));
    text += SelfTestRegionsText(held_out.regions, kMaxRegionLines, frame);
    line("ms per image",
         fmt::format("{:.1f} (SIFT alone {:.1f})", held_out.mean_total_ms, held_out.mean_sift_ms));
  }
  if (report.held_out != nullptr && !report.held_out->why_none.empty())
    line("self-test", "none: " + report.held_out->why_none);
  if (report.held_out != nullptr) text += PlanText(*report.held_out);
  if (report.foreign != nullptr) {
    line("other places",
         fmt::format("{} images, {} false fixes ({} of P(right) {:g} % or more)",
                     report.foreign->images.size(), NumFixes(*report.foreign),
                     std::count_if(report.foreign->images.begin(), report.foreign->images.end(),
                                   [](const HeldOutResult& image) {
                                     return image.has_fix() &&
                                            image.localization.probability >= kNearlyCertain;
                                   }),
                     100 * kNearlyCertain));
  }
  return text;
}

std::string ReportJson(const PrintedReport& report, bool with_times) {
  nlohmann::json json = {{"map", report.rows->name},
                         {"sealed", report.rows->sealed},
                         {"num_landmarks", report.rows->landmarks.size()},
                         {"landmarks", report.rows->landmark_choice},
                         {"num_regions", report.rows->regions.size()},
                         {"lower_bound", nullptr},
                         {"algorithm", report.rows->algorithm},
                         {"k", report.rows->k},
                         {"map_bytes", report.map_bytes}};
  if (report.rows->lower_bound) json["lower_bound"] = *report.rows->lower_bound;
  if (report.held_out != nullptr && !report.held_out->why_none.empty())
    json["no_self_test"] = report.held_out->why_none;
  if (report.held_out != nullptr && !report.held_out->plan_verdict.empty())
    json["floor_plan"] = report.held_out->plan_verdict;
  if (report.held_out != nullptr) {
    for (const auto& [name, value] : report.held_out->figures) json[name] = value;
  }
  if (report.held_out != nullptr && !report.held_out->images.empty()) {
    if (with_times) {
      json["mean_total_ms"] = report.held_out->mean_total_ms;
      json["mean_sift_ms"] = report.held_out->mean_sift_ms;
    }
    json["regions"] = SelfTestRegionsJson(report.held_out->regions);
    json["images"] = ImagesJson(*report.held_out, report, true, with_times);
  }
  if (report.foreign != nullptr) {
    json["num_foreign"] = report.foreign->images.size();
    json["num_false_fixes"] = NumFixes(*report.foreign);
    json["foreign_images"] = ImagesJson(*report.foreign, report, false, with_times);
  }
  // A name need not be UTF-8.
  return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

std::string SelfTestRegionsText(const std::vector<RegionSelfTest>& regions, int max_num_lines,
                                const CaptureFrame& frame) {
  if (regions.empty()) return "";
  std::vector<RegionSelfTest> order = regions;
  std::stable_sort(order.begin(), order.end(), [](const RegionSelfTest& a, const RegionSelfTest& b) {
    const auto key = [](const RegionSelfTest& row) {
      return std::pair(row.LocalizedRatio() * row.PrecisionRatio(), -row.num_held_out);
    };
    return key(a) < key(b);
  });
  const int width = IsMetric(frame) ? 19 : 26;
  std::string text =
      fmt::format("{:<22} {:>6} {:>9} {:>9} {:>{}} {:>{}}\n", "by region, worst first", "images", "localized",
                  "precision", "median error", width, "90th percentile", width);
  const size_t num_lines = std::min<size_t>(order.size(), max_num_lines);
  for (size_t i = 0; i < num_lines; ++i) {
    const RegionSelfTest& row = order[i];
    const auto error = [&](double length, double deg) {
      return fmt::format("{}, {:.3f} deg", ShortLength(frame, length), deg);
    };
    text += fmt::format("  {:<20} {:>6} {:>9} {:>9} {:>{}} {:>{}}\n",
                        row.region == kOutsideRegions ? "outside" : fmt::format("region {}", row.region),
                        row.num_held_out, fmt::format("{:.1f} %", 100 * row.LocalizedRatio()),
                        row.errors ? fmt::format("{:.1f} %", 100 * row.PrecisionRatio()) : "-",
                        row.errors ? error(row.errors->median_m, row.errors->median_deg) : "-", width,
                        row.errors ? error(row.errors->p90_m, row.errors->p90_deg) : "-", width);
  }
  if (const size_t num_more = order.size() - num_lines; num_more > 0)
    text += fmt::format("  ... and {} better {}\n", num_more, num_more == 1 ? "one" : "ones");
  return text;
}

nlohmann::ordered_json SelfTestRegionsJson(const std::vector<RegionSelfTest>& regions) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const RegionSelfTest& row : regions) {
    nlohmann::ordered_json entry = {{"region", nullptr},
                                    {"num_held_out", row.num_held_out},
                                    {"num_localized", row.num_localized},
                                    {"num_gross_errors", row.num_gross_errors},
                                    {"localized_ratio", row.LocalizedRatio()},
                                    {"precision_ratio", nullptr}};
    if (row.region != kOutsideRegions) entry["region"] = row.region;
    if (row.errors) {
      entry["precision_ratio"] = row.PrecisionRatio();
      entry["median_error_m"] = row.errors->median_m;
      entry["median_error_deg"] = row.errors->median_deg;
      entry["p90_error_m"] = row.errors->p90_m;
      entry["p90_error_deg"] = row.errors->p90_deg;
    }
    list.push_back(std::move(entry));
  }
  return list;
}

}  // namespace cairn::check_map
