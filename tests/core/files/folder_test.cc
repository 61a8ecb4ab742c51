#include "core/files/folder.h"

#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/files/folder_manifest.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class FolderTest : public testing::Test {
 protected:
  void SetUp() override {
    root_ = fs::path(testing::TempDir()) / fmt::format("folder_test_{}", getpid());
    fs::remove_all(root_);
    fs::create_directories(root_);
  }
  void TearDown() override { fs::remove_all(root_); }

  std::string Path(const std::string& name) const { return (root_ / name).string(); }
  void Write(const std::string& name, const std::string& text) const {
    fs::create_directories(fs::path(Path(name)).parent_path());
    ASSERT_TRUE(WriteFileAtomically(Path(name), text).ok());
  }

  // out/ with a file of this text, one in a folder and a link to a folder outside.
  Status Replace(const std::string& text, const std::string& kind = "a capture") const {
    return ReplaceFolderAtomically(Path("out"), kind, [&](const std::string& folder) -> Status {
      CAIRN_RETURN_IF_ERROR(WriteFileAtomically(folder + "/list.txt", text));
      fs::create_directories(folder + "/images/a b");
      CAIRN_RETURN_IF_ERROR(WriteFileAtomically(folder + "/images/a b/1.png", "image"));
      fs::create_directory_symlink("../elsewhere", folder + "/link");
      return Ok();
    });
  }

  // Everything below the root: what a file holds, where a link leads.
  std::map<std::string, std::string> Tree() const {
    std::map<std::string, std::string> tree;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(root_)) {
      std::string& what = tree[entry.path().lexically_relative(root_).string()];
      if (entry.is_symlink())
        what = "-> " + fs::read_symlink(entry.path()).string();
      else if (entry.is_regular_file())
        what = *ReadFile(entry.path().string());
    }
    return tree;
  }

  // The message of a refusal that leaves everything as it is.
  std::string Refusal(const std::string& kind = "a capture") const {
    const auto before = Tree();
    const Status status = Replace("new", kind);
    EXPECT_EQ(Tree(), before);
    EXPECT_FALSE(status.ok());
    if (status.ok()) return "";
    EXPECT_EQ(status.error().code, ErrorCode::kInvalidArgument);
    return status.error().message;
  }

  // The number of a process that has ended.
  static pid_t DeadProcess() {
    const pid_t child = fork();
    if (child == 0) _exit(0);
    waitpid(child, nullptr, 0);
    return child;
  }

  fs::path root_;
};

TEST_F(FolderTest, WhatCairnMadeIsReplacedAsAWhole) {
  Write("elsewhere/kept.txt", "kept");
  ASSERT_TRUE(Replace("old").ok());
  ASSERT_TRUE(Replace("new").ok());
  const auto tree = Tree();
  EXPECT_EQ(tree.at("out/list.txt"), "new");
  EXPECT_EQ(tree.at("elsewhere/kept.txt"), "kept");  // behind the link
  EXPECT_EQ(tree.size(), 9u);  // two below the root, and below out/ two folders, three files, a link
}

TEST_F(FolderTest, TheManifestSaysWhatTheFolderHolds) {
  ASSERT_TRUE(Replace("text").ok());
  EXPECT_EQ(*ReadFile(Path("out/.cairn-folder")),
            "cairn folder 1\nkind a capture\nfolder images\nfolder images/a b\n"
            "file 5 " +
                HashBytes("image") +
                " images/a b/1.png\n"
                "link " +
                HashBytes("../elsewhere") +
                " link\n"
                "file 4 " +
                HashBytes("text") + " list.txt\n");
}

TEST_F(FolderTest, AnEmptyFolderIsFilled) {
  fs::create_directories(Path("out"));
  ASSERT_TRUE(Replace("text").ok());
  EXPECT_EQ(*ReadFile(Path("out/list.txt")), "text");
}

