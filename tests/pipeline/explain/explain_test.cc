#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/base/random.h"
#include "core/world/drop_reason.h"
#include "pipeline/explain/advise.h"
#include "pipeline/explain/compare_maps.h"
#include "pipeline/explain/explain_place.h"
#include "pipeline/explain/place_changes.h"
#include "pipeline/explain/station_losses.h"

namespace cairn::pipeline {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

DropCount Drop(DropReason reason, std::vector<int32_t> at_stations) {
  const DropReasonEntry& entry = DescribeDropReason(reason);
  DropCount drop{.reason_id = static_cast<int>(reason),
                 .stage = entry.stage,
                 .kind = DropKindName(entry.kind),
                 .name = entry.name,
                 .text = entry.text,
                 .at_stations = std::move(at_stations)};
  for (const int32_t num : drop.at_stations) drop.num_dropped += num;
  return drop;
}

// Five stations in a row, a metre apart, all looking north; an image at each; ten landmarks.  Region 0 has
// stations 0 to 2 and landmarks 0 to 3, no region has stations 3 and 4.
//
//   station   0 - 1 - 2 - 3 - 4
//   region    0   0   0
MapRows FiveStations() {
  MapRows rows;
  rows.name = "row";
  rows.k = 4;
  rows.descriptors = DescriptorMatrix::Zero(10, kSiftDescriptorDim);
  for (int i = 0; i < 10; ++i) {
    rows.landmarks.push_back({.class_id = static_cast<ClassId>(i), .position = {0.5 * i, 3, 1}});
    rows.descriptors(i, i) = 255;  // at right angles to all others
  }
  for (int i = 0; i < 5; ++i) {
    rows.stations.push_back({.position = {1.0 * i, 0}, .heading_deg = 90, .is_covered = i < 3});
    MapImage image{
        .image_id = static_cast<ImageId>(i + 1), .name = "image" + std::to_string(i) + ".png", .station = i};
    image.landmarks = i < 3 ? std::vector<LandmarkIdx>{0, 1, 2, 3} : std::vector<LandmarkIdx>{4};
    rows.images.push_back(std::move(image));
    if (i > 0) rows.station_edges.emplace_back(i - 1, i);
  }
  rows.regions = {{.stations = {0, 1, 2}, .landmarks = {0, 1, 2, 3}}};
  rows.self_test = {{"localized_ratio", 1.0}};
  return rows;
}

TEST(CompareMaps, MapIsTheSameAsItself) {
  const MapRows rows = FiveStations();
  const MapComparison comparison = CompareMaps(rows, rows);
  EXPECT_EQ(comparison.num_landmarks_shared, 10);
  EXPECT_EQ(comparison.max_move_m, 0);
  EXPECT_EQ(NumChangedRegions(comparison), 0);
  EXPECT_THAT(comparison.coverage_lost, IsEmpty());
  EXPECT_THAT(comparison.images_only_in_b, IsEmpty());
}

TEST(CompareMaps, NumbersAndIdsDoNotMatterPlacesAndLooksDo) {
  const MapRows a = FiveStations();
  MapRows b = a;
  std::swap(b.landmarks[4], b.landmarks[9]);  // the same landmarks in another order
  b.descriptors.row(4).swap(b.descriptors.row(9));
  for (MapLandmark& landmark : b.landmarks) landmark.class_id += 100;
  b.landmarks[0].position.x() += 0.002;  // moved by 2 mm: the same
  b.landmarks[1].position.x() += 0.2;    // by 20 cm: another
  b.descriptors.row(2).setZero();        // at the same place, but looks different
  b.descriptors(2, 100) = 255;
  const MapComparison comparison = CompareMaps(a, b);
  EXPECT_THAT(comparison.landmark_in_b, ElementsAre(0, -1, -1, 3, 9, 5, 6, 7, 8, 4));
  EXPECT_NEAR(comparison.max_move_m, 0.002, 1e-9);
  EXPECT_EQ(comparison.median_move_m, 0);
}

TEST(CompareMaps, RegionsAreMatchedByTheirStations) {
  const MapRows a = FiveStations();
  MapRows b = a;
  b.regions = {{.stations = {3, 4}, .landmarks = {4}}, {.stations = {1, 2}, .landmarks = {0, 1, 2, 3}}};
  b.stations[0].is_covered = false;
  b.stations[3].is_covered = b.stations[4].is_covered = true;
  const MapComparison comparison = CompareMaps(a, b);
  ASSERT_THAT(comparison.regions, SizeIs(2));
  EXPECT_EQ(comparison.regions[0].in_a, -1);
  EXPECT_EQ(comparison.regions[1].in_a, 0);
  EXPECT_EQ(comparison.regions[1].num_shared_stations, 2);
  EXPECT_EQ(comparison.regions[1].num_shared_landmarks, 4);
  EXPECT_EQ(NumChangedRegions(comparison), 2);
  EXPECT_THAT(comparison.coverage_lost, ElementsAre(0));
  EXPECT_THAT(comparison.coverage_gained, ElementsAre(3, 4));
  // A region of A that none of B shares half of the stations with.
  const MapComparison back = CompareMaps(b, a);
  EXPECT_THAT(back.regions, SizeIs(2));
  EXPECT_EQ(back.regions[1].in_a, 0);
  EXPECT_EQ(back.regions[1].in_b, -1);
}

TEST(CompareMaps, TextNamesOptionsAndFigures) {
  MapRows a = FiveStations(), b = a;
  a.stage_options = {{"decompose_regions", "k = 40\ntau = 0\n"}};
  b.stage_options = {{"decompose_regions", "k = 10\ntau = 0\n"}};
  b.self_test = {{"localized_ratio", 0.5}};
  b.images.pop_back();
  const std::string text = ComparisonText(a, b, 1000, 900, CompareMaps(a, b), 5);
  EXPECT_THAT(text, HasSubstr("[decompose_regions] k"));
  EXPECT_THAT(text, HasSubstr("40 -> 10"));
  EXPECT_THAT(text, Not(HasSubstr("tau")));
  EXPECT_THAT(text, HasSubstr("localized_ratio"));
  EXPECT_THAT(text, HasSubstr("1 of A alone: image4.png"));
  EXPECT_THAT(text, HasSubstr("-100"));
}

// The five stations surveyed three times; between the second and the third more vanished than appeared.
MapRows ThreeSurveys() {
  MapRows rows = FiveStations();
  rows.sessions = {"may", "june", "july"};
  rows.floor_from_world.translation = {10, 0, 0};
  rows.findings.changes = {{1, {1, 3, 1}, 0.5, 40, 50, 0, 1}, {2, {2, 3, 1}, 0.25, 30, 2, 1, 2}};
  return rows;
}

TEST(ChangesSince, AreThoseOfSessionsThatTheOtherMapLacks) {
  const MapRows b = ThreeSurveys();
  MapRows a = b;
  EXPECT_THAT(ChangesSince(a, b), IsEmpty());
  a.sessions = {"may", "june"};  // by name: whatever changes A tells of
  EXPECT_THAT(ChangesSince(a, b), ElementsAre(b.findings.changes[1]));
  EXPECT_THAT(ChangesSince(FiveStations(), b), SizeIs(2));  // one survey, without a name
  EXPECT_THAT(ChangesSince(b, FiveStations()), IsEmpty());
}

TEST(ChangesSince, AreInTheComparisonOfMaps) {
  const MapRows b = ThreeSurveys();
  MapRows a = b;
  EXPECT_THAT(ComparisonText(a, b, 1, 1, CompareMaps(a, b), 5), Not(HasSubstr("places that changed")));
  a.sessions = {"may", "june"};
  const MapComparison comparison = CompareMaps(a, b);
  const std::string text = ComparisonText(a, b, 1, 1, comparison, 5);
  EXPECT_THAT(text, HasSubstr("places that changed: 1 that A does not know"));
  EXPECT_THAT(text, HasSubstr("july"));
  EXPECT_THAT(text, HasSubstr("12.00, 3.00"));  // the floor frame's
  EXPECT_THAT(text, HasSubstr("image1.png -> image2.png"));
  const auto json = ComparisonJson(a, b, 1, 1, comparison)["changed_places"];
  ASSERT_EQ(json.size(), 1U);
  EXPECT_EQ(json[0]["session"], "july");
  EXPECT_EQ(json[0]["x_m"], 12);
  EXPECT_EQ(json[0]["num_vanished"], 30);
  EXPECT_EQ(json[0]["image_before"], "image1.png");
}

TEST(PlaceChangesText, SaysWhereThingsMovedTo) {
  MapRows rows = ThreeSurveys();
  EXPECT_TRUE(PlaceChangesJson(rows, rows.findings.changes)[1]["moved_to"].is_null());
  rows.findings.changes[0].moved_to = 1;
  rows.findings.changes[0].num_moved = 14;
  // Also in a list of one: the place is that of the map's change.
  const std::vector<MapChange> first = {rows.findings.changes[0]};
  EXPECT_THAT(PlaceChangesText(rows, first, 5), HasSubstr(" 12.00, 3.00  "));
  const auto json = PlaceChangesJson(rows, first)[0]["moved_to"];
  EXPECT_EQ(json["x_m"], 12);
  EXPECT_EQ(json["y_m"], 3);
  EXPECT_EQ(json["num_features"], 14);
}

TEST(PlaceChangesText, ShowsTheFirstOfManyAndImagesThatTheMapLacks) {
  MapRows rows = ThreeSurveys();
  rows.findings.changes[0].image_before = -1;
  const std::string text = PlaceChangesText(rows, rows.findings.changes, 1);
  EXPECT_THAT(text, HasSubstr("- -> image1.png"));
  EXPECT_THAT(text, HasSubstr("and 1 more"));
  EXPECT_THAT(text, Not(HasSubstr("july")));
  EXPECT_TRUE(PlaceChangesJson(rows, rows.findings.changes)[0]["image_before"].is_null());
  EXPECT_EQ(PlaceChangesText(rows, {}, 1), "");
}

TEST(CompareMaps, EmptyMapsCanBeCompared) {
  const MapRows rows = FiveStations();
  EXPECT_EQ(CompareMaps({}, {}).num_landmarks_shared, 0);
  EXPECT_EQ(CompareMaps({}, rows).regions[0].in_a, -1);
  EXPECT_EQ(CompareMaps(rows, {}).regions[0].in_b, -1);
}

TEST(StationLosses, CountWhatBecameOfTheScene) {
  MapRows rows = FiveStations();
  rows.findings.drops = {
      Drop(DropReason::kFewObservations, {1, 0, 0, 30, 0}), Drop(DropReason::kAmbiguous, {0, 0, 0, 2, 50}),
      Drop(DropReason::kNotCommon, {5, 5, 5, 1, 1}), Drop(DropReason::kFewFeatures, {0, 0, 0, 1, 1})};
  const StationLosses losses(rows);
  EXPECT_EQ(losses.NumLandmarks(0), 4);
  EXPECT_EQ(losses.NumVisible(0), 9);
  EXPECT_EQ(losses.NumSeenTooSeldom(3), 30);
  EXPECT_EQ(losses.NumAlike(4), 50);
  EXPECT_EQ(losses.WhyUncovered(0), std::nullopt);
  EXPECT_EQ(losses.WhyUncovered(4), DropReason::kFewFeatures);
  // Landmark 4 is of no region: with landmarks = "all" it is seen, but dropped as not_common all the same.
  EXPECT_EQ(losses.NumLandmarks(3), 1);
  EXPECT_EQ(losses.NumVisible(3), 1);
}

TEST(Advise, TellsWhereToTakeImagesAndWhereTheyWouldNotHelp) {
  MapRows rows = FiveStations();
  rows.findings.drops = {Drop(DropReason::kFewObservations, {0, 0, 0, 30, 0}),
                         Drop(DropReason::kFewFeatures, {0, 0, 0, 1, 0})};
  rows.stations[4].is_covered = true;
  std::vector<Advice> advice = Advise(rows);
  ASSERT_THAT(advice, SizeIs(1));
  EXPECT_THAT(advice[0].text, HasSubstr("30 more were seen from too few places"));
  EXPECT_THAT(advice[0].stations, ElementsAre(3));
  ASSERT_THAT(advice[0].images_to_take, SizeIs(2));  // half way to stations 2 and 4
  EXPECT_EQ(advice[0].images_to_take[0].position, Eigen::Vector2d(2.5, 0));
  EXPECT_EQ(advice[0].images_to_take[1].position, Eigen::Vector2d(3.5, 0));
  EXPECT_EQ(advice[0].images_to_take[0].heading_deg, 90);
  rows.views.plan.walls = {{.start = {2.4, -1}, .end = {2.4, 1}}};  // nobody stands that near to a wall
  advice = Advise(rows);
  ASSERT_THAT(advice[0].images_to_take, SizeIs(1));
  EXPECT_EQ(advice[0].images_to_take[0].position, Eigen::Vector2d(3.5, 0));

  rows.findings.drops[0] = Drop(DropReason::kAmbiguous, {0, 0, 0, 30, 0});
  advice = Advise(rows);
  EXPECT_THAT(advice[0].text, HasSubstr("30 look like others elsewhere"));
  EXPECT_THAT(advice[0].images_to_take, IsEmpty());
  rows.findings.drops.erase(rows.findings.drops.begin());
  EXPECT_THAT(Advise(rows)[0].text, HasSubstr("blank walls"));
}

TEST(Advise, PutsLargePlacesFirstAndKeepsToThePlaceThatIsAskedAbout) {
  MapRows rows = FiveStations();
  rows.stations[0].is_covered = false;
  rows.findings.drops = {Drop(DropReason::kFewFeatures, {0, 0, 0, 1, 1}),
                         Drop(DropReason::kLeftOver, {1, 0, 0, 0, 0})};
  std::vector<Advice> advice = Advise(rows);
  ASSERT_THAT(advice, SizeIs(2));
  EXPECT_THAT(advice[0].stations, ElementsAre(3, 4));
  EXPECT_THAT(advice[1].text, HasSubstr("algorithm = \"best\""));
  advice = Advise(rows, {0});
  ASSERT_THAT(advice, SizeIs(1));
  EXPECT_THAT(advice[0].stations, ElementsAre(0));
}

TEST(Advise, NamesRegionsThatFailAndThatLookAlike) {
  MapRows rows = FiveStations();
  for (MapStation& station : rows.stations) station.is_covered = true;
  EXPECT_THAT(Advise(rows), IsEmpty());
  rows.findings.self_test_regions = {{.region = 0, .num_held_out = 10, .num_localized = 3}};
  rows.findings.region_entropies = {{.region = 0, .entropy = 1.1}};
  const std::string text = AdviceText(Advise(rows));
  EXPECT_THAT(text, HasSubstr("localizes 3 of 10"));
  EXPECT_THAT(text, HasSubstr("as 3.0 places alike"));
  EXPECT_THAT(text, HasSubstr("image at 0.50, 0.00 looking towards 90 deg"));
}

TEST(Advise, SendsTheSurveyWhereTheLastOneFoundLessThanWasThere) {
  MapRows rows = ThreeSurveys();
  for (MapStation& station : rows.stations) station.is_covered = true;
  rows.findings.changes[0].num_appeared = 1;
  const std::vector<Advice> advice = Advise(rows);
  ASSERT_THAT(advice, SizeIs(1));  // what June lost has been surveyed since
  EXPECT_FALSE(advice[0].is_weakness);
  EXPECT_THAT(advice[0].text, HasSubstr("Survey here next: around 12.00, 3.00"));
  EXPECT_THAT(advice[0].text, HasSubstr("session july finds 30 features gone and 2 new (image2.png)"));
  EXPECT_THAT(advice[0].stations, ElementsAre(2));
  EXPECT_THAT(advice[0].images_to_take, SizeIs(2));
  EXPECT_THAT(Advise(rows, {0}), IsEmpty());
  rows.findings.changes[1].num_appeared = 30;  // as much is new
  EXPECT_THAT(Advise(rows), IsEmpty());
  rows.findings.changes[1] = {2, {2, 3, 1}, 0.25, 30, 2, -1, -1};  // no image of the map shows it
  ASSERT_THAT(Advise(rows), SizeIs(1));
  EXPECT_THAT(Advise(rows)[0].stations, IsEmpty());
}

TEST(Advise, SaysThatPosesAreOffThoughImagesAreLocalized) {
  MapRows rows = FiveStations();
  for (MapStation& station : rows.stations) station.is_covered = true;
  rows.self_test = {{"localized_ratio", 1.0}, {"within_10cm_5deg_ratio", 0.9}};
  EXPECT_THAT(Advise(rows), IsEmpty());
  rows.self_test["within_10cm_5deg_ratio"] = 0.6;
  EXPECT_THAT(AdviceText(Advise(rows)), HasSubstr("only 60 % lie within 10 cm"));
  rows.frame.unit = "unknown";  // ten centimetres mean nothing there
  EXPECT_THAT(Advise(rows), IsEmpty());
}

TEST(Advise, SaysThatTheScaleIsPoorlyKnown) {
  MapRows rows = FiveStations();
  for (MapStation& station : rows.stations) station.is_covered = true;
  rows.self_test = {{"localized_ratio", 1.0}, {"within_10cm_5deg_ratio", 0.9}};
  rows.frame.source = "gps";
  rows.frame.scale_sigma_ratio = 0.03;
  EXPECT_THAT(Advise(rows), IsEmpty());
  rows.frame.scale_sigma_ratio = 0.04;
  EXPECT_THAT(AdviceText(Advise(rows)),
              HasSubstr("metres are known to 4.0 % only (gps): what is 10 m away may be 0.40 m nearer"));
}

// Bytes, part localized and within 10 cm of a map of 100 kB that localizes 0.9 of the images.
std::string SizesText(const std::vector<ParetoPoint>& sizes) {
  MapRows rows;
  rows.self_test = {{"localized_ratio", 0.9}, {"within_10cm_5deg_ratio", 0.8}};
  std::vector<Advice> advice;
  AddSizes(rows, 100000, sizes, &advice);
  return AdviceText(advice);
}
ParetoPoint Size(int64_t num_bytes, double localized_ratio, double within_ratio) {
  return {.max_bytes = num_bytes + 1,
          .num_bytes = num_bytes,
          .localized_ratio = localized_ratio,
          .within_10cm_5deg_ratio = within_ratio};
}

TEST(Advise, NamesTheSmallestMapThatDoesAsMuchOrTheSmallestThatDoesMore) {
  EXPECT_EQ(SizesText({}), "");
  EXPECT_EQ(SizesText({Size(90000, 0.9, 0.8)}), "");                         // hardly smaller
  EXPECT_EQ(SizesText({Size(40000, 0.8, 0.8), Size(40000, 0.9, 0.7)}), "");  // does less
  EXPECT_THAT(
      SizesText({Size(60000, 0.9, 0.8), Size(40000, 0.9, 0.8), Size(20000, 0.5, 0.5)}),
      HasSubstr(
          "A smaller map is enough: a map of 40 kB ([emit_map] landmarks = \"all\", max_bytes = 40001)"));
  EXPECT_THAT(SizesText({Size(900000, 1, 0.9), Size(300000, 0.95, 0.9), Size(40000, 0.9, 0.8)}),
              HasSubstr("A map that localizes more is possible: a map of 300 kB"));
  ParetoPoint every_class = Size(900000, 1, 0.9);
  every_class.max_bytes = 0;
  EXPECT_THAT(SizesText({every_class}), HasSubstr("([emit_map] landmarks = \"all\") localizes"));
}

TEST(Advise, SendsTheSurveyWhereHeldOutImagesFailed) {
  const Advice::View between{.position = {0.5, 0}, .heading_deg = 90};
  std::vector<Advice> advice = {{.text = "region 0", .stations = {0, 1}, .images_to_take = {between}},
                                {.text = "an option"}};
  const auto failed = [](const char* name, std::optional<StationIdx> station, double x) {
    return FailedImage{.name = name, .station = station, .view = {.position = {x, 0}, .heading_deg = 45}};
  };
  AddFailedImages({}, {failed("a.jpg", 1, 1.1), failed("b.jpg", 3, 3.1), failed("c.jpg", std::nullopt, 9)},
                  &advice);
  ASSERT_THAT(advice, SizeIs(3));
  ASSERT_THAT(advice[0].images_to_take, SizeIs(2));
  EXPECT_EQ(advice[0].images_to_take[0].position.x(), 1.1);
  EXPECT_THAT(advice[1].text, HasSubstr("2 held-out images failed where most are localized (b.jpg, c.jpg)"));
  EXPECT_THAT(advice[1].stations, ElementsAre(3));
  EXPECT_THAT(advice[1].images_to_take, SizeIs(2));
  EXPECT_EQ(advice[2].text, "an option");
  for (int i = 0; i < 20; ++i) AddFailedImages({}, {failed("a.jpg", 1, i)}, &advice);
  EXPECT_THAT(advice[0].images_to_take, SizeIs(Advice::kMaxViews));
}

TEST(Advise, TellsErrorsOfAFrameFromNoise) {
  Random random(1);
  std::vector<PlacedImage> noisy, scaled, at_one_place;
  for (int i = 0; i < 40; ++i) {
    const Eigen::Vector2d place(random.Uniform(-2, 2), random.Uniform(-2, 2));
    const Eigen::Vector2d noise(random.Uniform(-0.02, 0.02), random.Uniform(-0.02, 0.02));
    noisy.push_back({place, place + noise});
    scaled.push_back({place, 1.04 * place + Eigen::Vector2d(0.1, 0) + 0.2 * noise});
    at_one_place.push_back({noise, noise + Eigen::Vector2d(0.1, 0)});
  }
  std::vector<Advice> advice;
  AddMisalignment(noisy, &advice);
  AddMisalignment(at_one_place, &advice);
  AddMisalignment({scaled.begin(), scaled.begin() + 9}, &advice);
  EXPECT_THAT(advice, IsEmpty());
  AddMisalignment(scaled, &advice);
  ASSERT_THAT(advice, SizeIs(1));
  EXPECT_THAT(advice[0].text, HasSubstr("scaled by -3.8"));  // 1 / 1.04: what would make the map's poses fit
}

TEST(ParetoCsv, IsReadAsItWasWritten) {
  ParetoPoint point = Size(40000, 0.9, 0.8);
  point.num_held_out = 10;
  point.median_error_m = 0.0123;
  const std::string csv = ParetoCsv({point, Size(1, 0, 0)});
  const auto read = ParseParetoCsv(csv, "map.pareto.csv");
  ASSERT_TRUE(read.ok()) << read.error().message;
  ASSERT_THAT(*read, SizeIs(2));
  EXPECT_EQ((*read)[0].median_error_m, 0.0123);
  EXPECT_EQ((*read)[1].median_error_m, std::nullopt);
  EXPECT_EQ(ParetoCsv(*read), csv);
  for (const char* line :
       {"1,2,3", "0,inf,0,0,0,0,0,1,1,1,,", "0,9,0,0,0,0,0,nan,1,1,,", "0,0,0,0,0,0,0,1,1,1,,",
        "0,9,0,0,0,0,0,2,1,1,,", "a,9,0,0,0,0,0,1,1,1,,", "0,9,0,0,0,0,0,1,9,1,,", "0,9,0,0,0,0,0,1,1,1,-3,",
        "0,9,0,0,0,0,0,1,1,1,1e999,"}) {
    const auto refused = ParseParetoCsv(ParetoCsv({}) + line + "\n", "map.pareto.csv");
    ASSERT_FALSE(refused.ok()) << line;
    EXPECT_THAT(refused.error().message, HasSubstr("map.pareto.csv: line 2"));
  }
}

TEST(ParetoCsv, OtherTablesAreRefused) {
  for (const char* csv : {"", "a,b\n", "0,9,0,0,0,0,0,1,1,1,,\n"})
    EXPECT_FALSE(ParseParetoCsv(csv, "a.csv").ok()) << csv;
}

TEST(StationsAt, FindsTheNearestPlaceAndRefusesWhatIsFar) {
  MapRows rows = FiveStations();
  rows.stations.push_back({.position = {2, 0}, .heading_deg = 270});
  EXPECT_THAT(*StationsAt(rows, {{2.1, 0.3}, {}}), ElementsAre(2, 5));
  EXPECT_THAT(*StationsAt(rows, {{2.1, 0.3}, -80}), ElementsAre(5));
  const auto far = StationsAt(rows, {{9, 0}, {}});
  ASSERT_FALSE(far.ok());
  EXPECT_EQ(far.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(far.error().message, HasSubstr("station 4 (4.00, 0.00, 90 deg), 5.00 m away"));
  EXPECT_EQ(StationsAt({}, {}).error().code, ErrorCode::kNoData);
}

TEST(ExplainStation, TellsCoverageAndLosses) {
  MapRows rows = FiveStations();
  rows.findings.drops = {Drop(DropReason::kFewObservations, {0, 0, 0, 30, 0}),
                         Drop(DropReason::kFewFeatures, {0, 0, 0, 1, 0})};
  rows.findings.self_test_regions = {{.region = 0, .num_held_out = 4, .num_localized = 3}};
  const std::string covered = ExplainStationText(rows, 1);
  EXPECT_THAT(covered, HasSubstr("covered: yes"));
  EXPECT_THAT(covered, HasSubstr("region 0: 4 of its 4 landmarks; 3 stations; self-test: 3 of 4"));
  const std::string uncovered = ExplainStationText(rows, 3);
  EXPECT_THAT(uncovered, HasSubstr("covered: no"));
  EXPECT_THAT(uncovered, HasSubstr("fewer than k features are visible from it"));
  EXPECT_THAT(uncovered, HasSubstr("few_observations"));
  EXPECT_THAT(uncovered, HasSubstr("image3.png"));
}

TEST(ExplainImage, TellsItsLooks) {
  MapRows rows = FiveStations();
  for (int i = 0; i < 5; ++i) rows.appearance.push_back({.images = {i}, .is_kept = i == 1, .entropy = 0.7});
  rows.appearance[0].look_alikes = {{4, 0.8}};
  const std::string text = ExplainImageText(rows, 4);
  EXPECT_THAT(text, HasSubstr("sees 1 landmarks"));
  EXPECT_THAT(text, HasSubstr("looks like image0.png (score 0.80)"));
  EXPECT_THAT(text, HasSubstr("not kept"));
}

}  // namespace
}  // namespace cairn::pipeline
