#include "stages/filter_visibility/filter_visibility.h"

#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/random.h"
#include "stages/filter_visibility/lattice_area.h"
#include "stages/filter_visibility/stations.h"

namespace cairn::filter_visibility {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// A level camera (z up) at (x, y, 1) that looks along `heading_deg`.
Pose CameraAt(double x, double y, double heading_deg) {
  const double a = RadFromDeg(heading_deg);
  Eigen::Matrix3d world_from_cam;  // columns: right, down, forward
  world_from_cam.col(0) = Eigen::Vector3d(std::sin(a), -std::cos(a), 0);
  world_from_cam.col(1) = Eigen::Vector3d(0, 0, -1);
  world_from_cam.col(2) = Eigen::Vector3d(std::cos(a), std::sin(a), 0);
  return Pose{Eigen::Quaterniond(world_from_cam), Eigen::Vector3d(x, y, 1)}.Inverse();
}

// A lattice survey with four headings at every 'o', half a metre apart; row 0 is y = 0.  Image ids count from
// 1, four a station; noise_m moves every image.
Classes LatticeSurvey(const std::vector<std::string>& drawing, double noise_m = 0) {
  Classes classes;
  Random random(5);
  for (size_t row = 0; row < drawing.size(); ++row) {
    for (size_t column = 0; column < drawing[row].size(); ++column) {
      if (drawing[row][column] != 'o') continue;
      for (const double heading_deg : {0, 90, 180, 270}) {
        SurveyImage image;
        image.image_id = static_cast<ImageId>(classes.images.size() + 1);
        image.cam_from_world = CameraAt(0.5 * column + random.Uniform(-noise_m, noise_m),
                                        0.5 * row + random.Uniform(-noise_m, noise_m), heading_deg);
        classes.images.push_back(image);
      }
    }
  }
  return classes;
}

// Adds a class that is seen from the '#' of a drawing, in the first image of each station.
void AddClass(const std::vector<std::string>& drawing, Classes* classes) {
  FeatureClass& feature_class = classes->classes.emplace_back();
  feature_class.class_id = static_cast<ClassId>(10 * classes->classes.size());
  ImageId first_image = 1;
  for (const std::string& row : drawing) {
    for (const char station : row) {
      if (station == ' ') continue;
      if (station == '#') feature_class.observations.push_back({.image_id = first_image});
      first_image += 4;
    }
  }
}

const std::vector<std::string> kFullLattice(6, "oooooooo");

Stations LatticeStations(const std::vector<std::string>& drawing) {
  const Result<Stations> stations = FindStations(LatticeSurvey(drawing).images, {});
  EXPECT_TRUE(stations.ok());
  return *stations;
}

// Stations of the '#' of a drawing of the full lattice.
std::vector<StationIdx> Area(const std::vector<std::string>& drawing) {
  std::vector<StationIdx> area;
  StationIdx station = 0;
  for (const std::string& row : drawing) {
    for (const char c : row) {
      if (c == '#') area.push_back(station);
      ++station;
    }
  }
  return area;
}

TEST(FindStations, RecognisesALatticeWithFourHeadings) {
  const Result<Stations> stations = FindStations(LatticeSurvey(kFullLattice, 0.01).images, {});
  ASSERT_TRUE(stations.ok());
  EXPECT_TRUE(stations->is_lattice);
  const World& world = stations->world;
  EXPECT_NEAR(world.lattice_spacing_m, 0.5, 0.005);
  ASSERT_EQ(world.num_stations(), 48);
  EXPECT_EQ(world.edges.size(), 6 * 7 + 5 * 8);  // 4-neighbours
  EXPECT_THAT(world.station_images[0], ElementsAre(1, 2, 3, 4));
  EXPECT_NEAR(world.positions[9].x(), 0.5, 0.01);  // second of the second row
  EXPECT_NEAR(world.positions[9].y(), 0.5, 0.01);
  EXPECT_THAT(world.headings_deg, IsEmpty());
  EXPECT_EQ(world.floor_from_world.Matrix(), Pose().Matrix());
  EXPECT_TRUE(CheckWorld(world).ok());
}

TEST(FindStations, RecognisesALatticeThatIsTurnedAgainstTheAxes) {
  Classes classes = LatticeSurvey(kFullLattice);
  const Pose turn{Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ())), {3.3, -7.1, 0}};
  for (SurveyImage& image : classes.images) image.cam_from_world = image.cam_from_world * turn.Inverse();
  const Result<Stations> stations = FindStations(classes.images, {});
  ASSERT_TRUE(stations.ok());
  EXPECT_TRUE(stations->is_lattice);
  EXPECT_EQ(stations->world.num_stations(), 48);
  EXPECT_EQ(stations->world.edges.size(), 6 * 7 + 5 * 8);
}