TEST_F(FolderTest, AFolderThatOnlyLooksLikeOneOfOursIsRefused) {
  for (const char* name : {"images.txt", "cameras.txt", "cameras.bin", "frame.json", "sessions.txt"})
    Write(std::string("out/") + name, "somebody's own");
  EXPECT_THAT(Refusal(), HasSubstr("nothing shows that cairn made it"));
  EXPECT_THAT(Refusal(), HasSubstr("name another folder, or move this one away"));
  for (const char* name : {"images.txt", "cameras.txt", "cameras.bin", "frame.json"})
    fs::remove(Path(std::string("out/") + name));
  EXPECT_THAT(Refusal(), HasSubstr("out: holds sessions.txt, and nothing shows that cairn made it"));
}

TEST_F(FolderTest, AForeignFileAnywhereIsRefusedAndNamed) {
  for (const std::string foreign :
       {"out/notes.txt", "out/images/a b/2.png", "out/deep/er/x", "out/.hidden"}) {
    ASSERT_TRUE(Replace("old").ok());
    Write(foreign, "mine");
    EXPECT_THAT(Refusal(), HasSubstr(" was not made by cairn"));
    fs::remove(Path(foreign));
    EXPECT_EQ(*ReadFile(Path("out/list.txt")), "old");
    fs::remove_all(Path("out/deep"));
  }
}

TEST_F(FolderTest, AForeignFolderLinkOrPipeIsRefused) {
  ASSERT_TRUE(Replace("old").ok());
  fs::create_directory(Path("out/empty"));
  EXPECT_THAT(Refusal(), HasSubstr("out/empty: was not made by cairn"));
  fs::remove(Path("out/empty"));
  fs::create_symlink("nowhere", Path("out/another"));
  EXPECT_THAT(Refusal(), HasSubstr("out/another: was not made by cairn"));
  fs::remove(Path("out/another"));
  ASSERT_EQ(mkfifo(Path("out/pipe").c_str(), 0600), 0);
  EXPECT_THAT(Refusal(), HasSubstr("out/pipe: was not made by cairn"));
  fs::remove(Path("out/pipe"));
  EXPECT_TRUE(Replace("new").ok());
}

TEST_F(FolderTest, AChangedFileOrLinkIsRefusedAndNamed) {
  ASSERT_TRUE(Replace("old").ok());
  Write("out/list.txt", "odl");  // as long as before
  EXPECT_THAT(Refusal(), HasSubstr("out/list.txt: was changed since cairn wrote it"));
  Write("out/list.txt", "longer");
  EXPECT_THAT(Refusal(), HasSubstr("out/list.txt: was changed since cairn wrote it"));
  Write("out/list.txt", "old");
  fs::remove(Path("out/link"));
  fs::create_directory_symlink("../other", Path("out/link"));
  EXPECT_THAT(Refusal(), HasSubstr("out/link: was changed"));
  fs::remove(Path("out/link"));
  Write("out/link", "a file now");
  EXPECT_THAT(Refusal(), HasSubstr("out/link: was changed"));
  fs::remove(Path("out/link"));
  ASSERT_EQ(mkfifo(Path("out/link").c_str(), 0600), 0);
  EXPECT_THAT(Refusal(), HasSubstr("out/link: was changed"));
}

TEST_F(FolderTest, AMissingFileDoesNotMatter) {
  ASSERT_TRUE(Replace("same").ok());
  fs::remove_all(Path("out/images"));
  ASSERT_TRUE(Replace("same").ok());
  EXPECT_TRUE(fs::exists(Path("out/images/a b/1.png")));
}

TEST_F(FolderTest, AnotherKindOfFolderIsRefused) {
  ASSERT_TRUE(Replace("old", "a COLMAP model").ok());
  EXPECT_THAT(Refusal(), HasSubstr("is a COLMAP model, not a capture"));
}

