#include "core/capture/film_file.h"

#include <unistd.h>

#include <filesystem>

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/files/file.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

class FilmFileTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / fmt::format("film_file_test_{}", getpid());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string Write(const std::string& name, const std::string& bytes) const {
    EXPECT_TRUE(WriteFileAtomically((folder_ / name).string(), bytes).ok());
    return (folder_ / name).string();
  }
  fs::path folder_;
};

TEST_F(FilmFileTest, AFilmIsKnownByItsFirstBytes) {
  using namespace std::string_literals;
  EXPECT_TRUE(IsFilm(Write("mp4", "\0\0\0\x20"s + "ftypisom\0\0\2\0"s)));
  EXPECT_TRUE(IsFilm(Write("old_quicktime", "\0\0\0\x08"s + "wide\0\0\1\0mdat"s)));
  EXPECT_TRUE(IsFilm(Write("matroska", "\x1a\x45\xdf\xa3\x01\0\0\0\0\0\0\x23"s)));
  EXPECT_TRUE(IsFilm(Write("avi", "RIFF\x10\0\0\0AVI LIST"s)));
  EXPECT_FALSE(IsFilm(Write("sound", "RIFF\x10\0\0\0WAVEfmt "s)));
  EXPECT_FALSE(IsFilm(Write("image", "\xff\xd8\xff\xe0\0\x10JFIF\0"s)));
  EXPECT_FALSE(IsFilm(Write("recipe.toml", "name = \"ftyp\"\n")));
  EXPECT_FALSE(IsFilm(Write("short", "\x1a\x45"s)));
  EXPECT_FALSE(IsFilm(Write("empty", "")));
}

// Then what it is not is told of a film.
TEST_F(FilmFileTest, AFilmIsKnownByItsName) {
  for (const char* name : {"a.mp4", "a.MOV", "a.mkv", "a.WebM", "a.avi"})
    EXPECT_TRUE(IsFilm(Write(name, "text"))) << name;
  EXPECT_FALSE(IsFilm(Write("mp4", "text")));
  EXPECT_FALSE(IsFilm(Write("a.mp4.txt", "text")));
}

TEST_F(FilmFileTest, WhatIsNoFileIsNoFilm) {
  fs::create_directories(folder_ / "folder.mp4");
  EXPECT_FALSE(IsFilm((folder_ / "folder.mp4").string()));
  EXPECT_FALSE(IsFilm((folder_ / "none.mp4").string()));
  fs::create_symlink("none.mp4", folder_ / "link.mp4");
  EXPECT_FALSE(IsFilm((folder_ / "link.mp4").string()));
}

}  // namespace
}  // namespace cairn
