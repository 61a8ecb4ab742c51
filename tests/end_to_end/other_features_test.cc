// Features that others found, through the whole line, by the program that a user has.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/files/file.h"
#include "tests/end_to_end/opencv_features.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;

// A rendered survey, compiled by SIFT and by a detector of OpenCV's for each type of descriptors.
class OtherFeatures : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder("other_features");
    RenderTinySurvey(Path("survey"));
    ASSERT_FALSE(HasFatalFailure());
    const auto capture = ReadCapture(Path("survey"));
    ASSERT_TRUE(capture.ok());
    for (const std::string name : {"orb", "akaze", "kaze"}) {
      ASSERT_TRUE(WriteOpenCvFeatures(name, *capture, Path("kapture_" + name), 800).ok());
      CopyLists("survey", name);
      fs::create_directory_symlink(Path("survey/images"), Path(name + "/images"));
      Expect(RunShell("cairn features " + Path("kapture_" + name) + " " + Path(name)), 0, "");
      Compile(name);
    }
    fs::create_directory_symlink(Path("survey"), Path("sift"));
    Compile("sift");
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }

  static std::string Path(const std::string& name) { return *folder_ / name; }
  static void Expect(const ProgramRun& run, int exit_code, const std::string& text) {
    EXPECT_EQ(run.exit_code, exit_code) << run.out << run.err;
    EXPECT_THAT(run.out + run.err, HasSubstr(text));
  }
  // The lists of a capture, without its images.
  static void CopyLists(const std::string& from, const std::string& to) {
    fs::create_directories(Path(to));
    for (const auto& entry : fs::directory_iterator(Path(from))) {
      if (entry.is_regular_file()) fs::copy_file(entry.path(), fs::path(Path(to)) / entry.path().filename());
    }
  }
  static void Compile(const std::string& name, const std::string& map = "", const std::string& more = "") {
    const std::string recipe = Path((map.empty() ? name : map) + ".toml");
    WriteCaptureRecipe(recipe, {Path(name)});
    if (!more.empty()) ReplaceInFile(recipe, "[extract_features]\n", "[extract_features]\n" + more);
    Expect(RunShell("cairn compile " + recipe + " -o " + Path((map.empty() ? name : map) + ".cairn")), 0,
           "compiled");
  }
  static json Inspect(const std::string& map) {
    return json::parse(RunShell("cairn inspect --json " + Path(map + ".cairn")).out);
  }
  static std::vector<json> Localize(const std::string& words) {
    std::vector<json> answers;
    std::istringstream lines(RunShell("cairn localize " + words).out);
    for (std::string line; std::getline(lines, line);) answers.push_back(json::parse(line));
    return answers;
  }
  static std::string Queries() {
    std::string names;
    const Capture survey = *ReadCapture(Path("survey"));
    for (const CaptureImage& query : survey.queries) names += " " + query.name;
    return names;
  }

  static TemporaryFolder* folder_;
};
TemporaryFolder* OtherFeatures::folder_ = nullptr;

TEST_F(OtherFeatures, OfEveryTypeMakeMapsThatLocalize) {
  const std::pair<const char*, const char*> kinds[] = {
      {"orb", "binary 256 orb"}, {"akaze", "binary 488 akaze"}, {"kaze", "float 64 kaze"}, {"sift", "sift"}};
  const Capture survey = *ReadCapture(Path("survey"));
  for (const auto& [name, kind] : kinds) {
    const json map = Inspect(name);
    EXPECT_EQ(map["descriptors"], kind);
    EXPECT_EQ(map["format"], std::string(kind) == "sift" ? "2.8" : "3.8");
    EXPECT_EQ(map["sealed"], true);
    EXPECT_GT(map["num_landmarks"], 100) << name;
    EXPECT_GE(map["self_test"]["localized_ratio"], 0.5) << name << ": held-out images by their features";
    EXPECT_EQ(map["self_test"]["precision_ratio"], 1.0) << name;
    if (std::string(kind) == "sift") continue;
    const std::vector<json> answers = Localize(Path(std::string(name) + ".cairn") + Queries() +
                                               " --features " + Path(std::string("kapture_") + name));
    ASSERT_EQ(answers.size(), survey.queries.size());
    int num_fixes = 0;
    for (size_t i = 0; i < answers.size(); ++i) {
      if (!answers[i]["fix"]) continue;
      ++num_fixes;
      const Eigen::Vector3d truth = survey.queries[i].cam_from_world->Center();
      for (int axis = 0; axis < 3; ++axis)
        EXPECT_NEAR(answers[i]["center_m"][axis].get<double>(), truth[axis], 0.25) << name << " " << i;
    }
    EXPECT_GE(num_fixes, 3) << name;
    EXPECT_EQ(num_fixes, static_cast<int>(std::lround(map["self_test"]["localized_ratio"].get<double>() *
                                                      static_cast<double>(answers.size()))))
        << "as the self-test has it";
  }
}

