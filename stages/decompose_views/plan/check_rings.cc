#include "stages/decompose_views/plan/check_rings.h"

#include <memory>

#include <geos/geom/CoordinateArraySequence.h>
#include <geos/geom/GeometryFactory.h>
#include <geos/geom/LinearRing.h>
#include <geos/geom/MultiPolygon.h>
#include <geos/geom/Polygon.h>
#include <geos/operation/valid/IsValidOp.h>
#include <geos/util/GEOSException.h>

#include "stages/decompose_views/formats/input_plan.h"

namespace cairn::decompose_views {
namespace {

using geos::geom::Coordinate;

std::unique_ptr<geos::geom::LinearRing> MakeRing(const geos::geom::GeometryFactory& factory,
                                                 const std::vector<Eigen::Vector2d>& ring) {
  std::vector<Coordinate> points;
  for (const Eigen::Vector2d& point : ring) points.emplace_back(point.x(), point.y());
  points.push_back(points.front());
  return factory.createLinearRing(
      std::make_unique<geos::geom::CoordinateArraySequence>(std::move(points), 2));
}

}  // namespace

Status CheckRings(const std::vector<std::vector<Eigen::Vector2d>>& rings) {
  try {
    const auto factory = geos::geom::GeometryFactory::create();
    std::vector<std::unique_ptr<geos::geom::Polygon>> polygons;
    for (size_t i = 0; i < rings.size();) {
      auto shell = MakeRing(*factory, rings[i]);
      std::vector<std::unique_ptr<geos::geom::LinearRing>> holes;
      for (++i; i < rings.size() && TwiceArea(rings[i]) < 0; ++i)
        holes.push_back(MakeRing(*factory, rings[i]));
      polygons.push_back(factory->createPolygon(std::move(shell), std::move(holes)));
    }
    const auto all = factory->createMultiPolygon(std::move(polygons));
    geos::operation::valid::IsValidOp check(all.get());
    const auto* error = check.getValidationError();
    if (error == nullptr) return Ok();
    const Coordinate& place = error->getCoordinate();
    return MakeError(ErrorCode::kCorrupt, "the polygon is not valid: {} at ({:g}, {:g})", error->getMessage(),
                     place.x, place.y);
  } catch (const geos::util::GEOSException& exception) {
    return MakeError(ErrorCode::kCorrupt, "the polygon is not valid: {}", exception.what());
  }
}

}  // namespace cairn::decompose_views
