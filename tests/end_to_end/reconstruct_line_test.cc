#include <filesystem>
#include <fstream>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/capture/capture.h"
#include "core/files/file.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// A stretch of the drive in which neighbours match.
constexpr int kFirstImage = 12, kNumLineImages = 12;

// A rendered drive whose poses are hidden: a flat folder of images, and where four of the cameras stood.
class ReconstructLine : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder("reconstruct_line_test");
    std::ofstream(Path("simulate.toml")) << R"(width_m = 5.5
depth_m = 6
num_rooms = 2
survey = "driven"
step_m = 0.35
image_width_px = 320
image_height_px = 240
horizontal_fov_deg = 65
texel_m = 0.008
num_queries = 0
)";
    const ProgramRun run = RunShell("cairn stage simulate " + Path("simulate.toml") + " -o " + Path("posed") +
                                    " --progress none");
    ASSERT_EQ(run.exit_code, 0) << run.err;
    fs::create_directories(Path("flat"));
    std::vector<Reject> rejects;
    std::vector<CaptureImage> images = *ReadImagesText(Path("posed/images.txt"), &rejects);
    images = {images.begin() + kFirstImage, images.begin() + kFirstImage + kNumLineImages};
    for (const CaptureImage& image : images) {
      fs::copy_file(Path("posed/images/" + image.name), Path("flat/" + image.name));
      truth_[image.name] = *image.cam_from_world;
    }
    std::ofstream control_points(Path("control_points.txt"));
    for (int i = 0; i < kNumLineImages; i += 3) {
      const Eigen::Vector3d centre = images[i].cam_from_world->Center();
      control_points << fmt::format("{} {} {} {}\n", images[i].name, centre.x(), centre.y(), centre.z());
    }
    control_points.close();
    std::ofstream(Path("flat.toml")) << R"(name = "flat"
[capture]
path = "flat"
[reconstruct]
control_points = "../control_points.txt"
min_registered_ratio = 0.8
hold_out_every = 5
)" << TinyStageOptions();
    ReplaceInFile(Path("flat.toml"), "max_num_features = 300",
                  "max_num_features = 600\ncontrast_threshold = 0.01");
    first_run_ = new ProgramRun(Compile());
  }
  static void TearDownTestSuite() {
    delete folder_;
    delete first_run_;
  }
  static std::string Path(const std::string& name) { return *folder_ / name; }
  static ProgramRun Compile() {
    return RunShell("cairn compile " + Path("flat.toml") + " -o " + Path("flat.cairn") +
                    " --progress none --threads 2");
  }

  static TemporaryFolder* folder_;
  static ProgramRun* first_run_;
  static std::map<std::string, Pose> truth_;
};
TemporaryFolder* ReconstructLine::folder_ = nullptr;
ProgramRun* ReconstructLine::first_run_ = nullptr;
std::map<std::string, Pose> ReconstructLine::truth_;

TEST_F(ReconstructLine, ImagesWithoutPosesBecomeAMapInTheFrameOfTheControlPoints) {
  ASSERT_EQ(first_run_->exit_code, 0) << first_run_->err;
  const auto poses = ReadCapture(Path("flat.build/poses"));
  ASSERT_TRUE(poses.ok()) << poses.error().message;
  EXPECT_GE(poses->images.size() + poses->queries.size(), 0.8 * kNumLineImages);
  for (const auto* list : {&poses->images, &poses->queries}) {
    for (const CaptureImage& image : *list) {
      EXPECT_LT(CenterErrorM(*image.cam_from_world, truth_.at(image.name)), 0.1) << image.name;
      EXPECT_LT(RotationErrorDeg(*image.cam_from_world, truth_.at(image.name)), 1.5) << image.name;
    }
  }
  const ProgramRun inspect = RunShell("cairn inspect " + Path("flat.cairn") + " --json");
  const auto json = nlohmann::json::parse(inspect.out);
  EXPECT_EQ(json["unit"], "metre");
  EXPECT_EQ(json["frame_source"], "control_points");
  EXPECT_GT(json["scale_sigma_ratio"].get<double>(), 0.001);  // four points, 5 cm each
  EXPECT_LT(json["scale_sigma_ratio"].get<double>(), 0.1);
  ASSERT_EQ(json["scale_centre_m"].size(), 3u);
  EXPECT_GT(json["num_landmarks"].get<int>(), 100);
  EXPECT_EQ(json["num_images"].get<size_t>(), poses->images.size()) << "held-out images are not in the map";
  EXPECT_TRUE(json["stage_options"].contains("reconstruct"));
}