TEST_F(OtherFeatures, GiveTheSameBytesForAnyNumberOfThreadsAndAreNotMatchedAgain) {
  const std::string recipe = Path("orb.toml");
  fs::create_directories(Path("again"));
  Expect(RunShell("cairn compile " + recipe + " -o " + Path("again/orb.cairn") + " -j 1"), 0, "compiled");
  EXPECT_EQ(*ReadFile(Path("orb.cairn")), *ReadFile(Path("again/orb.cairn")));
  // One image has other features: only what is new is matched.
  fs::copy(Path("kapture_orb"), Path("kapture_changed"), fs::copy_options::recursive);
  const std::string name = ReadCapture(Path("survey"))->images[3].name;
  const std::string file = Path("kapture_changed/reconstruction/descriptors/orb/" + name + ".desc");
  std::string bytes = *ReadFile(file);
  for (char& byte : bytes) byte = static_cast<char>(~byte);
  ASSERT_TRUE(WriteFileAtomically(file, bytes).ok());
  fs::remove(Path("orb/features.db"));
  Expect(RunShell("cairn features " + Path("kapture_changed") + " " + Path("orb")), 0, "binary 256 orb");
  const ProgramRun run = RunShell("cairn compile " + recipe + " -o " + Path("again/orb.cairn") + " -j 1");
  Expect(run, 0, "compiled");
  const size_t num_images = ReadCapture(Path("survey"))->images.size();
  EXPECT_THAT(run.out + run.err, HasSubstr(fmt::format("{} taken over", num_images - 1))) << run.out;
  EXPECT_NE(*ReadFile(Path("orb.cairn")), *ReadFile(Path("again/orb.cairn")));
}

// The words of a map that has them: of landmarks, and all of the survey's.
TEST_F(OtherFeatures, HaveWordsOfTheirOwn) {
  for (const std::string name : {"orb", "kaze"}) {
    for (const std::string words : {"landmarks", "survey"}) {
      const std::string map = name + "_" + words;
      Compile(name, map);
      ASSERT_FALSE(HasFatalFailure());
      const std::string recipe = Path(map + ".toml");
      const std::string emit =
          words == "survey" ? "words = \"survey\"\n" : "min_num_landmarks_for_words = 0\n";
      ReplaceInFile(recipe, "[emit_map]\n", "[emit_map]\n" + emit);
      Expect(RunShell("cairn compile " + recipe + " -o " + Path(map + ".cairn")), 0, "compiled");
      EXPECT_GT(Inspect(map)["num_words"], 50) << map;
      EXPECT_GE(Inspect(map)["self_test"]["localized_ratio"], 0.5) << map;
    }
  }
}

// Maps of different kinds have nothing in common; a model's path is from the recipe; imports are noticed.
TEST_F(OtherFeatures, AMapIsComparedWithOneOfAnotherKind) {
  Expect(RunShell("cairn diff " + Path("orb.cairn") + " " + Path("kaze.cairn")), 0, "landmarks");
  Expect(RunShell("cairn report " + Path("orb.cairn") + " -o " + Path("orb.html")), 0, "");
  Expect(RunShell("cairn migrate " + Path("orb.cairn") + " -o " + Path("moved.cairn")), 0, "as version 3.8");
  EXPECT_EQ(Inspect("moved")["descriptors"], "binary 256 orb");
}

TEST_F(OtherFeatures, ACompiledCaptureThatIsGivenFeaturesIsCompiledAnew) {
  CopyLists("survey", "later");
  fs::create_directory_symlink(Path("survey/images"), Path("later/images"));
  Compile("later");
  EXPECT_EQ(Inspect("later")["descriptors"], "sift");
  Expect(RunShell("cairn features " + Path("kapture_orb") + " " + Path("later")), 0, "");
  Expect(RunShell("cairn compile " + Path("later.toml") + " -o " + Path("later.cairn")), 0, "compiled");
  EXPECT_EQ(Inspect("later")["descriptors"], "binary 256 orb");
}

TEST_F(OtherFeatures, ImagesNeedNoFiles) {
  CopyLists("survey", "bare");
  Expect(RunShell("cairn features " + Path("kapture_kaze") + " " + Path("bare")), 0, "float 64 kaze");
  Compile("bare");
  EXPECT_EQ(Inspect("bare")["num_landmarks"], Inspect("kaze")["num_landmarks"]);
  EXPECT_EQ(Inspect("bare")["self_test"]["localized_ratio"], Inspect("kaze")["self_test"]["localized_ratio"]);
}

