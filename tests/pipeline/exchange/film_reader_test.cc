#include "pipeline/exchange/film/film_reader.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "tests/pipeline/exchange/drawn_film.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;
using testing::DoubleNear;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pointwise;

class FilmReaderTest : public testing::Test {
 protected:
  void SetUp() override {
    root_ =
        testing::TempDir() + "/film_reader_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(root_);
    fs::create_directories(root_);
  }
  void TearDown() override { fs::remove_all(root_); }
  std::string Path(const std::string& name) const { return root_ + "/" + name; }

  std::vector<FilmFrame> Frames(const std::string& name, int64_t* num_damaged = nullptr) const {
    std::vector<FilmFrame> frames;
    auto reader = FilmReader::Open(Path(name));
    EXPECT_TRUE(reader.ok()) << (reader.ok() ? "" : reader.error().message);
    while (reader.ok()) {
      auto frame = (*reader)->Next();
      EXPECT_TRUE(frame.ok()) << (frame.ok() ? "" : frame.error().message);
      if (!frame.ok() || !frame->has_value()) break;
      frames.push_back(std::move(**frame));
    }
    if (num_damaged != nullptr && reader.ok()) *num_damaged = (*reader)->num_damaged();
    return frames;
  }
  Error OpenError(const std::string& name) const {
    const auto reader = FilmReader::Open(Path(name));
    return reader.ok() ? Error{} : reader.error();
  }
  void Write(const std::string& name, const std::string& bytes) const {
    ASSERT_TRUE(WriteFileAtomically(Path(name), bytes).ok());
  }
  std::string root_;
};

std::vector<double> Times(const std::vector<FilmFrame>& frames) {
  std::vector<double> times;
  for (const FilmFrame& frame : frames) times.push_back(frame.time_s);
  return times;
}

// Mean of a quarter of a picture: 0 left, 1 top, 2 right, 3 bottom edge.
double MeanAt(const cv::Mat& grey, int edge) {
  const int w = grey.cols, h = grey.rows;
  const cv::Rect edges[] = {
      {0, 0, w / 4, h}, {0, 0, w, h / 4}, {w - w / 4, 0, w / 4, h}, {0, h - h / 4, w, h / 4}};
  return cv::mean(grey(edges[edge]))[0];
}

TEST_F(FilmReaderTest, FramesHaveTheTimesThatTheFilmStates) {
  // The first four frames come at 10 a second, the others at 3 a second.
  const std::vector<double> stated = {0, 0.1, 0.2, 0.3, 19 / 30.0, 29 / 30.0, 1.3, 49 / 30.0};
  const std::string times = "-vf \"setpts='if(lt(N,4),3*N,9+10*(N-3))/30/TB'\" -vsync vfr ";
  const std::vector<cv::Mat> frames = DrawnWalk(8, 4);
  const std::pair<const char*, const char*> kinds[] = {
      {"a.mp4", "-c:v libx264 -pix_fmt yuv420p -bf 2"},
      {"a.mov", "-c:v libx264 -pix_fmt yuv420p"},
      {"a.mkv", "-c:v libx264 -pix_fmt yuv420p -bf 2"},
      {"a.webm", "-c:v libvpx"},
      {"a.ts", "-c:v libx264 -pix_fmt yuv420p -output_ts_offset 5"}};
  for (const auto& [name, codec] : kinds) {
    EncodeFilm(Path(name), frames, times + codec);
    EXPECT_THAT(Times(Frames(name)), Pointwise(DoubleNear(0.0011), stated)) << name;
  }
}

TEST_F(FilmReaderTest, TimesThatCannotBeAreOneIntervalAfterTheLast) {
  EncodeFilm(Path("years.mkv"), DrawnWalk(6, 4),
             "-vf \"setpts='if(lt(N,3),N,N+1e12)'\" -vsync vfr -c:v libx264 -pix_fmt yuv420p -bf 0");
  const std::vector<double> times = Times(Frames("years.mkv"));
  ASSERT_GE(times.size(), 4u);
  for (size_t i = 1; i < times.size(); ++i) {
    EXPECT_GT(times[i], times[i - 1]);
    EXPECT_LT(times[i], 10);
  }
}