TEST(FindStations, DrivenSurveyHasCellsWithHeadings) {
  //  cells of 0.5 m:  | 0 | 1 |
  //  Three images in cell 0 (headings 0, 10 and 90), one in cell 1 (heading 359).
  std::vector<SurveyImage> images(4);
  images[0] = {.image_id = 7, .cam_from_world = CameraAt(0.1, 0.1, 0)};
  images[1] = {.image_id = 8, .cam_from_world = CameraAt(0.3, 0.2, 10)};
  images[2] = {.image_id = 9, .cam_from_world = CameraAt(0.2, 0.2, 90)};
  images[3] = {.image_id = 4, .cam_from_world = CameraAt(0.7, 0.2, 359)};
  const Result<Stations> stations = FindStations(images, {});
  ASSERT_TRUE(stations.ok());
  EXPECT_FALSE(stations->is_lattice);
  const World& world = stations->world;
  // Ordered by row, column, heading; 90 degrees is two bins from 0 and so not a neighbour.
  EXPECT_THAT(world.headings_deg, ElementsAre(0, 90, 0));
  EXPECT_THAT(world.edges, ElementsAre(std::pair(0, 2)));
  EXPECT_THAT(world.station_images[0], ElementsAre(7, 8));
  EXPECT_EQ(world.positions[0], Eigen::Vector2d(0.25, 0.25));
  EXPECT_EQ(world.lattice_spacing_m, 0);
}

TEST(FindStations, NeighbouringHeadingsOfACellAreAdjacentAroundTheCircle) {
  std::vector<SurveyImage> images;
  for (int i = 0; i < 8; ++i) {
    images.push_back({.image_id = static_cast<ImageId>(i + 1), .cam_from_world = CameraAt(0.1, 0.1, 45 * i)});
  }
  const Result<Stations> stations = FindStations(images, {});
  ASSERT_TRUE(stations.ok());
  EXPECT_EQ(stations->world.edges.size(), 8);
}

TEST(FindStations, UpIsTheMeanOfTheCamerasUnlessGiven) {
  // A world whose y axis points down, as a camera's does.
  Classes classes = LatticeSurvey(kFullLattice);
  const Pose y_down{Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitX())),
                    {0, 0, 0}};
  for (SurveyImage& image : classes.images) image.cam_from_world = image.cam_from_world * y_down;
  Result<Stations> stations = FindStations(classes.images, {});
  ASSERT_TRUE(stations.ok());
  const Eigen::Vector3d up_in_world = y_down.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  EXPECT_NEAR((stations->world.floor_from_world.rotation * up_in_world - Eigen::Vector3d::UnitZ()).norm(), 0,
              1e-9);
  EXPECT_TRUE(stations->is_lattice);

  FilterVisibilityOptions options;
  options.up = "0,0,2";
  stations = FindStations(classes.images, options);
  ASSERT_TRUE(stations.ok());
  EXPECT_EQ(stations->world.floor_from_world.Matrix(), Pose().Matrix());
  options.up = "1,2,3";
  const Pose given = FindStations(classes.images, options)->world.floor_from_world;
  EXPECT_NEAR((given.rotation * Eigen::Vector3d(1, 2, 3).normalized()).z(), 1, 1e-12);
  options.up = "upwards";
  EXPECT_EQ(FindStations(classes.images, options).error().code, ErrorCode::kInvalidArgument);
}

TEST(FindStations, ForcedLatticeOfATrajectoryIsAnError) {
  Random random(1);
  std::vector<SurveyImage> images;
  for (ImageId i = 1; i < 50; ++i) {
    images.push_back(
        {.image_id = i, .cam_from_world = CameraAt(random.Uniform(0, 9), random.Uniform(0, 9), 0)});
  }
  FilterVisibilityOptions options;
  options.survey = "lattice";
  EXPECT_THAT(FindStations(images, options).error().message, HasSubstr("do not lie on a square grid"));
}

TEST(HoleSizes, CountsStationsEnclosedByTheArea) {
  // The two stations in the middle are a hole; the one at the right is not: it is left over a diagonal.
  // clang-format off
  const std::vector<StationIdx> area = Area({"........",
                                             ".#######",
                                             ".#..##.#",
                                             ".######.",
                                             "..#.##..",
                                             "...###.."});
  // clang-format on
  EXPECT_THAT(HoleSizes(area, LatticeStations(kFullLattice)), ElementsAre(2));
}

TEST(HoleSizes, PillarsAreNoHoles) {
  //   o o o
  //   o   o      the lattice has no station in the middle
  //   o o o
  const Stations stations = LatticeStations({"ooo", "o o", "ooo"});
  EXPECT_THAT(HoleSizes({0, 1, 2, 3, 4, 5, 6, 7}, stations), IsEmpty());
}

TEST(TrimArea, KeepsNeighboursOfStationsWithSevenNeighbours) {
  // The tail to the right has no station with 7 of 8 neighbours; (2, 2) and (3, 2) have 8, the rest are
  // their neighbours.
  const Stations stations = LatticeStations(kFullLattice);
  // clang-format off
  const std::vector<StationIdx> area = Area({"........",
                                             ".####...",
                                             ".#######",
                                             ".####...",
                                             "........",
                                             "........"});
  const std::vector<StationIdx> expected = Area({"........",
                                                 ".####...",
                                                 ".####...",
                                                 ".####...",
                                                 "........",
                                                 "........"});
  // clang-format on
  EXPECT_EQ(TrimArea(area, stations, 7), expected);
  EXPECT_EQ(TrimArea(expected, stations, 7), expected);  // a fixed point
  EXPECT_EQ(TrimArea(area, stations, 0), area);
}

