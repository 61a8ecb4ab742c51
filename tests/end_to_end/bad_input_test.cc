#include <algorithm>
#include <filesystem>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

// Captures of a few images, each spoilt in one way, and what the program says about it.
class BadInput : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder("bad_input_test");
    ASSERT_NO_FATAL_FAILURE(RenderTinySurvey(Path("survey")));
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }
  void SetUp() override {
    CopyCapture(Path("survey"), Path("capture"), 12);
    WriteCaptureRecipe(Path("bad.toml"), {"capture"});
  }
  void TearDown() override {
    for (const char* name : {"capture", "bad.build", "bad.cairn"}) fs::remove_all(Path(name));
  }

  static std::string Path(const std::string& name) { return *folder_ / name; }
  static ProgramRun CompileBad(const std::string& arguments = "") {
    return RunShell("cairn compile " + Path("bad.toml") + " -o " + Path("bad.cairn") + " --progress none " +
                    arguments);
  }
  // An impossible capture gives the stage's code and a message, and neither a map nor part of one.
  static void ExpectFailure(const ProgramRun& run, int exit_code, const std::string& message) {
    EXPECT_EQ(run.exit_code, exit_code) << run.out << run.err;
    EXPECT_THAT(run.err, HasSubstr(message));
    EXPECT_FALSE(fs::exists(Path("bad.cairn")));
    if (!fs::exists(Path("bad.build"))) return;
    for (const auto& entry : fs::directory_iterator(Path("bad.build"))) {
      EXPECT_EQ(entry.path().string().find(".tmp-"), std::string::npos) << entry.path();
    }
  }
  // The files of the capture's images, ascending.
  static std::vector<std::string> Images() {
    std::vector<std::string> images;
    for (const auto& entry : fs::recursive_directory_iterator(Path("capture/images"))) {
      if (entry.is_regular_file()) images.push_back(entry.path().string());
    }
    std::sort(images.begin(), images.end());
    return images;
  }
  static std::string Name(const std::string& image) { return fs::path(image).filename().string(); }

  static TemporaryFolder* folder_;
};
TemporaryFolder* BadInput::folder_ = nullptr;

TEST_F(BadInput, BadImagesAreListedAndTheRestCompiles) {
  fs::remove_all(Path("capture"));
  CopyCapture(Path("survey"), Path("capture"), 1000);
  const std::vector<std::string> images = Images();
  fs::remove(images[3]);                                              // missing
  fs::resize_file(images[10], fs::file_size(images[10]) * 2 / 3);     // truncated
  fs::resize_file(images[20], 0);                                     // empty
  ASSERT_TRUE(WriteFileAtomically(images[30], "not an image").ok());  // something else
  const ProgramRun run = CompileBad("--threads 2");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  for (const int i : {3, 10, 20, 30}) EXPECT_THAT(run.err, HasSubstr(Name(images[i]))) << run.err;
  EXPECT_THAT(run.out, HasSubstr("4 rejected"));
  EXPECT_TRUE(fs::exists(Path("bad.cairn")));
}

TEST_F(BadInput, PosesThatAreNoneAreListed) {
  const std::string images = Path("capture/images.txt");
  ReplaceInFile(images, "1 0.500000000 ", "1 nan ");          // heading 0 of the first station
  ReplaceInFile(images, "2 0.707106781 ", "2 1.707106781 ");  // its heading 90: no unit quaternion
  const ProgramRun run = CompileBad("--until extract-features");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("10 images"));
  EXPECT_THAT(run.out, HasSubstr("2 rejected"));
  EXPECT_THAT(run.err, AllOf(HasSubstr(Name(Images()[0])), HasSubstr(Name(Images()[1]))));
}

TEST_F(BadInput, UnlistedImageIsAWarning) {
  fs::copy_file(Images()[0], Path("capture/images/stranger.jpg"));
  const ProgramRun run = CompileBad("--until extract-features");
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.err, HasSubstr("stranger.jpg"));
  EXPECT_THAT(run.out, HasSubstr("12 images"));
}

