#include "core/files/replacement.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/database.h"
#include "core/files/file.h"
#include "core/files/file_descriptor.h"
#include "core/files/temporary.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// Files in a folder of their own, which begins empty.
class ReplacementTest : public testing::Test {
 protected:
  ReplacementTest() : folder_(testing::TempDir() + "/replacement") {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    chmod(folder_.c_str(), 0777);
    mask_ = umask(022);
  }
  ~ReplacementTest() override { umask(mask_); }

  std::string Path(const std::string& name) const { return folder_ + "/" + name; }

  // A file with these contents and this mode, written by hand.
  std::string Make(const std::string& name, const std::string& contents, mode_t mode = 0644) const {
    std::FILE* const file = std::fopen(Path(name).c_str(), "wb");
    std::fwrite(contents.data(), 1, contents.size(), file);
    std::fclose(file);
    chmod(Path(name).c_str(), mode);
    return Path(name);
  }

  static struct stat StatusOf(const std::string& path) {
    struct stat status = {};
    EXPECT_EQ(lstat(path.c_str(), &status), 0) << path;
    return status;
  }
  static mode_t ModeOf(const std::string& path) { return StatusOf(path).st_mode & 07777; }

  std::vector<std::string> Names() const {
    std::vector<std::string> names;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder_))
      names.push_back(entry.path().filename().string());
    return names;
  }

  // The body's answer, as the user "nobody".  REQUIRES: IsRoot()
  static bool AsNobody(const std::function<bool()>& body) {
    const pid_t child = fork();
    if (child == 0) {
      const bool is_nobody = setresgid(65534, 65534, 65534) == 0 && setresuid(65534, 65534, 65534) == 0;
      _exit(is_nobody && body() ? 0 : 1);
    }
    int status = -1;
    waitpid(child, &status, 0);
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
  }
  static bool IsRoot() { return geteuid() == 0; }

  std::string folder_;
  mode_t mask_ = 0;
};

// Same size, and no descriptor is left to look into it: it is not taken for the same.
TEST_F(ReplacementTest, TargetThatCannotBeOpenedIsReplaced) {
  const std::string path = Make("file", "old");
  Result<Replacement> file = Replacement::Begin(path);
  ASSERT_TRUE(file.ok() && file->Write("new").ok());
  rlimit limit = {};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &limit), 0);
  const rlimit none = {3, limit.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &none), 0);
  const Status status = file->Finish();
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &limit), 0);
  EXPECT_TRUE(status.ok()) << status.error().message;
  EXPECT_TRUE(file->is_in_place());
  EXPECT_EQ(*ReadFile(path), "new");
}