TEST(HasBlock, NeedsAFullSquare) {
  const Stations stations = LatticeStations(kFullLattice);
  const std::vector<StationIdx> area =
      Area({"###.....", "#.#.....", "###.....", "#.##....", "########", "........"});
  EXPECT_TRUE(HasBlock(area, stations, 2));
  EXPECT_FALSE(HasBlock(area, stations, 3));
}

TEST(FilterVisibility, CountsWhatItDropsByReason) {
  Classes classes = LatticeSurvey(kFullLattice);
  AddClass({"#####...", "#####...", "#####...", "#####...", "........", "........"}, &classes);  // kept
  AddClass({"###.....", "###.....", "###.....", "........", "........", "........"}, &classes);  // 9 stations
  AddClass({"########", "#......#", "########", "........", "........", "........"},
           &classes);  // a hole of 6
  AddClass({"##......", "##......", "##......", "########", "########", "........"}, &classes);  // no 3 x 3
  const Result<FilterVisibilityResult> result = FilterVisibility(classes, {});
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_THAT(result->world.class_ids, ElementsAre(10));
  EXPECT_EQ(result->world.areas[0].size(), 20);
  EXPECT_THAT(result->dropped,
              testing::UnorderedElementsAre(testing::Pair("few_stations", 1), testing::Pair("holes", 1),
                                            testing::Pair("no_block", 1)));
}

TEST(FilterVisibility, KeepsTheLargestComponent) {
  Classes classes = LatticeSurvey(kFullLattice);
  AddClass({"###..###", "###..###", "###..###", "......##", "........", "........"}, &classes);
  FilterVisibilityOptions options;
  options.min_num_stations = 9;
  const Result<FilterVisibilityResult> result = FilterVisibility(classes, options);
  ASSERT_TRUE(result.ok()) << result.error().message;
  // The right one has 11 stations; the station below its middle stays (its neighbour (6, 1) has all 8), as
  // does the last one: (6, 2) has 7 of 8 neighbours inside.
  EXPECT_EQ(result->world.areas[0],
            Area({".....###", ".....###", ".....###", "......##", "........", "........"}));
}

TEST(FilterVisibility, DrivenSurveysNeedConnectedStations) {
  Classes classes;
  for (ImageId i = 1; i <= 8; ++i) {
    classes.images.push_back({.image_id = i, .cam_from_world = CameraAt(0.25 + 0.5 * i, 0.25, 0)});
  }
  for (const std::vector<ImageId>& seen_in :
       {std::vector<ImageId>{1, 2, 3}, {1, 3, 5}, {1, 2}, {1, 2, 4, 5, 6}}) {
    FeatureClass& feature_class = classes.classes.emplace_back();
    feature_class.class_id = static_cast<ClassId>(classes.classes.size());
    for (const ImageId image_id : seen_in) feature_class.observations.push_back({.image_id = image_id});
  }
  const Result<FilterVisibilityResult> result = FilterVisibility(classes, {});
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_FALSE(result->is_lattice);
  EXPECT_THAT(result->world.class_ids, ElementsAre(1, 4));
  EXPECT_THAT(result->world.areas[1], ElementsAre(3, 4, 5));
  EXPECT_THAT(result->dropped,
              testing::UnorderedElementsAre(testing::Pair("few_stations", 1), testing::Pair("scattered", 1)));
}

TEST(FilterVisibility, NothingLeftIsAWorldWithoutFeaturesAndNamesTheFilters) {
  Classes classes = LatticeSurvey(kFullLattice);
  AddClass({"###.....", "........", "........", "........", "........", "........"}, &classes);
  const Result<FilterVisibilityResult> result = FilterVisibility(classes, {});
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_EQ(result->world.num_features(), 0);
  EXPECT_EQ(result->world.num_stations(), 48);
  EXPECT_EQ(WhyNoFeature(*result, 1),
            "none of 1 classes is visible enough from the 48 stations of a lattice survey (dropped 1 by "
            "few_stations): loosen the options of filter_visibility or survey more densely");
}

TEST(FilterVisibility, ClassSeenInAnUnknownImageIsAnError) {
  Classes classes = LatticeSurvey(kFullLattice);
  classes.classes.emplace_back().observations.push_back({.image_id = 9999});
  EXPECT_THAT(FilterVisibility(classes, {}).error().message, HasSubstr("observed in image 9999"));
}

TEST(FilterVisibilityDrops, ClassesAndStationsThatDoNotCountAreNamedWithTheirReason) {
  Classes classes = LatticeSurvey(kFullLattice);
  // Kept; the tail of three stations does not count.
  AddClass({"#####...", "########", "#####...", "#####...", "........", "........"}, &classes);
  AddClass({"###.....", "###.....", "###.....", "........", "........", "........"}, &classes);
  AddClass({"########", "#......#", "########", "........", "........", "........"}, &classes);
  AddClass({"##......", "##......", "##......", "########", "########", "........"}, &classes);
  const Result<FilterVisibilityResult> result = FilterVisibility(classes, {});
  ASSERT_TRUE(result.ok()) << result.error().message;
  const auto end_of_tail = static_cast<uint32_t>(Area({"........", ".......#"})[0]);
  EXPECT_THAT(result->dropped_items,
              ElementsAre(DroppedItem{.reason = DropReason::kOutsideArea,
                                      .item_id = 10,
                                      .seen_at = {end_of_tail - 2, end_of_tail - 1, end_of_tail}},
                          DroppedItem{.reason = DropReason::kFewStations, .item_id = 20, .found = 9},
                          DroppedItem{.reason = DropReason::kHoles, .item_id = 30, .found = 18},
                          DroppedItem{.reason = DropReason::kNoBlock, .item_id = 40, .found = 22}));
}