TEST_F(BadInput, UnknownCameraModelNamesTheModel) {
  ReplaceInFile(Path("capture/cameras.txt"), "PINHOLE", "CATOPTRIC");
  const ProgramRun run = CompileBad();
  ExpectFailure(run, 5, "CATOPTRIC");
  EXPECT_THAT(run.err, HasSubstr("cameras.txt"));
}

TEST_F(BadInput, EmptyAndBrokenListsNameTheFile) {
  fs::resize_file(Path("capture/cameras.txt"), 0);
  const ProgramRun run = CompileBad();
  EXPECT_NE(run.exit_code, 0);
  EXPECT_THAT(run.err, HasSubstr("cameras.txt"));
  EXPECT_FALSE(fs::exists(Path("bad.cairn")));

  CopyCapture(Path("survey"), Path("capture"), 12);
  ASSERT_TRUE(WriteFileAtomically(Path("capture/images.txt"), "1 0.5 half\n\n").ok());
  ExpectFailure(CompileBad(), 4, "images.txt:1");
}

TEST_F(BadInput, CaptureOfOneImageLeavesNoMap) {
  fs::remove_all(Path("capture"));
  CopyCapture(Path("survey"), Path("capture"), 1);
  ExpectFailure(CompileBad(), 6, "was not written");
}

TEST_F(BadInput, CaptureWithoutOverlapLeavesNoMap) {
  // Two images that stand a kilometre apart, whatever they show.
  fs::remove_all(Path("capture"));
  CopyCapture(Path("survey"), Path("capture"), 2);
  std::istringstream text(ReadFile(Path("capture/images.txt")).value());
  std::string line, moved;
  while (std::getline(text, line)) {
    std::istringstream words(line);
    std::string w[10];
    for (std::string& word : w) words >> word;
    if (w[9].empty()) continue;
    moved += w[0] + " 1 0 0 0 " + (moved.empty() ? "0" : "1000") + " 0 0 " + w[8] + " " + w[9] + "\n\n";
  }
  ASSERT_TRUE(WriteFileAtomically(Path("capture/images.txt"), moved).ok());
  ExpectFailure(CompileBad(), 6, "was not written");
}

TEST_F(BadInput, CaptureOfBadImagesOnlyLeavesNoMap) {
  for (const std::string& image : Images()) fs::resize_file(image, 0);
  ExpectFailure(CompileBad(), 6, "was not written");
}

TEST_F(BadInput, EmptyFolderIsNoCapture) {
  fs::remove_all(Path("capture"));
  fs::create_directories(Path("capture"));
  const ProgramRun run = CompileBad();
  EXPECT_NE(run.exit_code, 0);
  EXPECT_THAT(run.err, HasSubstr("capture"));
  EXPECT_FALSE(fs::exists(Path("bad.cairn")));
}

TEST_F(BadInput, FailureLeavesAnEarlierMapAlone) {
  ASSERT_TRUE(WriteFileAtomically(Path("bad.cairn"), "the map of yesterday").ok());
  for (const std::string& image : Images()) fs::resize_file(image, 0);
  EXPECT_EQ(CompileBad().exit_code, 6);
  EXPECT_EQ(ReadFile(Path("bad.cairn")).value(), "the map of yesterday");
}

TEST_F(BadInput, RecipeKeyNamesFileLineAndNearestKey) {
  ReplaceInFile(Path("bad.toml"), "max_num_features", "max_num_feature");
  ExpectFailure(CompileBad(), 2, "did you mean 'max_num_features'?");
}

TEST_F(BadInput, DamagedStageFilesAreNamed) {
  ASSERT_TRUE(WriteFileAtomically(Path("features.db"), "").ok());
  using Case = std::pair<std::string, int>;  // command, exit code
  for (const auto& [command, exit_code] :
       {Case{"stage match-features " + Path("features.db") + " -o " + Path("out.db"), 4},
        Case{"stage group-classes " + Path("features.db") + " --capture " + Path("capture") + " -o " +
                 Path("out.db"),
             4},
        Case{"stage filter-visibility " + Path("features.db") + " -o " + Path("out.db"), 4},
        Case{"stage decompose-regions " + Path("features.db") + " -o " + Path("out.db"), 4},
        Case{"stage build-vocabulary " + Path("features.db") + " -o " + Path("out.db"), 4},
        Case{"stage link-appearance " + Path("features.db") + " -o " + Path("out.db"), 4},
        Case{"check " + Path("features.db") + " -o " + Path("out.cairn"), 11},
        Case{"inspect " + Path("features.db"), 11}}) {
    const ProgramRun run = RunShell("cairn " + command);
    EXPECT_EQ(run.exit_code, exit_code) << command << "\n" << run.err;
    EXPECT_THAT(run.err, HasSubstr("features.db")) << command;
    EXPECT_FALSE(fs::exists(Path("out.db"))) << command;
  }
}

