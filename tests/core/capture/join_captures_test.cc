#include "core/capture/join_captures.h"

#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/capture/sessions.h"
#include "core/files/file.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr char kPose[] = "0.5 0.5 -0.5 0.500000001 0.35 1 -1.05";

class JoinCapturesTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / fmt::format("join_captures_test_{}", getpid());
    fs::remove_all(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string Path(const std::string& name) const { return (folder_ / name).string(); }
  std::string Text(const std::string& name) const { return ReadFile(Path(name)).value(); }
  void Write(const std::string& name, const std::string& text) const {
    fs::create_directories(fs::path(Path(name)).parent_path());
    ASSERT_TRUE(WriteFileAtomically(Path(name), text).ok());
  }

  // A capture with poses; the files of the images hold their names.
  void WriteCapture(const std::string& name, const std::string& cameras, const std::string& images) const {
    Write(name + "/cameras.txt", cameras);
    Write(name + "/images.txt", images);
    Write(name + "/images/1.png", name);
    Write(name + "/images/a b.png", name);
  }
  static std::string Line(int id, int camera, const std::string& name) {
    return fmt::format("{} {} {} {}\n\n", id, kPose, camera, name);
  }

  Result<JoinedCapture> Join(const std::vector<CaptureSession>& sessions) const {
    return JoinCaptures(sessions, Path("joined"));
  }
  CaptureSession Session(const std::string& name) const { return {.name = name, .root = Path(name)}; }
  std::string Refusal(const std::vector<CaptureSession>& sessions,
                      ErrorCode code = ErrorCode::kInvalidArgument) const {
    const auto joined = Join(sessions);
    if (joined.ok()) return "no error";
    EXPECT_EQ(joined.error().code, code);
    return joined.error().message;
  }

  fs::path folder_;
};

TEST_F(JoinCapturesTest, ImagesKeepPosesAndFilesUnderTheirSession) {
  WriteCapture("day1", "1 PINHOLE 8 6 5 5 4 3\n", Line(1, 1, "1.png") + Line(9, 1, "a b.png"));
  WriteCapture("day2", "4 PINHOLE 8 6 7 7 4 3\n7 PINHOLE 8 6 5 5 4 3\n",
               Line(1, 4, "1.png") + Line(2, 7, "a b.png"));
  Write("day2/queries.txt", Line(1, 7, "1.png"));
  const auto joined = Join({Session("day1"), Session("day2")});
  ASSERT_TRUE(joined.ok()) << joined.error().message;
  EXPECT_EQ(joined->num_images, 4);
  EXPECT_EQ(joined->num_queries, 1);
  EXPECT_EQ(joined->num_cameras, 2);  // day2's camera 7 is day1's 1
  // The numbers of poses as they are written, to the last digit.
  EXPECT_EQ(
      Text("joined/images.txt"),
      fmt::format(
          "1 {0} 1 day1/1.png\n\n2 {0} 1 day1/a b.png\n\n3 {0} 2 day2/1.png\n\n4 {0} 1 day2/a b.png\n\n",
          kPose));
  const auto capture = ReadCapture(Path("joined"));
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  const std::vector<std::string> sessions = {"day1", "day2"};
  EXPECT_EQ(ReadSessionsText(Path("joined/sessions.txt")).value(), sessions);
  EXPECT_EQ(capture->sessions, sessions);
  ASSERT_EQ(capture->images.size(), 4u);
  EXPECT_THAT(capture->rejects, IsEmpty());
  EXPECT_THAT(capture->warnings, IsEmpty());
  EXPECT_EQ(capture->images[2].name, "day2/1.png");
  EXPECT_EQ(ReadFile(capture->ImagePath(capture->images[2])).value(), "day2");
  EXPECT_EQ(capture->cameras.at(capture->images[2].camera_id).params[0], 7);
  EXPECT_EQ(SessionOfImage(sessions, capture->images[2].name), 1);
  EXPECT_EQ(SessionOfImage(sessions, "elsewhere/1.png"), -1);
  EXPECT_EQ(SessionOfImage(sessions, "day1.png"), -1);
}