TEST(FilterVisibilityDrops, AreaWithoutAFullNeighbourhoodIsTrimmedAway) {
  // The largest component has no block; the one that has is smaller.
  Classes classes = LatticeSurvey(kFullLattice);
  AddClass({"###.#...", "###.#...", "###.#...", "....#...", "....####", "....####"}, &classes);
  AddClass({"########", "########", "########", "........", "........", "........"}, &classes);
  FilterVisibilityOptions options;
  options.min_num_neighbours = 7;
  const Result<FilterVisibilityResult> result = FilterVisibility(classes, options);
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_THAT(result->dropped_items,
              ElementsAre(DroppedItem{.reason = DropReason::kTrimmedAway, .item_id = 10, .found = 21}));
}

TEST(FilterVisibilityDrops, ScatteredClassesAreNamed) {
  Classes classes;
  for (ImageId i = 1; i <= 8; ++i) {
    classes.images.push_back({.image_id = i, .cam_from_world = CameraAt(0.25 + 0.5 * i, 0.25, 0)});
  }
  for (const std::vector<ImageId>& seen_in : {std::vector<ImageId>{1, 2, 3, 8}, {1, 3, 5}}) {
    FeatureClass& feature_class = classes.classes.emplace_back();
    feature_class.class_id = static_cast<ClassId>(classes.classes.size());
    for (const ImageId image_id : seen_in) feature_class.observations.push_back({.image_id = image_id});
  }
  const Result<FilterVisibilityResult> result = FilterVisibility(classes, {});
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_THAT(result->dropped_items,
              ElementsAre(DroppedItem{.reason = DropReason::kOutsideArea, .item_id = 1, .seen_at = {7}},
                          DroppedItem{.reason = DropReason::kScattered, .item_id = 2, .found = 3}));
}

TEST(FilterVisibilityDrops, WhatStaysAndWhatIsDroppedAddUpToWhatWasSeenAtEveryStation) {
  Random random(17);
  for (int trial = 0; trial < 20; ++trial) {
    Classes classes = LatticeSurvey(kFullLattice);
    for (int i = 0; i < 40; ++i) {
      std::vector<std::string> drawing(kFullLattice.size(), std::string(kFullLattice[0].size(), '.'));
      const double x = random.Uniform(0, 8), y = random.Uniform(0, 6), radius = random.Uniform(1, 6);
      for (size_t row = 0; row < drawing.size(); ++row) {
        for (size_t column = 0; column < drawing[row].size(); ++column) {
          const bool is_near = std::hypot(column - x, row - y) < radius;
          if (is_near && random.Uniform() < 0.95) drawing[row][column] = '#';
        }
      }
      AddClass(drawing, &classes);
    }
    FilterVisibilityOptions options;
    options.survey = trial % 2 == 0 ? "lattice" : "driven";
    options.min_num_stations = 9;
    const Result<FilterVisibilityResult> result = FilterVisibility(classes, options);
    ASSERT_TRUE(result.ok()) << result.error().message;
    std::map<ImageId, StationIdx> station_of;
    for (size_t station = 0; station < result->world.station_images.size(); ++station) {
      for (const ImageId image : result->world.station_images[station])
        station_of[image] = static_cast<StationIdx>(station);
    }
    std::map<ClassId, std::set<StationIdx>> seen;  // per class, what is not accounted for yet
    for (const FeatureClass& feature_class : classes.classes) {
      for (const Observation& observation : feature_class.observations)
        seen[feature_class.class_id].insert(station_of.at(observation.image_id));
    }
    const size_t num_classes = classes.classes.size();
    size_t num_accounted = result->world.areas.size();
    for (size_t i = 0; i < result->world.areas.size(); ++i) {
      for (const StationIdx station : result->world.areas[i])
        EXPECT_EQ(seen[result->world.class_ids[i]].erase(station), 1u);
    }
    for (const DroppedItem& item : result->dropped_items) {
      std::set<StationIdx>& left = seen[static_cast<ClassId>(item.item_id)];
      if (item.reason == DropReason::kOutsideArea) {
        for (const uint32_t station : item.seen_at)
          EXPECT_EQ(left.erase(static_cast<StationIdx>(station)), 1u);
        continue;
      }
      EXPECT_EQ(static_cast<int64_t>(left.size()), item.found);
      left.clear();
      ++num_accounted;
    }
    EXPECT_EQ(num_accounted, num_classes);
    for (const auto& [class_id, left] : seen) EXPECT_THAT(left, IsEmpty()) << class_id;
  }
}