TEST_F(FolderTest, AManifestThatIsNotWholeTellsNothing) {
  ASSERT_TRUE(Replace("old").ok());
  const std::string manifest = *ReadFile(Path("out/.cairn-folder"));
  for (const std::string& damaged :
       {std::string(), manifest.substr(0, manifest.size() - 1), "x" + manifest, manifest + "what\n",
        manifest + "file 5\n", std::string("cairn folder 2\n") + manifest.substr(15)}) {
    Write("out/.cairn-folder", damaged);
    EXPECT_THAT(Refusal(), HasSubstr("nothing shows that cairn made it")) << damaged;
  }
  fs::remove(Path("out/.cairn-folder"));
  Write("elsewhere/manifest", manifest);
  fs::create_symlink(Path("elsewhere/manifest"), Path("out/.cairn-folder"));
  EXPECT_THAT(Refusal(), HasSubstr("nothing shows that cairn made it"));
}

TEST_F(FolderTest, AFolderThatWasNeverFinishedIsRefused) {
  Write("out/images/1.png", "half");
  ASSERT_TRUE(BeginOwnFolder(Path("out"), "a capture").ok());
  EXPECT_THAT(Refusal(), HasSubstr("was never finished"));
}

TEST_F(FolderTest, FilesAndLinksAreNoFolders) {
  Write("out", "a file");
  EXPECT_THAT(Refusal(), HasSubstr("is a file, expected a folder"));
  fs::remove(Path("out"));
  Write("elsewhere/mine", "mine");
  fs::create_directory_symlink("elsewhere", Path("out"));
  EXPECT_THAT(Refusal(), HasSubstr("is a link, expected a folder"));
  fs::remove(Path("out"));
  fs::create_directory_symlink("nowhere", Path("out"));
  EXPECT_THAT(Refusal(), HasSubstr("is a link, expected a folder"));
  EXPECT_EQ(ReplaceFolderAtomically(Path("none/out"), "a capture", [](const std::string&) { return Ok(); })
                .error()
                .code,
            ErrorCode::kIo);
}

TEST_F(FolderTest, TheSameContentsKeepTheFolderAndItsDate) {
  ASSERT_TRUE(Replace("same").ok());
  const fs::file_time_type long_ago = fs::last_write_time(Path("out")) - std::chrono::hours(1);
  fs::last_write_time(Path("out"), long_ago);
  ASSERT_TRUE(Replace("same").ok());
  EXPECT_EQ(fs::last_write_time(Path("out")), long_ago);
  EXPECT_EQ(std::distance(fs::directory_iterator(root_), fs::directory_iterator()), 1);
}

TEST_F(FolderTest, AFileThatKeepsItsBytesKeepsItsDate) {
  ASSERT_TRUE(Replace("old").ok());
  const fs::file_time_type long_ago = fs::last_write_time(Path("out")) - std::chrono::hours(1);
  fs::last_write_time(Path("out/images/a b/1.png"), long_ago);
  fs::last_write_time(Path("out/list.txt"), long_ago);
  ASSERT_TRUE(Replace("new").ok());
  EXPECT_EQ(fs::last_write_time(Path("out/images/a b/1.png")), long_ago);
  EXPECT_GT(fs::last_write_time(Path("out/list.txt")), long_ago);
}

TEST_F(FolderTest, AnErrorLeavesTheOldAndNothingBesideIt) {
  ASSERT_TRUE(Replace("old").ok());
  const auto before = Tree();
  const Status status =
      ReplaceFolderAtomically(Path("out"), "a capture", [&](const std::string& folder) -> Status {
        CAIRN_RETURN_IF_ERROR(WriteFileAtomically(folder + "/half.txt", "half"));
        return MakeError(ErrorCode::kNoData, "no");
      });
  EXPECT_EQ(status.error().code, ErrorCode::kNoData);
  EXPECT_EQ(Tree(), before);
}

TEST_F(FolderTest, WhatAppearsWhileTheNewOneIsWrittenStays) {
  ASSERT_TRUE(Replace("old").ok());
  const Status status =
      ReplaceFolderAtomically(Path("out"), "a capture", [&](const std::string& folder) -> Status {
        Write("out/notes.txt", "mine");
        return WriteFileAtomically(folder + "/list.txt", "new");
      });
  ASSERT_FALSE(status.ok());
  EXPECT_THAT(status.error().message, HasSubstr("out/notes.txt: was not made by cairn"));
  const auto tree = Tree();
  EXPECT_EQ(tree.at("out/notes.txt"), "mine");
  EXPECT_EQ(tree.at("out/list.txt"), "old");
  EXPECT_EQ(std::distance(fs::directory_iterator(root_), fs::directory_iterator()), 1);
}