TEST_F(JoinCapturesTest, WhatOneCaptureRejectsOrLeavesOutTheJoinedOneDoesToo) {
  WriteCapture("day1", "1 PINHOLE 8 6 5 5 4 3\n", Line(1, 1, "1.png"));
  WriteCapture("day2", "1 PINHOLE 8 6 5 5 4 3\n",
               "1 nan 0 0 0 0 0 0 1 1.png\n\n" + Line(2, 3, "a b.png") + Line(3, 1, "gone.png"));
  ASSERT_TRUE(Join({Session("day1"), Session("day2")}).ok());
  const auto capture = ReadCapture(Path("joined"));
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  EXPECT_EQ(capture->images.size(), 1u);
  ASSERT_EQ(capture->rejects.size(), 3u);
  EXPECT_EQ(capture->rejects[0].name, "day2/1.png");
  EXPECT_THAT(capture->rejects[1].reason, HasSubstr("camera 2 is not in"));
  EXPECT_THAT(capture->rejects[2].reason, HasSubstr("no such file"));
  EXPECT_THAT(capture->warnings, ElementsAre(HasSubstr("day1/a b.png: in neither")));
}

TEST_F(JoinCapturesTest, CapturesWithoutPosesHaveTheirOwnCameras) {
  // 1 x 1 px, grey.
  const std::string image = "P5\n1 1\n255\nx";
  Write("day1/1.pgm", image);
  Write("day2/images/deep/1.pgm", image);
  const auto joined = Join({Session("day1"), Session("day2")});
  ASSERT_TRUE(joined.ok()) << joined.error().message;
  const auto capture = ReadCapture(Path("joined"));
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  EXPECT_FALSE(capture->has_poses);
  ASSERT_EQ(capture->images.size(), 2u);
  EXPECT_EQ(capture->images[0].name, "day1/1.pgm");
  EXPECT_EQ(capture->images[1].name, "day2/deep/1.pgm");
  EXPECT_EQ(capture->images[0].camera_id, 1u);
  EXPECT_EQ(capture->images[1].camera_id, 2u);
}

TEST_F(JoinCapturesTest, SessionsWithoutPosesKeepTheCamerasThatTheyGive) {
  const std::string image = "P5\n1 1\n255\nx";
  for (const std::string day : {"day1", "day2", "day3"}) Write(day + "/images/1.pgm", image);
  Write("day1/cameras.txt", "8 PINHOLE 1 1 5 5 0.5 0.5\n");
  Write("day2/cameras.txt", "8 PINHOLE 1 1 6 6 0.5 0.5\n");
  ASSERT_TRUE(Join({Session("day1"), Session("day2"), Session("day3")}).ok());
  const auto capture = ReadCapture(Path("joined"));
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  ASSERT_EQ(capture->images.size(), 3u);
  const auto focal = [&](int i) { return capture->cameras.at(capture->images[i].camera_id).FocalX(); };
  EXPECT_EQ(focal(0), 5);
  EXPECT_EQ(focal(1), 6);
  EXPECT_EQ(focal(2), 1.2);  // guessed
  Write("day2/queries.txt", "");
  EXPECT_THAT(Refusal({Session("day1"), Session("day2")}),
              HasSubstr("held-out images are given with their poses"));
}

TEST_F(JoinCapturesTest, OdometryOfSessionsWithoutPosesIsKeptUnderTheirNames) {
  const std::string image = "P5\n1 1\n255\nx";
  for (const std::string day : {"day1", "day2", "day3"}) Write(day + "/images/1.pgm", image);
  ASSERT_TRUE(Join({Session("day1"), Session("day2")}).ok());
  EXPECT_FALSE(ReadFile(Path("joined/odometry.txt")).ok());
  Write("day1/odometry.txt", "# names\n1.pgm 1 2 3  0 0 0 1\r\n");
  Write("day3/odometry.txt", "1.pgm 4 5 6 0 0 0 1\n");
  ASSERT_TRUE(Join({Session("day1"), Session("day2"), Session("day3")}).ok());
  EXPECT_EQ(*ReadFile(Path("joined/odometry.txt")), "day1/1.pgm 1 2 3 0 0 0 1\nday3/1.pgm 4 5 6 0 0 0 1\n");
}

TEST_F(JoinCapturesTest, ImusOfSessionsWithoutPosesAreKeptUnderTheirNames) {
  for (const std::string day : {"day1", "day2"}) Write(day + "/images/1.pgm", "P5\n1 1\n255\nx");
  ASSERT_TRUE(Join({Session("day1"), Session("day2")}).ok());
  EXPECT_FALSE(fs::exists(Path("joined/imu")));
  Write("day2/imu.csv", "5,0,0,0,0,0,9.8\n");
  ASSERT_TRUE(Join({Session("day1"), Session("day2")}).ok());
  EXPECT_EQ(*ReadFile(Path("joined/imu/day2.csv")), "5,0,0,0,0,0,9.8\n");
  EXPECT_FALSE(fs::exists(Path("joined/imu/day1.csv")));
  fs::remove(Path("day2/imu.csv"));
  ASSERT_TRUE(Join({Session("day1"), Session("day2")}).ok());
  EXPECT_FALSE(fs::exists(Path("joined/imu/day2.csv")));
}

