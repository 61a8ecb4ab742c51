#include "pipeline/exchange/film/import_film.h"

#include <filesystem>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "core/files/file.h"
#include "tests/pipeline/exchange/drawn_film.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

// Options for the frames that `cairn import --keyframes` names so.
FilmOptions Frames(const std::string& text) {
  const WantedFrames wanted = ParseFrameChoice(text).value();
  return {.choice = wanted.choice, .every_s = wanted.every_s};
}

class ImportFilmTest : public testing::Test {
 protected:
  void SetUp() override {
    root_ =
        testing::TempDir() + "/import_film_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(root_);
    fs::create_directories(root_);
  }
  void TearDown() override { fs::remove_all(root_); }
  std::string Path(const std::string& name) const { return root_ + "/" + name; }
  Result<FilmReport> Import(const std::string& film, const FilmOptions& options = {},
                            const std::string& capture = "capture", int num_threads = 1) const {
    NoProgress progress;
    return ImportFilm(Path(film), options, Path(capture), num_threads, progress);
  }
  // Its message; the capture is not there.
  Error ImportError(const std::string& film, const FilmOptions& options = {}) const {
    const auto report = Import(film, options, "refused");
    EXPECT_FALSE(report.ok());
    EXPECT_FALSE(fs::exists(Path("refused")));
    return report.ok() ? Error{} : report.error();
  }
  std::vector<std::string> Images(const std::string& capture = "capture") const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(Path(capture) + "/images"))
      names.push_back(entry.path().filename().string());
    std::sort(names.begin(), names.end());
    return names;
  }
  std::map<std::string, std::string> Bytes(const std::string& capture) const {
    std::map<std::string, std::string> bytes;
    for (const auto& entry : fs::recursive_directory_iterator(Path(capture))) {
      if (entry.is_regular_file())
        bytes[entry.path().lexically_relative(Path(capture))] = ReadFile(entry.path().string()).value();
    }
    return bytes;
  }
  std::string root_;
};

