#include "stages/decompose_views/formats/geojson_plan.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

namespace cairn::decompose_views {
namespace {

using nlohmann::json;

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
    if (type == "\"LineString\"") return ReadLine(object.value("coordinates", json()));
    if (type == "\"MultiLineString\"") {
      const json lines = object.value("coordinates", json());
      if (!lines.is_array()) return Corrupt(what_, "a MultiLineString has no list \"coordinates\"");
      for (const json& line : lines) CAIRN_RETURN_IF_ERROR(ReadLine(line));
      return Ok();
    }
    return MakeError(
        ErrorCode::kUnsupported,
        "{}: a GeoJSON object of type {}; floor plans are Polygon and MultiPolygon, or walls that enclose "
        "nothing in particular as LineString and MultiLineString",
        what_, type.empty() ? "?" : type);
  }

  // Rings and lines, after Read.
  InputPlan Plan() && {
    if (lines_.empty()) return std::move(plan_);
    for (std::vector<Eigen::Vector2d>& ring : plan_.rings) {
      ring.push_back(ring.front());
      lines_.push_back({numbers_[&ring - plan_.rings.data()], std::move(ring)});
    }
    if (!plan_.rings.empty()) {
      plan_.notes.push_back(
          fmt::format("{} rings of polygons are walls, as there are lines besides; to make polygons "
                      "the plan's free space, give them the property \"kind\": \"free_space\"",
                      plan_.rings.size()));
    }
    plan_.rings.clear();
    std::stable_sort(lines_.begin(), lines_.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    for (const auto& [number, points] : lines_) {
      for (size_t i = 0; i + 1 < points.size(); ++i)
        plan_.segments.push_back({points[i], points[i + 1], number});
    }
    return std::move(plan_);
  }

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

  Result<std::vector<Eigen::Vector2d>> ReadPoints(const json& points, const char* kind) {
    ++num_parts_;
    if (!points.is_array()) return Corrupt(what_, "{} {} is not a list of points", kind, num_parts_);
    std::vector<Eigen::Vector2d> places;
    for (const json& point : points) {
      if (!point.is_array() || point.size() < 2 || !point[0].is_number() || !point[1].is_number()) {
        return Corrupt(what_, "{} {}: point {} is not [x, y] in metres", kind, num_parts_, places.size() + 1);
      }
      const Eigen::Vector2d place(point[0].get<double>(), point[1].get<double>());
      if (!(place.array().abs() <= kMaxCoordinateM).all()) {
        return Corrupt(what_, "{} {}: point {} lies beyond {:g} m", kind, num_parts_, places.size() + 1,
                       kMaxCoordinateM);
      }
      places.push_back(place);
    }
    return places;
  }

  Status ReadLine(const json& points) {
    CAIRN_ASSIGN_OR_RETURN(std::vector<Eigen::Vector2d> line, ReadPoints(points, "line"));
    if (line.size() < 2)
      return Corrupt(what_, "line {} has {} points, a wall has two ends", num_parts_, line.size());
    lines_.push_back({num_parts_, std::move(line)});
    return Ok();
  }

  Status ReadRing(const json& points, bool outer) {
    CAIRN_ASSIGN_OR_RETURN(std::vector<Eigen::Vector2d> ring, ReadPoints(points, "ring"));
    if (ring.size() < 4) {
      return Corrupt(what_,
                     "ring {} has {} points; a closed ring has at least 4, the last equal to the first",
                     num_parts_, ring.size());
    }
    if (ring.front() != ring.back()) {
      return Corrupt(
          what_,
          "ring {} is open: it begins at ({:g}, {:g}) and ends at ({:g}, {:g}); repeat the first point",
          num_parts_, ring.front().x(), ring.front().y(), ring.back().x(), ring.back().y());
    }
    ring.pop_back();
    if ((TwiceArea(ring) > 0) != outer) std::reverse(ring.begin(), ring.end());
    plan_.rings.push_back(std::move(ring));
    numbers_.push_back(num_parts_);
    return Ok();
  }

  const std::string& what_;
  InputPlan plan_;
  std::vector<std::pair<int, std::vector<Eigen::Vector2d>>> lines_;  // by number
  std::vector<int> numbers_;                                         // of the rings
  int num_parts_ = 0;
};

// The name of a coordinate reference system of degrees, if the file has one: its member "crs" of 2008, which
// QGIS and ogr2ogr still write.
std::string CrsOfDegrees(const json& document) {
  static const json::json_pointer kName("/crs/properties/name");
  if (!document.contains(kName) || !document[kName].is_string()) return "";
  const std::string text = document[kName].get<std::string>();
  // WGS 84 (with height), NAD83, ETRS89.
  for (const char* code : {"CRS84", ":4326", ":4979", ":4269", ":4258"}) {
    if (text.ends_with(code)) return text;
  }
  return "";
}

}  // namespace

Result<GeoJsonPlan> ParseGeoJson(const std::string& text, const std::string& what) {
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
  GeoJsonPlan result{std::move(reader).Plan(), CrsOfDegrees(document)};
  if (result.plan.rings.empty() && result.plan.segments.empty())
    return MakeError(ErrorCode::kNoData, "{}: no polygon and no line in it", what);
  return result;
}

}  // namespace cairn::decompose_views
