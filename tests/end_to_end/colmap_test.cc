#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/capture/capture.h"
#include "core/colmap/colmap_database.h"
#include "core/files/file.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// The installed colmap and ours on each other's files, of one small rendered survey.
class Colmap : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder("colmap_test");
    ASSERT_NO_FATAL_FAILURE(RenderTinySurvey(Path("survey")));
    CopyCapture(Path("survey"), Path("capture"), 40);
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }
  static std::string Path(const std::string& name) { return *folder_ / name; }
  static ProgramRun RunColmap(const std::string& arguments) {
    return RunShell("export QT_QPA_PLATFORM=offscreen; colmap " + arguments);
  }
  static void Succeed(const ProgramRun& run) { ASSERT_EQ(run.exit_code, 0) << run.out << run.err; }
  static int64_t Count(const std::string& database, const std::string& query) {
    return SQLite::Database(Path(database)).execAndGet(query).getInt64();
  }
  static TemporaryFolder* folder_;
};
TemporaryFolder* Colmap::folder_ = nullptr;

TEST_F(Colmap, TheirFeaturesAndMatchesBecomeAMapThatLocalizes) {
  const Camera camera = ReadCapture(Path("capture"))->cameras.begin()->second;
  Succeed(RunColmap(
      fmt::format("feature_extractor --database_path {} --image_path {} --ImageReader.single_camera 1 "
                  "--ImageReader.camera_model {} --ImageReader.camera_params {} --SiftExtraction.use_gpu 0 "
                  "--SiftExtraction.max_num_features 400 --SiftExtraction.num_threads 2",
                  Path("theirs.db"), Path("capture/images"), CameraModelName(camera.model),
                  fmt::join(camera.params, ","))));
  Succeed(RunColmap("exhaustive_matcher --database_path " + Path("theirs.db") +
                    " --SiftMatching.use_gpu 0 --SiftMatching.num_threads 2"));
  const std::string bytes = *ReadFile(Path("theirs.db"));
  Succeed(RunShell("cairn stage match-features " + Path("theirs.db") + " --capture " + Path("capture") +
                   " -o " + Path("our_matches.db")));
  EXPECT_GT(Count("our_matches.db", "SELECT count(*) FROM two_view_geometries"), 40);

  Succeed(RunShell(
      "cd " + Path("") +
      " && cairn stage group-classes theirs.db --capture capture -o classes.db"
      " && cairn stage filter-visibility classes.db --survey driven --cell-size-m 0.7 --heading-bin-deg 90"
      " --min-num-stations-driven 2 -o world.db"
      " && cairn stage decompose-regions world.db --k 4 --tau 0 -o regions.db"
      " && cairn stage build-vocabulary theirs.db -o vocabulary.db"
      " && cairn stage emit-map --classes classes.db --world world.db --regions regions.db"
      " --vocabulary vocabulary.db --name theirs --landmarks all -o theirs.cairn"));
  EXPECT_EQ(*ReadFile(Path("theirs.db")), bytes);
  EXPECT_FALSE(fs::exists(Path("theirs.db-wal")));
  const auto survey = ReadCapture(Path("capture"));
  const CaptureImage& image = survey->images[survey->images.size() / 2];
  const ProgramRun run = RunShell("cairn localize " + Path("theirs.cairn") + " " + survey->ImagePath(image) +
                                  " -o " + Path("poses.txt"));
  Succeed(run);
  std::vector<Reject> rejects;
  const auto poses = ReadImagesText(Path("poses.txt"), &rejects);
  ASSERT_EQ(poses->size(), 1u) << run.out;
  EXPECT_LT(CenterErrorM(*poses->front().cam_from_world, *image.cam_from_world), 0.05);

  // Their model of the same survey comes in, ours goes out.
  Succeed(RunShell("cairn export " + Path("theirs.cairn") + " -o " + Path("model") + " --text"));
  const ProgramRun analyzed = RunColmap("model_analyzer --path " + Path("model"));
  EXPECT_THAT(analyzed.out + analyzed.err, HasSubstr("Registered images: 40"));
  Succeed(RunShell("cairn export " + Path("classes.db") + " --matches " + Path("theirs.db") + " -o " +
                   Path("full")));
  Succeed(RunShell("cairn import " + Path("full") + " --images " + Path("capture/images") +
                   " --every 10 -o " + Path("imported")));
  const auto imported = ReadCapture(Path("imported"));
  ASSERT_TRUE(imported.ok()) << imported.error().message;
  EXPECT_EQ(imported->images.size(), 36u);
  EXPECT_EQ(imported->queries.size(), 4u);
}

TEST_F(Colmap, TheirMatcherTakesOurFeatures) {
  CopyCapture(Path("survey"), Path("few"), 16);
  Succeed(RunShell("cairn stage extract-features " + Path("few") + " --max-num-features 400 -o " +
                   Path("features.db")));
  fs::copy_file(Path("features.db"), Path("matched_by_colmap.db"));
  Succeed(RunColmap("exhaustive_matcher --database_path " + Path("matched_by_colmap.db") +
                    " --SiftMatching.use_gpu 0 --SiftMatching.num_threads 2"));
  EXPECT_GT(Count("matched_by_colmap.db", "SELECT count(*) FROM two_view_geometries WHERE rows > 15"), 5);
}

TEST_F(Colmap, DamagedDatabasesEndWithAnErrorOrAValidResult) {
  Succeed(RunShell("cairn stage extract-features " + Path("capture") + " --max-num-features 200 -o " +
                   Path("whole.db") + " && cairn stage match-features " + Path("whole.db") +
                   " --pairs exhaustive -o " + Path("whole_matches.db")));
  const std::string bytes = *ReadFile(Path("whole_matches.db"));
  const auto run_stages = [&](const std::string& damaged, bool must_fail) {
    std::ofstream(Path("damaged.db"), std::ios::binary) << damaged;
    for (const std::string& command :
         {"stage match-features " + Path("damaged.db"),
          "stage group-classes " + Path("damaged.db") + " --capture " + Path("capture")}) {
      const ProgramRun run = RunShell("cairn " + command + " -o " + Path("damaged_out.db"));
      EXPECT_TRUE(run.exit_code >= (must_fail ? 1 : 0) && run.exit_code <= 9) << command << run.err;
      if (run.exit_code != 0) {
        EXPECT_THAT(run.err, HasSubstr("damaged")) << command;
        EXPECT_FALSE(fs::exists(Path("damaged_out.db"))) << command;
      }
      fs::remove(Path("damaged_out.db"));
    }
  };
  for (size_t i = 0; i < 8; ++i) run_stages(bytes.substr(0, bytes.size() * i / 8), true);
  for (size_t i = 0; i < 24; ++i) {
    std::string damaged = bytes;
    damaged[bytes.size() * i / 24 + 40] = static_cast<char>(~damaged[bytes.size() * i / 24 + 40]);
    run_stages(damaged, false);
  }
}

}  // namespace
}  // namespace cairn