TEST_F(BadInput, OutputThatIsAnInputIsRefusedByEveryCommand) {
  for (const char* name : {"in", "other"}) ASSERT_TRUE(WriteFileAtomically(Path(name), "kept").ok());
  for (const char* words : {"stage extract-features capture -o capture/images.txt",
                            "stage extract-features capture -o f.db --depfile ./in --options in",
                            "stage match-features in -o in",
                            "stage match-features other --capture capture -o capture/images.txt",
                            "stage match-features other --pair-list in -o in",
                            "stage reconstruct other --capture capture -o capture",
                            "stage group-classes in --capture capture -o in",
                            "stage filter-visibility in -o in",
                            "stage decompose-regions in -o in",
                            "stage decompose-regions other --classes in -o in",
                            "stage decompose-regions in -o new --svg in",
                            "stage build-vocabulary in -o in",
                            "stage link-appearance in other -o in",
                            "stage link-appearance other in -o in",
                            "plan decompose in -o in",
                            "stage emit-map --name a --classes in --world other --regions other --vocabulary "
                            "other --frame in -o in",
                            "check in -o in",
                            "check other --queries in -o in",
                            "check in --details in",
                            "compile in -o in",
                            "import capture --queries in -o capture",
                            "join a=capture -o capture",
                            "export in -o .",
                            "inspect in --svg in",
                            "inspect in --ambiguity-svg in",
                            "localize other --list in -o in",
                            "plan locate in other --svg in",
                            "plan path in --from 0,0 --to 1,1 --svg in",
                            "plan tell-apart in --a 0,0,0 --b 1,1,0 --svg in",
                            "drive other --building in --start 0,0,0 --goal a -o in",
                            "sign in --key other -o in",
                            "sign other --key in -o in",
                            "migrate in -o in",
                            "update delta in other -o in",
                            "update apply other in -o in",
                            "update apply in other -o in",
                            "pareto in -o in",
                            "report in -o in"}) {
    const ProgramRun run = RunShell("cd " + folder_->string() + " && cairn " + words);
    EXPECT_EQ(run.exit_code, 2) << words;
    EXPECT_THAT(run.err, HasSubstr(" cannot be the ")) << words;
    EXPECT_EQ(ReadFile(Path("in")).value(), "kept") << words;
  }
  const std::string extract = "cairn stage extract-features " + Path("capture") + " -o " + Path("f.db");
  ASSERT_EQ(RunShell(extract).exit_code, 0);
  const ProgramRun again = RunShell(extract + " --reuse " + Path("f.db"));
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_THAT(again.out, HasSubstr(" 12 taken over"));
}

TEST_F(BadInput, SpaceInAPathIsRefusedWithASentence) {
  fs::create_directories(Path("my maps"));
  const ProgramRun run =
      RunShell("cairn compile " + Path("bad.toml") + " -o '" + Path("my maps/a.cairn") + "'");
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("has a space in its path, which Make cannot handle"));
}

TEST_F(BadInput, FolderThatAnotherCompileHoldsIsBusy) {
  ASSERT_EQ(CompileBad("--until extract-features").exit_code, 0);
  const ProgramRun run = RunShell("flock " + Path("bad.build/lock") + " cairn compile " + Path("bad.toml") +
                                  " -o " + Path("bad.cairn"));
  EXPECT_EQ(run.exit_code, 9);
  EXPECT_THAT(run.err, HasSubstr("another build"));
}

}  // namespace
}  // namespace cairn
