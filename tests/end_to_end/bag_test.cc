#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <unsupported/Eigen/Splines>

#include "core/capture/capture.h"
#include "core/colmap/cameras_text.h"
#include "core/files/file.h"
#include "tests/end_to_end/program_run.h"
#include "tests/pipeline/exchange/bag_writers.h"
#include "tests/pipeline/exchange/recorded_drive.h"
#include "tests/reconstruct/inertial/simulated_imu.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using pipeline::kBaseFromCamera;
using pipeline::kSecondNs;
using pipeline::Recorded;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

// Lies on its side behind it.
const Pose kBaseFromImu = {Eigen::Quaterniond(0.5, 0.5, 0.5, 0.5), {-0.1, 0.05, 0.2}};

// A rendered drive, and what a robot on it records.
class Bag : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder("bag_test");
    const ProgramRun rendered = RunShell(
        "cairn stage simulate --survey driven --step-m 0.08 --max-turn-deg 5 --num-queries 0 --width-m 5.5 "
        "--depth-m 6 --num-rooms 2 --texel-m 0.006 --image-width-px 400 --image-height-px 300 --seed 5 "
        "--progress none -o " +
        Path("drive"));
    ASSERT_EQ(rendered.exit_code, 0) << rendered.err;
    truth_ = ReadCapture(Path("drive")).value();
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static std::string Path(const std::string& name) { return *folder_ / name; }
  static ProgramRun Compile(const std::string& what) {
    return RunShell("cd " + folder_->string() + " && cairn compile " + what + " --progress lines");
  }
  static std::string Unit(const std::string& build_dir) {
    const auto frame = ReadFile(Path(build_dir + "/poses/frame.json"));
    return frame.ok() ? nlohmann::json::parse(*frame)["unit"].get<std::string>() : "no poses";
  }
  static size_t NumImages(const std::string& capture) {
    return static_cast<size_t>(
        std::distance(fs::directory_iterator(Path(capture + "/images")), fs::directory_iterator()));
  }

  static std::vector<Recorded> Messages(size_t first, size_t end,
                                        pipeline::MessageForm form = pipeline::MessageForm::kCdr,
                                        const std::string& camera = "/camera") {
    return pipeline::RecordedDrive(truth_, first, end, form, camera);
  }
  // The same without odometry, with what a consumer's IMU on the robot says meanwhile.
  static std::vector<Recorded> MessagesWithImu(size_t num_images) {
    std::vector<Recorded> messages = Messages(0, num_images);
    std::erase_if(messages, [](const Recorded& message) { return message.topic == "/odom"; });
    messages.push_back({"/tf_static", "tf2_msgs/msg/TFMessage", 0,
                        pipeline::TransformBytes({{"base_link", "imu_link", kBaseFromImu}})});
    reconstruct::SimulatedImu imu;
    imu.cam_from_imu = kBaseFromCamera.Inverse() * kBaseFromImu;
    const double duration_s = static_cast<double>(num_images + 7) / 4;
    for (const reconstruct::ImuSample& sample :
         reconstruct::RecordImu(Driven(num_images), imu, duration_s, 1).samples) {
      messages.push_back(
          {"/imu", "sensor_msgs/msg/Imu", sample.time_ns,
           pipeline::ImuBytes({.stamp_ns = sample.time_ns, .turn = sample.gyro, .accel = sample.accel})});
    }
    std::stable_sort(messages.begin(), messages.end(),
                     [](const Recorded& a, const Recorded& b) { return a.time_ns < b.time_ns; });
    return messages;
  }
  // Smoothly through the images' places and headings, at their times, at rest for a second before and after.
  static reconstruct::Motion Driven(size_t num_images) {
    constexpr Eigen::Index kRest = 4;
    const auto num = static_cast<Eigen::Index>(num_images) + 2 * kRest;
    Eigen::Matrix4Xd ways(4, num);  // x, y, z, heading
    Eigen::Array<double, 1, Eigen::Dynamic> parts(num);
    for (Eigen::Index k = 0; k < num; ++k) {
      const Eigen::Index i = std::clamp<Eigen::Index>(k - kRest, 0, num - 2 * kRest - 1);
      const Pose pose = truth_.images[static_cast<size_t>(i)].cam_from_world->Inverse();
      const Eigen::Vector3d ahead = pose.rotation * Eigen::Vector3d::UnitZ();
      double heading = std::atan2(ahead.y(), ahead.x());
      if (k > 0) heading = ways(3, k - 1) + std::remainder(heading - ways(3, k - 1), 2 * std::numbers::pi);
      ways.col(k) << pose.translation, heading;
      parts[k] = static_cast<double>(k) / static_cast<double>(num - 1);
    }
    using Way = Eigen::Spline<double, 4>;
    const Way way = Eigen::SplineFitting<Way>::Interpolate(ways, 3, parts);
    const double duration_s = static_cast<double>(num - 1) / 4;
    return [=](double time_s) -> Pose {
      const Eigen::Vector4d at = way(std::clamp(time_s / duration_s, 0.0, 1.0));
      return {reconstruct::YawPitchRoll(at[3], 0, 0) * reconstruct::LooksAhead(), at.head<3>()};
    };
  }
  // The true frame from that of a build's poses.
  static Eigen::Matrix4d TruthFromFound(const std::string& build_dir) {
    const Capture mapped = ReadCapture(Path(build_dir + "/poses")).value();
    Eigen::Matrix3Xd found(3, mapped.images.size()), truth(3, mapped.images.size());
    for (size_t i = 0; i < mapped.images.size(); ++i) {
      const std::string& name = mapped.images[i].name;
      const auto number = static_cast<size_t>(std::lround(4 * std::stod(name))) - 4;
      found.col(static_cast<Eigen::Index>(i)) = mapped.images[i].cam_from_world->Center();
      truth.col(static_cast<Eigen::Index>(i)) = truth_.images[number].cam_from_world->Center();
    }
    return Eigen::umeyama(found, truth);
  }
  static void Write(const std::string& name, const std::string& bytes) {
    fs::create_directories(fs::path(Path(name)).parent_path());
    ASSERT_TRUE(WriteFileAtomically(Path(name), bytes).ok());
  }
  static void WriteRos1(const std::string& name, std::vector<Recorded> messages) {
    for (Recorded& message : messages) message.type.erase(message.type.find("/msg"), 4);
    Write(name, pipeline::Ros1BagBytes(messages, {.compression = "lz4"}));
  }

  static inline TemporaryFolder* folder_ = nullptr;
  static inline Capture truth_;
};