TEST_F(OtherFeatures, MapsAreAskedWithTheirOwnKindAlone) {
  const std::string query = Path("survey/images/") + ReadCapture(Path("survey"))->queries[0].name;
  const auto localize = [&](const std::string& map, const std::string& more) {
    return RunShell("cairn localize " + Path(map + ".cairn") + " " + query + " " + more);
  };
  Expect(localize("orb", ""), 5,
         "give features of that kind (LocalizeFeatures, `cairn localize --features`)");
  Expect(localize("orb", "--sequence"), 5, "descriptors of the kind 'binary 256 orb'");
  Expect(localize("orb", "--features " + Path("kapture_akaze")), 2,
         "descriptors of the kind 'binary 488 akaze', expected 'binary 256 orb'");
  Expect(localize("sift", "--features " + Path("kapture_orb")), 2,
         "descriptors of the kind 'binary 256 orb', expected 'sift'");
  Expect(localize("orb", "--features " + Path("kapture_orb") + " --descriptors 'binary brief'"), 2,
         "'binary 256 brief', expected 'binary 256 orb'");
  Expect(localize("orb", "--features " + Path("none")), 3, "no such file or folder");
  for (const char* other : {"--sequence", "--log log", "--rig rig.json", "--estimator both"})
    Expect(localize("orb", "--features " + Path("kapture_orb") + " " + other), 2, "leave one of them out");
  Expect(localize("orb", "--features " + Path("kapture_orb") + " --model a.onnx"), 2,
         "leave one of them out");
  Expect(localize("orb", "--features " + Path("kapture_orb") + " --contrast-threshold 0.1"), 2,
         "leave it out");
  Expect(localize("orb", "--features " + Path("kapture_orb") + " --budget-ms 5"), 2, "leave it out");
  Expect(localize("orb", "--descriptors binary"), 2, "give --features, or leave it out");
  Expect(RunShell("cairn atlas " + Path("orb.cairn") + " " + Path("sift.cairn") + " -o " + Path("a.atlas")),
         5, "an atlas finds places by SIFT's");
  Expect(RunShell("cairn where " + Path("orb.cairn") + " " + query), 5, "'binary 256 orb'");
}

TEST_F(OtherFeatures, CapturesLoseNothing) {
  Expect(RunShell("cairn features " + Path("kapture_orb") + " " + Path("akaze")), 2,
         "the capture has features already; move them away to give it others");
  CopyLists("survey", "few");
  fs::create_directories(Path("npz"));
  Expect(RunShell("cairn features " + Path("npz") + " " + Path("few")), 6,
         "no .npz file and no reconstruction");
  EXPECT_FALSE(fs::exists(Path("few/features.db")));
  Expect(RunShell("cairn features " + Path("kapture_orb/none") + " " + Path("few")), 3,
         "no such file or folder");
  Expect(RunShell("cairn features " + Path("kapture_orb") + " " + Path("few") + " --descriptors floats"), 2,
         "expected auto, sift, float, dense or binary");
  // Of one image a file is missing: the others are compiled, and it is a reject.
  fs::copy(Path("kapture_orb"), Path("kapture_few"), fs::copy_options::recursive);
  const std::string name = ReadCapture(Path("survey"))->images[0].name;
  fs::remove(Path("kapture_few/reconstruction/keypoints/orb/" + name + ".kpt"));
  const ProgramRun run = RunShell("cairn features " + Path("kapture_few") + " " + Path("few"));
  Expect(run, 0, "no features of 1 images; the first: " + name);
  Expect(RunShell("cairn stage extract-features " + Path("few") + " -o " + Path("few.db")), 0,
         "no such image in it, and it has the features of this capture's images");
}

TEST_F(OtherFeatures, AModelsFindsTheSameInSurveyAndQueries) {
  const char* given = std::getenv("CAIRN_TEST_MODEL");
  const std::string model =
      given != nullptr ? given : std::string(CAIRN_SOURCE_DIR) + "/../shared/data/models/xfeat.onnx";
  if (!fs::exists(model)) GTEST_SKIP() << "no model: " << model;
  fs::create_symlink(fs::absolute(model), Path("xfeat.onnx"));
  Compile("sift", "model", "model = \"xfeat.onnx\"\n");  // from the recipe
  const json map = Inspect("model");
  EXPECT_THAT(map["descriptors"].get<std::string>(), HasSubstr("dense 64 xfeat-"));
  EXPECT_GE(map["self_test"]["localized_ratio"], 0.5);
  const std::string queries = Path("survey/images/") + ReadCapture(Path("survey"))->queries[0].name;
  EXPECT_EQ(Localize(Path("model.cairn") + " " + queries + " --model " + model).size(), 1u);
  Expect(RunShell("cairn localize " + Path("model.cairn") + " " + queries), 5, "'dense 64 xfeat-");
  Expect(RunShell("cairn localize " + Path("orb.cairn") + " " + queries + " --model " + model), 2,
         "expected 'binary 256 orb'");
  Expect(RunShell("cairn localize " + Path("orb.cairn") + " " + queries + " --model " + Path("none.onnx")), 3,
         "none.onnx");
}

}  // namespace
}  // namespace cairn
