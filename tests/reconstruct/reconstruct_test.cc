#include "stages/reconstruct/reconstruct.h"

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "tests/core/capture/exif_jpeg.h"
#include "tests/reconstruct/fake_colmap.h"
#include "tests/reconstruct/synthetic_survey.h"

namespace cairn::reconstruct {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::SizeIs;

// Our mapper, and the real colmap, on surveys with known truth.
class ReconstructTest : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    root_ = testing::TempDir() + "/reconstruct_test";
    fs::remove_all(root_);
    fs::create_directories(root_);
  }
  Result<ReconstructResult> Run(SyntheticSurvey survey, ReconstructOptions options) {
    options.mapper.mapper = GetParam();
    survey.capture.root = survey.capture.images_folder = root_;
    const std::string work = root_ + "/work";
    fs::remove_all(work);
    fs::create_directories(work);
    NoProgress progress;
    return Reconstruct(survey.input, survey.capture, options, work, 2, progress);
  }
  void Write(const std::string& name, const std::string& text) {
    ASSERT_TRUE(WriteFileAtomically(root_ + "/" + name, text).ok());
  }
  // Every image's true place as a control point.
  void WriteControlPoints(const SyntheticSurvey& survey) {
    std::string text;
    for (size_t i = 0; i < survey.input.images.size(); ++i) {
      const Eigen::Vector3d centre = survey.cams_from_world[i].Center();
      text += fmt::format("{} {} {} {}\n", survey.input.images[i].name, centre.x(), centre.y(), centre.z());
    }
    Write("control_points.txt", text);
  }
  std::string root_;
};

double MaxCenterErrorM(const ReconstructResult& result, const SyntheticSurvey& survey) {
  double most = 0;
  for (const CaptureImage& image : result.images) {
    for (size_t i = 0; i < survey.input.images.size(); ++i) {
      if (survey.input.images[i].name == image.name)
        most = std::max(most, CenterErrorM(*image.cam_from_world, survey.cams_from_world[i]));
    }
  }
  return most;
}

TEST_P(ReconstructTest, ControlPointsGiveTruePosesAndTheTrueCamera) {
  const SyntheticSurvey survey = MakeSyntheticSurvey(12, 11);
  WriteControlPoints(survey);
  const auto result = Run(survey, {.control_points = "control_points.txt"});
  ASSERT_TRUE(result.ok()) << result.error().message;
  ASSERT_THAT(result->images, SizeIs(12));
  EXPECT_THAT(result->rejects, SizeIs(0));
  EXPECT_THAT(result->model_sizes, testing::ElementsAre(12));
  EXPECT_EQ(result->frame.unit, "metre");
  EXPECT_EQ(result->frame.source, "control_points");
  EXPECT_FALSE(result->frame.anchor);
  EXPECT_TRUE(result->frame.is_reconstructed);
  EXPECT_LT(result->mean_error_px, 2 * kKeypointNoisePx);
  // 0.3 px at 9 m and f = 500 px is 5 mm of a point; a camera has hundreds of points.
  EXPECT_LT(MaxCenterErrorM(*result, survey), 0.03);
  for (size_t i = 0; i < 12; ++i) {
    EXPECT_LT(RotationErrorDeg(*result->images[i].cam_from_world, survey.cams_from_world[i]), 0.2);
    EXPECT_LT(result->residuals[i].residual_m, 0.03);
    EXPECT_FALSE(result->residuals[i].is_off);
  }
  // The guess was 768 px and without distortion, the truth is 500 px and none.
  EXPECT_EQ(result->cameras.at(1).model, CameraModel::kSimpleRadial);
  EXPECT_NEAR(result->cameras.at(1).FocalX(), 500, 5);
  EXPECT_NEAR(result->cameras.at(1).params[3], 0, 0.01);
}

TEST_P(ReconstructTest, KnownDistancesGiveTheScale) {
  const SyntheticSurvey survey = MakeSyntheticSurvey(10, 12);
  const auto distance = [&](int i, int j) {
    return CenterErrorM(survey.cams_from_world[i], survey.cams_from_world[j]);
  };
  Write("distances.txt",
        fmt::format("image00.jpg image05.jpg {}\nimage01.jpg image08.jpg {}\nimage02.jpg image09.jpg {}\n",
                    distance(0, 5), distance(1, 8), 2 * distance(2, 9)));
  const auto result = Run(survey, {.distances = "distances.txt"});
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_EQ(result->frame.unit, "metre");
  EXPECT_EQ(result->frame.source, "distances");
  EXPECT_NEAR(
      CenterErrorM(*result->images[0].cam_from_world, *result->images[9].cam_from_world) / distance(0, 9), 1,
      0.01);
  EXPECT_LT(result->images[0].cam_from_world->Center().norm(), 1e-9);
  EXPECT_FALSE(result->residuals[0].is_off);
  EXPECT_TRUE(result->residuals[2].is_off);
  EXPECT_NEAR(result->residuals[2].residual_m, distance(2, 9), 0.1);
}