TEST_F(Bag, ThatIsAFolderCompilesToAMapInMetresAndIsImportedAgainWhereItChanged) {
  Write("run/metadata.yaml",
        "rosbag2_bagfile_information:\n  relative_file_paths: [run_0.mcap, run_1.mcap]\n");
  Write("run/run_0.mcap", pipeline::McapBytes(Messages(0, 75), {.compression = "zstd"}));
  Write("run/run_1.mcap", pipeline::McapBytes(Messages(75, 150)));
  const ProgramRun first = Compile("run");
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_THAT(first.out, HasSubstr("run.toml: the recipe of run, with defaults"));
  EXPECT_TRUE(fs::exists(Path("run.cairn")));
  EXPECT_EQ(Unit("run.build"), "metre");
  // It is as large as what it is of.
  EXPECT_NEAR(TruthFromFound("run.build").col(0).norm(), 1, 0.02);
  EXPECT_THAT(Compile("run").out, HasSubstr("up to date"));

  // A file that was only touched gives the same capture, and nothing follows.
  fs::last_write_time(Path("run/run_1.mcap"), fs::file_time_type::clock::now());
  const ProgramRun touched = Compile("run.toml");
  EXPECT_THAT(touched.err, AllOf(HasSubstr("run_1.mcap changed"), Not(HasSubstr("poses: "))));
  // Wheels that measured twice as much in front of the same images.
  std::vector<Recorded> twice = Messages(75, 150);
  for (Recorded& message : twice) {
    if (message.topic != "/odom") continue;
    Pose pose =
        truth_.images[static_cast<size_t>(4 * message.time_ns / kSecondNs) - 4].cam_from_world->Inverse() *
        kBaseFromCamera.Inverse();
    pose.translation *= 2;
    message.bytes = pipeline::OdometryBytes(message.time_ns, pose);
  }
  Write("run/run_1.mcap", pipeline::McapBytes(twice));
  EXPECT_THAT(Compile("run --until reconstruct").err, HasSubstr("poses: odometry.txt changed"));
  Write("run/run_1.mcap", pipeline::McapBytes(Messages(75, 150)));
  // Odometry is what gives metres, although the images stay the same.
  ReplaceInFile(Path("run.toml"), "path = \"run\"", "path = \"run\"\nodometry = \"none\"");
  EXPECT_EQ(Compile("run.toml --until reconstruct").exit_code, 0);
  EXPECT_EQ(Unit("run.build"), "arbitrary");
  EXPECT_FALSE(fs::exists(Path("run.build/bag-run/odometry.txt")));
  ReplaceInFile(Path("run.toml"), "odometry = \"none\"",
                "camera_on_robot = [-0.5, 0, 1, -0.5, 0.5, -0.5, 0.5]");
  EXPECT_EQ(Compile("run.toml --until reconstruct").exit_code, 0);
  EXPECT_EQ(Unit("run.build"), "metre");

  // A Makefile that includes the rules notices a file that is no longer there, too.
  Write("run.mk", "CAIRN := " CAIRN_PROGRAM
                  "\nRECIPE := run.toml\nMAP := run.cairn\nBUILD := run.build\n"
                  "include " CAIRN_MAP_RULES "\n");
  const std::string make = "unset MAKEFLAGS MAKELEVEL; make -C " + folder_->string() +
                           " --no-print-directory -f run.mk PROGRESS=lines run.build/bag-run.stamp";
  ASSERT_EQ(RunShell(make).exit_code, 0);
  EXPECT_THAT(RunShell(make).out, HasSubstr("up to date"));
  const size_t num_before = NumImages("run.build/bag-run");
  fs::remove(Path("run/run_1.mcap"));
  Write("run/metadata.yaml", "rosbag2_bagfile_information:\n  relative_file_paths: [run_0.mcap]\n");
  const ProgramRun fewer = RunShell(make);
  EXPECT_EQ(fewer.exit_code, 0) << fewer.err;
  EXPECT_LT(NumImages("run.build/bag-run"), num_before);
  EXPECT_THAT(RunShell(make).out, HasSubstr("up to date"));
  EXPECT_EQ(RunShell("cairn clean " + Path("run.build")).exit_code, 0);
  EXPECT_FALSE(fs::exists(Path("run.build")));
}

