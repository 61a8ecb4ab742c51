#include "core/files/file_lock.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <optional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using Claim = FileLock::Claim;
using Kind = FileLock::Kind;

class FileLockTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / fmt::format("file_lock_test_{}", getpid());
    fs::create_directories(folder_);
    ASSERT_TRUE(WriteFileAtomically(Path("file"), "text").ok());
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string Path(const std::string& name) const { return (folder_ / name).string(); }
  // Each has opened the file anew, as another process would.
  FileLock Another() const { return FileLock(open(Path("file").c_str(), O_RDWR | O_CLOEXEC)); }

  fs::path folder_;
};

TEST_F(FileLockTest, OneIsExclusiveAndManyAreShared) {
  FileLock a = Another(), b = Another(), c = Another();
  EXPECT_EQ(a.Try(Kind::kShared), Claim::kHeld);
  EXPECT_EQ(b.Try(Kind::kShared), Claim::kHeld);
  EXPECT_EQ(c.Try(Kind::kExclusive), Claim::kTaken);
  a.Release();
  EXPECT_EQ(c.Try(Kind::kExclusive), Claim::kTaken);
  b.Release();
  EXPECT_EQ(c.Try(Kind::kExclusive), Claim::kHeld);
  EXPECT_EQ(a.Try(Kind::kShared), Claim::kTaken);
  EXPECT_EQ(a.Try(Kind::kExclusive), Claim::kTaken);
  errno = EINTR;  // of an earlier call
  c.Share();
  EXPECT_EQ(a.Try(Kind::kShared), Claim::kHeld);
  EXPECT_EQ(b.Try(Kind::kExclusive), Claim::kTaken);
}

TEST_F(FileLockTest, IsHeldByTheObjectThatItWasMovedTo) {
  FileLock other = Another();
  {
    FileLock first = Another();
    ASSERT_EQ(first.Try(Kind::kExclusive), Claim::kHeld);
    FileLock second = std::move(first);
    EXPECT_EQ(other.Try(Kind::kExclusive), Claim::kTaken);
    FileLock third(-1);
    third = std::move(second);
    EXPECT_EQ(third.Try(Kind::kExclusive), Claim::kHeld);
    EXPECT_EQ(other.Try(Kind::kExclusive), Claim::kTaken);
  }
  EXPECT_EQ(other.Try(Kind::kExclusive), Claim::kHeld);
}

TEST_F(FileLockTest, FolderOfAFileIsLockedForAsLongAsTheObjectLives) {
  std::optional<Result<FileLock>> first = LockFolderOf(Path("file"));
  ASSERT_TRUE(first->ok());
  // Whatever file of it is meant, and whether it is there.
  for (const char* name : {"file", "new"}) {
    const Result<FileLock> second = LockFolderOf(Path(name));
    ASSERT_FALSE(second.ok());
    EXPECT_EQ(second.error().code, ErrorCode::kBusy);
    EXPECT_THAT(second.error().message, HasSubstr(Path(name) + ": another update or rollback is running"));
  }
  first.reset();
  EXPECT_TRUE(LockFolderOf(Path("new")).ok());
}

TEST_F(FileLockTest, FolderThatIsNotThereIsNamed) {
  EXPECT_EQ(LockFolderOf(Path("none/file")).error().code, ErrorCode::kNotFound);
  const Result<FileLock> below = LockFolderOf(Path("file/file"));
  ASSERT_FALSE(below.ok());
  EXPECT_EQ(below.error().code, ErrorCode::kIo);
  EXPECT_THAT(below.error().message, HasSubstr(Path("file/file") + ": its folder: Not a directory"));
}

// Unless the file system says so, of this file and now, there are locks.
TEST_F(FileLockTest, RecordLocksAreTakenForGranted) {
  errno = ENOLCK;  // of an earlier call
  EXPECT_TRUE(HasRecordLocks(Path("file")));
  EXPECT_TRUE(HasRecordLocks(Path("none")));
}

}  // namespace
}  // namespace cairn