TEST_F(ReconstructLine, HeldOutImagesAreLocalized) {
  ASSERT_EQ(first_run_->exit_code, 0) << first_run_->err;
  const ProgramRun run = RunShell("cairn check " + Path("flat.cairn") + " --json --queries " +
                                  Path("flat.build/poses/queries.txt"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto json = nlohmann::json::parse(run.out);
  EXPECT_GE(json["localized_ratio"].get<double>(), 0.5) << run.out;
}

TEST_F(ReconstructLine, EndsWithAVerdictInWordsAndAsAPicture) {
  ASSERT_EQ(first_run_->exit_code, 0) << first_run_->err;
  EXPECT_THAT(first_run_->out, HasSubstr("whole: "));
  EXPECT_THAT(first_run_->out, HasSubstr("seen from above: " + Path("flat.build/poses/reconstruction.svg")));
  const auto json = nlohmann::json::parse(ReadFile(Path("flat.build/poses/reconstruction.json")).value());
  const auto verdict = json["verdict"];
  EXPECT_EQ(verdict["is_metric"], true);
  EXPECT_EQ(verdict["num_images"], kNumLineImages);
  EXPECT_EQ(verdict["num_joined"].get<size_t>() + verdict["missing"].size(), size_t{kNumLineImages});
  EXPECT_EQ(verdict["num_joined"].get<size_t>(),
            json["num_images"].get<size_t>() + json["num_queries"].get<size_t>())
      << "held-out images are joined, too";
  EXPECT_NEAR(verdict["median_step"].get<double>(), 0.35, 0.05);
  const std::string picture = ReadFile(Path("flat.build/poses/reconstruction.svg")).value();
  EXPECT_THAT(picture, HasSubstr(" m</text>"));

  // The report shows the same.
  const std::string page = Path("flat.html"), json_path = Path("flat.build/poses/reconstruction.json");
  const auto report = [&](const std::string& options = "") {
    return RunShell("cairn report " + Path("flat.cairn") + " -o " + page + " " + options);
  };
  const ProgramRun run = report("--svg " + Path("pictures"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(ReadFile(Path("pictures/reconstruction.svg")).value(), picture);
  EXPECT_THAT(ReadFile(page).value(), HasSubstr(picture));
  EXPECT_THAT(ReadFile(page).value(), HasSubstr("\"reconstruction\":{\"text\":\""));
  ASSERT_EQ(report("--print").exit_code, 0);
  EXPECT_THAT(ReadFile(page).value(), HasSubstr("<h2>Reconstruction</h2>\n<pre>"));
  EXPECT_THAT(ReadFile(page).value(), HasSubstr(picture));

  // Not that of another compilation, nor one that cannot be read; and it is not written over.
  const std::string text = ReadFile(json_path).value();
  auto other = nlohmann::json::parse(text);
  for (auto& name : other["verdict"]["images"]["name"]) name = "x" + name.get<std::string>();
  std::ofstream(json_path) << other;
  const ProgramRun of_other = report();
  EXPECT_EQ(of_other.exit_code, 0) << of_other.err;
  EXPECT_THAT(of_other.err, HasSubstr(json_path + ": is of another compilation than "));
  EXPECT_THAT(ReadFile(page).value(), testing::Not(HasSubstr("\"reconstruction\":{")));
  other["verdict"]["way"] = "long";
  std::ofstream(json_path) << other;
  const ProgramRun broken = report();
  EXPECT_EQ(broken.exit_code, static_cast<int>(ErrorCode::kCorrupt));
  EXPECT_THAT(broken.err, HasSubstr(json_path + ": 'way' is not a length"));
  other.erase("verdict");  // of an earlier version
  std::ofstream(json_path) << other;
  EXPECT_EQ(report().exit_code, 0);
  std::ofstream(json_path) << text;
  const ProgramRun over = RunShell("cairn report " + Path("flat.cairn") + " -o " + json_path);
  EXPECT_EQ(over.exit_code, 2) << over.err;
  EXPECT_EQ(ReadFile(json_path).value(), text);
}

TEST_F(ReconstructLine, SecondRunDoesNothingAndChangedControlPointsRunTheReconstruction) {
  ASSERT_EQ(first_run_->exit_code, 0) << first_run_->err;
  EXPECT_THAT(Compile().out, HasSubstr("up to date"));
  const std::string matches = HashFile(Path("flat.build/matches.db")).value();
  const auto matched = fs::last_write_time(Path("flat.build/matches.db.stamp"));
  const std::string images = ReadFile(Path("flat.build/poses/images.txt")).value();
  // The same places in another order: the reconstruction runs again, to the same bytes, and nothing after it.
  const auto grouped = fs::last_write_time(Path("flat.build/classes.db.stamp"));
  const auto reconstructed = fs::last_write_time(Path("flat.build/poses.stamp"));
  const std::string control_points = ReadFile(Path("control_points.txt")).value();
  std::ofstream(Path("control_points.txt")) << "# again\n" << control_points;
  const ProgramRun run = Compile();
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(fs::last_write_time(Path("flat.build/matches.db.stamp")), matched);
  EXPECT_NE(fs::last_write_time(Path("flat.build/poses.stamp")), reconstructed);
  EXPECT_EQ(fs::last_write_time(Path("flat.build/classes.db.stamp")), grouped);
  EXPECT_EQ(ReadFile(Path("flat.build/poses/images.txt")).value(), images);
  EXPECT_EQ(HashFile(Path("flat.build/matches.db")).value(), matches);
}

TEST_F(ReconstructLine, EveryWayToChoosePairsThatNeedsNoPosesCompiles) {
  const std::string recipe = ReadFile(Path("flat.toml")).value();
  for (const std::string pairs : {"sequence", "retrieval", "exhaustive", "auto"}) {
    std::ofstream(Path("pairs.toml")) << recipe << "[match_features]\npairs = \"" << pairs << "\"\n";
    const ProgramRun run = RunShell("cairn compile " + Path("pairs.toml") + " -o " + Path(pairs + ".cairn") +
                                    " --progress none --threads 2");
    EXPECT_EQ(run.exit_code, 0) << pairs << ": " << run.err;
    EXPECT_THAT(run.err, testing::Not(HasSubstr("Circular"))) << pairs;
    EXPECT_TRUE(fs::exists(Path(pairs + ".cairn"))) << pairs;
  }
  std::ofstream(Path("pairs.toml")) << recipe << "[match_features]\npairs = \"frustum\"\n";
  const ProgramRun run =
      RunShell("cairn compile " + Path("pairs.toml") + " -o " + Path("frustum.cairn") + " --progress none");
  EXPECT_EQ(run.exit_code, static_cast<int>(ErrorCode::kInvalidArgument));
  EXPECT_THAT(run.err, HasSubstr("pairs = frustum needs a pose for every image"));
}

TEST_F(ReconstructLine, CamerasThatAreGivenAreTaken) {
  fs::create_directories(Path("known/images"));
  for (const auto& entry : fs::directory_iterator(Path("flat")))
    fs::copy_file(entry.path(), Path("known/images") / entry.path().filename());
  fs::copy_file(Path("posed/cameras.txt"), Path("known/cameras.txt"));
  const ProgramRun run =
      RunShell("cairn stage extract-features " + Path("known") + " -o " + Path("known.db") + " && sqlite3 " +
               Path("known.db") + " 'SELECT count(*), min(prior_focal_length), min(width) FROM cameras'");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("1|1|320"));
  EXPECT_THAT(run.err, testing::Not(HasSubstr("assumed")));
}

// Every second image is of a second session, which has no poses.
TEST_F(ReconstructLine, ASessionWithoutPosesJoinsOneThatHasSome) {
  std::vector<Reject> rejects;
  std::vector<CaptureImage> all = *ReadImagesText(Path("posed/images.txt"), &rejects), old;
  for (const char* folder : {"old/images", "new"}) fs::create_directories(Path(folder));
  for (int i = 0; i < kNumLineImages; ++i) {
    const CaptureImage& image = all[kFirstImage + i];
    const bool is_old = i % 2 == 0;
    fs::copy_file(Path("posed/images/" + image.name), Path((is_old ? "old/images/" : "new/") + image.name));
    if (is_old) old.push_back(image);
  }
  ASSERT_TRUE(WriteImagesText(Path("old/images.txt"), old).ok());
  fs::copy_file(Path("posed/cameras.txt"), Path("old/cameras.txt"));
  std::ofstream(Path("both.toml"))
      << "name = \"both\"\n[[capture]]\npath = \"old\"\n[[capture]]\npath = \"new\"\n"
      << TinyStageOptions();
  ReplaceInFile(Path("both.toml"), "max_num_features = 300",
                "max_num_features = 600\ncontrast_threshold = 0.01");
  const auto compile = [&](const std::string& map, const std::string& more) {
    return RunShell("cairn compile " + Path("both.toml") + " -o " + Path(map) + " --progress none " + more);
  };
  const ProgramRun run = compile("both.cairn", "--threads 2");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("6 of 6 images of new are joined to the other captures"));
  const auto poses = ReadCapture(Path("both.build/poses"));
  ASSERT_TRUE(poses.ok()) << poses.error().message;
  ASSERT_EQ(poses->images.size(), static_cast<size_t>(kNumLineImages));
  for (const CaptureImage& image : poses->images) {
    const bool is_old = image.name.starts_with("old/");
    const Pose& truth = truth_.at(image.name.substr(4));
    EXPECT_LT(CenterErrorM(*image.cam_from_world, truth), is_old ? 1e-5 : 0.05) << image.name;
    EXPECT_LT(RotationErrorDeg(*image.cam_from_world, truth), is_old ? 1e-3 : 0.5) << image.name;
  }
  const auto json = nlohmann::json::parse(RunShell("cairn inspect --json " + Path("both.cairn")).out);
  EXPECT_EQ(json["unit"], "metre");
  EXPECT_EQ(json["frame_source"], "survey");
  ASSERT_EQ(json["sessions"].size(), 2u);
  EXPECT_GT(json["sessions"][1]["num_landmarks"].get<int>(), 20);

  // The same map by any number of threads; again, nothing; with another pose of an old image, the poses anew.
  ASSERT_EQ(compile("again.cairn", "--threads 1").exit_code, 0);
  EXPECT_EQ(HashFile(Path("again.cairn")).value(), HashFile(Path("both.cairn")).value());
  EXPECT_THAT(compile("both.cairn", "").out, HasSubstr("up to date"));
  old[0].cam_from_world->translation.x() += 0.001;
  ASSERT_TRUE(WriteImagesText(Path("old/images.txt"), old).ok());
  EXPECT_THAT(compile("both.cairn", "").out, HasSubstr("6 of 6 images of new are joined"));
}

TEST_F(ReconstructLine, FailingColmapFailsTheCompileWithItsLastLines) {
  fs::create_directories(Path("fake"));
  std::ofstream(Path("fake/colmap")) << "#!/bin/sh\necho out of luck\nexit 9\n";
  fs::permissions(Path("fake/colmap"), fs::perms::owner_all);
  const auto reconstruct = [](const std::string& mapper, const std::string& output) {
    return RunShell("PATH=" + Path("fake") + ":$PATH cairn stage reconstruct " +
                    Path("flat.build/matches.db") + " --capture " + Path("flat") + " --mapper " + mapper +
                    " -o " + Path(output) + " --progress none");
  };
  // A drive needs none.
  EXPECT_EQ(reconstruct("auto", "mapped").exit_code, 0);
  const ProgramRun run = reconstruct("colmap", "failed");
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.err, HasSubstr("exit code 9"));
  EXPECT_THAT(run.err, HasSubstr("out of luck"));
  for (const auto& entry : fs::directory_iterator(folder_->string()))
    EXPECT_THAT(entry.path().filename().string(), testing::Not(HasSubstr("failed")))
        << "nothing is left behind";
}

TEST_F(ReconstructLine, ReconstructOfAPosedCaptureIsNoGoal) {
  std::ofstream(Path("posed.toml")) << "name = \"posed\"\n[capture]\npath = \"posed\"\n";
  const ProgramRun run =
      RunShell("cairn compile " + Path("posed.toml") + " -o " + Path("posed.cairn") + " --until reconstruct");
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("has poses of its own"));
}

TEST_F(ReconstructLine, MissingFilesOfKnownPlacesAreNamed) {
  std::ofstream(Path("missing.toml")) << "name = \"missing\"\n[capture]\npath = \"flat\"\n[reconstruct]\n"
                                         "distances = \"nowhere.txt\"\n";
  const ProgramRun run = RunShell("cairn compile " + Path("missing.toml") + " -o " + Path("missing.cairn"));
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_THAT(run.err, HasSubstr("flat/nowhere.txt (paths are relative to the capture)"));
}

}  // namespace
}  // namespace cairn
