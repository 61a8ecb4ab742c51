#include "pipeline/report/report_inputs.h"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

namespace cairn::pipeline {
namespace {

using Json = nlohmann::ordered_json;

// Nothing is drawn beyond this, metres: no map reaches that far.
constexpr double kMaxPlace = 1e7;

bool IsText(const Json& object, const char* key) { return !object.contains(key) || object[key].is_string(); }
bool IsPlaceNumber(const Json& number) {
  return number.is_number() && std::abs(number.get<double>()) <= kMaxPlace;
}
bool IsNumber(const Json& object, const char* key) {
  return !object.contains(key) || IsPlaceNumber(object[key]);
}
// At least zero.
bool IsAmount(const Json& object, const char* key) {
  return !object.contains(key) ||
         (object[key].is_number() && object[key].get<double>() >= 0 && object[key].get<double>() < 1e15);
}

// x, y and a heading, where there is one.
bool IsPlace(const Json& object, const char* key) {
  if (!object.contains(key)) return true;
  const Json& place = object[key];
  return place.is_array() && place.size() >= 2 && std::all_of(place.begin(), place.end(), IsPlaceNumber);
}

bool IsPose(const Json& object, const char* key) {
  if (!object.contains(key)) return true;
  const Json& pose = object[key];
  return pose.is_object() && pose.contains("x_m") && pose.contains("y_m") && IsNumber(pose, "x_m") &&
         IsNumber(pose, "y_m") && IsNumber(pose, "heading_deg");
}

// Whether the list of that name, if there is one, holds only valid objects.
template <typename IsRight>
bool AreAll(const Json& object, const char* key, const IsRight& is_right) {
  if (!object.contains(key)) return true;
  const Json& list = object[key];
  return list.is_array() && std::all_of(list.begin(), list.end(), [&](const Json& entry) {
           return entry.is_object() && is_right(entry);
         });
}

}  // namespace

bool IsBuildReport(const Json& build) {
  return build.contains("stages") && AreAll(build, "stages", [](const Json& stage) {
           if (!stage.contains("stage") || !IsText(stage, "stage") || !IsAmount(stage, "seconds") ||
               !IsAmount(stage, "peak_memory_bytes"))
             return false;
           if (stage.contains("out")) {
             if (!stage["out"].is_object()) return false;
             for (const auto& [noun, number] : stage["out"].items()) {
               if (!IsAmount(stage["out"], noun.c_str())) return false;
             }
           }
           return AreAll(stage, "rejected", [](const Json& reject) {
             return reject.contains("what") && IsText(reject, "what") && reject.contains("count") &&
                    IsAmount(reject, "count") && reject.contains("reason") && IsText(reject, "reason");
           });
         });
}

bool IsCheckReport(const Json& check) {
  return check.contains("images") && AreAll(check, "images", [](const Json& image) {
           return IsText(image, "name") && IsText(image, "message") && IsText(image, "rejected") &&
                  IsText(image, "reason") && IsPlace(image, "true_floor") && IsPlace(image, "floor") &&
                  IsNumber(image, "error_m") && IsAmount(image, "error_m") && IsNumber(image, "error_deg") &&
                  IsAmount(image, "error_deg") && IsAmount(image, "num_inliers") &&
                  (!image.contains("is_gross_error") || image["is_gross_error"].is_boolean()) &&
                  (!image.contains("floor") || image.contains("error_m"));
         });
}

bool IsCheckOf(const Json& check, const MapRows& rows) {
  const auto is_number = [&](const std::string& key, double value) {
    return check.contains(key) && check[key].is_number() && check[key].get<double>() == value;
  };
  return is_number("num_landmarks", static_cast<double>(rows.landmarks.size())) &&
         is_number("num_regions", static_cast<double>(rows.regions.size())) &&
         std::all_of(rows.self_test.begin(), rows.self_test.end(),
                     [&](const auto& figure) { return is_number(figure.first, figure.second); });
}

bool IsDrive(const Json& drive) {
  const auto is_step = [](const Json& step) { return IsPose(step, "pose"); };
  return drive.contains("start") && IsPose(drive, "start") &&
         (!drive.contains("reached") || drive["reached"].is_boolean()) &&
         AreAll(drive, "legs", [&](const Json& leg) {
           return IsText(leg, "kind") && IsPose(leg, "pose") && AreAll(leg, "steps", is_step);
         });
}

}  // namespace cairn::pipeline