TEST_F(FilmReaderTest, AnAviHasAFrameAtEveryInterval) {
  EncodeFilm(Path("a.avi"), DrawnWalk(5, 4), "-c:v mpeg4 -q:v 2");
  EXPECT_THAT(Times(Frames("a.avi")),
              Pointwise(DoubleNear(1e-4), {0.0, 1 / 30.0, 2 / 30.0, 3 / 30.0, 4 / 30.0}));
}

TEST_F(FilmReaderTest, PicturesAreUprightAsTheFilmStates) {
  cv::Mat frame(120, 160, CV_8UC1, cv::Scalar(40));
  frame(cv::Rect(0, 0, 40, 120)).setTo(200);  // the left edge is bright
  EncodeFilm(Path("0.mp4"), {frame, frame});
  // ffmpeg 5 copies rotate=90 as 90 degrees anticlockwise, and turns pictures so itself: the left edge comes
  // to the bottom.
  const int kBrightEdge[] = {0, 3, 2, 1};
  for (int quarters = 0; quarters < 4; ++quarters) {
    const std::string name = "turned" + std::to_string(quarters) + ".mp4";
    RunTool("ffmpeg -v error -y -i " + Path("0.mp4") +
            " -c copy -metadata:s:v:0 rotate=" + std::to_string(90 * quarters) + " " + Path(name));
    const auto frames = Frames(name);
    ASSERT_EQ(frames.size(), 2u);
    EXPECT_EQ(frames[0].grey.size(), quarters % 2 == 1 ? cv::Size(120, 160) : cv::Size(160, 120));
    for (int edge = 0; edge < 4; ++edge) {
      const bool is_bright = edge == kBrightEdge[quarters];
      if (is_bright) {
        EXPECT_NEAR(MeanAt(frames[0].grey, edge), 200, 3) << quarters;
      } else {
        EXPECT_LT(MeanAt(frames[0].grey, edge), 100) << quarters << " " << edge;
      }
    }
  }
}

TEST_F(FilmReaderTest, PixelsBecomeSquare) {
  EncodeFilm(Path("wide.mp4"), DrawnWalk(2, 4), "-c:v libx264 -pix_fmt yuv420p -vf setsar=3/2");
  EncodeFilm(Path("high.mkv"), DrawnWalk(2, 4), "-c:v libx264 -pix_fmt yuv420p -vf setsar=2/3");
  EXPECT_EQ(Frames("wide.mp4")[0].grey.size(), cv::Size(480, 240));
  EXPECT_EQ(Frames("high.mkv")[0].grey.size(), cv::Size(320, 360));
}

// Luma of 16 .. 235, of 0 .. 255, of ten bits, and colours without luma: the same greys.
TEST_F(FilmReaderTest, GreysAreThoseOfTheFramesWhateverThePixels) {
  cv::Mat frame(64, 96, CV_8UC1);
  for (int x = 0; x < frame.cols; ++x) frame.col(x).setTo(8 + 2.5 * x);
  const std::pair<const char*, const char*> kinds[] = {{"tv.mkv", "-c:v libx264 -qp 0 -pix_fmt yuv420p"},
                                                       {"full.avi", "-c:v mjpeg -pix_fmt yuvj420p -q:v 1"},
                                                       {"ten.mkv", "-c:v libx264 -qp 0 -pix_fmt yuv420p10le"},
                                                       {"rgb.mkv", "-c:v ffv1 -pix_fmt bgr0"},
                                                       {"grey.mkv", "-c:v ffv1 -pix_fmt gray"}};
  for (const auto& [name, options] : kinds) {
    EncodeFilm(Path(name), {frame, frame}, options);
    const auto frames = Frames(name);
    ASSERT_EQ(frames.size(), 2u) << name;
    EXPECT_LE(cv::norm(frames[1].grey, frame, cv::NORM_INF), 3) << name;
  }
}

TEST_F(FilmReaderTest, AFilmThatWasCutOffGivesItsWholeFrames) {
  const std::vector<cv::Mat> frames = DrawnWalk(90, 4);
  const std::pair<const char*, const char*> kinds[] = {
      {"a.mp4", "-c:v libx264 -pix_fmt yuv420p -bf 0 -movflags +faststart"},
      {"a.mkv", "-c:v libx264 -pix_fmt yuv420p -bf 0"},
      {"a.avi", "-c:v mpeg4 -q:v 2"}};
  for (const auto& [name, options] : kinds) {
    EncodeFilm(Path(name), frames, options);
    const std::vector<FilmFrame> whole = Frames(name);
    ASSERT_EQ(whole.size(), 90u) << name;
    fs::resize_file(Path(name), fs::file_size(Path(name)) * 3 / 5);
    const std::vector<FilmFrame> cut = Frames(name);
    EXPECT_GT(cut.size(), 30u) << name;
    EXPECT_LT(cut.size(), 75u) << name;
    for (size_t i = 0; i < cut.size(); ++i)
      ASSERT_EQ(cv::norm(cut[i].grey, whole[i].grey, cv::NORM_INF), 0)
          << name << ": frame " << i << " is not whole";
  }
}

