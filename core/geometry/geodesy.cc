#include "core/geometry/geodesy.h"

#include <cmath>

#include "core/geometry/pose.h"

namespace cairn {
namespace {

// WGS84 [NIMA TR8350.2 table 3.1]: semi-major axis, flattening.
constexpr double kA = 6378137.0;
constexpr double kF = 1.0 / 298.257223563;
constexpr double kB = kA * (1 - kF);
constexpr double kE2 = kF * (2 - kF);          // first eccentricity, squared
constexpr double kSecondE2 = kE2 / (1 - kE2);  // second eccentricity, squared

// Rows: the directions east, north and up at a place, in ECEF.
Eigen::Matrix3d EnuFromEcefRotation(const GeodeticPosition& place) {
  const double lat = RadFromDeg(place.latitude_deg), lon = RadFromDeg(place.longitude_deg);
  Eigen::Matrix3d rotation;
  rotation << -std::sin(lon), std::cos(lon), 0,                                       //
      -std::sin(lat) * std::cos(lon), -std::sin(lat) * std::sin(lon), std::cos(lat),  //
      std::cos(lat) * std::cos(lon), std::cos(lat) * std::sin(lon), std::sin(lat);
  return rotation;
}

}  // namespace

Eigen::Vector3d EcefFromGeodetic(const GeodeticPosition& position) {
  const double lat = RadFromDeg(position.latitude_deg), lon = RadFromDeg(position.longitude_deg);
  const double n = kA / std::sqrt(1 - kE2 * std::pow(std::sin(lat), 2));  // radius in the prime vertical
  const double h = position.altitude_m;
  return {(n + h) * std::cos(lat) * std::cos(lon), (n + h) * std::cos(lat) * std::sin(lon),
          (n * (1 - kE2) + h) * std::sin(lat)};
}

GeodeticPosition GeodeticFromEcef(const Eigen::Vector3d& ecef) {
  const double p = ecef.head<2>().norm();
  double reduced = std::atan2(ecef.z() * kA, p * kB);  // reduced latitude
  double lat = 0;
  // One round is good to a nanodegree at the ground; the second for altitudes.
  for (int round = 0; round < 2; ++round) {
    lat = std::atan2(ecef.z() + kSecondE2 * kB * std::pow(std::sin(reduced), 3),
                     p - kE2 * kA * std::pow(std::cos(reduced), 3));
    reduced = std::atan2((1 - kF) * std::sin(lat), std::cos(lat));
  }
  const double n = kA / std::sqrt(1 - kE2 * std::pow(std::sin(lat), 2));
  // Height over the tangent point: no division by a cosine or sine that vanishes at a pole or the equator.
  const double height = p * std::cos(lat) + ecef.z() * std::sin(lat) - kA * kA / n;
  return {DegFromRad(lat), DegFromRad(std::atan2(ecef.y(), ecef.x())), height};
}

Eigen::Vector3d EnuFromGeodetic(const GeodeticPosition& anchor, const GeodeticPosition& position) {
  return EnuFromEcefRotation(anchor) * (EcefFromGeodetic(position) - EcefFromGeodetic(anchor));
}

GeodeticPosition GeodeticFromEnu(const GeodeticPosition& anchor, const Eigen::Vector3d& enu) {
  return GeodeticFromEcef(EcefFromGeodetic(anchor) + EnuFromEcefRotation(anchor).transpose() * enu);
}

}  // namespace cairn
