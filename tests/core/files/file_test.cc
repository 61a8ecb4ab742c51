#include "core/files/file.h"

#include <unistd.h>

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class File : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / fmt::format("file_test_{}", getpid());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path folder_;
};

// Bytes that differ from one part of a file to the next.
std::string Bytes(size_t num_bytes) {
  std::string bytes(num_bytes, '\0');
  for (size_t i = 0; i < num_bytes; ++i) bytes[i] = static_cast<char>(i * 2654435761u >> 13);
  return bytes;
}

TEST_F(File, IsReadAndHashedWholeWhateverItsSize) {
  const std::string path = (folder_ / "file").string();
  for (const size_t num_bytes : {0, 1, 240, 65535, 65536, 65537, 300'000}) {
    const std::string bytes = Bytes(num_bytes);
    ASSERT_TRUE(WriteFileAtomically(path, bytes).ok());
    EXPECT_EQ(ReadFile(path).value(), bytes) << num_bytes;
    EXPECT_EQ(HashFile(path).value(), HashBytes(bytes)) << num_bytes;
    EXPECT_EQ(ReadHead(path, 240), bytes.substr(0, 240)) << num_bytes;
  }
}

// The numbers are those of `xxhsum -H2`.
TEST_F(File, HashesAreXxh3s) {
  EXPECT_EQ(HashBytes(""), "99aa06d3014798d86001c324468d497f");
  EXPECT_EQ(HashBytes("a"), "a96faf705af16834e6c632b61e964e1f");
}

// A file of /proc says that it has no bytes.
TEST_F(File, OfUnknownSizeIsReadToItsEnd) {
  const std::string maps = ReadFile("/proc/self/maps").value();
  EXPECT_THAT(maps, HasSubstr("[stack]"));
  EXPECT_GT(maps.size(), 4096u);
  EXPECT_EQ(HashFile("/proc/self/cmdline").value(), HashBytes(ReadFile("/proc/self/cmdline").value()));
}

TEST_F(File, ThatIsNoneIsAnError) {
  const auto folder = HashFile(folder_.string());
  ASSERT_FALSE(folder.ok());
  EXPECT_EQ(folder.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(folder.error().message, HasSubstr(folder_.string()));
  EXPECT_EQ(HashFile((folder_ / "missing").string()).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(ReadHead(folder_.string(), 4), "");
  EXPECT_EQ(ReadHead((folder_ / "missing").string(), 4), "");
}

}  // namespace
}  // namespace cairn