// Whatever the bytes: frames, or an error.
TEST_F(FilmReaderTest, DamagedFilmsHaveAnEnd) {
  const std::pair<const char*, const char*> kinds[] = {{"a.mp4", "-c:v libx264 -pix_fmt yuv420p"},
                                                       {"a.mkv", "-c:v libx264 -pix_fmt yuv420p"},
                                                       {"a.webm", "-c:v libvpx"},
                                                       {"a.avi", "-c:v mpeg4"}};
  cv::RNG random(5);
  for (const auto& [name, options] : kinds) {
    EncodeFilm(Path(name), DrawnWalk(12, 4), options);
    const std::string whole = ReadFile(Path(name)).value();
    for (int trial = 0; trial < 25; ++trial) {
      std::string bytes = whole;
      // Half of them in the head, where the structure is.
      const size_t range = trial % 2 == 0 ? std::min<size_t>(1000, bytes.size()) : bytes.size();
      for (int i = 0; i < 8; ++i)
        bytes[static_cast<size_t>(random.uniform(0, static_cast<int>(range)))] =
            static_cast<char>(random.uniform(0, 256));
      Write(std::string("damaged_") + name, bytes);
      const auto reader = FilmReader::Open(Path(std::string("damaged_") + name));
      int num_frames = 0;
      double last_s = -1;
      while (reader.ok()) {
        const auto frame = (*reader)->Next();
        if (!frame.ok() || !frame->has_value()) break;
        EXPECT_GT((*frame)->time_s, last_s) << name << " " << trial;
        last_s = (*frame)->time_s;
        ASSERT_LE(++num_frames, 100) << name << " " << trial;
      }
    }
  }
}

TEST_F(FilmReaderTest, SaysWhatAFileIsThatIsNoFilm) {
  EXPECT_EQ(OpenError("none.mp4").code, ErrorCode::kNotFound);
  Write("empty.mp4", "");
  EXPECT_EQ(OpenError("empty.mp4").code, ErrorCode::kEmptyFile);
  EXPECT_THAT(OpenError("empty.mp4").message, HasSubstr("zero bytes"));
  Write("text.mp4", std::string(3000, 'a') + "\nThis is no film.\n");
  EXPECT_EQ(OpenError("text.mp4").code, ErrorCode::kCorrupt);
  EXPECT_THAT(OpenError("text.mp4").message, HasSubstr("text.mp4: not a film that can be read"));
  RunTool("ffmpeg -v error -y -f lavfi -i sine=duration=1 -c:a aac " + Path("sound.mp4"));
  EXPECT_EQ(OpenError("sound.mp4").code, ErrorCode::kNoData);
  EXPECT_THAT(OpenError("sound.mp4").message, HasSubstr("no video in it, only sound"));
  EncodeFilm(Path("whole.mp4"), DrawnWalk(30, 4));
  const std::string bytes = ReadFile(Path("whole.mp4")).value();
  Write("cut.mp4", bytes.substr(0, bytes.size() / 2));
  EXPECT_EQ(OpenError("cut.mp4").code, ErrorCode::kCorrupt);
  EXPECT_THAT(OpenError("cut.mp4").message, HasSubstr("a film without its index"));
}

// A playlist would make the reader open what it names.
TEST_F(FilmReaderTest, OpensNoFileThatAFilmNames) {
  EncodeFilm(Path("real.ts"), DrawnWalk(30, 4), "-c:v mpeg2video");
  Write("list.mp4", "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nreal.ts\n#EXT-X-ENDLIST\n");
  EXPECT_EQ(OpenError("list.mp4").code, ErrorCode::kCorrupt);
  Write("concat.mp4", "ffconcat version 1.0\nfile real.ts\n");
  EXPECT_EQ(OpenError("concat.mp4").code, ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace cairn::pipeline
