#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "core/capture/capture.h"
#include "core/colmap/colmap_model.h"
#include "core/files/file.h"
#include "pipeline/exchange/import/layouts.h"
#include "pipeline/exchange/import/write_capture.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Miniature data sets of each layout.  Where a test turns the camera it is by a quarter turn about z, whose
// matrix and quaternion can be written down:
//     0 -1  0
// R = 1  0  0      q = (w, x, y, z) = (s, 0, 0, s), s = sqrt(1/2);   R x = y, R y = -x
//     0  0  1
class Import : public testing::Test {
 protected:
  void SetUp() override {
    root_ = testing::TempDir() + "/import_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(root_);
    fs::create_directories(root_);
  }
  void Write(const std::string& name, const std::string& text) {
    fs::create_directories(fs::path(root_ + "/" + name).parent_path());
    ASSERT_TRUE(WriteFileAtomically(root_ + "/" + name, text).ok());
  }
  void WriteImage(const std::string& name, int width = 8, int height = 6) {
    fs::create_directories(fs::path(root_ + "/" + name).parent_path());
    ASSERT_TRUE(cv::imwrite(root_ + "/" + name, cv::Mat(height, width, CV_8UC1, cv::Scalar(100))));
  }
  Result<ImportedSurvey> Read(const ImportOptions& options = {}) { return ReadSurvey(root_, options); }
  std::string MessageOf(const ImportOptions& options = {}) {
    const auto survey = Read(options);
    return survey.ok() ? "read" : survey.error().message;
  }
  std::string root_;
};

std::vector<std::string> Names(const ImportedSurvey& survey) {
  std::vector<std::string> names;
  for (const ImportedImage& image : survey.images) names.push_back(image.name);
  return names;
}

// cam_from_world takes `world` to `cam`.
void ExpectMaps(const Pose& cam_from_world, const Eigen::Vector3d& world, const Eigen::Vector3d& cam) {
  EXPECT_LT((cam_from_world * world - cam).norm(), 1e-6) << (cam_from_world * world).transpose();
}

const ImportOptions kSmallCamera = {.camera = "PINHOLE,8,6,10,10,4,3"};
constexpr char kQuarterTurnQuaternion[] = "0 0 0.70710678118654757 0.70710678118654757";  // x y z w

TEST_F(Import, TumPosesAreWorldFromCameraInterpolatedInTime) {
  Write("groundtruth.txt", std::string("# timestamp tx ty tz qx qy qz qw\n") +   //
                               "10.00 1 2 3 " + kQuarterTurnQuaternion + "\n" +  //
                               "10.01 3 2 3 " + kQuarterTurnQuaternion + "\n" +  //
                               "12.00 9 9 9 0 0 0 1\n");
  Write("rgb.txt",
        "# timestamp filename\n10.00 rgb/a.png\n10.005 rgb/b.png\n11.0 rgb/c.png\n12.5 rgb/d.png\n");
  for (const char* name : {"rgb/a.png", "rgb/b.png", "rgb/c.png", "rgb/d.png"}) WriteImage(name);
  const auto survey = Read(kSmallCamera);
  ASSERT_TRUE(survey.ok()) << survey.error().message;
  EXPECT_THAT(Names(*survey), ElementsAre("rgb/a.png", "rgb/b.png"));
  // The camera stands at (1, 2, 3), its x axis along the world's y: a point one metre further in y is at x
  // = 1.
  ExpectMaps(survey->images[0].cam_from_world, {1, 2, 3}, {0, 0, 0});
  ExpectMaps(survey->images[0].cam_from_world, {1, 3, 3}, {1, 0, 0});
  ExpectMaps(survey->images[0].cam_from_world, {0, 2, 4}, {0, 1, 1});
  ExpectMaps(survey->images[1].cam_from_world, {2, 2, 3}, {0, 0, 0});  // half way
  ASSERT_EQ(survey->left_out.size(), 2u);
  EXPECT_THAT(survey->left_out[0].reason, HasSubstr("0.990 s before and 1.000 s after, farther than 0.02 s"));
  EXPECT_THAT(survey->left_out[1].reason, HasSubstr("no stated pose after it"));
}