TEST_F(JoinCapturesTest, SecondJoinTouchesOnlyWhatChanged) {
  WriteCapture("day1", "1 PINHOLE 8 6 5 5 4 3\n", Line(1, 1, "1.png"));
  WriteCapture("day2", "1 PINHOLE 8 6 5 5 4 3\n", Line(1, 1, "1.png"));
  Write("day2/queries.txt", Line(1, 1, "a b.png"));
  const std::vector<std::string> files = {"cameras.txt", "images.txt", "queries.txt", "frame.json",
                                          "sessions.txt"};
  ASSERT_TRUE(Join({Session("day1"), Session("day2")}).ok());
  const auto long_ago = fs::file_time_type::clock::now() - std::chrono::hours(1);
  for (const std::string& file : files) fs::last_write_time(Path("joined/" + file), long_ago);
  const auto dates_changed = [&] {
    std::vector<std::string> changed;
    for (const std::string& file : files) {
      if (!fs::exists(Path("joined/" + file)) || fs::last_write_time(Path("joined/" + file)) != long_ago)
        changed.push_back(file);
    }
    return changed;
  };
  ASSERT_TRUE(Join({Session("day1"), Session("day2")}).ok());
  EXPECT_THAT(dates_changed(), IsEmpty());

  // Another folder for day2, without queries.
  fs::rename(Path("day2"), Path("moved"));
  fs::remove(Path("moved/queries.txt"));
  ASSERT_TRUE(Join({Session("day1"), {.name = "day2", .root = Path("moved")}}).ok());
  EXPECT_THAT(dates_changed(), ElementsAre("queries.txt", "sessions.txt"));
  EXPECT_FALSE(fs::exists(Path("joined/queries.txt")));
  EXPECT_EQ(fs::read_symlink(Path("joined/images/day2")), Path("moved/images"));

  ASSERT_TRUE(Join({Session("day1")}).ok());
  EXPECT_FALSE(fs::is_symlink(Path("joined/images/day2")));
  EXPECT_TRUE(fs::exists(Path("moved/images/1.png")));
}

TEST_F(JoinCapturesTest, FramesAreJoinedAndOthersRegistered) {
  for (const char* name : {"day1", "day2", "day3"})
    WriteCapture(name, "1 PINHOLE 8 6 5 5 4 3\n", Line(1, 1, "1.png"));
  const auto frame = [&](const std::string& name, const CaptureFrame& f) {
    Write(name + "/frame.json", CaptureFrameJson(f));
  };
  const GeodeticPosition here = {.latitude_deg = 50, .longitude_deg = 8, .altitude_m = 100};
  frame("day1", {.scale_sigma_ratio = 0.001, .scale_centre = {1, 0, 0}});
  frame("day2", {.anchor = here,
                 .source = "gps",
                 .is_reconstructed = true,
                 .scale_sigma_ratio = 0.01,
                 .scale_centre = {2, 0, 0}});
  ASSERT_TRUE(Join({Session("day1"), Session("day2")}).ok());
  const auto joined = ReadCaptureFrame(Path("joined/frame.json"));
  ASSERT_TRUE(joined.ok());
  EXPECT_EQ(joined->source, "mixed");
  EXPECT_FALSE(joined->is_reconstructed);
  ASSERT_TRUE(joined->anchor);
  EXPECT_EQ(joined->anchor->longitude_deg, 8);
  EXPECT_EQ(joined->scale_sigma_ratio, 0.01);  // the worst one's
  EXPECT_EQ(joined->scale_centre.x(), 2);

  GeodeticPosition there = here;
  there.longitude_deg = 8.001;
  frame("day3", {.anchor = there});
  const auto other_origin = Join({Session("day1"), Session("day2"), Session("day3")});
  ASSERT_TRUE(other_origin.ok());
  EXPECT_EQ(other_origin->num_registered, 1);
  EXPECT_THAT(
      other_origin->warnings,
      ElementsAre(HasSubstr("'day3' (" + Path("day3") +
                            ") has its origin at 50.0000000, 8.0010000, 100.00 m, not 50.0000000, 8.0000000, "
                            "100.00 m: it is registered")));
  frame("day3", {.unit = "arbitrary", .source = "none"});
  const auto other_unit = Join({Session("day1"), Session("day3")});
  ASSERT_TRUE(other_unit.ok());
  EXPECT_THAT(other_unit->warnings, ElementsAre(HasSubstr("is in the unit arbitrary, not metre")));
  EXPECT_EQ(Text("joined/register.txt"), "day3\n");
}

