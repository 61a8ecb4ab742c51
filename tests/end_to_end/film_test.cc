#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "core/base/quantiles.h"
#include "core/capture/capture.h"
#include "core/files/file.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr double kFramesPerSecond = 30;

// Renders a drive of small images that are as near to each other as those of a film, and encodes it.
void MakeFilm(const std::string& drive, const std::string& film) {
  const ProgramRun rendered = RunShell(
      "cairn stage simulate --survey driven --step-m 0.03 --max-turn-deg 2 --num-queries 0 --width-m 5.5 "
      "--depth-m 6 --num-rooms 2 --texel-m 0.006 --image-width-px 400 --image-height-px 300 --seed 5 "
      "--progress none -o " +
      drive);
  ASSERT_EQ(rendered.exit_code, 0) << rendered.err;
  const ProgramRun encoded = RunShell("ffmpeg -v error -y -framerate 30 -i " + drive +
                                      "/images/d%04d.jpg -c:v libx264 -pix_fmt yuv420p " + film);
  ASSERT_EQ(encoded.exit_code, 0) << encoded.err;
}

// Distances of the images of `capture`, named by their time, from where the frames of `drive` were taken,
// after the similarity that fits best; and the length of the way.  Metres.
struct FilmErrors {
  std::vector<double> errors_m;
  double way_m = 0;
};

FilmErrors CompareToDrive(const Capture& capture, const Capture& drive) {
  FilmErrors result;
  for (size_t i = 1; i < drive.images.size(); ++i) {
    result.way_m +=
        (drive.images[i].cam_from_world->Center() - drive.images[i - 1].cam_from_world->Center()).norm();
  }
  const auto num = static_cast<Eigen::Index>(capture.images.size());
  Eigen::Matrix3Xd found(3, num), truth(3, num);
  for (Eigen::Index i = 0; i < num; ++i) {
    const CaptureImage& image = capture.images[static_cast<size_t>(i)];
    const double time_s = std::stod(image.name);  // 000012.345.jpg
    found.col(i) = image.cam_from_world->Center();
    truth.col(i) =
        drive.images[static_cast<size_t>(std::lround(time_s * kFramesPerSecond))].cam_from_world->Center();
  }
  const Eigen::Matrix4d truth_from_found = Eigen::umeyama(found, truth);
  for (Eigen::Index i = 0; i < num; ++i) {
    result.errors_m.push_back(
        (truth_from_found.topRows<3>() * found.col(i).homogeneous() - truth.col(i)).norm());
  }
  return result;
}

TEST(Film, OfADriveCompilesToOneMapWithTheDrivesPoses) {
  TemporaryFolder folder("film_test");
  ASSERT_NO_FATAL_FAILURE(MakeFilm(folder / "drive", folder / "walk.mp4"));
  const auto compile = [&](const std::string& what) {
    return RunShell("cd " + folder.string() + " && cairn compile " + what + " --progress lines");
  };
  const ProgramRun first = compile("walk.mp4");
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_THAT(first.out, HasSubstr("walk.toml: the recipe of walk.mp4, with defaults"));
  EXPECT_TRUE(fs::exists(folder / "walk.cairn"));

  const Capture imported = ReadCapture(folder / "walk.build/film-walk").value();
  const Capture mapped = ReadCapture(folder / "walk.build/poses").value();
  const Capture drive = ReadCapture(folder / "drive").value();
  EXPECT_GT(drive.images.size(), 5 * imported.images.size());  // few keyframes
  EXPECT_GE(static_cast<double>(mapped.images.size()), 0.95 * static_cast<double>(imported.images.size()));
  const FilmErrors errors = CompareToDrive(mapped, drive);
  // The first images of a film may hang on few others.
  const auto num_right = std::count_if(errors.errors_m.begin(), errors.errors_m.end(),
                                       [&](double error_m) { return error_m < 0.01 * errors.way_m; });
  EXPECT_GE(static_cast<double>(num_right), 0.95 * static_cast<double>(errors.errors_m.size()));
  EXPECT_LT(Median(errors.errors_m), 0.001 * errors.way_m);

  // Nothing is redone as long as the film is the same ...
  EXPECT_THAT(compile("walk.mp4").out, HasSubstr("up to date"));
  // ... and one that was only touched is imported again, to the same images: their features and matches are
  // taken over, and nothing follows.
  fs::last_write_time(folder / "walk.mp4", fs::file_time_type::clock::now());
  const std::string manifest = *ReadFile(folder / "walk.build/film-walk/.cairn-folder");
  const ProgramRun touched = compile("walk.toml");
  EXPECT_THAT(touched.err, HasSubstr("walk.mp4 changed"));
  EXPECT_THAT(touched.err, testing::Not(HasSubstr("poses: ")));
  EXPECT_EQ(*ReadFile(folder / "walk.build/film-walk/.cairn-folder"), manifest);
  // What the recipe says of the film counts.
  ReplaceInFile(folder / "walk.toml", "path = \"walk.mp4\"", "path = \"walk.mp4\"\nkeyframes = 1\n");
  const ProgramRun other = compile("walk.toml --until import");
  EXPECT_EQ(other.exit_code, 0) << other.err;
  EXPECT_TRUE(fs::exists(folder / "walk.build/film-walk/images/000001.000.jpg"));
  EXPECT_LT(ReadCapture(folder / "walk.build/film-walk")->images.size(), imported.images.size());
  EXPECT_EQ(RunShell("cairn clean " + (folder / "walk.build")).exit_code, 0);
  EXPECT_FALSE(fs::exists(folder / "walk.build"));
}

TEST(Film, ThatCannotBeReadIsToldAndLeavesNoMap) {
  TemporaryFolder folder("bad_film_test");
  ASSERT_TRUE(WriteFileAtomically(folder / "text.mp4", "No film.\n").ok());
  const ProgramRun run = RunShell("cd " + folder.string() + " && cairn compile text.mp4 --progress none");
  EXPECT_EQ(run.exit_code, 4);
  EXPECT_THAT(run.err, HasSubstr("text.mp4: not a film that can be read"));
  EXPECT_THAT(run.err, HasSubstr("stage import failed"));
  EXPECT_FALSE(fs::exists(folder / "text.cairn"));
}

}  // namespace
}  // namespace cairn
