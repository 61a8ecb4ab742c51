#include "core/files/output_path.h"

#include <sys/stat.h>

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

TEST(OutputPath, OnlyFilesAreReplaced) {
  const fs::path folder = fs::path(testing::TempDir()) / "output_path";
  fs::remove_all(folder);
  fs::create_directories(folder / "folder");
  const std::string file = folder / "file", pipe = folder / "pipe", link = folder / "link";
  ASSERT_TRUE(WriteFileAtomically(file, "old").ok());
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  fs::create_symlink(pipe, link);
  EXPECT_TRUE(CheckCanBeReplaced(file).ok());
  EXPECT_TRUE(CheckCanBeReplaced(folder / "new").ok());
  EXPECT_EQ(CheckCanBeReplaced("").error().code, ErrorCode::kInvalidArgument);
  for (const std::string& path :
       {pipe, link, std::string(folder / "folder"), std::string(folder / "none" / "file")}) {
    const Status status = WriteFileAtomically(path, "new");
    ASSERT_FALSE(status.ok()) << path;
    EXPECT_THAT(status.error().message, testing::HasSubstr(path));
  }
  EXPECT_TRUE(fs::is_fifo(pipe));
  EXPECT_TRUE(fs::is_symlink(link));
}

TEST(OutputPath, TheFolderOfABareNameIsThisOne) {
  EXPECT_EQ(FolderOf("map.cairn"), ".");
  EXPECT_EQ(FolderOf("maps/map.cairn"), "maps");
}

}  // namespace
}  // namespace cairn