TEST_P(ReconstructTest, GpsGivesAnAnchoredFrame) {
  SyntheticSurvey survey = MakeSyntheticSurvey(10, 13);
  const GeodeticPosition place{-33.8567844, 151.2152967, -20};  // south, east, below sea level
  for (size_t i = 0; i < survey.input.images.size(); ++i) {
    const GeodeticPosition gps = GeodeticFromEnu(place, survey.cams_from_world[i].Center());
    const auto seconds = [](double angle_deg) {
      return Rationals{
          {0, 1}, {0, 1}, {static_cast<uint32_t>(std::llround(std::abs(angle_deg) * 3.6e6)), 1000}};
    };
    const GpsBlock block{.latitude_ref = 'S',
                         .latitude = seconds(gps.latitude_deg),
                         .longitude = seconds(gps.longitude_deg),
                         .altitude_ref = 1,
                         .altitude = {{static_cast<uint32_t>(std::llround(-1000 * gps.altitude_m)), 1000}}};
    if (i != 4) Write(survey.input.images[i].name, ExifJpeg(block));  // one image has none
  }
  const auto result = Run(survey, {.gps_sigma_m = 0.1, .gps_altitude_sigma_m = 0.1});
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_EQ(result->frame.source, "gps");
  ASSERT_TRUE(result->frame.anchor);
  EXPECT_THAT(result->residuals, SizeIs(9));
  for (size_t i = 0; i < 10; ++i) {
    const GeodeticPosition found =
        GeodeticFromEnu(*result->frame.anchor, result->images[i].cam_from_world->Center());
    EXPECT_LT((EnuFromGeodetic(place, found) - survey.cams_from_world[i].Center()).norm(), 0.05);
  }
}

TEST_P(ReconstructTest, WithoutAnythingKnownTheUnitIsArbitraryAndSaidSo) {
  const SyntheticSurvey survey = MakeSyntheticSurvey(8, 14);
  const auto result = Run(survey, {.unscaled_depth = 4.75, .hold_out_every = 3});
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_EQ(result->frame.unit, "arbitrary");
  EXPECT_EQ(result->frame.source, "none");
  ASSERT_THAT(result->warnings, SizeIs(1));
  EXPECT_THAT(result->warnings[0], AllOf(HasSubstr("no image has a GPS position"), HasSubstr("arbitrary")));
  ASSERT_THAT(result->queries, SizeIs(2));
  EXPECT_EQ(result->queries[0].name, "image02.jpg");
  EXPECT_EQ(result->queries[1].name, "image05.jpg");
  EXPECT_THAT(result->images, SizeIs(6));
  // The cameras stand 9 to 10 m from the middle of the cloud: everything is half as large as it was.
  EXPECT_NEAR(CenterErrorM(*result->images[0].cam_from_world, *result->images[5].cam_from_world),
              0.5 * CenterErrorM(survey.cams_from_world[0], survey.cams_from_world[7]), 0.1);
}

TEST_P(ReconstructTest, AskedForGpsThatIsNotThereIsAnError) {
  const auto result = Run(MakeSyntheticSurvey(6, 15), {.scale_from = "gps"});
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::kNoData);
  EXPECT_THAT(result.error().message, HasSubstr("no image has a GPS position"));
}

// Two places without a match between them, and one image of nothing: the larger place is kept, the others are
// listed with their reasons.
TEST_P(ReconstructTest, LargestPartIsKeptAndTheRestIsListed) {
  SyntheticSurvey survey = MakeSyntheticSurvey(9, 16);
  AppendSurvey(MakeSyntheticSurvey(5, 17, "other", 10), &survey);
  survey.input.images.push_back({15, "lonely.jpg", 1});
  survey.input.keypoints.emplace_back();
  const auto result = Run(survey, {.min_registered_ratio = 0.6, .scale_from = "none"});
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_THAT(result->model_sizes, testing::ElementsAre(9, 5));
  EXPECT_THAT(result->images, SizeIs(9));
  ASSERT_THAT(result->rejects, SizeIs(6));
  EXPECT_EQ(result->rejects[0].name, "other00.jpg");
  EXPECT_THAT(result->rejects[0].reason, HasSubstr("in a separate part of 5 images"));
  EXPECT_EQ(result->rejects[5].name, "lonely.jpg");
  EXPECT_THAT(result->rejects[5].reason, HasSubstr("no 15 verified matches with any registered image"));
  ASSERT_THAT(result->warnings, SizeIs(1));
  EXPECT_EQ(result->verdict.num_images(), 15);
  ASSERT_THAT(result->verdict.parts, SizeIs(1));
  EXPECT_EQ(result->verdict.parts[0].first, "other00.jpg");
  EXPECT_EQ(result->verdict.missing[0].reason, result->rejects[5].reason);
  EXPECT_THAT(result->warnings[0],
              HasSubstr("only 9 of 15 images were registered (60 %); models of 9, 5 images"));

  const auto too_few = Run(survey, {.min_registered_ratio = 0.61, .scale_from = "none"});
  ASSERT_FALSE(too_few.ok());
  EXPECT_EQ(too_few.error().code, ErrorCode::kNoData);
  EXPECT_THAT(
      too_few.error().message,
      AllOf(HasSubstr("only 9 of 15"), HasSubstr("min_registered_ratio = 0.61"), HasSubstr("other00.jpg: "),
            HasSubstr("\n  9 images, image00.jpg to image08.jpg\n  5 images, other00.jpg to other04.jpg\n")));
}

