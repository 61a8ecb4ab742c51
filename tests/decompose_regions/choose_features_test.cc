#include "stages/decompose_regions/choose_features.h"

#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/LU>

#include "stages/decompose_regions/check_regions.h"
#include "stages/decompose_regions/decompose_regions.h"
#include "tests/decompose_regions/ascii_world.h"

namespace cairn::decompose_regions {
namespace {

using testing::Contains;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// A world whose features have classes: class 100 + i is feature i.
struct Survey {
  World world;
  Classes classes;
};

Eigen::Matrix<uint8_t, 1, kSiftDescriptorDim> RandomDescriptor(Random* random) {
  Eigen::Matrix<double, 1, kSiftDescriptorDim> values;
  for (double& value : values) value = random->Uniform();
  return (512 * values / values.norm()).cast<uint8_t>();
}

// An image of station `station` at this place, turned by a heading about the y axis (0: looks along +z).
void AddImage(const Eigen::Vector3d& center, double heading_deg, StationIdx station, Survey* survey) {
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(-RadFromDeg(heading_deg), Eigen::Vector3d::UnitY()));
  const ImageId image_id = 10 + static_cast<ImageId>(survey->classes.images.size());
  survey->classes.images.push_back(
      {.image_id = image_id, .cam_from_world = {.rotation = rotation, .translation = -(rotation * center)}});
  survey->classes.images.back().camera_id = 1;
  survey->world.station_images.resize(survey->world.num_stations());
  survey->world.station_images[station].push_back(image_id);
}

Survey SurveyOf(World world) {
  Survey survey{.world = std::move(world)};
  survey.classes.cameras = {{.camera_id = 1, .width = 640, .height = 480, .params = {500, 320, 240}}};
  return survey;
}

// A class at this place, seen in these images (from 0); a feature seen from their stations.
FeatureClass& AddClass(const Eigen::Vector3d& position, const std::vector<int>& images, Random* random,
                       Survey* survey) {
  FeatureClass& added = survey->classes.classes.emplace_back();
  added.class_id = 100 + static_cast<ClassId>(survey->world.areas.size());
  added.position = position;
  added.covariance = 1e-6 * Eigen::Matrix3d::Identity();
  added.reprojection_error_px = 0.5;
  added.descriptor = RandomDescriptor(random);
  std::vector<StationIdx>& area = survey->world.areas.emplace_back();
  for (const int image : images) {
    const ImageId image_id = 10 + static_cast<ImageId>(image);
    added.observations.push_back({.image_id = image_id, .keypoint = {.scale = 2}});
    for (StationIdx station = 0; station < survey->world.num_stations(); ++station) {
      const std::vector<ImageId>& taken = survey->world.station_images[station];
      if (std::find(taken.begin(), taken.end(), image_id) != taken.end()) area.push_back(station);
    }
  }
  area.erase(std::unique(area.begin(), area.end()), area.end());
  survey->world.class_ids.push_back(added.class_id);
  return added;
}

// One station with one image at the origin.
Survey LoneImage() {
  Survey survey = SurveyOf(AsciiWorld({"o"}, {}));
  AddImage(Eigen::Vector3d::Zero(), 0, 0, &survey);
  return survey;
}

// The features that one region, of all stations and so far with the first k features, keeps.
std::vector<FeatureIdx> Choose(const Survey& survey, int k, const ChooseFeaturesOptions& options = {}) {
  Region region;
  region.features.resize(k);
  region.stations.resize(survey.world.num_stations());
  std::iota(region.features.begin(), region.features.end(), 0);
  std::iota(region.stations.begin(), region.stations.end(), 0);
  const Decomposition decomposition{.algorithm = "b2", .k = k, .regions = {region}};
  const Result<Decomposition> chosen = ChooseFeatures(survey.world, survey.classes, decomposition, options);
  EXPECT_TRUE(chosen.ok()) << (chosen.ok() ? "" : chosen.error().message);
  return chosen.ok() ? chosen->regions[0].features : std::vector<FeatureIdx>();
}

Eigen::Vector3d Toward(double x, double y, double distance) {
  return distance * Eigen::Vector3d(x, y, 1).normalized();
}

TEST(ChooseFeatures, TakesLandmarksThatAreSpreadOverTheImage) {
  Survey survey = LoneImage();
  Random random(0);
  for (int i = 0; i < 20; ++i)
    AddClass(Toward(0.4 + 0.002 * i, 0.3 + 0.003 * (i % 3), 4), {0}, &random, &survey);
  for (const auto& [x, y] : {std::pair(-0.5, -0.4), std::pair(0.5, -0.4), std::pair(-0.5, 0.4)})
    AddClass(Toward(x, y, 4), {0}, &random, &survey);
  const std::vector<FeatureIdx> features = Choose(survey, 4);
  EXPECT_THAT(features, testing::IsSupersetOf({20, 21, 22}));  // one of the crowd is the fourth corner
}

TEST(ChooseFeatures, TakesTheBetterOfTwoInOneDirection) {
  const auto better = [](const std::function<void(FeatureClass*)>& spoil) {
    Survey survey = LoneImage();
    Random random(1);
    FeatureClass first = AddClass(Toward(0.2, 0.1, 3), {0}, &random, &survey);
    AddClass(Toward(0.2, 0.1, 3), {0}, &random, &survey);
    spoil(&survey.classes.classes[0]);
    return Choose(survey, 1);
  };
  EXPECT_THAT(better([](FeatureClass* c) { c->covariance *= 1e3; }), ElementsAre(1));
  EXPECT_THAT(better([](FeatureClass* c) { c->reprojection_error_px = 3; }), ElementsAre(1));
  EXPECT_THAT(better([](FeatureClass* c) { c->observations[0].keypoint.scale = 12; }), ElementsAre(1));
  EXPECT_THAT(better([](FeatureClass*) {}), ElementsAre(0));  // equal: the first
}

TEST(ChooseFeatures, TakesDistinctiveLandmarks) {
  Survey survey = LoneImage();
  Random random(2);
  for (int i = 0; i < 3; ++i) AddClass(Toward(0.2, 0.1, 3), {0}, &random, &survey);
  survey.classes.classes[1].descriptor = survey.classes.classes[0].descriptor;
  survey.classes.classes[1].descriptor[0] += 4;
  EXPECT_THAT(Choose(survey, 1), ElementsAre(2));
}

TEST(ChooseFeatures, TakesLandmarksForEveryHeading) {
  // One place, four headings; ten landmarks ahead, four in each other direction.
  Survey survey = SurveyOf(AsciiWorld({"o"}, {}));
  Random random(3);
  for (int heading = 0; heading < 4; ++heading) AddImage(Eigen::Vector3d::Zero(), 90 * heading, 0, &survey);
  for (int i = 0; i < 22; ++i) {
    const int heading = i < 10 ? 0 : 1 + (i - 10) / 4;
    const Eigen::Vector3d point = Toward(random.Uniform(-0.5, 0.5), random.Uniform(-0.4, 0.4), 4);
    AddClass(Eigen::AngleAxisd(RadFromDeg(90 * heading), Eigen::Vector3d::UnitY()) * point, {heading},
             &random, &survey);
  }
  std::vector<int> per_heading(4, 0);
  for (const FeatureIdx feature : Choose(survey, 12)) {
    ++per_heading[static_cast<int>(survey.classes.classes[feature].observations[0].image_id) - 10];
  }
  EXPECT_THAT(per_heading, Each(3));
}

TEST(ChooseFeatures, RegionsOfOnePlaceTakeDifferentLandmarks) {
  Survey survey = LoneImage();
  Random random(4);
  for (int i = 0; i < 6; ++i)
    AddClass(Toward(random.Uniform(-0.5, 0.5), random.Uniform(-0.4, 0.4), 4), {0}, &random, &survey);
  const Region region{.features = {0, 1, 2}, .stations = {0}};
  const Decomposition decomposition{.algorithm = "b2", .k = 3, .regions = {region, region}};
  const Decomposition chosen =
      *ChooseFeatures(survey.world, survey.classes, decomposition, {.min_kept_ratio = 1});
  std::vector<FeatureIdx> all = chosen.regions[0].features;
  all.insert(all.end(), chosen.regions[1].features.begin(), chosen.regions[1].features.end());
  EXPECT_THAT(all, testing::UnorderedElementsAre(0, 1, 2, 3, 4, 5));
}

TEST(ChooseFeatures, RegionShrinksForABetterFeatureButKeepsWhatOnlyItCovers) {
  //   stations        0 1 2 3 4 5
  //   region 0        # # # # . .     only it covers 0 and 1
  //   region 1        . . # # # #
  //   poor feature    # # # # # #
  //   good ones       # # # . . .   and   # . # # . .
  Survey survey = SurveyOf(AsciiWorld({"oooooo"}, {}));
  for (int station = 0; station < 6; ++station) AddImage({0.5 * station, 0, 0}, 0, station, &survey);
  Random random(5);
  const auto add = [&](const std::vector<int>& images, double sigma_m) {
    AddClass({1, 0.2, 4}, images, &random, &survey).covariance =
        sigma_m * sigma_m * Eigen::Matrix3d::Identity();
  };
  add({0, 1, 2, 3, 4, 5}, 2);
  add({0, 1, 2}, 1e-3);
  add({0, 2, 3}, 1e-4);
  const Decomposition decomposition{
      .algorithm = "b2",
      .k = 1,
      .regions = {{.features = {0}, .stations = {0, 1, 2, 3}}, {.features = {0}, .stations = {2, 3, 4, 5}}}};
  const auto first_region = [&](double min_kept_ratio) {
    const Decomposition chosen =
        *ChooseFeatures(survey.world, survey.classes, decomposition, {.min_kept_ratio = min_kept_ratio});
    EXPECT_THAT(CheckRegions(survey.world, chosen).violations, IsEmpty());
    return chosen.regions[0];
  };
  EXPECT_THAT(first_region(0.75).features, ElementsAre(1));
  EXPECT_THAT(first_region(0.75).stations, ElementsAre(0, 1, 2));
  EXPECT_THAT(first_region(0.76).features, ElementsAre(0));
  EXPECT_THAT(first_region(1).stations, ElementsAre(0, 1, 2, 3));
}

// Stations in a row with an image each, and features that all look at one point, worse (2 m) or better ones.
class RowSurvey {
 public:
  explicit RowSurvey(int num_stations) : survey_(SurveyOf(AsciiWorld({std::string(num_stations, 'o')}, {}))) {
    for (int station = 0; station < num_stations; ++station)
      AddImage({0.5 * station, 0, 0}, 0, station, &survey_);
  }
  // Returns the class, whose feature is the next one.
  FeatureClass& Add(const std::vector<int>& seen_from, double sigma_m) {
    FeatureClass& added = AddClass({1, 0.2, 4}, seen_from, &random_, &survey_);
    added.covariance = sigma_m * sigma_m * Eigen::Matrix3d::Identity();
    return added;
  }
  // What becomes of regions of these stations, which have feature 0.
  std::vector<Region> Choose(const std::vector<std::vector<StationIdx>>& stations,
                             double min_kept_ratio) const {
    Decomposition decomposition{.algorithm = "b2", .k = 1};
    for (const std::vector<StationIdx>& of_region : stations)
      decomposition.regions.push_back({{0}, of_region});
    const Result<Decomposition> chosen =
        ChooseFeatures(survey_.world, survey_.classes, decomposition, {.min_kept_ratio = min_kept_ratio});
    EXPECT_TRUE(chosen.ok()) << (chosen.ok() ? "" : chosen.error().message);
    return chosen.ok() ? chosen->regions : std::vector<Region>();
  }
  Survey& survey() { return survey_; }