TEST_F(Import, TumCamerasAreKnownByTheFolderOrAskedFor) {
  Write("groundtruth.txt", "1 0 0 0 0 0 0 1\n");
  Write("rgb.txt", "1 rgb/a.png\n");
  WriteImage("rgb/a.png", 640, 480);
  EXPECT_THAT(MessageOf(), HasSubstr("give --camera"));
  const std::string freiburg = root_ + "/rgbd_dataset_freiburg3_desk";
  fs::create_directories(freiburg);
  for (const char* name : {"groundtruth.txt", "rgb.txt", "rgb"})
    fs::rename(root_ + "/" + name, freiburg + "/" + name);
  const auto survey = ReadSurvey(freiburg, {});
  ASSERT_TRUE(survey.ok()) << survey.error().message;
  // OpenCV's principal point plus half a pixel.
  EXPECT_THAT(survey->cameras.at(1).params, ElementsAre(535.4, 539.2, 320.6, 248.1));
}

TEST_F(Import, SevenScenesMatricesAreWorldFromCameraAndSplitsHoldOut) {
  const std::string turned = "0 -1 0 5\n1 0 0 6\n0 0 1 7\n0 0 0 1\n";
  for (const char* frame : {"seq-01/frame-000000", "seq-01/frame-000001", "seq-02/frame-000000"}) {
    WriteImage(std::string(frame) + ".color.png");
    Write(std::string(frame) + ".pose.txt", turned);
  }
  Write("seq-01/frame-000001.pose.txt",
        "-1.#IND 0 0 0\n0 -1.#IND 0 0\n0 0 -1.#IND 0\n0 0 0 1\n");  // tracking was lost
  Write("TrainSplit.txt", "sequence1\n");
  Write("TestSplit.txt", "sequence2\n");
  auto survey = Read(kSmallCamera);
  ASSERT_TRUE(survey.ok()) << survey.error().message;
  EXPECT_THAT(Names(*survey), ElementsAre("seq-01/frame-000000.color.png", "seq-02/frame-000000.color.png"));
  EXPECT_FALSE(survey->images[0].is_query);
  EXPECT_TRUE(survey->images[1].is_query);
  ExpectMaps(survey->images[0].cam_from_world, {5, 6, 7}, {0, 0, 0});
  ExpectMaps(survey->images[0].cam_from_world, {5, 7, 7}, {1, 0, 0});
  ASSERT_EQ(survey->left_out.size(), 1u);
  EXPECT_THAT(survey->left_out[0].reason, HasSubstr("frame-000001.pose.txt: pose is not finite"));

  ASSERT_TRUE(ChooseQueries({.every = 2}, &*survey).ok());
  EXPECT_TRUE(survey->images[1].is_query);
  EXPECT_EQ(ChooseQueries({.every = 1}, &*survey).error().code, ErrorCode::kNoData);

  Write("seq-01/frame-000000.pose.txt", "0 -1 0 5\n");
  EXPECT_THAT(MessageOf(kSmallCamera),
              HasSubstr("frame-000000.pose.txt: expected a 4 x 4 matrix, found 4 numbers"));
}

