#include "pipeline/build/folder_lock.h"

#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/files/folder_manifest.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class FolderLockTest : public testing::Test {
 protected:
  FolderLockTest() : folder_(fs::path(testing::TempDir()) / fmt::format("folder_lock_{}", getpid())) {
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "options");
  }
  ~FolderLockTest() override { fs::remove_all(folder_); }
  std::string Write(const std::string& name) const {
    const std::string path = (folder_ / name).string();
    EXPECT_TRUE(WriteFileAtomically(path, "x").ok());
    return path;
  }
  Result<FolderLock> Acquire(const std::string& session) const {
    return FolderLock::Acquire((folder_ / "a.build").string(), session);
  }
  fs::path folder_;
};

TEST_F(FolderLockTest, AnotherSessionIsRefusedAndToldWhichOneIsThere) {
  {
    const auto lock = Acquire("1@here");
    ASSERT_TRUE(lock.ok()) << lock.error().message;
    const auto second = Acquire("2@here");
    ASSERT_FALSE(second.ok());
    EXPECT_EQ(second.error().code, ErrorCode::kBusy);
    EXPECT_THAT(second.error().message, HasSubstr("(process 1@here)"));
  }
  EXPECT_TRUE(Acquire("2@here").ok());
}

TEST_F(FolderLockTest, StagesOfOneSessionShareTheFolder) {
  const auto first = Acquire("1@here"), second = Acquire("1@here");
  EXPECT_TRUE(first.ok());
  EXPECT_TRUE(second.ok());
}

TEST_F(FolderLockTest, LockOfADeadProcessIsNone) {
  const pid_t child = fork();
  if (child == 0) _exit(Acquire("child").ok() ? 0 : 1);  // dies with the file in place
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_EQ(status, 0);
  EXPECT_TRUE(Acquire("parent").ok());
}

TEST_F(FolderLockTest, OfManyAtOnceOnlyOneSessionIsEverInside) {
  std::atomic<int> num_inside[2] = {0, 0};
  std::atomic<int> num_clashes = 0, num_entered = 0;
  std::vector<std::thread> threads;
  for (int t = 0; t < 8; ++t) {
    threads.emplace_back([&, session = t % 2] {
      for (int i = 0; i < 20; ++i) {
        const auto lock = Acquire(session == 0 ? "even" : "odd");
        if (!lock.ok()) continue;
        ++num_entered;
        ++num_inside[session];
        if (num_inside[1 - session] > 0) ++num_clashes;
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
        --num_inside[session];
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(num_clashes, 0);
  EXPECT_GT(num_entered, 20);
}

TEST_F(FolderLockTest, WhoeverComesFirstRemovesStaleTemporariesAndNothingElse) {
  fs::create_directories(folder_ / "a.build/options");
  fs::create_directories(folder_ / "a.build/poses.tmp-12/work");
  ASSERT_TRUE(BeginOwnFolder((folder_ / "a.build/poses.tmp-12").string(), "a folder of poses").ok());
  fs::create_directories(folder_ / "a.build/poses.tmp-12-old");
  fs::create_directories(folder_ / "a.build/poses.tmp-13");
  ASSERT_TRUE(WriteFileAtomically((folder_ / "a.build/config.mk").string(),
                                  "# x\nMAP := " + (folder_ / "a.cairn").string() + "\nCAPTURE := c\n")
                  .ok());
  for (const char* name : {"a.build/features.db.tmp-123", "a.build/matches.db.tmp-5-journal",
                           "a.build/matches.db.tmp-5-wal", "a.build/features.db.stamp.tmp-4",
                           "a.build/options/seed.tmp-9", "a.cairn.tmp-77", "a.report.json.tmp-77"}) {
    Write(name);
  }
  const std::vector<std::string> kept = {Write("a.build/features.db"),
                                         Write("a.build/my.tmp-notes"),
                                         Write("a.cairn"),
                                         Write("b.cairn.tmp-77"),
                                         Write("a.cairn.tmp-mine"),
                                         Write("a.build/notes.tmp-2024"),
                                         Write("a.build/options/notes.tmp-2024"),
                                         Write("a.build/poses.tmp-13/letter.txt")};
  const auto first = Acquire("1@here");
  ASSERT_TRUE(first.ok());
  for (const std::string& path : kept) EXPECT_TRUE(fs::exists(path)) << path;
  for (const auto& entry : fs::recursive_directory_iterator(folder_)) {
    const std::string path = entry.path().string();
    if (std::find(kept.begin(), kept.end(), path) != kept.end()) continue;
    EXPECT_TRUE(path.find(".tmp-") == std::string::npos || path.ends_with("/poses.tmp-13")) << path;
  }
  // A process that joins must not remove them: they are being written now.
  const std::string written = Write("a.build/features.db.tmp-6");
  ASSERT_TRUE(Acquire("1@here").ok());
  EXPECT_TRUE(fs::exists(written));
}

}  // namespace
}  // namespace cairn::pipeline
