#include "stages/decompose_views/plan/read_plan.h"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "core/base/text.h"
#include "core/files/file.h"
#include "stages/decompose_views/plan/check_rings.h"

namespace cairn::decompose_views {
namespace {

using nlohmann::json;

constexpr double kMaxCoordinateM = 1e9;
constexpr int kMaxDepth = 32;

class GeoJsonReader {
 public:
  explicit GeoJsonReader(const std::string& what) : what_(what) {}

  Status Read(const json& object, int depth = 0) {
    if (depth > kMaxDepth) return Corrupt(what_, "collections in collections, more than {} deep", kMaxDepth);
    const std::string type = object.is_object() ? object.value("type", json()).dump() : "";
    if (type == "\"FeatureCollection\"") return ReadAll(object, "features", depth);
    if (type == "\"GeometryCollection\"") return ReadAll(object, "geometries", depth);
    if (type == "\"Feature\"") {
      if (!object.contains("geometry")) return Corrupt(what_, "a Feature has no \"geometry\"");
      return object["geometry"].is_null() ? Ok() : Read(object["geometry"], depth + 1);
    }
    if (type == "\"Polygon\"") return ReadPolygon(object.value("coordinates", json()));
    if (type == "\"MultiPolygon\"") {
      const json polygons = object.value("coordinates", json());
      if (!polygons.is_array()) return Corrupt(what_, "a MultiPolygon has no list \"coordinates\"");
      for (const json& polygon : polygons) CAIRN_RETURN_IF_ERROR(ReadPolygon(polygon));
      return Ok();
    }
    return MakeError(ErrorCode::kUnsupported,
                     "{}: a GeoJSON object of type {}; floor plans are Polygon or MultiPolygon (walls that "
                     "enclose nothing: lines x0,y0,x1,y1)",
                     what_, type.empty() ? "?" : type);
  }

  InputPlan plan;

 private:
  Status ReadAll(const json& object, const char* member, int depth) {
    const auto list = object.find(member);
    if (list == object.end() || !list->is_array()) return Corrupt(what_, "no list \"{}\"", member);
    const bool has_free_space = std::any_of(list->begin(), list->end(), IsFreeSpace);
    for (const json& part : *list) {
      if (!has_free_space || IsFreeSpace(part)) CAIRN_RETURN_IF_ERROR(Read(part, depth + 1));
    }
    return Ok();
  }

  // A plan may also contain furniture and rooms: those polygons are not the plan's walls.
  static bool IsFreeSpace(const json& object) {
    const auto properties = object.is_object() ? object.find("properties") : object.end();
    if (!object.is_object() || properties == object.end() || !properties->is_object()) return false;
    const auto kind = properties->find("kind");
    return kind != properties->end() && kind->is_string() && *kind == "free_space";
  }

  Status ReadPolygon(const json& rings) {
    if (!rings.is_array() || rings.empty()) return Corrupt(what_, "a Polygon has no list of rings");
    for (size_t i = 0; i < rings.size(); ++i) CAIRN_RETURN_IF_ERROR(ReadRing(rings[i], i == 0));
    return Ok();
  }

  Status ReadRing(const json& points, bool outer) {
    const size_t number = plan.rings.size() + 1;
    if (!points.is_array()) return Corrupt(what_, "ring {} is not a list of points", number);
    std::vector<Eigen::Vector2d> ring;
    for (const json& point : points) {
      if (!point.is_array() || point.size() < 2 || !point[0].is_number() || !point[1].is_number()) {
        return Corrupt(what_, "ring {}: point {} is not [x, y] in metres", number, ring.size() + 1);
      }
      const Eigen::Vector2d place(point[0].get<double>(), point[1].get<double>());
      if (!(place.array().abs() <= kMaxCoordinateM).all()) {
        return Corrupt(what_, "ring {}: point {} lies beyond {:g} m", number, ring.size() + 1,
                       kMaxCoordinateM);
      }
      ring.push_back(place);
    }
    if (ring.size() < 4) {
      return Corrupt(what_,
                     "ring {} has {} points; a closed ring has at least 4, the last equal to the first",
                     number, ring.size());
    }
    if (ring.front() != ring.back()) {
      return Corrupt(
          what_,
          "ring {} is open: it begins at ({:g}, {:g}) and ends at ({:g}, {:g}); repeat the first point",
          number, ring.front().x(), ring.front().y(), ring.back().x(), ring.back().y());
    }
    ring.pop_back();
    if ((TwiceArea(ring) > 0) != outer) std::reverse(ring.begin(), ring.end());
    plan.rings.push_back(std::move(ring));
    return Ok();
  }

  const std::string& what_;
};

Result<InputPlan> ParseGeoJson(const std::string& text, const std::string& what) {
  json document;
  try {
    document = json::parse(text);
  } catch (const json::parse_error& error) {
    if (error.byte > text.size())
      return Corrupt(what, "JSON that ends too early, after {} bytes", text.size());
    return Corrupt(what, "begins with '{{' but is not JSON: it goes wrong at byte {} of {}", error.byte,
                   text.size());
  } catch (const json::out_of_range&) {
    return Corrupt(what, "a number in it is too large; expected metres up to {:g}", kMaxCoordinateM);
  }
  GeoJsonReader reader(what);
  CAIRN_RETURN_IF_ERROR(reader.Read(document));
  if (reader.plan.rings.empty()) return MakeError(ErrorCode::kNoData, "{}: no polygon in it", what);
  return std::move(reader.plan);
}

Result<InputPlan> ParseSegments(const std::string& text, const std::string& what) {
  InputPlan plan;
  int number = 0;
  for (const std::string_view line : SplitLines(text)) {
    ++number;
    const std::string_view trimmed = Trim(line);
    if (trimmed.empty() || trimmed[0] == '#') continue;
    const std::vector<double> values = ParseNumbers(trimmed).value_or(std::vector<double>());
    const bool is_near =
        std::all_of(values.begin(), values.end(), [](double v) { return std::abs(v) <= kMaxCoordinateM; });
    if (values.size() != 4 || !is_near) {
      return Corrupt(what, "line {}: {:?} is not x0,y0,x1,y1 in metres (four finite numbers up to {:g})",
                     number, trimmed.substr(0, 80), kMaxCoordinateM);
    }
    plan.segments.push_back({{values[0], values[1]}, {values[2], values[3]}, number});
  }
  if (plan.segments.empty()) {
    return MakeError(ErrorCode::kNoData, "{}: no walls in it; expected lines x0,y0,x1,y1 or GeoJSON", what);
  }
  return plan;
}

}  // namespace

Result<InputPlan> ParsePlan(const std::string& text, const std::string& what) {
  return Trim(text).starts_with('{') ? ParseGeoJson(text, what) : ParseSegments(text, what);
}

Result<InputPlan> ReadPlan(const std::string& path) {
  CAIRN_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  return ParsePlan(text, path);
}

}  // namespace cairn::decompose_views