TEST_F(Import, KittiPosesAreOfCameraZeroAndProjectionsShiftTheOthers) {
  // Camera 1 lies half a metre to the right of camera 0: P1's last column is fx * (-0.5).
  Write("sequences/03/calib.txt",
        "P0: 10 0 4 0 0 10 3 0 0 0 1 0\nP1: 10 0 4 -5 0 10 3 0 0 0 1 0\nTr: 1 0 0 0 0 1 0 0 0 0 1 0\n");
  Write("poses/03.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n0 -1 0 1 1 0 0 2 0 0 1 3\n");
  for (const char* name : {"image_0/000000", "image_0/000001", "image_0/000002", "image_1/000001"})
    WriteImage(std::string("sequences/03/") + name + ".png");
  auto survey = Read({.sensors = {"image_0", "image_1"}});
  ASSERT_TRUE(survey.ok()) << survey.error().message;
  EXPECT_THAT(Names(*survey), ElementsAre("image_0/000000.png", "image_0/000001.png", "image_1/000001.png"));
  ExpectMaps(survey->images[0].cam_from_world, {1, 2, 3}, {1, 2, 3});
  ExpectMaps(survey->images[1].cam_from_world, {1, 3, 3}, {1, 0, 0});
  ExpectMaps(survey->images[2].cam_from_world, {1, 3, 3}, {0.5, 0, 0});
  EXPECT_THAT(survey->cameras.at(1).params, ElementsAre(10, 10, 4.5, 3.5));
  EXPECT_THAT(survey->left_out[0].reason, HasSubstr("03.txt has poses of frames 0 to 1"));

  EXPECT_THAT(Names(*Read()), ElementsAre("image_0/000000.png", "image_0/000001.png"));  // the first camera
  EXPECT_TRUE(ReadSurvey(root_ + "/sequences/03", {}).ok());  // the sequence's folder
  Write("poses/03.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n1 2 3\n");
  EXPECT_THAT(MessageOf(), HasSubstr("03.txt:2: expected the 12 numbers of a 3 x 4 pose"));
  Write("poses/03.txt", "2 0 0 0 0 1 0 0 0 0 1 0\n");
  EXPECT_THAT(MessageOf(), HasSubstr("03.txt:1: the pose's rotation is not valid"));
}

TEST_F(Import, EurocComposesTheBodyPoseWithTheCamerasPlaceOnIt) {
  // The camera lies 0.1 m along the body's x, turned a quarter about z.
  const std::string sensor =
      "# camera\nsensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n"
      "  data: [0, -1, 0, 0.1,\n         1, 0, 0, 0,\n         0, 0, 1, 0,\n         0, 0, 0, 1]\n"
      "resolution: [8, 6]\ncamera_model: pinhole\nintrinsics: [10, 11, 4, 3]\n"
      "distortion_model: radial-tangential\ndistortion_coefficients: [-0.28, 0.07, 1e-4, 2e-5]\n";
  Write("mav0/cam0/sensor.yaml", sensor);
  Write("mav0/cam0/data.csv",
        "#timestamp [ns],filename\r\n1403636579763555584,a.png\r\n1403636579813555456,b.png\r\n");
  Write("mav0/state_groundtruth_estimate0/data.csv",
        "#timestamp, p_RS_R_x [m], ...\n1403636579763555584,1,2,3,1,0,0,0,0.1,0,0,0,0,0,0,0,0\n");
  WriteImage("mav0/cam0/data/a.png");
  WriteImage("mav0/cam0/data/b.png");
  const auto survey = Read();
  ASSERT_TRUE(survey.ok()) << survey.error().message;
  EXPECT_THAT(Names(*survey), ElementsAre("cam0/a.png"));
  ExpectMaps(survey->images[0].cam_from_world, {1.1, 2, 3}, {0, 0, 0});
  ExpectMaps(survey->images[0].cam_from_world, {1.1, 3, 3}, {1, 0, 0});
  EXPECT_EQ(survey->cameras.at(1).model, CameraModel::kOpenCv);
  EXPECT_THAT(survey->cameras.at(1).params, ElementsAre(10, 11, 4.5, 3.5, -0.28, 0.07, 1e-4, 2e-5));
  EXPECT_THAT(survey->left_out[0].reason, HasSubstr("no stated pose after it"));

  Write("mav0/cam0/sensor.yaml", "T_BS: [\n");
  EXPECT_THAT(MessageOf(), HasSubstr("sensor.yaml:"));
  Write("mav0/cam0/sensor.yaml", sensor);
  Write("mav0/cam0/data.csv", "#timestamp [ns],filename\nnow,a.png\n");
  EXPECT_THAT(MessageOf(), HasSubstr("data.csv:2: expected TIME, FILE, found 'now,a.png'"));
}

