#include "core/files/temporary.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file_descriptor.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

std::string Read(const ScratchFile& file, uint64_t offset, size_t num_bytes) {
  std::string bytes(num_bytes, '?');
  EXPECT_TRUE(file.Read(offset, bytes.data(), num_bytes).ok());
  return bytes;
}

TEST(TemporariesOf, AreThoseOfATargetAlone) {
  const std::string folder = testing::TempDir() + "/temporaries";
  fs::remove_all(folder);
  EXPECT_THAT(TemporariesOf(folder + "/map"), testing::IsEmpty());  // no folder
  fs::create_directory(folder);
  for (const char* name : {"map", "map.tmp-12-0f", "map.tmp-7", "map.tmp-7-journal", "map.tmp-",
                           "map.previous", "map.previous.tmp-7", "amap.tmp-7"})
    std::ofstream(folder + "/" + name) << "x";
  EXPECT_THAT(
      TemporariesOf(folder + "/map"),
      testing::ElementsAre(folder + "/map.tmp-12-0f", folder + "/map.tmp-7", folder + "/map.tmp-7-journal"));
  EXPECT_THAT(TemporariesOf(folder + "/map.previous"), testing::ElementsAre(folder + "/map.previous.tmp-7"));
  const fs::path before = fs::current_path();
  fs::current_path(folder);
  EXPECT_THAT(TemporariesOf("map.previous"), testing::ElementsAre("map.previous.tmp-7"));
  fs::current_path(before);
  fs::remove_all(folder);
}

TEST(ScratchFile, GivesBackWhatWasAppendedAndLeavesNothing) {
  const std::string folder = testing::TempDir() + "/scratch";
  fs::remove_all(folder);
  fs::create_directory(folder);
  {
    ScratchFile file(folder + "/output");
    EXPECT_TRUE(fs::is_empty(folder));
    ASSERT_TRUE(file.Append("some", 4).ok());
    ASSERT_TRUE(file.Append(" bytes", 6).ok());
    EXPECT_EQ(file.num_bytes(), 10u);
    EXPECT_EQ(Read(file, 0, 10), "some bytes");
    EXPECT_EQ(Read(file, 5, 3), "byt");
    EXPECT_TRUE(fs::is_empty(folder)) << "the file has no name";
    ScratchFile moved = std::move(file);
    ASSERT_TRUE(moved.Append("!", 1).ok());
    EXPECT_EQ(Read(moved, 9, 2), "s!");
  }
  EXPECT_TRUE(fs::is_empty(folder));
}

TEST(ScratchFile, SaysBesideWhatItCannotBeWrittenOrRead) {
  ScratchFile nowhere("/nowhere/output");
  const Status status = nowhere.Append("x", 1);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kIo);
  EXPECT_THAT(status.error().message, HasSubstr("/nowhere/output"));
  EXPECT_EQ(nowhere.num_bytes(), 0u);
  ScratchFile file(testing::TempDir() + "/output");
  ASSERT_TRUE(file.Append("x", 1).ok());
  char byte;
  const Status beyond = file.Read(1, &byte, 1);
  ASSERT_FALSE(beyond.ok());
  EXPECT_THAT(beyond.error().message, HasSubstr(testing::TempDir() + "/output"));
}

TEST(FileDescriptor, AllBytesAreReadAndWrittenOrItSaysWhyNot) {
  const std::string path = testing::TempDir() + "/all_at";
  std::ofstream(path) << "0123456789";
  const FileDescriptor file(open(path.c_str(), O_RDWR));
  std::string bytes(4, '?');
  ASSERT_TRUE(ReadAllAt(file.get(), bytes.data(), 4, 6));
  EXPECT_EQ(bytes, "6789");
  EXPECT_FALSE(ReadAllAt(file.get(), bytes.data(), 4, 7));
  EXPECT_EQ(errno, EIO) << "the file ends before";
  ASSERT_TRUE(WriteAllAt(file.get(), "ab", 2, 9));
  ASSERT_TRUE(ReadAllAt(file.get(), bytes.data(), 3, 8));
  EXPECT_EQ(bytes, "8ab9");
  // What interrupted an earlier call is none of this one's.
  errno = EINTR;
  ASSERT_TRUE(ReadAllAt(file.get(), bytes.data(), 3, 0) && WriteAllAt(file.get(), bytes.data(), 3, 0));
  EXPECT_EQ(bytes, "0129");
  const FileDescriptor full(open("/dev/full", O_WRONLY));
  EXPECT_FALSE(WriteAllAt(full.get(), "ab", 2, 0));
  EXPECT_EQ(errno, ENOSPC);
}

// A file of /proc gives a page at most at a time.
TEST(FileDescriptor, WhatComesInPiecesIsReadWhole) {
  // No memory is taken between the two readings, which would change what the file says.
  static char expected[12'000], bytes[sizeof(expected)];
  const FileDescriptor file(open("/proc/self/maps", O_RDONLY | O_CLOEXEC));
  size_t num_read = 0;
  while (num_read < sizeof(expected)) {
    const ssize_t num = read(file.get(), expected + num_read, sizeof(expected) - num_read);
    if (num <= 0) break;
    num_read += static_cast<size_t>(num);
  }
  if (num_read < sizeof(expected)) GTEST_SKIP() << "this program is small";
  ASSERT_TRUE(ReadAllAt(file.get(), bytes, sizeof(bytes), 0));
  EXPECT_EQ(std::string_view(bytes, sizeof(bytes)), std::string_view(expected, sizeof(expected)));
}

}  // namespace
}  // namespace cairn