// Images at each place: one that looks along +x, and, at the first `num_turned` places, another one that
// stands `offset` from it and looks `turn_deg` elsewhere.
std::vector<SurveyImage> TurnedAt(const std::vector<Eigen::Vector2d>& places, size_t num_turned,
                                  double turn_deg, const Eigen::Vector2d& offset = Eigen::Vector2d::Zero()) {
  std::vector<SurveyImage> images;
  const auto add = [&](const Eigen::Vector2d& at, double heading_deg) {
    images.push_back({.image_id = static_cast<ImageId>(images.size() + 1),
                      .cam_from_world = CameraAt(at.x(), at.y(), heading_deg)});
  };
  for (size_t i = 0; i < places.size(); ++i) {
    add(places[i], 0);
    if (i < num_turned) add(places[i] + offset, turn_deg);
  }
  return images;
}
// Places half a metre apart, row by row, the first at (0.05, 0.05).
std::vector<Eigen::Vector2d> Grid(int num_columns, int num_rows) {
  std::vector<Eigen::Vector2d> places;
  for (int row = 0; row < num_rows; ++row) {
    for (int column = 0; column < num_columns; ++column)
      places.emplace_back(0.05 + 0.5 * column, 0.05 + 0.5 * row);
  }
  return places;
}
bool IsLattice(const std::vector<SurveyImage>& images, const FilterVisibilityOptions& options = {}) {
  const Result<Stations> stations = FindStations(images, options);
  EXPECT_TRUE(stations.ok()) << (stations.ok() ? "" : stations.error().message);
  return stations.ok() && stations->is_lattice;
}

TEST(FindStations, HalfOfThePlacesOfALatticeHaveHeadingsThirtyDegreesApart) {
  EXPECT_TRUE(IsLattice(TurnedAt(Grid(4, 2), 4, 30.5)));
  EXPECT_FALSE(IsLattice(TurnedAt(Grid(4, 2), 3, 30.5)));
  EXPECT_FALSE(IsLattice(TurnedAt(Grid(4, 2), 8, 29.5)));
  EXPECT_TRUE(IsLattice(TurnedAt(Grid(4, 2), 8, 329.5)));
  EXPECT_FALSE(IsLattice(TurnedAt(Grid(4, 2), 8, 330.5)));
  FilterVisibilityOptions options;
  options.survey = "lattice";
  EXPECT_TRUE(IsLattice(TurnedAt(Grid(4, 2), 0, 0), options));
  options.survey = "driven";
  EXPECT_FALSE(IsLattice(TurnedAt(Grid(4, 2), 8, 90), options));
}

TEST(FindStations, ImagesOfOnePlaceLieWithinADistanceOnAnySideOfItsFirst) {
  // Places are looked up in cells as wide as the distance: the second image is in any of the nine around.
  for (const double x : {-0.06, 0.0, 0.06}) {
    for (const double y : {-0.06, 0.0, 0.06})
      EXPECT_TRUE(IsLattice(TurnedAt(Grid(4, 2), 8, 90, {x, y}))) << x << " " << y;
  }
  EXPECT_TRUE(IsLattice(TurnedAt(Grid(4, 2), 8, 90, {0.099, 0})));
  EXPECT_FALSE(IsLattice(TurnedAt(Grid(4, 2), 8, 90, {0.101, 0})));
  FilterVisibilityOptions options;
  options.same_place_m = 0.11;
  EXPECT_TRUE(IsLattice(TurnedAt(Grid(4, 2), 8, 90, {0.101, 0}), options));
}

TEST(FindStations, NineInTenPlacesLieOnTheGridAndFourAreEnough) {
  // Places far from the others, a part of a spacing off the grid.
  const auto with_others = [](size_t num_on_grid, int num_others, double off_m) {
    std::vector<Eigen::Vector2d> places = Grid(6, 3);
    places.resize(num_on_grid);
    for (int i = 0; i < num_others; ++i) places.emplace_back(0.05 + 10 * (i + 1) + off_m, 0.05);
    return TurnedAt(places, places.size(), 90);
  };
  EXPECT_TRUE(IsLattice(with_others(18, 2, 0.125)));
  EXPECT_FALSE(IsLattice(with_others(17, 3, 0.125)));
  EXPECT_TRUE(IsLattice(with_others(17, 3, 0.09)));  // 0.18 of a spacing
  EXPECT_TRUE(IsLattice(TurnedAt(Grid(2, 2), 4, 90)));
  std::vector<Eigen::Vector2d> three = Grid(2, 2);
  three.pop_back();
  EXPECT_FALSE(IsLattice(TurnedAt(three, 3, 90)));
}

TEST(FindStations, AStationOfALatticeStandsAtTheMeanOfItsImagesToTheMicrometre) {
  std::vector<SurveyImage> images = TurnedAt(Grid(2, 2), 4, 90, {0.03, -0.02});
  images.push_back({.image_id = 100, .cam_from_world = CameraAt(0.05 + 0.0000013, 0.05, 180)});
  const Result<Stations> stations = FindStations(images, {});
  ASSERT_TRUE(stations.ok());
  const World& world = stations->world;
  ASSERT_EQ(world.num_stations(), 4);
  EXPECT_THAT(world.station_images[0], ElementsAre(1, 2, 100));
  EXPECT_NEAR(world.positions[0].x(), 0.06, 1e-9);  // a third of 1.3 um is nothing
  EXPECT_NEAR(world.positions[0].y(), 0.043333, 1e-9);
  EXPECT_NEAR(world.positions[3].x(), 0.565, 1e-9);
  EXPECT_NEAR(world.positions[3].y(), 0.54, 1e-9);
  EXPECT_NEAR(world.lattice_spacing_m, 0.5, 1e-9);
  EXPECT_THAT(world.edges, ElementsAre(std::pair(0, 1), std::pair(0, 2), std::pair(1, 3), std::pair(2, 3)));
}