TEST_F(JoinCapturesTest, SessionsThatAreNotInTheFrameAreListedForRegistration) {
  WriteCapture("old", "1 PINHOLE 1 1 5 5 4 3\n", Line(1, 1, "1.png"));
  Write("bare/images/1.pgm", "P5\n1 1\n255\nx");
  Write("bare/cameras.txt", "3 PINHOLE 1 1 6 6 0.5 0.5\n");
  Write("bare/odometry.txt", "1.pgm 1 2 3 0 0 0 1\n");
  WriteCapture("own", "1 PINHOLE 1 1 7 7 4 3\n", Line(1, 1, "1.png"));
  Write("own/queries.txt", Line(1, 1, "a b.png"));
  CaptureSession own = Session("own");
  own.is_registered = true;
  const auto joined = Join({Session("bare"), Session("old"), own});
  ASSERT_TRUE(joined.ok()) << joined.error().message;
  EXPECT_EQ(joined->num_registered, 2);
  EXPECT_EQ(joined->num_images, 1);
  EXPECT_EQ(joined->num_queries, 0);
  EXPECT_THAT(joined->warnings, ElementsAre(HasSubstr("own/queries.txt: not read: 'own' is registered")));
  EXPECT_EQ(Text("joined/register.txt"), "bare\nown\n");
  EXPECT_EQ(Text("joined/images.txt"), fmt::format("1 {} 1 old/1.png\n\n", kPose));
  EXPECT_EQ(Text("joined/poses/own.txt"), fmt::format("1 {} 2 own/1.png\n\n", kPose));
  EXPECT_EQ(Text("joined/odometry.txt"), "bare/1.pgm 1 2 3 0 0 0 1\n");

  const auto capture = ReadCapture(Path("joined"));
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  EXPECT_FALSE(capture->has_poses);
  EXPECT_THAT(capture->registered, ElementsAre("bare", "own"));
  ASSERT_EQ(capture->images.size(), 3u);
  EXPECT_EQ(capture->images[0].name, "bare/1.pgm");
  EXPECT_FALSE(capture->images[0].cam_from_world);
  EXPECT_EQ(capture->cameras.at(capture->images[0].camera_id).FocalX(), 6);
  EXPECT_EQ(capture->images[1].name, "old/1.png");
  EXPECT_TRUE(capture->images[1].cam_from_world);
  EXPECT_EQ(capture->cameras.at(capture->images[1].camera_id).FocalX(), 5);
  EXPECT_FALSE(capture->images[2].cam_from_world);
  EXPECT_EQ(capture->cameras.at(capture->images[2].camera_id).FocalX(), 7);
  ASSERT_EQ(capture->own_poses.size(), 1u);
  EXPECT_EQ(capture->own_poses.at("own/1.png").translation.x(), 0.35);
  EXPECT_EQ(capture->rejects.size(), 0u);

  own.queries_path = Path("own/queries.txt");
  EXPECT_THAT(Refusal({Session("old"), own}), HasSubstr("those of 'own' are in its own"));
  own.queries_path.clear();
  EXPECT_THAT(Refusal({Session("bare"), own}), HasSubstr("every capture with poses is to be registered"));

  Write("joined/poses/own.txt", Line(1, 2, "old/1.png"));
  EXPECT_EQ(ReadCapture(Path("joined")).error().code, ErrorCode::kCorrupt);
  Write("joined/register.txt", "old\n");
  EXPECT_THAT(ReadCapture(Path("joined")).error().message,
              HasSubstr("register.txt names old, whose image old/1.png"));
}