TEST_F(Bag, OfSeveralCamerasSaysWhichLineToWrite) {
  std::vector<Recorded> messages = Messages(0, 30, pipeline::MessageForm::kCdr, "/left");
  for (const Recorded& message : Messages(60, 85, pipeline::MessageForm::kCdr, "/right")) {
    if (message.topic.starts_with("/right")) messages.push_back(message);
  }
  pipeline::WriteDb3(Path("two.db3"), messages);
  const ProgramRun asked = Compile("two.db3");
  EXPECT_EQ(asked.exit_code, 2);
  EXPECT_THAT(
      asked.err,
      AllOf(
          HasSubstr("several topics have images; choose one with --topic /left/image_raw/compressed, or in a "
                    "recipe's [[capture]] with topic = \"/left/image_raw/compressed\"\n"),
          HasSubstr("/right/image_raw/compressed  sensor_msgs/CompressedImage        25      4.0  400 x 300  "
                    "jpeg\n"),
          HasSubstr("stage import failed; "),
          HasSubstr("; two.toml says under [[capture]] how it is imported: edit that, then run cairn compile "
                    "two.toml -o two.cairn\n")));
  EXPECT_FALSE(fs::exists(Path("two.cairn")));
  const std::string recipe = *ReadFile(Path("two.toml"));
  Write("two.toml", recipe + "topic = \"/left/image_raw/compressed\"\nkeyframes = \"all\"\n");
  const ProgramRun left = Compile("two.toml -o two.cairn --until extract_features");
  EXPECT_EQ(left.exit_code, 0) << left.err;
  EXPECT_EQ(NumImages("two.build/bag-two"), 30u);
  ReplaceInFile(Path("two.toml"), "/left/", "/right/");
  const ProgramRun right = Compile("two.toml -o two.cairn --until extract_features");
  EXPECT_EQ(right.exit_code, 0) << right.err;
  EXPECT_THAT(right.err, AllOf(HasSubstr("bag-two: options/bag-two changed"), HasSubstr("features.db: ")));
  EXPECT_EQ(NumImages("two.build/bag-two"), 25u);
  EXPECT_THAT(Compile("two.toml -o two.cairn --until extract_features").out, HasSubstr("up to date"));
  // A topic that is not there.
  ReplaceInFile(Path("two.toml"), "/right/", "/middle/");
  EXPECT_THAT(Compile("two.toml").err, HasSubstr("no topic /middle/image_raw/compressed; there are\n"));
}

