#pragma once

#include <Eigen/Core>

namespace cairn {

// A place on the Earth, WGS84.  Altitude as its source defines it (EXIF: above sea level; the undulation of
// the geoid is not known here and nearly constant over a map).
struct GeodeticPosition {
  double latitude_deg = 0;   // north positive
  double longitude_deg = 0;  // east positive
  double altitude_m = 0;
};

// Earth-centred, earth-fixed coordinates, metres [NIMA TR8350.2 §4].
Eigen::Vector3d EcefFromGeodetic(const GeodeticPosition& position);
// Its inverse, to 1e-9 degrees and 1e-4 m for altitudes between -10 and 100 km [Bowring, Survey Review 1976].
GeodeticPosition GeodeticFromEcef(const Eigen::Vector3d& ecef);

// East, north, up in metres in the tangent frame at `anchor`, and back.
Eigen::Vector3d EnuFromGeodetic(const GeodeticPosition& anchor, const GeodeticPosition& position);
GeodeticPosition GeodeticFromEnu(const GeodeticPosition& anchor, const Eigen::Vector3d& enu);

}  // namespace cairn