// One image of 'new' is a copy of one that is held out, one of one of the survey, and one of another of
// 'new'; 'own', which has poses of its own, has one of another session's.
TEST_F(JoinCapturesTest, CopiesOfOtherImagesAreNotRegistered) {
  const auto picture = [](char pixel) { return fmt::format("P5\n1 1\n255\n{}", pixel); };
  WriteCapture("old", "1 PINHOLE 1 1 5 5 4 3\n", Line(1, 1, "1.pgm"));
  Write("old/queries.txt", Line(1, 1, "2.pgm"));
  Write("old/images/1.pgm", picture('a'));
  Write("old/images/2.pgm", picture('b'));
  Write("new/3.pgm", picture('b'));
  Write("new/4.pgm", picture('a'));
  Write("new/5.pgm", picture('c'));
  Write("new/6.pgm", picture('c'));
  WriteCapture("own", "1 PINHOLE 1 1 7 7 4 3\n", Line(1, 1, "7.pgm") + Line(2, 1, "8.pgm"));
  Write("own/images/7.pgm", picture('a'));
  Write("own/images/8.pgm", picture('d'));
  CaptureSession own = Session("own");
  own.is_registered = true;
  ASSERT_TRUE(Join({Session("old"), Session("new"), own}).ok());
  const auto capture = ReadCapture(Path("joined"));
  ASSERT_TRUE(capture.ok()) << capture.error().message;
  std::vector<std::string> names;
  for (const CaptureImage& image : capture->images) names.push_back(image.name);
  EXPECT_THAT(names, ElementsAre("new/5.pgm", "old/1.pgm", "own/8.pgm"));
  EXPECT_EQ(capture->queries.size(), 1u);
  EXPECT_EQ(capture->own_poses.count("own/7.pgm"), 0u);
  std::map<std::string, std::string> reasons;
  for (const Reject& reject : capture->rejects) reasons.emplace(reject.name, reject.reason);
  EXPECT_EQ(reasons.size(), 4u);
  EXPECT_THAT(reasons["new/3.pgm"], HasSubstr("the same file as old/2.pgm, which is held out"));
  EXPECT_EQ(reasons["new/4.pgm"], "the same file as old/1.pgm: it says nothing more");
  EXPECT_THAT(reasons["new/6.pgm"], HasSubstr("as new/5.pgm"));
  EXPECT_THAT(reasons["own/7.pgm"], HasSubstr("as old/1.pgm"));
}

TEST_F(JoinCapturesTest, WhatCannotBeJoinedIsRefusedWithTheRemedy) {
  WriteCapture("posed", "1 PINHOLE 8 6 5 5 4 3\n", Line(1, 1, "1.png"));
  EXPECT_THAT(Refusal({Session("posed"), Session("posed")}), HasSubstr("two captures are named 'posed'"));
  EXPECT_THAT(Refusal({{.name = "a/b", .root = Path("posed")}}), HasSubstr("session 'a/b'"));
  EXPECT_THAT(Refusal({{.name = "a", .root = Path("none")}}, ErrorCode::kNotFound),
              HasSubstr("no such folder"));
  Write("joined/images.txt", "somebody's own");
  EXPECT_THAT(Refusal({Session("posed")}), HasSubstr("nothing shows that cairn made it"));
  EXPECT_EQ(Text("joined/images.txt"), "somebody's own");
}

TEST_F(JoinCapturesTest, ACaptureThatHasSessionsOfItsOwnIsNotReplaced) {
  WriteCapture("posed", "1 PINHOLE 8 6 5 5 4 3\n", Line(1, 1, "1.png"));
  Write("joined/sessions.txt", "day1\n");
  Write("joined/queries.txt", "mine");
  fs::create_directories(Path("joined/images"));
  fs::create_directory_symlink(Path("posed"), Path("joined/images/day1"));
  EXPECT_THAT(Refusal({Session("posed")}), HasSubstr("nothing shows that cairn made it"));
  EXPECT_EQ(Text("joined/queries.txt"), "mine");
  EXPECT_TRUE(fs::is_symlink(Path("joined/images/day1")));
}

TEST_F(JoinCapturesTest, SessionListsWithNamesThatAreNoneAreCorrupt) {
  Write("s/sessions.txt", "# days\nday1 /somewhere\n\nday2\n");
  EXPECT_THAT(ReadSessionsText(Path("s/sessions.txt")).value(), ElementsAre("day1", "day2"));
  Write("s/sessions.txt", "day1\n../day2\n");
  EXPECT_THAT(ReadSessionsText(Path("s/sessions.txt")).error().message,
              HasSubstr("sessions.txt:2: session '../day2'"));
  Write("s/sessions.txt", "day1\nday1\n");
  EXPECT_THAT(ReadSessionsText(Path("s/sessions.txt")).error().message, HasSubstr("is listed twice"));
}

}  // namespace
}  // namespace cairn