TEST_F(Import, KaptureRigsPlaceTheirSensors) {
  const std::string s = "0.70710678118654757";
  Write("sensors/sensors.txt",
        "# kapture format: 1.1\nfront, , camera, PINHOLE, 8, 6, 10, 10, 4, 3\nimu, , imu\n"
        "left, name, camera, UNKNOWN_CAMERA, 8, 6\n");
  // left_from_rig: the rig's origin lies a metre ahead of `left` in its x.
  Write("sensors/rigs.txt", "rig, left, 1, 0, 0, 0, 1, 0, 0\n");
  // device_from_world: a quarter turn.  The second has no position.
  Write("sensors/trajectories.txt", "5, rig, " + s + ", 0, 0, " + s + ", 0, 0, 2\n" +  //
                                        "5, front, 1, 0, 0, 0, 7, 8, 9\n6, front, 1, 0, 0, 0, , ,\n");
  Write("sensors/records_camera.txt", "5, front, front/5.png\n5, left, left/5.png\n6, front, front/6.png\n");
  for (const char* name : {"front/5.png", "left/5.png", "front/6.png"})
    WriteImage(std::string("sensors/records_data/") + name);
  const auto survey = Read();
  ASSERT_TRUE(survey.ok()) << survey.error().message;
  EXPECT_THAT(Names(*survey), ElementsAre("front/5.png", "left/5.png"));
  ExpectMaps(survey->images[0].cam_from_world, {0, 0, 0}, {7, 8, 9});
  ExpectMaps(survey->images[1].cam_from_world, {1, 0, 0}, {1, 1, 2});  // (1,0,0) -> (0,1,2) in the rig
  EXPECT_FALSE(survey->cameras.at(2).has_focal_prior);
  EXPECT_THAT(survey->left_out[0].reason, HasSubstr("records_camera.txt:3: no pose at this time"));

  EXPECT_THAT(Names(*Read({.sensors = {"left"}})), ElementsAre("left/5.png"));
  EXPECT_THAT(MessageOf({.sensors = {"right"}}), HasSubstr("sensors.txt: no camera 'right'"));
  Write("sensors/rigs.txt", "rig, left, 1, 0, 0\n");
  EXPECT_THAT(MessageOf(), HasSubstr("rigs.txt:1: expected RIG, ID, QW"));
}

TEST_F(Import, ColmapModelsKeepNamesAndPoses) {
  ColmapModel model;
  Camera camera;
  camera.camera_id = 3;
  camera.width = 8;
  camera.height = 6;
  camera.params = {10, 4, 3};
  model.cameras = {{3, camera}};
  Pose pose;
  pose.translation = {1, 2, 3};
  model.images = {
      {4, "b/x y.png", 3, pose, {}}, {9, "a.png", 3, Pose(), {}}, {12, "gone.png", 3, Pose(), {}}};
  fs::create_directories(root_ + "/sparse/0");
  WriteImage("images/b/x y.png");
  WriteImage("images/a.png");
  for (const ModelFormat format : {ModelFormat::kText, ModelFormat::kBinary}) {
    ASSERT_TRUE(WriteColmapModel(model, format, root_ + "/sparse/0").ok());
    for (const char* source : {"", "/sparse/0"}) {
      const auto survey = ReadSurvey(root_ + source, {});
      ASSERT_TRUE(survey.ok()) << survey.error().message;
      EXPECT_THAT(Names(*survey), ElementsAre("a.png", "b/x y.png"));
      ExpectMaps(survey->images[1].cam_from_world, {0, 0, 0}, {1, 2, 3});
      EXPECT_EQ(survey->left_out[0].name, "gone.png");
    }
  }
}

