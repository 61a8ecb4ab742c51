#pragma once

#include <string>

#include "core/base/error.h"
#include "stages/decompose_views/formats/input_plan.h"

namespace cairn::decompose_views {

// A plan and what its file says of its coordinates.
struct GeoJsonPlan {
  InputPlan plan;  // in the file's units
  // The name of the file's coordinate reference system (member "crs"), where that is one of degrees; else
  // empty.
  std::string crs_of_degrees;
};

// Reads RFC 7946's objects, coordinates taken as plane ones: Polygon, MultiPolygon, LineString,
// MultiLineString, GeometryCollection, Feature, FeatureCollection; where features have the property "kind" =
// "free_space", those alone.  Polygons alone are a closed plan; where there are lines too, rings are walls as
// lines are. `what` names the text in messages.  Errors: Corrupt (no JSON, an open ring, coordinates that are
// no finite numbers; names the ring or line and the point), Unsupported (other geometries), NoData (no
// walls).
Result<GeoJsonPlan> ParseGeoJson(const std::string& text, const std::string& what);

}  // namespace cairn::decompose_views
