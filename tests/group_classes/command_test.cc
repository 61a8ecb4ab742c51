#include "stages/group_classes/command.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/line/memory.h"
#include "stages/group_classes/group_classes.h"
#include "tests/group_classes/survey.h"
#include "tests/ran_command.h"

namespace cairn::group_classes {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::Pair;

class GroupClassesCommandTest : public CommandTest {
 protected:
  void SetUp() override { std::filesystem::create_directories(folder_ / "capture/images"); }

  void Write(const Survey& survey) const {
    WriteMatches(survey.matched, Path("matches.db"));
    ASSERT_TRUE(WriteCamerasText(Path("capture/cameras.txt"), survey.capture.cameras).ok());
    ASSERT_TRUE(WriteImagesText(Path("capture/images.txt"), survey.capture.images).ok());
    for (const CaptureImage& image : survey.capture.images) {
      const std::filesystem::path path = folder_ / "capture/images" / image.name;
      std::filesystem::create_directories(path.parent_path());
      ASSERT_TRUE(WriteFileAtomically(path, "").ok());
    }
  }
  // group-classes matches.db --capture CAPTURE -o classes.db WORDS...
  Ran Run(const std::vector<std::string>& more, int64_t memory_mib = 1 << 20) const {
    return RunWords(GroupClassesCommand(),
                    {Path("matches.db"), "--capture", Path("capture"), "-o", Path("classes.db")}, more,
                    memory_mib);
  }
  // What the function says of the files that the command was given.
  GroupClassesResult Grouped(const GroupClassesOptions& options,
                             const std::vector<std::string>& sessions = {}) const {
    NoProgress progress;
    const auto matched = ReadMatchedFeatures(Path("matches.db"));
    const auto capture = ReadCapture(Path("capture"));
    EXPECT_TRUE(matched.ok() && capture.ok());
    auto result = GroupClasses(*matched, *capture, options, 1, progress, nullptr, sessions);
    EXPECT_TRUE(result.ok()) << result.error().message;
    return std::move(*result);
  }
  // Makes the database's file as large, with nothing in it.
  void Enlarge(int64_t size_mib) const {
    std::filesystem::resize_file(Path("matches.db"), static_cast<uintmax_t>(size_mib) << 20);
  }
};

std::string KeptText(const GroupClassesResult& result) {
  std::vector<std::string> dropped;
  for (const auto& [reason, count] : result.classes.dropped)
    dropped.push_back(fmt::format("{} {}", count, reason));
  return fmt::format("group_classes: {} tracks, {} classes kept, dropped: {}\n", result.num_tracks,
                     result.classes.classes.size(),
                     dropped.empty() ? "none" : fmt::format("{}", fmt::join(dropped, ", ")));
}

TEST_F(GroupClassesCommandTest, SaysWhatItKeptAndThatStatedPosesStayed) {
  Write(MakeSurvey({.pixel = 2}));
  GroupClassesOptions options;
  options.refine_poses = "never";
  const GroupClassesResult result = Grouped(options);
  ASSERT_GT(result.classes.dropped.size(), 1U);
  const Ran ran = Run({"--refine-poses", "never"});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  EXPECT_EQ(ran.out,
            KeptText(result) +
                fmt::format("group_classes: poses and cameras as stated, reprojection error {:.2f} px\n",
                            result.final_rms_px));
  EXPECT_THAT(ran.report.in, ElementsAre(Pair("images", 24), Pair("tracks", result.num_tracks)));
  EXPECT_THAT(ran.report.out, ElementsAre(Pair("classes", std::ssize(result.classes.classes))));
  EXPECT_EQ(ran.report.rejected.size(), result.classes.dropped.size());
  EXPECT_EQ(ReadClasses(Path("classes.db"))->classes.size(), result.classes.classes.size());
}

TEST_F(GroupClassesCommandTest, SaysHowFarPosesAndCamerasAreOffWhatIsStated) {
  const Pose offset{Eigen::Quaterniond(Eigen::AngleAxisd(0.03, Eigen::Vector3d::UnitY())),
                    Eigen::Vector3d(0.03, 0, 0)};
  Write(MakeSurvey({.pose_m = 0.01, .pose_deg = 0.2, .offset = offset, .k1 = 0.1}));
  const GroupClassesResult result = Grouped({});
  const SurveyFindings& findings = result.findings;
  ASSERT_TRUE(findings.has_offset);
  ASSERT_GT(findings.pose_gain, 0);
  const CameraFinding& camera = findings.cameras.at(0);
  ASSERT_FALSE(camera.free.empty());
  // Each parameter that was free has its deviation beside it.
  std::vector<std::string> params;
  for (size_t p = 0; p < result.classes.cameras[0].params.size(); ++p) {
    params.push_back(fmt::format("{:.6g}", result.classes.cameras[0].params[p]));
    for (size_t k = 0; k < camera.free.size(); ++k) {
      if (camera.free[k] == static_cast<int>(p)) params.back() += fmt::format(" +- {:.2g}", camera.sigma[k]);
    }
  }
  ASSERT_LT(camera.free.size(), params.size());
  const Pose& off = result.classes.camera_from_given;
  const Ran ran = Run({});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  EXPECT_EQ(
      ran.out,
      KeptText(result) +
          fmt::format("group_classes: reprojection error {:.2f} -> {:.2f} px; stated poses err by {:.2f} cm, "
                      "{:.3f} deg each and drift by {:.2f} cm, {:.3f} deg in a metre (square root); they "
                      "were moved by {:.1f} cm, {:.2f} deg an axis; left-out keypoints' variance is {:.1f} % "
                      "smaller\n",
                      result.initial_rms_px, result.final_rms_px, findings.noise.own_m / 0.01,
                      findings.noise.own_deg, findings.noise.walk_m / 0.01, findings.noise.walk_deg,
                      result.classes.stated_pose_sigma_m / 0.01, result.classes.stated_pose_sigma_deg,
                      findings.pose_gain / 0.01) +
          fmt::format("group_classes: the cameras are {:.1f} cm, {:.2f} deg off the stated poses\n",
                      off.translation.norm() / 0.01, DegFromRad(Eigen::AngleAxisd(off.rotation).angle())) +
          fmt::format("group_classes: camera 1 differs in {} from what is stated (PINHOLE): {} {}; left-out "
                      "keypoints' variance is {:.1f} % smaller\n",
                      camera.variant, CameraModelName(result.classes.cameras[0].model),
                      fmt::join(params, ", "), camera.gain / 0.01));
}

TEST_F(GroupClassesCommandTest, SaysWhatEachSessionMisses) {
  std::set<int> gone;
  Write(SurveyOfTwoSessions(&gone));
  ASSERT_TRUE(WriteFileAtomically(Path("sessions.txt"), "a\nb\n").ok());
  GroupClassesOptions options;
  options.refine_poses = "never";
  const GroupClassesResult result = Grouped(options, {"a", "b"});
  const Classes& classes = result.classes;
  std::string expected;
  for (int s = 0; s < 2; ++s) {
    const SessionPersistence& session = result.sessions[s];
    expected += fmt::format(
        "group_classes: {} sees {} of {} classes of other sessions that it could see, {:.0f} % as readily as "
        "they; {:.1f} % are there\n",
        s == 0 ? "a" : "b", session.num_seen, session.num_known, session.yield / 0.01,
        session.there_ratio / 0.01);
  }
  expected += fmt::format("group_classes: {} classes are probably gone; the place changed at {} places\n",
                          classes.vanished.size(), classes.changes.size());
  ASSERT_TRUE(classes.changes.empty());
  const Ran ran = Run({"--refine-poses", "never", "--sessions", Path("sessions.txt")});
  ASSERT_TRUE(ran.status.ok()) << ran.status.error().message;
  EXPECT_THAT(ran.out, testing::EndsWith(expected));
  EXPECT_THAT(expected, Not(HasSubstr(" 0 classes are probably gone")));
}

// Mebibytes that the command needs at least, by its own words where it has too few.
int64_t NeededMib(const Ran& ran) {
  const std::string& message = ran.status.error().message;
  const std::string before = "takes about ";
  return std::stoll(message.substr(message.find(before) + before.size()));
}

TEST_F(GroupClassesCommandTest, NeedsMemoryByTheFilesSizeAndLessOfALargeFile) {
  Write(MakeSurvey({}));
  const int64_t program_mib = kProgramBytes >> 20;
  const std::vector<std::string> as_stated = {"--refine-poses", "never"};
  Enlarge(500);  // 0.8 of it
  EXPECT_EQ(NeededMib(Run(as_stated, 1)), 400 + program_mib);
  EXPECT_EQ(Run(as_stated, 399 + program_mib).status.error().code, ErrorCode::kNoMemory);
  EXPECT_TRUE(Run(as_stated, 400 + program_mib).status.ok());
  Enlarge(10000);  // 0.15 of it, and 600 MiB
  EXPECT_EQ(NeededMib(Run(as_stated, 1)), 2100 + program_mib);
}

TEST_F(GroupClassesCommandTest, NeedsMoreMemoryForPosesThatAreAdjustedAtOnce) {
  Write(MakeSurvey({}));
  Enlarge(500);
  const int64_t as_stated_mib = 400 + (kProgramBytes >> 20);
  const auto more_mib = [&](const std::vector<std::string>& words) {
    return NeededMib(Run(words, 1)) - as_stated_mib;
  };
  // Of 100 keypoints 150 kB an image; of 100000 a thousand times as much: 24 images are 3433.2 MiB, but no
  // more is taken than 0.8 of the file.
  EXPECT_EQ(more_mib({}), 4);
  EXPECT_EQ(more_mib({"--num-keypoints-adjusted", "10"}), 4);
  EXPECT_EQ(more_mib({"--num-keypoints-adjusted", "1000"}), 35);
  EXPECT_EQ(more_mib({"--num-keypoints-adjusted", "100000"}), 400);
  // Those of a part for each thread, a third of it, those of a block or those learnt from: whatever is most.
  const auto at_once = [](const std::string& together, const std::string& at_once,
                          const std::string& learnt) {
    return std::vector<std::string>{"--num-keypoints-adjusted", "10000", "--num-images-together", together,
                                    "--num-images-at-once",     at_once, "--num-images-learnt",   learnt};
  };
  EXPECT_EQ(more_mib(at_once("10", "10", "10")), 144);
  EXPECT_EQ(more_mib(at_once("20", "10", "10")), 287);
  EXPECT_EQ(more_mib(at_once("10", "60", "10")), 287);
  EXPECT_EQ(more_mib(at_once("10", "10", "20")), 287);
}

TEST_F(GroupClassesCommandTest, SaysThatPosesAsStatedTakeLessMemory) {
  Write(MakeSurvey({}));
  Enlarge(500);
  const int64_t as_stated_mib = 400 + (kProgramBytes >> 20);
  const std::string remedy = "with --refine-poses never it fits";
  EXPECT_THAT(Run({}, as_stated_mib).status.error().message, HasSubstr(remedy));
  EXPECT_THAT(Run({}, as_stated_mib - 1).status.error().message, Not(HasSubstr(remedy)));
  // A reconstruction's are not adjusted, if nobody asks for it.
  CaptureFrame frame;
  frame.is_reconstructed = true;
  ASSERT_TRUE(WriteFileAtomically(Path("capture/frame.json"), CaptureFrameJson(frame)).ok());
  EXPECT_TRUE(Run({}, as_stated_mib).status.ok());
  EXPECT_FALSE(Run({"--refine-poses", "always"}, as_stated_mib).status.ok());
}

}  // namespace
}  // namespace cairn::group_classes
