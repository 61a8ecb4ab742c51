#include "core/modules/program_files.h"

#include <unistd.h>

#include <filesystem>

#include <gtest/gtest.h>

#include "core/files/file.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

class InstalledPathTest : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(root_ / "opt/bin"); }
  void TearDown() override { fs::remove_all(root_); }
  void Write(const std::string& name) const {
    fs::create_directories((root_ / name).parent_path());
    ASSERT_TRUE(WriteFileAtomically((root_ / name).string(), "x").ok());
  }

  const fs::path root_ = fs::path(testing::TempDir()) / fmt::format("installed_path_test_{}", getpid());
  const std::string program_ = (root_ / "opt/bin/cairn").string();
};

TEST_F(InstalledPathTest, IsOneFolderUpWhereInstalledAndBesideInABuildFolder) {
  Write("opt/lib/cairn/film.so");
  EXPECT_EQ(InstalledPath(program_, "lib/cairn/film.so").value(), (root_ / "opt/lib/cairn/film.so").string());
  Write("opt/bin/lib/cairn/film.so");
  EXPECT_EQ(InstalledPath(program_, "lib/cairn/film.so").value(),
            (root_ / "opt/bin/lib/cairn/film.so").string());
}

TEST_F(InstalledPathTest, IsNowhereElse) {
  Write("lib/cairn/film.so");            // two folders up
  Write("opt/bin/film.so");              // without its folders
  Write("elsewhere/lib/cairn/film.so");  // the working directory
  const fs::path before = fs::current_path();
  fs::current_path(root_ / "elsewhere");
  const Result<std::string> path = InstalledPath(program_, "lib/cairn/film.so");
  fs::current_path(before);
  ASSERT_FALSE(path.ok()) << *path;
  EXPECT_EQ(path.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(path.error().message,
            program_ +
                ": lib/cairn/film.so is neither beside it nor one folder up; install the "
                "program again");
}

TEST(ProgramPath, IsThisProgramsOwnFile) {
  const std::string path = ProgramPath().value();
  EXPECT_TRUE(fs::path(path).is_absolute());
  EXPECT_TRUE(fs::equivalent(path, "/proc/self/exe"));
  EXPECT_EQ(path, fs::canonical(path).string());
}

}  // namespace
}  // namespace cairn