 private:
  Survey survey_;
  Random random_{8};
};

TEST(ChooseFeatures, RegionKeepsTheConnectedPartThatIsNeededAndLargeEnough) {
  //   stations        0 1 2 3 4 5
  //   region 0        # # # # # #     only it covers 3 to 5
  //   region 1        # # # . . .
  //   a good feature  # . # # # #     parts {0}, which is too small, and {2, 3, 4, 5}
  //   or              # # . # # #     parts {0, 1}, without what is needed, and {3, 4, 5}
  for (const bool first : {true, false}) {
    RowSurvey row(6);
    row.Add({0, 1, 2, 3, 4, 5}, 2);
    row.Add(first ? std::vector<int>{0, 2, 3, 4, 5} : std::vector<int>{0, 1, 3, 4, 5}, 1e-3);
    const std::vector<Region> regions = row.Choose({{0, 1, 2, 3, 4, 5}, {0, 1, 2}}, first ? 0.5 : 0.25);
    EXPECT_THAT(regions[0].features, ElementsAre(1)) << first;
    if (first) {
      EXPECT_THAT(regions[0].stations, ElementsAre(2, 3, 4, 5));
    } else {
      EXPECT_THAT(regions[0].stations, ElementsAre(3, 4, 5));
    }
    EXPECT_THAT(regions[1].stations, ElementsAre(0, 1, 2)) << first;
  }
}

TEST(ChooseFeatures, LaterRegionsKeepWhatEarlierOnesGaveUpAndNoMore) {
  //   stations         0 1 2 3 4
  //   region 0         # # # . .
  //   region 1         . # # # #
  //   good for 0       # # . . .     it gives up station 2
  //   good for 1       . . # # #     it may give up station 1, which region 0 still covers
  //   better for 1     . . . # #     but not station 2
  RowSurvey row(5);
  row.Add({0, 1, 2, 3, 4}, 2);
  row.Add({0, 1}, 1e-3);
  row.Add({2, 3, 4}, 0.1);
  row.Add({3, 4}, 1e-3);
  const std::vector<Region> regions = row.Choose({{0, 1, 2}, {1, 2, 3, 4}}, 0.5);
  EXPECT_THAT(regions[0].stations, ElementsAre(0, 1));
  EXPECT_THAT(regions[0].features, ElementsAre(1));
  EXPECT_THAT(regions[1].stations, ElementsAre(2, 3, 4));
  EXPECT_THAT(regions[1].features, ElementsAre(2));
}

TEST(ChooseFeatures, RegionThatNoStationNeedsStaysAsItIs) {
  RowSurvey row(4);
  row.Add({0, 1, 2, 3}, 2);
  row.Add({0, 1, 2}, 1e-3);
  const std::vector<Region> regions = row.Choose({{0, 1, 2, 3}, {0, 1, 2, 3}}, 0.5);
  for (const Region& region : regions) {
    EXPECT_THAT(region.stations, ElementsAre(0, 1, 2, 3));
    EXPECT_THAT(region.features, ElementsAre(0));
  }
}

TEST(ChooseFeatures, RegionThatKeepsAllStationsComparesOnlyWhatAllOfThemSee) {
  // Feature 2, which looks like feature 0, is seen from the stations that only region 0 covers: it makes
  // feature 0 less distinctive where the region might shrink to them, and only there.
  RowSurvey row(4);
  row.Add({0, 1, 2, 3}, 1e-3);
  row.Add({0, 1, 2, 3}, 1e-3);
  const auto descriptor = row.survey().classes.classes[0].descriptor;
  row.Add({0, 1}, 5).descriptor = descriptor;
  EXPECT_THAT(row.Choose({{0, 1, 2}, {2, 3}}, 1)[0].features, ElementsAre(0));
  EXPECT_THAT(row.Choose({{0, 1, 2}, {2, 3}}, 0.99)[0].features, ElementsAre(1));
}

TEST(ChooseFeatures, ALandmarkOfAnotherRegionAddsNothing) {
  // Even a feature that hardly tells anything adds more.
  Survey survey = LoneImage();
  Random random(9);
  AddClass(Toward(0.1, 0.2, 4), {0}, &random, &survey);
  AddClass(Toward(-0.3, -0.2, 4), {0}, &random, &survey).covariance = 100 * Eigen::Matrix3d::Identity();
  const Region region{.features = {0}, .stations = {0}};
  const Decomposition decomposition{.algorithm = "b2", .k = 1, .regions = {region, region}};
  const Decomposition chosen = *ChooseFeatures(survey.world, survey.classes, decomposition, {});
  EXPECT_THAT(chosen.regions[0].features, ElementsAre(0));
  EXPECT_THAT(chosen.regions[1].features, ElementsAre(1));
}

TEST(ChooseFeatures, AWorldWithoutFeaturesNeedsNoNamesOfClasses) {
  const Decomposition none{.algorithm = "b2", .k = 1};
  EXPECT_TRUE(ChooseFeatures(AsciiWorld({"oo"}, {}), Classes(), none, {}).ok());
}

TEST(ChooseFeatures, OptionsHaveTheRangesOfTheirComments) {
  const auto check = [](const ChooseFeaturesOptions& options) {
    ChooseFeaturesOptions checked = options;
    return CheckOptions(DescribeOptions(&checked)).ok();
  };
  const ChooseFeaturesOptions least{.min_kept_ratio = 0,
                                    .keypoint_sigma_px = 1e-3,
                                    .keypoint_sigma_per_scale = 0,
                                    .confusion_angle_rad = 1e-3,
                                    .rough_sigma_m = 1e-3,
                                    .rough_sigma_deg = 1e-2};
  const ChooseFeaturesOptions most{.min_kept_ratio = 1,
                                   .keypoint_sigma_px = 1e3,
                                   .keypoint_sigma_per_scale = 1e3,
                                   .confusion_angle_rad = 10,
                                   .rough_sigma_m = 1e6,
                                   .rough_sigma_deg = 1e3};
  EXPECT_TRUE(check(least));
  EXPECT_TRUE(check(most));
  for (const auto member :
       {&ChooseFeaturesOptions::min_kept_ratio, &ChooseFeaturesOptions::keypoint_sigma_px,
        &ChooseFeaturesOptions::keypoint_sigma_per_scale, &ChooseFeaturesOptions::confusion_angle_rad,
        &ChooseFeaturesOptions::rough_sigma_m, &ChooseFeaturesOptions::rough_sigma_deg}) {
    ChooseFeaturesOptions less = least, more = most;
    less.*member -= 1e-4;
    more.*member *= 1.01;
    EXPECT_FALSE(check(less));
    EXPECT_FALSE(check(more));
  }
}

// The objective written out, with Jacobians by differences.
double Objective(const Survey& survey, const std::vector<FeatureIdx>& features,
                 const ChooseFeaturesOptions& options) {
  using Matrix6d = Eigen::Matrix<double, 6, 6>;
  const auto& classes = survey.classes.classes;
  Matrix6d rough = Matrix6d::Identity() / (options.rough_sigma_m * options.rough_sigma_m);
  rough.topLeftCorner<3, 3>() =
      Eigen::Matrix3d::Identity() / std::pow(RadFromDeg(options.rough_sigma_deg), 2);
  double sum = 0;
  for (const SurveyImage& image : survey.classes.images) {
    Matrix6d information = rough;
    for (const FeatureIdx feature : features) {
      const FeatureClass& landmark = classes[feature];
      for (const Observation& observation : landmark.observations) {
        if (observation.image_id != image.image_id) continue;
        double nearest_rad = 10;
        for (const FeatureClass& other : classes) {
          if (other.class_id == landmark.class_id) continue;
          nearest_rad = std::min(
              nearest_rad, std::acos(other.descriptor.cast<double>().dot(landmark.descriptor.cast<double>()) /
                                     (512.0 * 512.0)));
        }
        const double weight = nearest_rad * nearest_rad /
                              (nearest_rad * nearest_rad + std::pow(options.confusion_angle_rad, 2));
        const Eigen::Vector3d point = image.cam_from_world * landmark.position;
        Eigen::Matrix<double, 3, 6> jacobian;
        Eigen::Matrix3d by_point;
        const double step = 1e-6;
        for (int i = 0; i < 3; ++i) {
          const Eigen::Vector3d axis = Eigen::Vector3d::Unit(i);
          const auto slope = [&](const Eigen::Vector3d& plus, const Eigen::Vector3d& minus) {
            return Eigen::Vector3d((plus.normalized() - minus.normalized()) / (2 * step));
          };
          jacobian.col(i) =
              slope(Eigen::AngleAxisd(step, axis) * point, Eigen::AngleAxisd(-step, axis) * point);
          by_point.col(i) = jacobian.col(3 + i) = slope(point + step * axis, point - step * axis);
        }
        const Eigen::Matrix3d rotation = image.cam_from_world.rotation.toRotationMatrix();
        const double sigma_rad = std::hypot(options.keypoint_sigma_px,
                                            options.keypoint_sigma_per_scale * observation.keypoint.scale,
                                            landmark.reprojection_error_px) /
                                 500;
        // The bearing does not change along itself: noise there is as good as any.
        const Eigen::Matrix3d noise =
            sigma_rad * sigma_rad * Eigen::Matrix3d::Identity() +
            by_point * rotation * landmark.covariance * rotation.transpose() * by_point.transpose();
        information += weight * jacobian.transpose() * noise.inverse() * jacobian;
      }
    }
    sum += std::log(information.determinant()) - std::log(rough.determinant());
  }
  return sum;
}

TEST(ChooseFeatures, TakesTheBestLandmarkAndReachesItsShareOfTheOptimum) {
  for (int trial = 0; trial < 30; ++trial) {
    Random random(100 + trial);
    Survey survey = SurveyOf(AsciiWorld({"oo"}, {}));
    for (const StationIdx station : {0, 0, 1})
      AddImage({0.7 * station, random.Uniform(-0.2, 0.2), 0}, random.Uniform(-30, 30), station, &survey);
    for (int i = 0; i < 8; ++i) {
      std::vector<int> images = {static_cast<int>(random.UniformInt(0, 1)), 2};
      if (random.Uniform() < 0.3) images = {0, 1, 2};
      FeatureClass& added =
          AddClass(Toward(random.Uniform(-0.5, 0.5), random.Uniform(-0.4, 0.4), random.Uniform(2, 8)), images,
                   &random, &survey);
      added.covariance =
          Eigen::Vector3d(random.Uniform(1e-6, 1e-2), random.Uniform(1e-6, 1e-2), 1e-3).asDiagonal();
      added.reprojection_error_px = random.Uniform(0.3, 3);
      for (Observation& observation : added.observations)
        observation.keypoint.scale = static_cast<float>(random.Uniform(1, 10));
    }
    const ChooseFeaturesOptions options;
    FeatureIdx best_feature = -1;
    double best_of_one = -1, best_of_three = -1;
    for (FeatureIdx a = 0; a < 8; ++a) {
      if (const double value = Objective(survey, {a}, options); value > best_of_one) {
        best_of_one = value;
        best_feature = a;
      }
      for (FeatureIdx b = a + 1; b < 8; ++b) {
        for (FeatureIdx c = b + 1; c < 8; ++c)
          best_of_three = std::max(best_of_three, Objective(survey, {a, b, c}, options));
      }
    }
    EXPECT_THAT(Choose(survey, 1), ElementsAre(best_feature)) << trial;
    const std::vector<FeatureIdx> three = Choose(survey, 3);
    EXPECT_THAT(three, Contains(best_feature)) << trial;
    EXPECT_GE(Objective(survey, three, options), (1 - std::exp(-1)) * best_of_three) << trial;
  }
}

TEST(ChooseFeatures, KeepsEveryPropertyOfRegionsOnRandomWorlds) {
  for (uint64_t seed = 0; seed < 12; ++seed) {
    Random random(seed);
    Survey survey = SurveyOf(RandomWorld(9, 7, 60, seed % 3 == 2, seed));
    const int num_stations = survey.world.num_stations();
    for (StationIdx station = 0; station < num_stations; ++station) {
      const Eigen::Vector2d place = survey.world.positions[station];
      AddImage({place.x(), 0, place.y()}, random.Uniform(0, 360), station, &survey);
    }
    const std::vector<std::vector<StationIdx>> areas = std::exchange(survey.world.areas, {});
    for (const std::vector<StationIdx>& area : areas)
      AddClass({random.Uniform(0, 9), random.Uniform(-1, 1), random.Uniform(-7, 0)}, area, &random, &survey);
    ASSERT_EQ(survey.world.areas, areas);
    for (const char* algorithm : {"a2", "b2", "best"}) {
      for (const int tau : {0, 1, 2}) {
        const Result<Decomposition> cover =
            DecomposeRegions(survey.world, {.algorithm = algorithm, .k = 4, .tau = tau}, seed);
        if (!cover.ok()) continue;
        const Decomposition chosen = *ChooseFeatures(
            survey.world, survey.classes, *cover, {.min_kept_ratio = 0.25 * static_cast<double>(seed % 5)});
        EXPECT_THAT(CheckRegions(survey.world, chosen).violations, IsEmpty()) << algorithm << tau << seed;
        ASSERT_EQ(chosen.regions.size(), cover->regions.size());
        EXPECT_EQ(chosen.uncovered, cover->uncovered);
        for (size_t i = 0; i < chosen.regions.size(); ++i)
          EXPECT_EQ(chosen.regions[i].features.size(), cover->regions[i].features.size());
      }
    }
  }
}

TEST(ChooseFeatures, ErrorsNameTheElement) {
  Survey survey = LoneImage();
  Random random(6);
  AddClass(Toward(0, 0, 2), {0}, &random, &survey);
  const Decomposition decomposition{.k = 1, .regions = {{.features = {0}, .stations = {0}}}};
  const auto message = [&](const Survey& changed, const ChooseFeaturesOptions& options = {}) {
    const Result<Decomposition> result =
        ChooseFeatures(changed.world, changed.classes, decomposition, options);
    EXPECT_FALSE(result.ok());
    return result.ok() ? "" : result.error().message;
  };
  Survey nameless = survey, lost_class = survey, lost_image = survey, lost_camera = survey;
  nameless.world.class_ids.clear();
  lost_class.classes.classes.clear();
  lost_image.classes.images[0].image_id = 77;
  lost_camera.classes.cameras.clear();
  Survey later_class = survey, earlier_image = survey, other_camera = survey;
  later_class.classes.classes[0].class_id = 101;
  earlier_image.classes.images[0].image_id = 9;
  other_camera.classes.cameras[0].camera_id = 2;
  EXPECT_THAT(message(later_class), HasSubstr("feature 0 of the world is class 100"));
  EXPECT_THAT(message(earlier_image), HasSubstr("class 100 is observed in image 10"));
  EXPECT_THAT(message(other_camera), HasSubstr("image 10 is of camera 1"));
  EXPECT_THAT(message(nameless), HasSubstr("does not name the classes"));
  EXPECT_THAT(message(lost_class), HasSubstr("feature 0 of the world is class 100"));
  EXPECT_THAT(message(lost_image), HasSubstr("class 100 is observed in image 10"));
  EXPECT_THAT(message(lost_camera), HasSubstr("image 10 is of camera 1"));
  EXPECT_THAT(message(survey, {.min_kept_ratio = 2}), HasSubstr("min_kept_ratio"));
  EXPECT_THAT(message(survey, {.feature_choice = "any"}), HasSubstr("feature_choice"));
}

}  // namespace
}  // namespace cairn::decompose_regions
