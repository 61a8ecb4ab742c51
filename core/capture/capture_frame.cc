#include "core/capture/capture_frame.h"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "core/files/file.h"

namespace cairn {
namespace {

constexpr double kMaxCoordinateM = 1e7;
constexpr int kNumDigits = 3;  // that say something, of a length in an arbitrary unit

}  // namespace

const char* LengthUnit(const CaptureFrame& frame) { return IsMetric(frame) ? "m" : "units"; }

std::string ShortLength(const CaptureFrame& frame, double length, int digits) {
  if (IsMetric(frame)) return fmt::format("{:.{}f} cm", 100 * length, digits);
  return fmt::format("{:.{}g} units", length, kNumDigits);
}

Status CheckCaptureFrame(const CaptureFrame& frame) {
  if (!IsMetric(frame) && frame.unit != "arbitrary") {
    return MakeError(ErrorCode::kInvalidArgument, "unit '{}': expected 'metre' or 'arbitrary'", frame.unit);
  }
  const bool is_scale_valid = frame.scale_sigma_ratio >= 0 && frame.scale_sigma_ratio < 1 &&
                              frame.scale_centre.allFinite() &&
                              frame.scale_centre.cwiseAbs().maxCoeff() < kMaxCoordinateM;
  if (!is_scale_valid) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "scale known to {} of it about {}, {}, {}: expected a standard deviation in [0, 1) and a "
        "place within {:g} m",
        frame.scale_sigma_ratio, frame.scale_centre.x(), frame.scale_centre.y(), frame.scale_centre.z(),
        kMaxCoordinateM);
  }
  if (!IsMetric(frame) && frame.scale_sigma_ratio > 0) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "a frame of arbitrary unit says how well its scale is known: expected the unit metre");
  }
  if (!frame.anchor) return Ok();
  const GeodeticPosition& a = *frame.anchor;
  const bool is_valid =
      std::abs(a.latitude_deg) <= 90 && std::abs(a.longitude_deg) <= 180 && std::isfinite(a.altitude_m);
  if (!is_valid) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "anchor {}, {}, {}: expected a latitude in [-90, 90], a longitude in [-180, 180] and an "
                     "altitude in metres",
                     a.latitude_deg, a.longitude_deg, a.altitude_m);
  }
  if (!IsMetric(frame)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "a frame of arbitrary unit has an anchor: expected the unit metre");
  }
  return Ok();
}

std::string CaptureFrameJson(const CaptureFrame& frame) {
  nlohmann::ordered_json document = {
      {"unit", frame.unit}, {"source", frame.source}, {"is_reconstructed", frame.is_reconstructed}};
  if (frame.has_refined_cameras) document["has_refined_cameras"] = true;
  if (frame.anchor) {
    document["anchor"] = {{"latitude_deg", frame.anchor->latitude_deg},
                          {"longitude_deg", frame.anchor->longitude_deg},
                          {"altitude_m", frame.anchor->altitude_m}};
  }
  if (frame.scale_sigma_ratio > 0) {
    document["scale_sigma_ratio"] = frame.scale_sigma_ratio;
    document["scale_centre"] = {frame.scale_centre.x(), frame.scale_centre.y(), frame.scale_centre.z()};
  }
  return document.dump(2) + "\n";
}

Result<CaptureFrame> ReadCaptureFrame(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  const auto document = nlohmann::json::parse(text, nullptr, false);
  const auto has = [&](const nlohmann::json& object, const char* key, bool is_number) {
    return object.is_object() && object.contains(key) &&
           (is_number ? object[key].is_number() : object[key].is_string());
  };
  if (!has(document, "unit", false) || !has(document, "source", false)) {
    return MakeError(ErrorCode::kCorrupt, "{}: expected a JSON object with the texts 'unit' and 'source'",
                     path);
  }
  CaptureFrame frame{.unit = document["unit"].get<std::string>(),
                     .source = document["source"].get<std::string>(),
                     .is_reconstructed = document.value("is_reconstructed", nlohmann::json()) == true,
                     .has_refined_cameras = document.value("has_refined_cameras", nlohmann::json()) == true};
  if (document.contains("anchor")) {
    const nlohmann::json& anchor = document["anchor"];
    for (const char* key : {"latitude_deg", "longitude_deg", "altitude_m"}) {
      if (!has(anchor, key, true))
        return MakeError(ErrorCode::kCorrupt, "{}: anchor: expected the number '{}'", path, key);
    }
    frame.anchor =
        GeodeticPosition{anchor["latitude_deg"].get<double>(), anchor["longitude_deg"].get<double>(),
                         anchor["altitude_m"].get<double>()};
  }
  if (document.contains("scale_sigma_ratio")) {
    const nlohmann::json centre = document.value("scale_centre", nlohmann::json());
    const bool is_place =
        centre.is_array() && centre.size() == 3 &&
        std::all_of(centre.begin(), centre.end(), [](const auto& x) { return x.is_number(); });
    if (!has(document, "scale_sigma_ratio", true) || !is_place) {
      return MakeError(ErrorCode::kCorrupt,
                       "{}: expected the number 'scale_sigma_ratio' with three numbers in 'scale_centre'",
                       path);
    }
    frame.scale_sigma_ratio = document["scale_sigma_ratio"].get<double>();
    for (int i = 0; i < 3; ++i) frame.scale_centre[i] = centre[static_cast<size_t>(i)].get<double>();
  }
  if (const Status status = CheckCaptureFrame(frame); !status.ok())
    return MakeError(ErrorCode::kCorrupt, "{}: {}", path, status.error().message);
  return frame;
}

}  // namespace cairn