TEST_P(ReconstructTest, BadOptionsAreRefused) {
  const SyntheticSurvey survey = MakeSyntheticSurvey(3, 18);
  for (const ReconstructOptions& options :
       {ReconstructOptions{.min_registered_ratio = 2}, ReconstructOptions{.scale_from = "stars"},
        ReconstructOptions{.scale_from = "distances"}, ReconstructOptions{.scale_from = "control_points"},
        ReconstructOptions{.scale_from = "rig"}, ReconstructOptions{.scale_from = "camera_height"},
        ReconstructOptions{.camera_height_m = -1}, ReconstructOptions{.gps_sigma_m = 0},
        ReconstructOptions{.hold_out_every = 1}}) {
    const auto result = Run(survey, options);
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().code, ErrorCode::kInvalidArgument) << result.error().message;
  }
}

INSTANTIATE_TEST_SUITE_P(Mappers, ReconstructTest, testing::Values("global", "colmap"));

using ReconstructByColmapTest = ReconstructTest;
INSTANTIATE_TEST_SUITE_P(Mappers, ReconstructByColmapTest, testing::Values("colmap"));

TEST_P(ReconstructByColmapTest, WithoutAStartTheMapperRunsOnceMoreWithoutDistortion) {
  const FakeColmap colmap(R"(case "$*" in
*"ba_refine_extra_params 1"*) echo "ERROR: failed to create sparse model"; exit 1;;
esac
exec /usr/bin/colmap "$@")");
  const SyntheticSurvey survey = MakeSyntheticSurvey(12, 11);
  WriteControlPoints(survey);
  const auto result = Run(survey, {.control_points = "control_points.txt"});
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_THAT(result->images, SizeIs(12));
  EXPECT_EQ(result->cameras.at(1).model, CameraModel::kSimplePinhole);
  ASSERT_FALSE(result->warnings.empty());
  EXPECT_THAT(result->warnings[0], HasSubstr("0 of 12 images were registered by COLMAP with the cameras' "
                                             "distortion refined, 12 without"));
  ReconstructOptions only_with{.control_points = "control_points.txt"};
  only_with.mapper.refine_distortion = false;
  EXPECT_THAT(Run(survey, only_with)->warnings, SizeIs(0));
}

// As along a street: COLMAP starts from no pair of forward motion unless it is told to.
TEST_P(ReconstructByColmapTest, WithoutAStartTheMapperAtLastStartsFromAnyPair) {
  const FakeColmap colmap(R"(case "$*" in
*"init_max_forward_motion 1 "*) exec /usr/bin/colmap "$@";;
esac
echo "ERROR: failed to create sparse model"; exit 1)");
  const SyntheticSurvey survey = MakeSyntheticSurvey(12, 11);
  WriteControlPoints(survey);
  ReconstructOptions options{.control_points = "control_points.txt"};
  const auto result = Run(survey, options);
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_THAT(result->images, SizeIs(12));
  ASSERT_FALSE(result->warnings.empty());
  EXPECT_EQ(result->warnings[0],
            "0 of 12 images were registered by COLMAP with the cameras' distortion refined, 0 without, 12 "
            "from a start "
            "of any motion; the reconstruction is the one from a start of any motion");
  options.mapper.refine_distortion = false;
  EXPECT_EQ(Run(survey, options)->warnings[0],
            "0 of 12 images were registered by COLMAP without distortion, 12 from a start of any motion; the "
            "reconstruction is the one from a start of any motion");
}

// What joins too few images is left to COLMAP, which joins more of these: it says so.
using ReconstructGloballyTest = ReconstructTest;
INSTANTIATE_TEST_SUITE_P(Mappers, ReconstructGloballyTest, testing::Values("global", "auto"));

TEST_P(ReconstructGloballyTest, ColmapIsAskedOnlyWhereTooFewImagesAreJoined) {
  const FakeColmap colmap("echo called >> " + root_ +
                          "/colmap.log\necho 'ERROR: failed to create sparse model'; exit 1");
  const auto whole = Run(MakeSyntheticSurvey(12, 11), {.scale_from = "none"});
  ASSERT_TRUE(whole.ok()) << whole.error().message;
  EXPECT_FALSE(fs::exists(root_ + "/colmap.log"));
  SyntheticSurvey survey = MakeSyntheticSurvey(9, 16);
  AppendSurvey(MakeSyntheticSurvey(5, 17, "other", 10), &survey);
  const auto parts = Run(survey, {.min_registered_ratio = 0.7, .scale_from = "none"});
  ASSERT_FALSE(parts.ok());
  EXPECT_TRUE(fs::exists(root_ + "/colmap.log"));
  EXPECT_THAT(parts.error().message, HasSubstr("only 9 of 14"));
}

}  // namespace
}  // namespace cairn::reconstruct