TEST(FindStations, CellsOfADrivenSurveyAreJoinedInRowsAndColumns) {
  //   2 3     row 0, y in [0, 1)
  //   0 1     row -1; all look along +x
  FilterVisibilityOptions options;
  options.survey = "driven";
  options.cell_size_m = 1;
  options.heading_bin_deg = 360;
  std::vector<SurveyImage> images;
  for (const auto& [x, y] :
       {std::pair(-0.5, -0.9), std::pair(0.5, -0.1), std::pair(-0.01, 0.5), std::pair(0.99, 0.5)})
    images.push_back(
        {.image_id = static_cast<ImageId>(images.size() + 1), .cam_from_world = CameraAt(x, y, 0)});
  const Result<Stations> stations = FindStations(images, options);
  ASSERT_TRUE(stations.ok());
  const World& world = stations->world;
  EXPECT_THAT(world.positions, ElementsAre(Eigen::Vector2d(-0.5, -0.5), Eigen::Vector2d(0.5, -0.5),
                                           Eigen::Vector2d(-0.5, 0.5), Eigen::Vector2d(0.5, 0.5)));
  EXPECT_THAT(world.edges, ElementsAre(std::pair(0, 1), std::pair(0, 2), std::pair(1, 3), std::pair(2, 3)));
  EXPECT_THAT(world.headings_deg, IsEmpty());
}

TEST(FindStations, HeadingsOfADrivenSurveyAreOfTheNearestBin) {
  FilterVisibilityOptions options;
  options.survey = "driven";
  options.heading_bin_deg = 90;
  std::vector<SurveyImage> images;
  for (const double heading_deg : {44.0, 46.0, 134.0, 136.0, 316.0, 314.0})
    images.push_back({.image_id = static_cast<ImageId>(images.size() + 1),
                      .cam_from_world = CameraAt(0.2, 0.2, heading_deg)});
  const Result<Stations> stations = FindStations(images, options);
  ASSERT_TRUE(stations.ok());
  EXPECT_THAT(stations->world.headings_deg, ElementsAre(0, 90, 180, 270));
  EXPECT_THAT(stations->world.station_images,
              ElementsAre(ElementsAre(1, 5), ElementsAre(2, 3), ElementsAre(4), ElementsAre(6)));
  EXPECT_THAT(stations->world.edges,
              ElementsAre(std::pair(0, 1), std::pair(0, 3), std::pair(1, 2), std::pair(2, 3)));
}

TEST(FindStations, TwoHeadingsAreToldApartAndOneIsNone) {
  const std::vector<SurveyImage> images = {{.image_id = 1, .cam_from_world = CameraAt(0.1, 0.1, 10)},
                                           {.image_id = 2, .cam_from_world = CameraAt(0.1, 0.1, 170)}};
  FilterVisibilityOptions options;
  options.survey = "driven";
  options.heading_bin_deg = 180;
  EXPECT_THAT(FindStations(images, options)->world.headings_deg, ElementsAre(0, 180));
  options.heading_bin_deg = 360;
  EXPECT_THAT(FindStations(images, options)->world.headings_deg, IsEmpty());
}

TEST(FindStations, UpNearAnAxisIsTheAxis) {
  const auto floor_of = [](double tilt_deg, double up_snap_deg, const Eigen::Vector3d& axis) {
    // Cameras that stand upright in a world whose up is `tilt_deg` from an axis.
    const Eigen::Vector3d aside = axis.unitOrthogonal();
    const Eigen::Vector3d up = std::cos(RadFromDeg(tilt_deg)) * axis + std::sin(RadFromDeg(tilt_deg)) * aside;
    const Pose level_from_world{Eigen::Quaterniond::FromTwoVectors(up, Eigen::Vector3d::UnitZ()), {0, 0, 0}};
    std::vector<SurveyImage> images = TurnedAt(Grid(3, 1), 3, 90);
    for (SurveyImage& image : images) image.cam_from_world = image.cam_from_world * level_from_world;
    FilterVisibilityOptions options;
    options.up_snap_deg = up_snap_deg;
    const Result<Stations> stations = FindStations(images, options);
    EXPECT_TRUE(stations.ok());
    const Eigen::Quaterniond rotation = stations->world.floor_from_world.rotation;
    return std::pair((rotation * axis).isApprox(Eigen::Vector3d::UnitZ(), 1e-9),
                     (rotation * up).isApprox(Eigen::Vector3d::UnitZ(), 1e-9));
  };
  for (const Eigen::Vector3d& axis : {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0, -1, 0),
                                      Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(-1, 0, 0)}) {
    EXPECT_EQ(floor_of(2.9, 3, axis), std::pair(true, false));
    EXPECT_EQ(floor_of(3.1, 3, axis), std::pair(false, true));
    EXPECT_EQ(floor_of(0, 0, axis), std::pair(true, true));
  }
}