std::vector<cv::Mat> Joined(std::vector<cv::Mat> first, const std::vector<cv::Mat>& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

// 90 frames of 4 pixels each: 356 pixels, of which 38 (0.12 of 320) are the most between two images.
TEST_F(ImportFilmTest, KeyframesOfAWalkBecomeACaptureWithoutPoses) {
  EncodeFilm(Path("walk.mp4"), DrawnWalk(90, 4));
  const FilmReport report = Import("walk.mp4").value();
  EXPECT_EQ(report.frames.num_frames, 90);
  EXPECT_NEAR(report.duration_s, 89 / 30.0, 1e-3);
  EXPECT_EQ(report.width, 320);
  EXPECT_EQ(report.height, 240);
  EXPECT_THAT(report.warnings, IsEmpty());
  const std::vector<std::string> images = Images();
  EXPECT_EQ(images.size(), report.frames.num_keyframes);
  EXPECT_GE(images.size(), 10u);
  EXPECT_LE(images.size(), 18u);
  EXPECT_FALSE(fs::exists(Path("capture/cameras.txt")));
  EXPECT_TRUE(fs::exists(Path("capture/.cairn-folder")));
  // A name is the time, and the picture that of this time.
  const std::vector<cv::Mat> frames = DrawnWalk(90, 4);
  double last_s = -1;
  for (const std::string& name : images) {
    ASSERT_THAT(name, testing::MatchesRegex("0000[0-9][0-9][.][0-9][0-9][0-9][.]jpg"));
    const double time_s = std::stod(name.substr(0, 10));
    EXPECT_LE(time_s - last_s, last_s < 0 ? 2.0 : 14 / 30.0) << "neighbours share most of what they see";
    last_s = time_s;
    const cv::Mat image = cv::imread(Path("capture/images/" + name), cv::IMREAD_GRAYSCALE);
    const auto frame = static_cast<size_t>(std::lround(time_s * 30));
    EXPECT_LT(cv::norm(image, frames.at(frame), cv::NORM_L1) / static_cast<double>(image.total()), 3) << name;
  }
}

TEST_F(ImportFilmTest, SameFilesForAnyNumberOfThreads) {
  EncodeFilm(Path("walk.mkv"), DrawnWalk(60, 5));
  for (const int num_threads : {1, 2, 5}) {
    ASSERT_TRUE(Import("walk.mkv", {}, std::to_string(num_threads), num_threads).ok());
    EXPECT_EQ(Bytes(std::to_string(num_threads)), Bytes("1"));
  }
}

TEST_F(ImportFilmTest, FramesMayBeChosenByTime) {
  EncodeFilm(Path("walk.mp4"), DrawnWalk(60, 4));
  ASSERT_TRUE(Import("walk.mp4", Frames("0.5")).ok());
  EXPECT_THAT(Images(), ElementsAre("000000.000.jpg", "000000.500.jpg", "000001.000.jpg", "000001.500.jpg"));
  // Each third frame, although sums of 0.1 and times in units of a film do not meet exactly.
  ASSERT_TRUE(Import("walk.mp4", Frames("0.1"), "thirds").ok());
  EXPECT_THAT(Images("thirds"), testing::AllOf(SizeIs(20), Contains("000001.900.jpg")));
  ASSERT_TRUE(Import("walk.mp4", Frames("all"), "all").ok());
  EXPECT_THAT(Images("all"), SizeIs(60));
  for (const char* text : {"0", "-1", "nan", "inf", "often", ""})
    EXPECT_THAT(ParseFrameChoice(text).error().message, HasSubstr("must be auto, all, or the seconds"))
        << text;
}

TEST_F(ImportFilmTest, ACameraThatIsGivenIsOfTheUprightPicture) {
  EncodeFilm(Path("walk.mp4"), DrawnWalk(40, 6));
  ASSERT_TRUE(Import("walk.mp4", {.camera = "PINHOLE,320,240,250,250,160,120"}).ok());
  EXPECT_THAT(ReadFile(Path("capture/cameras.txt")).value(), HasSubstr("1 PINHOLE 320 240 250 250 160 120"));
  RunTool("ffmpeg -v error -y -i " + Path("walk.mp4") + " -c copy -metadata:s:v:0 rotate=90 " +
          Path("turned.mp4"));
  ASSERT_TRUE(Import("turned.mp4", {.camera = "PINHOLE,240,320,250,250,120,160"}, "turned").ok());
  EXPECT_THAT(ImportError("turned.mp4", {.camera = "PINHOLE,320,240,250,250,160,120"}).message,
              testing::AllOf(HasSubstr("240 x 320 pixels, but --camera has 320 x 240"),
                             HasSubstr("give the camera of the upright picture")));
  EXPECT_THAT(ImportError("walk.mp4", {.camera = "PINHOLE,640,480,250,250,320,240"}).message,
              Not(HasSubstr("upright")));
  EXPECT_THAT(ImportError("walk.mp4", {.camera = "HOLE,1"}).message, HasSubstr("HOLE"));
}

TEST_F(ImportFilmTest, TheFrameOfAScreenThatWasFilmedIsTold) {
  std::vector<cv::Mat> frames = DrawnWalk(90, 4);
  const cv::Mat border = frames.front().clone();
  const cv::Rect screen(80, 40, 190, 160);
  for (cv::Mat& frame : frames) {
    const cv::Mat picture = frame(screen).clone();
    frame = border.clone();
    picture.copyTo(frame(screen));
  }
  EncodeFilm(Path("screen.mp4"), frames);
  EXPECT_THAT(Import("screen.mp4").value().warnings,
              ElementsAre(AllOf(HasSubstr("a part of the picture stands still"), HasSubstr("crop"))));
}

TEST_F(ImportFilmTest, ACutIsToldAndBeginsANewPart) {
  EncodeFilm(Path("cut.mp4"), Joined(DrawnWalk(45, 4, 1), DrawnWalk(45, 4, 2)));
  const FilmReport report = Import("cut.mp4").value();
  EXPECT_THAT(report.frames.cuts, ElementsAre(45));
  EXPECT_THAT(report.warnings,
              ElementsAre(HasSubstr("nothing of what was seen before is seen at 1.5 s: cuts")));
  EXPECT_GE(Images().size(), 10u);
}

TEST_F(ImportFilmTest, ACameraThatStandsIsTold) {
  // The noise of a sensor is no motion.
  std::vector<cv::Mat> frames;
  cv::RNG random(7);
  for (int i = 0; i < 60; ++i) {
    cv::Mat noise(240, 320, CV_16SC1), frame;
    random.fill(noise, cv::RNG::NORMAL, 0, 3);
    cv::add(DrawnWalk(1, 0)[0], noise, frame, cv::noArray(), CV_8U);
    frames.push_back(frame);
  }
  EncodeFilm(Path("still.mp4"), frames);
  const Error error = ImportError("still.mp4");
  EXPECT_EQ(error.code, ErrorCode::kNoData);
  EXPECT_THAT(error.message, HasSubstr("the camera never moves: 60 frames in 2.0 s show the same"));
  ASSERT_TRUE(Import("still.mp4", Frames("all")).ok());
}

TEST_F(ImportFilmTest, RepeatedFramesAddNothing) {
  std::vector<cv::Mat> twice;
  for (const cv::Mat& frame : DrawnWalk(40, 6)) twice.insert(twice.end(), 2, frame);
  EncodeFilm(Path("once.mkv"), DrawnWalk(40, 6), "-c:v ffv1 -pix_fmt gray");
  EncodeFilm(Path("twice.mkv"), twice, "-c:v ffv1 -pix_fmt gray");
  const FilmReport once = Import("once.mkv").value();
  const FilmReport report = Import("twice.mkv", {}, "twice").value();
  EXPECT_EQ(report.frames.num_repeated, 40);
  EXPECT_EQ(report.frames.num_keyframes, once.frames.num_keyframes);
}

TEST_F(ImportFilmTest, BlackFramesAreNoImages) {
  const std::vector<cv::Mat> black(20, cv::Mat(240, 320, CV_8UC1, cv::Scalar(16)));
  const std::vector<cv::Mat> walk = DrawnWalk(40, 5);
  EncodeFilm(Path("black.mp4"), black);
  EXPECT_THAT(ImportError("black.mp4").message, HasSubstr("20 frames, all of them black or of one colour"));
  EncodeFilm(Path("begins_black.mp4"), Joined(Joined(black, walk), black));
  const FilmReport report = Import("begins_black.mp4").value();
  EXPECT_EQ(report.frames.num_blank, 40);
  EXPECT_THAT(report.frames.cuts, IsEmpty());
  for (const std::string& name : Images()) {
    EXPECT_GE(std::stod(name.substr(0, 10)), 20 / 30.0 - 1e-3);
    EXPECT_LE(std::stod(name.substr(0, 10)), 59 / 30.0 + 1e-3);
  }
}

TEST_F(ImportFilmTest, FewFramesAreTakenAndOneIsRefused) {
  EncodeFilm(Path("two.mp4"), DrawnWalk(2, 60));
  EXPECT_EQ(Import("two.mp4").value().frames.num_keyframes, 2);
  EncodeFilm(Path("one.mp4"), DrawnWalk(1, 0));
  EXPECT_THAT(ImportError("one.mp4").message, HasSubstr("one.mp4: one frame; a map needs a film of a walk"));
}

TEST_F(ImportFilmTest, FramesThatChangeTheirSizeAreTakenOrLeftOut) {
  std::vector<cv::Mat> small;
  for (const cv::Mat& frame : DrawnWalk(40, 5)) small.push_back(frame(cv::Rect(0, 0, 160, 120)));
  EncodeFilm(Path("a.ts"), DrawnWalk(40, 5), "-c:v libx264 -pix_fmt yuv420p");
  EncodeFilm(Path("b.ts"), small, "-c:v libx264 -pix_fmt yuv420p -output_ts_offset 1.4");
  RunTool("cat " + Path("a.ts") + " " + Path("b.ts") + " > " + Path("both.ts"));
  const FilmReport report = Import("both.ts").value();
  EXPECT_EQ(report.frames.num_frames, 80);
  std::map<int, int> num_of_width;
  for (const std::string& name : Images()) {
    num_of_width[cv::imread(Path("capture/images/" + name)).cols]++;
  }
  EXPECT_GE(num_of_width[320], 4);
  EXPECT_GE(num_of_width[160], 6);
  // With a camera, only its pictures.
  const FilmReport known = Import("both.ts", {.camera = "PINHOLE,320,240,250,250,160,120"}, "known").value();
  EXPECT_EQ(known.frames.num_frames, 40);
  EXPECT_THAT(known.warnings, Contains(HasSubstr("40 frames are of another size than --camera")));
}

TEST_F(ImportFilmTest, AFilmThatWasCutOffGivesWhatIsThereWithAWarning) {
  for (const char* name : {"a.mp4", "a.mkv"}) {
    EncodeFilm(Path(name), DrawnWalk(240, 4), "-c:v libx264 -pix_fmt yuv420p -movflags +faststart");
    fs::resize_file(Path(name), fs::file_size(Path(name)) / 2);
    const FilmReport report = Import(name, {}, std::string(name) + ".capture").value();
    EXPECT_GE(report.frames.num_keyframes, 5) << name;
    EXPECT_LT(report.frames.num_frames, 200) << name;
    EXPECT_THAT(report.warnings, Contains(HasSubstr("says that it is 8.0 s long, but its frames end after")))
        << name;
  }
}

TEST_F(ImportFilmTest, AGapIsTold) {
  EncodeFilm(Path("gap.mp4"), DrawnWalk(60, 4),
             "-vf \"setpts='(N+if(gte(N,30),60,0))/30/TB'\" -vsync vfr -c:v libx264 -pix_fmt yuv420p");
  const FilmReport report = Import("gap.mp4").value();
  EXPECT_EQ(report.frames.num_frames, 60);
  EXPECT_THAT(report.warnings, ElementsAre(HasSubstr("frames are missing after 1.0 s")));
}

// A blurred frame among sharp ones is passed over.
TEST_F(ImportFilmTest, BlurredFramesAreNoImages) {
  std::vector<cv::Mat> frames = DrawnWalk(80, 4);
  for (size_t i = 0; i < frames.size(); ++i) {
    if (i % 4 != 2) continue;
    frames[i] = frames[i].clone();
    cv::blur(frames[i], frames[i], {9, 1});
  }
  EncodeFilm(Path("shaken.mp4"), frames);
  const FilmReport report = Import("shaken.mp4").value();
  EXPECT_NEAR(static_cast<double>(report.frames.num_blurred), 20, 2);
  for (const std::string& name : Images())
    EXPECT_NE(std::lround(std::stod(name.substr(0, 10)) * 30) % 4, 2) << name;
}

TEST_F(ImportFilmTest, ACaptureThatSomeoneChangedIsNotReplaced) {
  EncodeFilm(Path("walk.mp4"), DrawnWalk(30, 6));
  ASSERT_TRUE(Import("walk.mp4").ok());
  ASSERT_TRUE(Import("walk.mp4").ok()) << "the same again";
  ASSERT_TRUE(WriteFileAtomically(Path("capture/notes.txt"), "mine").ok());
  const auto again = Import("walk.mp4", Frames("all"));
  ASSERT_FALSE(again.ok());
  EXPECT_THAT(again.error().message, HasSubstr("notes.txt"));
  EXPECT_TRUE(fs::exists(Path("capture/notes.txt")));
}

}  // namespace
}  // namespace cairn::pipeline