TEST_F(ReplacementTest, SameBytesLeaveTheFileUntouchedAndNoOthersDo) {
  // Three blocks of what is compared, and a difference in each.
  const std::string bytes(150'000, 'a');
  const std::string path = Make("file", bytes);
  const ino_t inode = StatusOf(path).st_ino;
  ASSERT_TRUE(WriteFileAtomically(path, bytes).ok());
  EXPECT_EQ(StatusOf(path).st_ino, inode);
  Result<Replacement> same = Replacement::Begin(path);
  ASSERT_TRUE(same.ok() && same->Write(bytes).ok() && same->Finish().ok());
  EXPECT_TRUE(same->is_in_place());
  EXPECT_EQ(StatusOf(path).st_ino, inode);
  for (const size_t place : {size_t{0}, size_t{70'000}, bytes.size() - 1}) {
    std::string other = bytes;
    other[place] = 'b';
    ASSERT_TRUE(WriteFileAtomically(path, other).ok());
    EXPECT_EQ(*ReadFile(path), other);
  }
  ASSERT_TRUE(WriteFileAtomically(path, bytes + "c").ok());
  EXPECT_EQ(*ReadFile(path), bytes + "c");
  ASSERT_TRUE(WriteFileAtomically(path, bytes).ok());
  EXPECT_EQ(*ReadFile(path), bytes);
  ASSERT_TRUE(WriteFileAtomically(path, "").ok());
  EXPECT_EQ(*ReadFile(path), "");
}

TEST_F(ReplacementTest, NewFileGetsWhatTheUmaskLeaves) {
  umask(027);
  ASSERT_TRUE(WriteFileAtomically(Path("file"), "new").ok());
  EXPECT_EQ(ModeOf(Path("file")), 0640U);
}

TEST_F(ReplacementTest, OwnerGroupAndModeStay) {
  const std::string path = Make("file", "old", 0640);
  if (IsRoot()) {
    ASSERT_EQ(chown(path.c_str(), 1234, 4321), 0);
  }
  const struct stat before = StatusOf(path);
  umask(077);
  ASSERT_TRUE(WriteFileAtomically(path, "new").ok());
  EXPECT_EQ(*ReadFile(path), "new");
  EXPECT_NE(StatusOf(path).st_ino, before.st_ino);
  EXPECT_EQ(ModeOf(path), 0640U);
  EXPECT_EQ(StatusOf(path).st_uid, before.st_uid);
  EXPECT_EQ(StatusOf(path).st_gid, before.st_gid);
}

// Root may give files away, also those that their owner alone, or their group alone, can read.
TEST_F(ReplacementTest, RootKeepsOwnersWhoAloneCanReadTheFile) {
  if (!IsRoot()) GTEST_SKIP() << "only root can give files away";
  for (const mode_t mode : {0600, 0400, 0040, 0604, 0000}) {
    const std::string path = Make("file", "old", mode);
    ASSERT_EQ(chown(path.c_str(), 1234, 4321), 0);
    const Status status = WriteFileAtomically(path, "new");
    ASSERT_TRUE(status.ok()) << status.error().message;
    EXPECT_EQ(*ReadFile(path), "new");
    EXPECT_EQ(ModeOf(path), mode);
    EXPECT_EQ(StatusOf(path).st_uid, 1234U);
    EXPECT_EQ(StatusOf(path).st_gid, 4321U);
    fs::remove(path);
  }
}

TEST_F(ReplacementTest, UntilItIsInPlaceItIsAsPrivateAsAnyFileThatItReplaces) {
  Make("file", "old", 0600);
  const Result<Replacement> file = Replacement::Begin(Path("file"));
  ASSERT_TRUE(file.ok());
  EXPECT_EQ(ModeOf(file->temporary()), 0600U);
}

// The folders of /proc have nothing to sync: that is no error.  What is no folder, nor any open file, is one,
// which says that the file is in place all the same.
TEST_F(ReplacementTest, FoldersWithNothingToSyncAreSynced) {
  const FileDescriptor proc(open("/proc", O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  errno = 0;
  if (fsync(proc.get()) == 0 || errno != EINVAL) GTEST_SKIP() << "/proc syncs";
  EXPECT_TRUE(SyncFolderOf("/proc/file", proc.get()).ok());
  const Status status = SyncFolderOf("/proc/file", -1);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kIo);
  EXPECT_THAT(status.error().message, HasSubstr("/proc/file: is in place; but its folder /proc cannot be"));
}

// Another user may write the folder, but cannot give files away.
//   mode   who reads             the new file, of nobody
//   0644   all                   0644
//   0640   owner and group       refused: both would lose it
//   0600   owner                 refused
//   0664   group writes          0644: nobody's group is another, and may do what all may
TEST_F(ReplacementTest, OwnerWhoCouldNotReadItAnyMoreIsNotLockedOut) {
  if (!IsRoot()) GTEST_SKIP() << "only root can be somebody else";
  for (const auto& [mode, expected] :
       {std::pair(0644, 0644), std::pair(0640, 0), std::pair(0600, 0), std::pair(0664, 0644)}) {
    const std::string path = Make("file", "old", mode);
    EXPECT_TRUE(AsNobody([&] {
      const Status status = WriteFileAtomically(path, "new");
      return expected != 0 ? status.ok()
                           : !status.ok() && status.error().code == ErrorCode::kReadOnly &&
                                 status.error().message.find(path) != std::string::npos;
    })) << fmt::format("{:o}", mode);
    EXPECT_EQ(*ReadFile(path), expected != 0 ? "new" : "old");
    EXPECT_EQ(ModeOf(path), expected != 0 ? expected : mode);
    fs::remove(path);
  }
  EXPECT_THAT(Names(), testing::IsEmpty());
}

// Only the group, or only the owner, can be kept by nobody (65534).
//   owner  group  mode   the new file
//   0      65534  0660   of the group, which can read it
//   0      65534  0600   refused: the owner would lose it
//   65534  0      0600   its owner's alone, as before
//   65534  0      0640   refused: the group would lose it
TEST_F(ReplacementTest, HalfOfWhatTheFileHadIsKeptWhereNobodyLosesIt) {
  if (!IsRoot()) GTEST_SKIP() << "only root can be somebody else";
  struct Case {
    uid_t owner;
    gid_t group;
    mode_t mode;
    bool is_written;
  };
  for (const Case& each : {Case{0, 65534, 0660, true}, Case{0, 65534, 0600, false},
                           Case{65534, 0, 0600, true}, Case{65534, 0, 0640, false}}) {
    const std::string path = Make("file", "old", each.mode);
    ASSERT_EQ(chown(path.c_str(), each.owner, each.group), 0);
    EXPECT_TRUE(AsNobody([&] { return WriteFileAtomically(path, "new").ok() == each.is_written; }));
    EXPECT_EQ(*ReadFile(path), each.is_written ? "new" : "old");
    EXPECT_EQ(StatusOf(path).st_uid, each.is_written ? 65534U : each.owner);
    EXPECT_EQ(StatusOf(path).st_gid, each.is_written ? 65534U : each.group);
    EXPECT_EQ(ModeOf(path), each.mode);
    fs::remove(path);
  }
}

TEST_F(ReplacementTest, PlantedLinksAreNeitherFollowedNorInTheWay) {
  const std::string victim = Make("victim", "kept");
  fs::create_symlink(victim, TemporaryPath(Path("file")));
  fs::create_directories(TemporaryPath(Path("other")) + "/in the way");
  EXPECT_TRUE(WriteFileAtomically(Path("file"), "new").ok());
  EXPECT_TRUE(WriteFileAtomically(Path("other"), "new").ok());
  EXPECT_EQ(*ReadFile(victim), "kept");
  EXPECT_EQ(*ReadFile(Path("file")), "new");
  EXPECT_FALSE(fs::is_symlink(Path("file")));
}

TEST_F(ReplacementTest, TemporariesAreNewFilesThatCleaningUpKnows) {
  const Result<TemporaryFile> file1 = CreateTemporary(Path("file"), 0640);
  const Result<TemporaryFile> file2 = CreateTemporary(Path("file"), 0666);
  ASSERT_TRUE(file1.ok() && file2.ok());
  EXPECT_NE(file1->path, file2->path);
  EXPECT_EQ(ModeOf(file1->path), 0640U);
  EXPECT_EQ(ModeOf(file2->path), 0644U);
  for (const Result<TemporaryFile>& file : {file1, file2}) {
    EXPECT_TRUE(IsTemporaryName(fs::path(file->path).filename().string(), "file"));
    EXPECT_EQ(write(file->descriptor, "x", 1), 1);
    close(file->descriptor);
  }
  EXPECT_EQ(CreateTemporary(Path("none/file"), 0666).error().code, ErrorCode::kIo);
  EXPECT_TRUE(IsTemporaryName("file.tmp-12", "file"));
  EXPECT_TRUE(IsTemporaryName("file.tmp-12-journal", ""));
  EXPECT_TRUE(IsTemporaryName("file.tmp-12.tmp-12-34", "file"));
  EXPECT_FALSE(IsTemporaryName("file.tmp-12.txt", "file"));
  EXPECT_FALSE(IsTemporaryName("file.tmp-", "file"));
  EXPECT_FALSE(IsTemporaryName("file.tmp-mine", "file"));
  EXPECT_FALSE(IsTemporaryName("other.tmp-12", "file"));
}

TEST_F(ReplacementTest, WhatIsNotFinishedLeavesNoTrace) {
  Make("file", "old");
  {
    Result<Replacement> file = Replacement::Begin(Path("file"));
    ASSERT_TRUE(file.ok() && file->Write("half").ok());
    Make(fs::path(file->temporary() + "-journal").filename().string(), "of SQLite");
    EXPECT_FALSE(file->is_in_place());
  }
  EXPECT_THAT(Names(), testing::ElementsAre("file"));
  EXPECT_EQ(*ReadFile(Path("file")), "old");
  EXPECT_EQ(ReplaceFileAtomically(Path("file"), [](const auto&) { return MakeError(ErrorCode::kGate, "no"); })
                .error()
                .code,
            ErrorCode::kGate);
  EXPECT_THAT(Names(), testing::ElementsAre("file"));
}

TEST_F(ReplacementTest, TemporaryThatSomebodyExchangedIsNotPutInPlace) {
  Make("file", "old");
  Result<Replacement> file = Replacement::Begin(Path("file"));
  ASSERT_TRUE(file.ok() && file->Write("new").ok());
  fs::remove(file->temporary());
  Make(fs::path(file->temporary()).filename().string(), "theirs");
  EXPECT_EQ(file->Finish().error().code, ErrorCode::kIo);
  EXPECT_EQ(*ReadFile(Path("file")), "old");
}

TEST_F(ReplacementTest, FileThatMustBeNewIsNotWrittenOverWhateverItIs) {
  Make("file", "old");
  fs::create_symlink(Path("nowhere"), Path("link"));
  for (const char* name : {"file", "link"}) {
    Result<Replacement> file = Replacement::Begin(Path(name));
    ASSERT_TRUE(file.ok() && file->Write("new").ok());
    EXPECT_EQ(file->FinishNew().error().code, ErrorCode::kInvalidArgument);
    EXPECT_FALSE(file->is_in_place());
  }
  EXPECT_EQ(*ReadFile(Path("file")), "old");
  EXPECT_FALSE(fs::exists(Path("nowhere")));
  Result<Replacement> file = Replacement::Begin(Path("new"), 0600);
  ASSERT_TRUE(file.ok() && file->Write("new").ok() && file->FinishNew().ok());
  EXPECT_TRUE(file->is_in_place());
  EXPECT_EQ(*ReadFile(Path("new")), "new");
  EXPECT_EQ(ModeOf(Path("new")), 0600U);
}

TEST_F(ReplacementTest, CopiesWholeFiles) {
  std::string bytes;
  for (int i = 0; i < 70'000; ++i) bytes += static_cast<char>('a' + i % 23);
  const std::string source = Make("source", bytes);
  Result<Replacement> file = Replacement::Begin(Path("copy"));
  errno = EINTR;  // of an earlier call
  ASSERT_TRUE(file.ok() && file->CopyFrom(source).ok() && file->Finish().ok());
  EXPECT_EQ(*ReadFile(Path("copy")), bytes);
  Result<Replacement> none = Replacement::Begin(Path("none"));
  EXPECT_EQ(none->CopyFrom(Path("nowhere")).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(none->CopyFrom(folder_).error().code, ErrorCode::kIo);
}

// A pipe gives what there is: less than is asked for, and then the rest.
TEST_F(ReplacementTest, CopiesWhatComesInPieces) {
  std::string bytes;
  for (int i = 0; i < 70'000; ++i) bytes += static_cast<char>('a' + i % 23);
  ASSERT_EQ(mkfifo(Path("pipe").c_str(), 0600), 0);
  const pid_t child = fork();
  if (child == 0) {
    const FileDescriptor pipe(open(Path("pipe").c_str(), O_WRONLY | O_CLOEXEC));
    size_t num_written = 0;
    for (const size_t end : {size_t{10}, size_t{1000}, bytes.size()}) {
      while (num_written < end) {
        const ssize_t num = write(pipe.get(), bytes.data() + num_written, end - num_written);
        if (num < 0) _exit(1);
        num_written += static_cast<size_t>(num);
      }
      usleep(20'000);
    }
    _exit(0);
  }
  Result<Replacement> file = Replacement::Begin(Path("copy"));
  ASSERT_TRUE(file.ok() && file->CopyFrom(Path("pipe")).ok() && file->Finish().ok());
  waitpid(child, nullptr, 0);
  EXPECT_EQ(*ReadFile(Path("copy")), bytes);
}

// Its first page cannot be read: that is no empty file.
TEST_F(ReplacementTest, ReadErrorIsNoEndOfAFile) {
  EXPECT_EQ(ReadFile("/proc/self/mem").error().code, ErrorCode::kIo);
  EXPECT_EQ(ReadFile(folder_).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(ReadFile(Path("none")).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(ReadFile(Make("file", "x") + "/y").error().code, ErrorCode::kNotFound);
  EXPECT_FALSE(ReadFile("/proc/self/status")->empty());  // says that it has no bytes
}

TEST_F(ReplacementTest, FileThatMayNotBeReadIsNotTakenForAnother) {
  if (!IsRoot()) GTEST_SKIP() << "root's own";
  const std::string path = Make("file", "SQLite format 3", 0600);
  EXPECT_TRUE(AsNobody([&] {
    const auto is_said = [&](const Error& error) {
      return error.code == ErrorCode::kIo && error.message.find("Permission denied") != std::string::npos;
    };
    return is_said(ReadFile(path).error()) && is_said(CheckSqliteFile(path).error());
  }));
}

}  // namespace
}  // namespace cairn