TEST(FindStations, UpThatIsNoDirectionIsAnError) {
  std::vector<SurveyImage> images = TurnedAt(Grid(2, 1), 0, 0);
  FilterVisibilityOptions options;
  for (const char* up : {"0,0", "0,0,0", "0,0,1,0", "0,0,9e-10"}) {
    options.up = up;
    const Result<Stations> stations = FindStations(images, options);
    ASSERT_FALSE(stations.ok()) << up;
    EXPECT_EQ(stations.error().code, ErrorCode::kInvalidArgument);
  }
  // One camera stands on its head, but for this angle: what is left is to be a thousandth of an up for each.
  const Pose level = images[1].cam_from_world;
  for (const double angle : {0.0, 0.0019, 0.0021}) {
    const Eigen::AngleAxisd turn(std::numbers::pi - angle, Eigen::Vector3d::UnitZ());
    images[1].cam_from_world = Pose{Eigen::Quaterniond(turn), {0, 0, 0}} * level;
    const Result<Stations> stations = FindStations(images, {});
    EXPECT_EQ(stations.ok(), angle > 0.002) << angle;
    if (!stations.ok()) EXPECT_THAT(stations.error().message, HasSubstr("up directions cancel out"));
  }
  EXPECT_EQ(FindStations({}, {}).error().code, ErrorCode::kNoData);
}

TEST(FloorFromUp, IsTheSmallestRotation) {
  EXPECT_EQ(FloorFromUp({0, 0, 5}).Matrix(), Pose().Matrix());
  EXPECT_EQ(FloorFromUp({9e-7, 0, 1}).Matrix(), Pose().Matrix());
  EXPECT_NE(FloorFromUp({2e-6, 0, 1}).Matrix(), Pose().Matrix());
  const Pose tilted = FloorFromUp({1e-5, 0, 1});
  EXPECT_NEAR(tilted.rotation.angularDistance(Eigen::Quaterniond::Identity()), 1e-5, 1e-9);
  EXPECT_TRUE(
      (FloorFromUp({3, 0, 0}).rotation * Eigen::Vector3d::UnitX()).isApprox(Eigen::Vector3d::UnitZ()));
}

// What the functions of areas say, by sets of cells.
struct AreaOracle {
  std::set<Cell> area, stations;

  int NumAround(const Cell& cell) const {
    int num = 0;
    for (int i = 0; i < 9; ++i)
      num += i != 4 && area.count({cell.first - 1 + i % 3, cell.second - 1 + i / 3}) > 0;
    return num;
  }
  std::vector<int> HoleSizes() const {
    std::set<Cell> others;  // a frame wider than the lattice
    for (int x = -2; x <= 9; ++x) {
      for (int y = -2; y <= 8; ++y) {
        if (!area.count({x, y})) others.insert({x, y});
      }
    }
    std::vector<int> sizes;
    while (!others.empty()) {
      std::vector<Cell> part = {*others.begin()};
      others.erase(part[0]);
      const bool is_outside = part[0] == Cell(-2, -2);
      int size = 0;
      for (size_t i = 0; i < part.size(); ++i) {
        size += static_cast<int>(stations.count(part[i]));
        for (int k = 0; k < 9; ++k) {
          const Cell next(part[i].first - 1 + k % 3, part[i].second - 1 + k / 3);
          if (others.erase(next) > 0) part.push_back(next);
        }
      }
      if (!is_outside && size > 0) sizes.push_back(size);
    }
    return sizes;
  }
  bool HasBlock(int side) const {
    return std::any_of(area.begin(), area.end(), [&](const Cell& corner) {
      int num = 0;
      for (int i = 0; i < side * side; ++i)
        num += static_cast<int>(area.count({corner.first + i % side, corner.second + i / side}));
      return num == side * side;
    });
  }
  bool Stays(const Cell& cell, int min_num_neighbours) const {
    for (int i = 0; i < 9; ++i) {
      const Cell near(cell.first - 1 + i % 3, cell.second - 1 + i / 3);
      if (area.count(near) && NumAround(near) >= min_num_neighbours) return true;
    }
    return false;
  }
};

TEST(LatticeArea, AgreesWithSetsOfCellsOnRandomAreas) {
  Random random(3);
  const Stations stations =
      LatticeStations({"oooooooo", "ooo oooo", "oooooooo", "oooooo o", "oooooooo", "oo ooooo"});
  for (int trial = 0; trial < 300; ++trial) {
    const double density = random.Uniform(0.4, 1);
    std::vector<StationIdx> area;
    AreaOracle oracle;
    for (StationIdx station = 0; station < stations.world.num_stations(); ++station) {
      const Cell& cell = stations.cells[station];
      oracle.stations.insert(cell);
      if (random.Uniform() > density) continue;
      area.push_back(station);
      oracle.area.insert(cell);
    }
    EXPECT_THAT(HoleSizes(area, stations), testing::UnorderedElementsAreArray(oracle.HoleSizes()));
    for (const int side : {1, 2, 3, 4})
      EXPECT_EQ(HasBlock(area, stations, side), oracle.HasBlock(side)) << side;
    for (const int min_num_neighbours : {0, 1, 5, 6, 7, 8}) {
      std::vector<StationIdx> expected;
      for (const StationIdx station : area) {
        if (oracle.Stays(stations.cells[station], min_num_neighbours)) expected.push_back(station);
      }
      EXPECT_EQ(TrimArea(area, stations, min_num_neighbours), expected) << min_num_neighbours;
    }
  }
  EXPECT_THAT(HoleSizes({}, stations), IsEmpty());
  EXPECT_FALSE(HasBlock({}, stations, 1));
  EXPECT_THAT(TrimArea({}, stations, 0), IsEmpty());
}

