#include "core/geometry/geodesy.h"

#include <gtest/gtest.h>

namespace cairn {
namespace {

TEST(Geodesy, EcefOfKnownPlaces) {
  EXPECT_LT((EcefFromGeodetic({0, 0, 0}) - Eigen::Vector3d(6378137, 0, 0)).norm(), 1e-6);
  EXPECT_LT((EcefFromGeodetic({0, 90, 10}) - Eigen::Vector3d(0, 6378147, 0)).norm(), 1e-6);
  EXPECT_LT((EcefFromGeodetic({90, 0, 0}) - Eigen::Vector3d(0, 0, 6356752.3142)).norm(), 1e-4);
  // The normal at 45 degrees is 6388838.290 m long: x = N cos 45, z = N (1 - e^2) sin 45.
  EXPECT_LT((EcefFromGeodetic({45, 0, 0}) - Eigen::Vector3d(4517590.8788, 0, 4487348.4088)).norm(), 1e-3);
}

TEST(Geodesy, AMilliDegreeAtTheEquator) {
  // 111.3195 m to the east, 110.5743 m to the north; the ground falls away by d^2 / 2R = 1 mm.
  const Eigen::Vector3d east = EnuFromGeodetic({0, 20, 0}, {0, 20.001, 0});
  EXPECT_NEAR(east.x(), 111.3195, 1e-3);
  EXPECT_NEAR(east.y(), 0, 1e-6);
  EXPECT_NEAR(east.z(), -0.00097, 1e-4);
  const Eigen::Vector3d north = EnuFromGeodetic({0, 20, 0}, {0.001, 20, 5});
  EXPECT_NEAR(north.x(), 0, 1e-6);
  EXPECT_NEAR(north.y(), 110.5743, 2e-3);
  EXPECT_NEAR(north.z(), 5 - 0.00097, 1e-3);
}

TEST(Geodesy, InverseIsExactOnAllHemispheresAndAtThePoles) {
  for (const double latitude : {-90.0, -71.3, -33.9, 0.0, 1e-4, 55.7, 89.999}) {
    for (const double longitude : {-179.99, -70.0, 0.0, 13.2, 151.2}) {
      for (const double altitude : {-400.0, 0.0, 8848.0, 90000.0}) {
        const GeodeticPosition position{latitude, longitude, altitude};
        const GeodeticPosition again = GeodeticFromEcef(EcefFromGeodetic(position));
        EXPECT_NEAR(again.latitude_deg, latitude, 1e-10);
        EXPECT_NEAR(again.altitude_m, altitude, 1e-4);
        if (latitude > -90) {
          EXPECT_NEAR(again.longitude_deg, longitude, 1e-9);
        }
      }
    }
  }
}

TEST(Geodesy, EnuRoundTripAcrossThe180thMeridian) {
  const GeodeticPosition anchor{-17, 179.9999, 3};
  const Eigen::Vector3d enu(100, -50, 7);
  const GeodeticPosition position = GeodeticFromEnu(anchor, enu);
  EXPECT_LT(position.longitude_deg, -179);
  EXPECT_LT((EnuFromGeodetic(anchor, position) - enu).norm(), 1e-4);
}

}  // namespace
}  // namespace cairn