TEST_F(Bag, OfACameraAndAnImuCompilesToAMapInMetresAndSaysHowWellTheyAreKnown) {
  Write("hand.mcap", pipeline::McapBytes(MessagesWithImu(150)));
  Write("hand.toml", "name = \"hand\"\n[[capture]]\npath = \"hand.mcap\"\nkeyframes = \"all\"\n");
  const ProgramRun first = Compile("hand.toml");
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_THAT(first.out + first.err,
              AllOf(HasSubstr("samples of an IMU\n"), HasSubstr("reconstruct: scale from imu (+- ")));
  const std::string csv = *ReadFile(Path("hand.build/bag-hand/imu.csv"));
  EXPECT_THAT(csv, HasSubstr("\n#imu_on_camera,"));
  const auto map = nlohmann::json::parse(RunShell("cairn inspect " + Path("hand.cairn") + " --json").out);
  EXPECT_EQ(map["unit"], "metre");
  EXPECT_EQ(map["frame_source"], "imu");
  const double sigma_ratio = map["scale_sigma_ratio"].get<double>();
  EXPECT_GT(sigma_ratio, 0.005);  // an accelerometer's own scale
  EXPECT_LT(sigma_ratio, 0.05);
  const Eigen::Matrix4d truth_from_found = TruthFromFound("hand.build");
  const double scale = truth_from_found.col(0).norm();
  EXPECT_LT(std::abs(std::log(scale)), 3 * sigma_ratio) << scale;
  EXPECT_GT(truth_from_found(2, 2) / scale, std::cos(RadFromDeg(1.5))) << "level";
  EXPECT_THAT(Compile("hand.toml").out, HasSubstr("up to date"));

  // Without it the same images have no metres.
  ReplaceInFile(Path("hand.toml"), "path = \"hand.mcap\"", "path = \"hand.mcap\"\nimu = \"none\"");
  EXPECT_EQ(Compile("hand.toml --until reconstruct").exit_code, 0);
  EXPECT_EQ(Unit("hand.build"), "arbitrary");
  EXPECT_FALSE(fs::exists(Path("hand.build/bag-hand/imu.csv")));

  // As a folder, whose imu.csv may be edited.
  ASSERT_EQ(RunShell("cairn import " + Path("hand.mcap") + " --keyframes all -o " + Path("folder")).exit_code,
            0);
  ASSERT_EQ(*ReadFile(Path("folder/imu.csv")), csv);
  ASSERT_EQ(Compile("folder --until reconstruct").exit_code, 0);
  EXPECT_EQ(Unit("folder.build"), "metre");
  Write("folder/imu.csv", csv + "# edited\n");
  EXPECT_THAT(Compile("folder --until reconstruct").err, HasSubstr("poses: imu.csv changed"));
  Write("folder/imu.csv", csv + "0,0,0,0,0,0,9.8\n");
  EXPECT_THAT(Compile("folder --until reconstruct").err, HasSubstr("folder/imu.csv:"));
  fs::remove(Path("folder/imu.csv"));
  EXPECT_EQ(Compile("folder --until reconstruct").exit_code, 0);
  EXPECT_EQ(Unit("folder.build"), "arbitrary");
}

// Images, and so features and matches, stay the same.
TEST_F(Bag, OdometryThatIsEditedInTheCaptureFindsPosesAgain) {
  WriteRos1("east.bag", Messages(0, 100, pipeline::MessageForm::kRos1));
  ASSERT_EQ(RunShell("cairn import " + Path("east.bag") + " -o " + Path("east")).exit_code, 0);
  ASSERT_EQ(Compile("east --until reconstruct").exit_code, 0);
  EXPECT_EQ(Unit("east.build"), "metre");
  const std::string odometry = *ReadFile(Path("east/odometry.txt"));
  Write("east/odometry.txt", odometry + "# edited\n");
  EXPECT_THAT(Compile("east --until reconstruct").err, HasSubstr("poses: odometry.txt changed"));
  fs::remove(Path("east/odometry.txt"));
  EXPECT_EQ(Compile("east --until reconstruct").exit_code, 0);
  EXPECT_EQ(Unit("east.build"), "arbitrary");
  Write("east/odometry.txt", odometry);
  EXPECT_EQ(Compile("east --until reconstruct").exit_code, 0);
  EXPECT_EQ(Unit("east.build"), "metre");
}