// Why the only class is dropped; "" if it stays.
std::string DroppedBy(const std::vector<std::string>& drawing, const FilterVisibilityOptions& options) {
  Classes classes = LatticeSurvey(kFullLattice);
  AddClass(drawing, &classes);
  const Result<FilterVisibilityResult> result = FilterVisibility(classes, options);
  EXPECT_TRUE(result.ok()) << (result.ok() ? "" : result.error().message);
  return result.ok() && !result->dropped.empty() ? result->dropped.begin()->first : "";
}

TEST(FilterVisibility, LimitsAreOfWhatStays) {
  // 22 stations around holes of one and of two, with a block of 3 x 3.
  const std::vector<std::string> drawing = {"########", "#.#..###", "########",
                                            "........", "........", "........"};
  FilterVisibilityOptions options;
  options.min_num_stations = 21;
  options.max_hole_stations = 2;
  options.max_num_holes = 2;
  options.min_block_side = 3;
  options.min_num_neighbours = 7;
  EXPECT_EQ(DroppedBy(drawing, options), "");
  const auto with = [&](int FilterVisibilityOptions::*member, int value) {
    FilterVisibilityOptions changed = options;
    changed.*member = value;
    return DroppedBy(drawing, changed);
  };
  EXPECT_EQ(with(&FilterVisibilityOptions::min_num_stations, 22), "few_stations");
  EXPECT_EQ(with(&FilterVisibilityOptions::max_hole_stations, 1), "holes");
  EXPECT_EQ(with(&FilterVisibilityOptions::max_num_holes, 1), "holes");
  EXPECT_EQ(with(&FilterVisibilityOptions::min_block_side, 4), "no_block");
}

TEST(FilterVisibility, OfEqualPartsTheOneWithTheSmallestStationStays) {
  Classes classes = LatticeSurvey(kFullLattice);
  AddClass({"###..###", "###..###", "###..###", "........", "........", "........"}, &classes);
  const Result<FilterVisibilityResult> result = FilterVisibility(classes, {});
  ASSERT_TRUE(result.ok()) << result.error().message;
  ASSERT_EQ(result->world.num_features(), 1);
  EXPECT_EQ(result->world.areas[0], Area({"###.....", "###.....", "###....."}));
}

TEST(FilterVisibility, NamesAllFiltersOrThatThereWasNoClass) {
  Classes classes = LatticeSurvey(kFullLattice);
  EXPECT_THAT(WhyNoFeature(*FilterVisibility(classes, {}), 0),
              HasSubstr("lattice survey (there was none): loosen"));
  AddClass({"###.....", "........", "........", "........", "........", "........"}, &classes);
  AddClass({"###.....", "........", "........", "........", "........", "........"}, &classes);
  AddClass({"##......", "##......", "##......", "########", "########", "........"}, &classes);
  EXPECT_THAT(
      WhyNoFeature(*FilterVisibility(classes, {}), 3),
      HasSubstr("none of 3 classes is visible enough from the 48 stations of a lattice survey (dropped 2 by "
                "few_stations, 1 by no_block)"));
}

TEST(FilterVisibility, OptionsHaveTheRangesOfTheirComments) {
  const auto check = [](const std::function<void(FilterVisibilityOptions*)>& change) {
    FilterVisibilityOptions options;
    change(&options);
    return CheckOptions(DescribeOptions(&options)).ok();
  };
  using Options = FilterVisibilityOptions;
  const auto check_range = [&](auto member, auto least, auto less, auto most, auto more) {
    EXPECT_TRUE(check([&](Options* o) { o->*member = least; }));
    EXPECT_FALSE(check([&](Options* o) { o->*member = less; }));
    EXPECT_TRUE(check([&](Options* o) { o->*member = most; }));
    EXPECT_FALSE(check([&](Options* o) { o->*member = more; }));
  };
  check_range(&Options::up_snap_deg, 0.0, -0.1, 45.0, 45.1);
  check_range(&Options::same_place_m, 1e-6, 0.9e-6, 1e3, 1001.0);
  check_range(&Options::cell_size_m, 1e-3, 0.9e-3, 1e6, 1.1e6);
  check_range(&Options::heading_bin_deg, 1.0, 0.9, 360.0, 360.1);
  check_range(&Options::min_block_side, 1, 0, 1000, 1001);
  check_range(&Options::min_num_neighbours, 0, -1, 8, 9);
  const auto check_least = [&](int Options::*member, int least) {
    EXPECT_TRUE(check([&](Options* o) { o->*member = least; }));
    EXPECT_FALSE(check([&](Options* o) { o->*member = least - 1; }));
  };
  check_least(&Options::min_num_stations, 1);
  check_least(&Options::max_hole_stations, 0);
  check_least(&Options::max_num_holes, 0);
  check_least(&Options::min_num_stations_driven, 1);
}

}  // namespace
}  // namespace cairn::filter_visibility
