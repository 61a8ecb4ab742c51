#include "pipeline/explain/pareto_points.h"

#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include "core/base/text.h"

namespace cairn::pipeline {
namespace {

constexpr std::string_view kHead =
    "max_bytes,bytes,landmarks,descriptor_bits,min_common_landmarks,stations_below_k,held_out,localized_"
    "ratio,"
    "within_10cm_5deg_ratio,precision_ratio,median_error_m,median_error_deg";

std::string NumberCell(const std::optional<double>& value, double unit, int digits) {
  return value ? fmt::format("{:.{}f}", *value / unit, digits) : "-";
}

bool IsRatio(double value) { return value >= 0 && value <= 1; }

}  // namespace

std::string ParetoCsv(const std::vector<ParetoPoint>& points) {
  std::string csv = fmt::format("{}\n", kHead);
  for (const ParetoPoint& point : points) {
    const auto number = [](const std::optional<double>& value) {
      return value ? fmt::format("{}", *value) : "";
    };
    csv += fmt::format("{},{},{},{},{},{},{},{},{},{},{},{}\n", point.max_bytes, point.num_bytes,
                       point.num_landmarks, point.descriptor_bits, point.min_common_landmarks,
                       point.num_stations_below_k, point.num_held_out, point.localized_ratio,
                       point.within_10cm_5deg_ratio, point.precision_ratio, number(point.median_error_m),
                       number(point.median_error_deg));
  }
  return csv;
}

Result<std::vector<ParetoPoint>> ParseParetoCsv(const std::string& csv, const std::string& path) {
  std::vector<ParetoPoint> points;
  const std::vector<std::string_view> lines = SplitLines(csv);
  if (lines.empty() || lines[0] != kHead)
    return MakeError(ErrorCode::kCorrupt, "{}: does not begin with the head of a table of cairn pareto: '{}'",
                     path, kHead);
  for (size_t i = 1; i < lines.size(); ++i) {
    const std::vector<std::string> fields = SplitFields(lines[i], ',');
    ParetoPoint point;
    const auto read_if_any = [](const std::string& field, std::optional<double>* value) {
      return field.empty() ||
             (ParseNumber(field, &value->emplace()) && std::isfinite(**value) && **value >= 0);
    };
    if (fields.size() != 12 || !ParseNumber(fields[0], &point.max_bytes) ||
        !ParseNumber(fields[1], &point.num_bytes) || !ParseNumber(fields[2], &point.num_landmarks) ||
        !ParseNumber(fields[3], &point.descriptor_bits) ||
        !ParseNumber(fields[4], &point.min_common_landmarks) ||
        !ParseNumber(fields[5], &point.num_stations_below_k) ||
        !ParseNumber(fields[6], &point.num_held_out) || !ParseNumber(fields[7], &point.localized_ratio) ||
        !ParseNumber(fields[8], &point.within_10cm_5deg_ratio) ||
        !ParseNumber(fields[9], &point.precision_ratio) || !read_if_any(fields[10], &point.median_error_m) ||
        !read_if_any(fields[11], &point.median_error_deg) || point.num_bytes < 1 ||
        !IsRatio(point.localized_ratio) || !IsRatio(point.within_10cm_5deg_ratio) ||
        !IsRatio(point.precision_ratio)) {
      return MakeError(ErrorCode::kCorrupt, "{}: line {} is not of the form that cairn pareto writes", path,
                       i + 1);
    }
    points.push_back(point);
  }
  return points;
}

std::string ParetoText(const std::vector<ParetoPoint>& points) {
  std::string text = fmt::format("{:>10} {:>10} {:>9} {:>5} {:>7} {:>8} {:>10} {:>12} {:>10} {:>8} {:>7}\n",
                                 "at most", "bytes", "landmarks", "bits", "common", "below k", "localized",
                                 "10 cm, 5 deg", "precision", "cm", "deg");
  for (const ParetoPoint& point : points) {
    text += fmt::format(
        "{:>10} {:>10} {:>9} {:>5} {:>7} {:>8} {:>8.1f} % {:>10.1f} % {:>8.1f} % {:>8} {:>7}\n",
        point.max_bytes > 0 ? std::to_string(point.max_bytes) : "-", point.num_bytes, point.num_landmarks,
        point.descriptor_bits, point.min_common_landmarks, point.num_stations_below_k,
        100 * point.localized_ratio, 100 * point.within_10cm_5deg_ratio, 100 * point.precision_ratio,
        NumberCell(point.median_error_m, 0.01, 2), NumberCell(point.median_error_deg, 1, 2));
  }
  return text;
}

}  // namespace cairn::pipeline