TEST_F(Bag, IsJoinedWithFilmsAndFolders) {
  WriteRos1("west.bag", Messages(0, 30, pipeline::MessageForm::kRos1));
  const ProgramRun encoded =
      RunShell("ffmpeg -v error -y -framerate 4 -i " + Path("drive") +
               "/images/d%04d.jpg -frames:v 40 -c:v libx264 -pix_fmt yuv420p " + Path("walk.mp4"));
  ASSERT_EQ(encoded.exit_code, 0) << encoded.err;
  fs::create_directories(Path("photos/images"));
  for (size_t i = 50; i < 60; ++i) {
    const CaptureImage& image = truth_.images[i];
    fs::copy(truth_.ImagePath(image), Path("photos/images/") + image.name);
  }
  Write("joined.toml",
        "name = \"joined\"\n[[capture]]\npath = \"west.bag\"\nkeyframes = \"all\"\n"
        "[[capture]]\npath = \"walk.mp4\"\nkeyframes = 1\n[[capture]]\npath = \"photos\"\n");
  const ProgramRun first = Compile("joined.toml --until extract_features");
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_EQ(NumImages("joined.build/bag-west"), 30u);
  EXPECT_EQ(NumImages("joined.build/film-walk"), 10u);
  const std::string odometry = *ReadFile(Path("joined.build/capture/odometry.txt"));
  EXPECT_EQ(std::count(odometry.begin(), odometry.end(), '\n'), 30);
  EXPECT_EQ(nlohmann::json::parse(*ReadFile(Path("joined.build/features.db.report.json")))["out"]["images"],
            50);
  EXPECT_THAT(Compile("joined.toml --until extract_features").out, HasSubstr("up to date"));
  // A key of one of them imports that one alone.
  ReplaceInFile(Path("joined.toml"), "keyframes = \"all\"", "keyframes = \"all\"\nodometry = \"none\"");
  const ProgramRun other = Compile("joined.toml --until extract_features");
  EXPECT_EQ(other.exit_code, 0) << other.err;
  EXPECT_THAT(other.err,
              AllOf(HasSubstr("bag-west: options/bag-west changed"), Not(HasSubstr("film-walk: "))));
  EXPECT_FALSE(fs::exists(Path("joined.build/capture/odometry.txt")));
  EXPECT_THAT(Compile("joined.toml --until extract_features").out, HasSubstr("up to date"));
}

TEST_F(Bag, ThatIsDamagedIsToldAndGivesWhatIsWhole) {
  pipeline::WriteDb3(Path("whole.db3"), Messages(0, 30));
  const std::string bytes = *ReadFile(Path("whole.db3"));
  Write("cut.db3", bytes.substr(0, bytes.size() / 2));
  const ProgramRun cut = Compile("cut.db3");
  EXPECT_EQ(cut.exit_code, 12);
  EXPECT_THAT(cut.err, AllOf(HasSubstr("cut.db3: "), HasSubstr("the file was cut off; copy it again"),
                             HasSubstr("stage import failed"), Not(HasSubstr("under [[capture]]"))));
  EXPECT_FALSE(fs::exists(Path("cut.cairn")));
  Write("text.bag", "No bag.\n");
  const ProgramRun text = Compile("text.bag");
  EXPECT_EQ(text.exit_code, 4);
  EXPECT_THAT(text.err, HasSubstr("text.bag: not a bag"));
  Write("gone/metadata.yaml", "rosbag2_bagfile_information:\n  relative_file_paths: [gone_0.mcap]\n");
  const ProgramRun gone = Compile("gone");
  EXPECT_EQ(gone.exit_code, 3);
  EXPECT_THAT(gone.err, HasSubstr("lists gone_0.mcap, which is not there; copy the whole folder"));
  const std::string mcap = pipeline::McapBytes(Messages(0, 30));
  Write("short.mcap", mcap.substr(0, mcap.size() / 2));
  const ProgramRun part = Compile("short.mcap --until import");
  EXPECT_EQ(part.exit_code, 0) << part.err;
  EXPECT_THAT(part.err, HasSubstr("short.mcap"));
  EXPECT_GT(NumImages("short.build/bag-short"), 1u);
}

// A stage's own files are SQLite's, as bags are.
TEST_F(Bag, IsNotWhatOtherSqliteFilesAre) {
  SQLite::Database(Path("features.db"), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE)
      .exec("CREATE TABLE images (id)");
  EXPECT_THAT(Compile("features.db").err,
              HasSubstr("features.db: a database of COLMAP or of a stage, not a recipe"));
  EXPECT_THAT(RunShell("cairn import " + Path("features.db") + " -o " + Path("features")).err,
              HasSubstr("a SQLite file, but not one that rosbag2 wrote"));
}

}  // namespace
}  // namespace cairn
