#include "core/files/input_file.h"

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/capture/capture.h"
#include "core/capture/exif.h"
#include "core/files/database.h"
#include "core/files/file.h"
#include "core/images/image_file.h"
#include "core/options/toml_options.h"
#include "core/plan/views_database.h"
#include "core/world/world.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class InputFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / fmt::format("input_file_test_{}", getpid());
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "folder");
    ASSERT_TRUE(WriteFileAtomically(Path("file"), "text").ok());
    ASSERT_EQ(mkfifo(Path("pipe").c_str(), 0600), 0);
    fs::create_symlink("file", Path("link"));
    fs::create_symlink("pipe", Path("link_to_pipe"));
    fs::create_symlink("nowhere", Path("link_to_nothing"));
    sockaddr_un address = {.sun_family = AF_UNIX};
    const int socket_fd = socket(AF_UNIX, SOCK_STREAM, 0);
    Path("socket").copy(address.sun_path, sizeof(address.sun_path) - 1);
    ASSERT_EQ(bind(socket_fd, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
    close(socket_fd);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }

  fs::path folder_;
};

TEST_F(InputFile, FilesAreReadThroughLinks) {
  for (const char* name : {"file", "link"}) {
    EXPECT_TRUE(CheckInputFile(Path(name)).ok());
    EXPECT_EQ(ReadFile(Path(name)).value(), "text");
  }
}

TEST_F(InputFile, WhatIsNoFileIsNamedAndNotOpened) {
  const auto refusal = [&](const std::string& path, ErrorCode code) {
    const Result<std::string> contents = ReadFile(path);
    EXPECT_FALSE(contents.ok());
    if (contents.ok()) return std::string();
    EXPECT_EQ(contents.error().code, code);
    return contents.error().message;
  };
  EXPECT_THAT(refusal(Path("pipe"), ErrorCode::kInvalidArgument),
              HasSubstr("pipe: is a pipe, expected a file"));
  EXPECT_THAT(refusal(Path("link_to_pipe"), ErrorCode::kInvalidArgument), HasSubstr("is a pipe"));
  EXPECT_THAT(refusal(Path("socket"), ErrorCode::kInvalidArgument), HasSubstr("is a socket"));
  EXPECT_THAT(refusal("/dev/null", ErrorCode::kInvalidArgument), HasSubstr("is a device"));
  EXPECT_THAT(refusal(Path("folder"), ErrorCode::kNotFound), HasSubstr("is a folder"));
  EXPECT_THAT(refusal(Path("none"), ErrorCode::kNotFound), HasSubstr("no such file"));
  EXPECT_THAT(refusal(Path("link_to_nothing"), ErrorCode::kNotFound),
              HasSubstr("a link to a file that does not exist"));
  EXPECT_THAT(refusal(Path("file/inside"), ErrorCode::kNotFound), HasSubstr("no such file"));
}

TEST_F(InputFile, FilesOfAnySizeAreReadWhole) {
  for (const size_t size : {0, 1, 4095, 4096, 4097, 1 << 20}) {
    std::string text(size, 'x');
    for (size_t i = 0; i < size; ++i) text[i] = static_cast<char>(i % 251);
    std::ofstream(Path("sized"), std::ios::binary) << text;
    EXPECT_EQ(ReadFile(Path("sized")).value(), text) << size;
  }
  // Said to have no bytes, and more than fit at first.
  const std::string mounts = ReadFile("/proc/self/status").value();
  EXPECT_THAT(mounts, HasSubstr("Name:"));
  EXPECT_EQ(mounts.back(), '\n');
  std::ifstream kallsyms("/proc/kallsyms", std::ios::binary);
  const std::string symbols{std::istreambuf_iterator<char>(kallsyms), {}};
  EXPECT_EQ(ReadFile("/proc/kallsyms").value().size(), symbols.size());
}

// Each of these would wait forever for a writer of the pipe.
TEST_F(InputFile, NoReaderWaitsForAPipe) {
  const std::string pipe = Path("pipe");
  EXPECT_THAT(ReadWorld(pipe).error().message, HasSubstr("is a pipe"));
  EXPECT_THAT(ReadTomlFile(pipe).error().message, HasSubstr("is a pipe"));
  EXPECT_THAT(CheckSqliteFile(pipe).error().message, HasSubstr("is a pipe"));
  EXPECT_THAT(ReadGreyImage(pipe).error().message, HasSubstr("is a pipe"));
  EXPECT_THAT(ReadViews(pipe).error().message, HasSubstr("is a pipe"));
  EXPECT_FALSE(IsSqliteFile(pipe));
  EXPECT_EQ(ReadSqliteHeader(pipe).page_size, 0u);
  EXPECT_EQ(ReadExif(pipe).focal_length_35mm_mm, 0);
}

TEST_F(InputFile, NoListOfACaptureWaitsForAPipe) {
  for (const std::string list : {"images.txt", "cameras.txt", "queries.txt", "sessions.txt", "frame.json"}) {
    const std::string capture = Path("capture_" + list);
    fs::create_directories(capture + "/images");
    ASSERT_TRUE(WriteFileAtomically(capture + "/images/a.pgm", "P5\n1 1\n255\nx").ok());
    ASSERT_TRUE(WriteFileAtomically(capture + "/cameras.txt", "1 PINHOLE 1 1 1 1 0.5 0.5\n").ok());
    ASSERT_TRUE(WriteFileAtomically(capture + "/images.txt", "1 1 0 0 0 0 0 0 1 a.pgm\n\n").ok());
    EXPECT_TRUE(ReadCapture(capture).ok());
    fs::remove(capture + "/" + list);
    ASSERT_EQ(mkfifo((capture + "/" + list).c_str(), 0600), 0);
    const auto read = ReadCapture(capture);
    ASSERT_FALSE(read.ok()) << list;
    EXPECT_THAT(read.error().message, HasSubstr(list + ": is a pipe, expected a file"));
  }
}

}  // namespace
}  // namespace cairn