TEST_F(FolderTest, NamesWithLineEndsAreTheirOwn) {
  const auto replace = [&](const std::string& text) {
    return ReplaceFolderAtomically(Path("out"), "a capture", [&](const std::string& folder) -> Status {
      for (const char* name : {"a\nb", "a\\nb", "c\r", "\xff"})
        CAIRN_RETURN_IF_ERROR(WriteFileAtomically(folder + "/" + name, name + text));
      return Ok();
    });
  };
  ASSERT_TRUE(replace("1").ok());
  const Status again = replace("2");
  ASSERT_TRUE(again.ok()) << again.error().message;
  EXPECT_EQ(Tree().at("out/a\nb"), "a\nb2");
  EXPECT_EQ(Tree().at("out/a\\nb"), "a\\nb2");
}

TEST_F(FolderTest, LeftoversOfKilledProcessesGoIfTheyAreOurs) {
  const std::string killed = fmt::format("out.tmp-{}", DeadProcess());
  // Killed while it wrote, and after it had exchanged the folders.
  for (const bool is_finished : {false, true}) {
    Write(killed + "/images/1.png", "half");
    ASSERT_TRUE((is_finished ? FinishOwnFolder : BeginOwnFolder)(Path(killed), "a capture").ok());
    ASSERT_TRUE(Replace(is_finished ? "1" : "2").ok());
    EXPECT_FALSE(fs::exists(Path(killed)));
  }
  fs::create_directory(Path(killed));
  ASSERT_TRUE(Replace("3").ok());
  EXPECT_FALSE(fs::exists(Path(killed)));
  // Killed while it wrote the manifest: before there was one, and when the last was to take its place.
  for (const bool has_manifest : {false, true}) {
    Write(killed + "/.cairn-folder.tmp-12-0123456789abcdef", "cairn fol");
    if (has_manifest) {
      ASSERT_TRUE(BeginOwnFolder(Path(killed), "a capture").ok());
    }
    ASSERT_TRUE(Replace(has_manifest ? "4" : "5").ok());
    EXPECT_FALSE(fs::exists(Path(killed))) << has_manifest;
  }
}

TEST_F(FolderTest, OtherFoldersWithTheNameOfALeftoverStay) {
  const std::string dead = fmt::format("out.tmp-{}", DeadProcess());
  Write(dead + "/letter.txt", "mine");
  Write(dead + "/.cairn-folder.tmp-12-0123456789abcdef", "cairn fol");
  Write("out.tmp-1/of-a-living-process", "its own");
  ASSERT_TRUE(BeginOwnFolder(Path("out.tmp-1"), "a capture").ok());
  Write("out.tmp-notes/letter.txt", "mine");
  Write(dead + "-old/letter.txt", "mine");
  Write(dead + "-old/added", "by cairn");
  ASSERT_TRUE(FinishOwnFolder(Path(dead + "-old"), "a capture").ok());
  Write(dead + "-old/added", "changed");
  Write("out/x", "");
  fs::remove(Path("out/x"));
  ASSERT_TRUE(Replace("new").ok());
  for (const std::string& kept :
       {dead, std::string("out.tmp-1"), std::string("out.tmp-notes"), dead + "-old"})
    EXPECT_GT(std::distance(fs::directory_iterator(Path(kept)), fs::directory_iterator()), 0) << kept;
}

// The process that writes it is this one; what an earlier call said of another process does not count.
TEST_F(FolderTest, FoldersThatLivingProcessesWriteStay) {
  const std::string written = fmt::format("out.tmp-{}", getpid());
  Write(written + "/images/1.png", "half");
  ASSERT_TRUE(BeginOwnFolder(Path(written), "a capture").ok());
  errno = ESRCH;
  ASSERT_TRUE(Replace("new").ok());
  EXPECT_EQ(Tree().at(written + "/images/1.png"), "half");
}