TEST_F(Import, CapturesAreWholeAndReadBack) {
  Write("groundtruth.txt", "1 0 0 0 0 0 0 1\n2 0.5 0 0 0 0 0 1\n3 1 0 0 0 0 0 1\n");
  Write("rgb.txt", "1 rgb/a.png\n2 rgb/b.png\n3 rgb/c.png\n4 rgb/d.png\n");
  for (const char* name : {"rgb/a.png", "rgb/b.png", "rgb/c.png", "rgb/d.png"}) WriteImage(name);
  Write("held_out", "# names\nrgb/b.png\nrgb/d.png\n");
  auto survey = Read(kSmallCamera);
  ASSERT_TRUE(survey.ok()) << survey.error().message;
  ASSERT_TRUE(ChooseQueries({.queries_path = root_ + "/held_out"}, &*survey).ok());
  NoProgress progress;
  for (const ImageTransfer transfer :
       {ImageTransfer::kSymbolicLink, ImageTransfer::kHardLink, ImageTransfer::kCopy}) {
    ASSERT_TRUE(WriteImportedCapture(*survey, transfer, root_ + "/capture", progress).ok());
    const auto capture = ReadCapture(root_ + "/capture");
    ASSERT_TRUE(capture.ok()) << capture.error().message;
    ASSERT_EQ(capture->images.size(), 2u);
    ASSERT_EQ(capture->queries.size(), 1u);
    EXPECT_THAT(capture->rejects, IsEmpty());
    EXPECT_THAT(capture->warnings, IsEmpty());
    EXPECT_NEAR(capture->queries[0].cam_from_world->translation.x(), -0.5, 1e-6);
    EXPECT_THAT(*ReadFile(root_ + "/capture/left_out.txt"), HasSubstr("rgb/d.png\tno stated pose after it"));
    EXPECT_EQ(fs::is_symlink(root_ + "/capture/images/rgb/a.png"), transfer == ImageTransfer::kSymbolicLink);
  }
}

TEST_F(Import, AFailureLeavesTheCaptureThatWasThere) {
  ImportedSurvey survey;
  Camera camera;
  camera.width = 8;
  camera.height = 6;
  camera.params = {10, 4, 3};
  survey.cameras = {{1, camera}};
  WriteImage("a.png");
  survey.images = {{"a.png", root_ + "/a.png", 1, Pose()}};
  NoProgress progress;
  ASSERT_TRUE(WriteImportedCapture(survey, ImageTransfer::kCopy, root_ + "/capture", progress).ok());
  const std::string before = *ReadFile(root_ + "/capture/images.txt");
  for (const char* name : {"../../escaped.png", "/tmp/escaped.png", ""}) {
    survey.images.push_back({name, root_ + "/a.png", 1, Pose()});
    const Status status = WriteImportedCapture(survey, ImageTransfer::kCopy, root_ + "/capture", progress);
    EXPECT_EQ(status.error().code, ErrorCode::kCorrupt);
    survey.images.pop_back();
  }
  survey.images.push_back({"b.png", root_ + "/nowhere.png", 1, Pose()});
  EXPECT_EQ(WriteImportedCapture(survey, ImageTransfer::kHardLink, root_ + "/capture", progress).error().code,
            ErrorCode::kIo);
  EXPECT_EQ(*ReadFile(root_ + "/capture/images.txt"), before);
  for (const auto& entry : fs::directory_iterator(root_))
    EXPECT_EQ(entry.path().string().find(".tmp-"), std::string::npos) << entry.path();
}

TEST_F(Import, UnknownFoldersAndWrongSizesAreSentences) {
  EXPECT_THAT(MessageOf(),
              HasSubstr("none of the known layouts; looked for\n  kapture: sensors/sensors.txt"));
  EXPECT_EQ(ReadSurvey(root_ + "/nowhere", {}).error().code, ErrorCode::kNotFound);
  Write("groundtruth.txt", "1 0 0 0 0 0 0 1\n");
  Write("rgb.txt", "1 rgb/a.png\n");
  WriteImage("rgb/a.png", 10, 6);
  EXPECT_THAT(MessageOf(kSmallCamera), HasSubstr("a.png: 10 x 6 px, but its camera has 8 x 6"));
  Write("groundtruth.txt", "1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0\n");
  EXPECT_THAT(MessageOf(kSmallCamera), HasSubstr("groundtruth.txt:2: expected TIME TX TY TZ QX QY QZ QW"));
}

}  // namespace
}  // namespace cairn::pipeline