TEST_F(FolderTest, TheOldFolderComesBackWhereAProcessDiedBetweenTwoRenames) {
  ASSERT_TRUE(Replace("old").ok());
  fs::rename(Path("out"), Path(fmt::format("out.tmp-{}-old", DeadProcess())));
  const Status status = ReplaceFolderAtomically(
      Path("out"), "a capture", [](const std::string&) { return MakeError(ErrorCode::kNoData, "no"); });
  EXPECT_EQ(status.error().code, ErrorCode::kNoData);
  EXPECT_EQ(*ReadFile(Path("out/list.txt")), "old");
  fs::remove_all(Path("out"));
  const std::string theirs = fmt::format("out.tmp-{}-old", DeadProcess());
  Write(theirs + "/letter.txt", "mine");
  ASSERT_TRUE(Replace("new").ok());
  EXPECT_EQ(Tree().at(theirs + "/letter.txt"), "mine");
}

// The manifests say that they are whole, of one kind, and of the same entries; the first still has them.
TEST_F(FolderTest, FoldersThatHoldTheSameAreWholeAndOfOneKind) {
  for (const char* name : {"a", "b"}) {
    fs::create_directories(Path(name));
    ASSERT_TRUE(FinishOwnFolder(Path(name), "a capture").ok());
  }
  EXPECT_TRUE(HoldsTheSame(Path("a"), Path("b")));
  EXPECT_FALSE(HoldsTheSame(Path("a"), Path("none")));
  EXPECT_FALSE(HoldsTheSame(Path("none"), Path("b")));
  ASSERT_TRUE(BeginOwnFolder(Path("b"), "a capture").ok());
  EXPECT_FALSE(HoldsTheSame(Path("a"), Path("b")));
  EXPECT_FALSE(HoldsTheSame(Path("b"), Path("a")));
  ASSERT_TRUE(FinishOwnFolder(Path("b"), "a model").ok());
  EXPECT_FALSE(HoldsTheSame(Path("a"), Path("b")));
  Write("a/list.txt", "text");
  Write("b/list.txt", "text");
  for (const char* name : {"a", "b"}) ASSERT_TRUE(FinishOwnFolder(Path(name), "a capture").ok());
  EXPECT_TRUE(HoldsTheSame(Path("a"), Path("b")));
  fs::remove(Path("a/list.txt"));
  EXPECT_FALSE(HoldsTheSame(Path("a"), Path("b")));
  EXPECT_TRUE(HoldsTheSame(Path("b"), Path("a")));
}

TEST_F(FolderTest, OwnFilesAreThoseThatNobodyChanged) {
  ASSERT_TRUE(Replace("old").ok());
  Write("out/list.txt", "odl");
  Write("out/notes.txt", "mine");
  EXPECT_THAT(OwnFiles(Path("out")), testing::ElementsAre(".cairn-folder", "images/a b/1.png", "link"));
  ASSERT_TRUE(BeginOwnFolder(Path("out"), "a capture").ok());
  EXPECT_THAT(OwnFiles(Path("out")), testing::IsEmpty());
  EXPECT_THAT(OwnFiles(Path("none")), testing::IsEmpty());
}

TEST_F(FolderTest, RemovingAFolderLeavesWhatIsNotCairns) {
  ASSERT_TRUE(Replace("old").ok());
  Write("out/images/mine.png", "mine");
  const auto before = Tree();
  EXPECT_FALSE(RemoveOwnFolder(Path("out")));
  EXPECT_EQ(Tree(), before);
  fs::remove(Path("out/images/mine.png"));
  fs::create_directory_symlink("out", Path("alias"));
  EXPECT_FALSE(RemoveOwnFolder(Path("alias")));
  EXPECT_FALSE(RemoveOwnFolder(Path("none")));
  EXPECT_TRUE(RemoveOwnFolder(Path("out")));
  EXPECT_FALSE(fs::exists(Path("out")));
}

}  // namespace
}  // namespace cairn
