#include "pipeline/exchange/film/film_module.h"

#include <dlfcn.h>

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/modules/program_files.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

// The module of this build, and copies of it in which something is otherwise.
class FilmModuleTest : public testing::Test {
 protected:
  void SetUp() override {
    root_ =
        testing::TempDir() + "/film_module_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(root_);
    fs::create_directories(root_);
  }
  void TearDown() override { fs::remove_all(root_); }

  static std::string Module() { return InstalledPath(ProgramPath().value(), "lib/cairn/film.so").value(); }

  // The module with `to`, of the same length, at each place of `from`.
  std::string Changed(const std::string& from, const std::string& to) const {
    EXPECT_EQ(from.size(), to.size());
    std::string bytes = ReadFile(Module()).value();
    size_t num_changed = 0;
    for (size_t at = 0; (at = bytes.find(from, at)) != std::string::npos; ++num_changed)
      bytes.replace(at, to.size(), to);
    EXPECT_GT(num_changed, 0u) << from;
    return Written(bytes);
  }
  std::string Written(const std::string& bytes) const {
    const std::string path = root_ + "/film.so";
    EXPECT_TRUE(WriteFileAtomically(path, bytes).ok());
    return path;
  }
  static Error LoadError(const std::string& path) {
    const Result<const FilmModule*> module = LoadFilmModule(path);
    return module.ok() ? Error{} : module.error();
  }

  std::string root_;
};

TEST_F(FilmModuleTest, OfThisBuildIsLoadedOnce) {
  const Result<const FilmModule*> module = LoadFilmModule(Module());
  ASSERT_TRUE(module.ok()) << module.error().message;
  EXPECT_STREQ((*module)->version, FilmModuleVersion());
  EXPECT_EQ(*LoadFilmModule(Module()), *module);
  // Its names, and FFmpeg's, are for nobody else.
  EXPECT_EQ(dlsym(RTLD_DEFAULT, kFilmModuleName), nullptr);
}

TEST_F(FilmModuleTest, OfAnotherBuildIsRefused) {
  const std::string version = FilmModuleVersion();
  std::string other = version;
  other.back() = other.back() == '0' ? '1' : '0';
  const std::string path = Changed(version, other);
  const Error error = LoadError(path);
  EXPECT_EQ(error.code, ErrorCode::kUnsupported);
  EXPECT_EQ(error.message, path + ": is of cairn " + other + ", but the program is " + version +
                               "; install both of one build");
}

TEST_F(FilmModuleTest, WithoutFfmpegSaysWhatToInstall) {
  const std::string path = Changed("libavformat.so.", "libavfarmat.so.");
  const Error error = LoadError(path);
  EXPECT_EQ(error.code, ErrorCode::kNotFound);
  EXPECT_THAT(error.message, AllOf(StartsWith(path + ": needs FFmpeg's libraries (libavfarmat.so."),
                                   testing::ContainsRegex("apt install libavformat[0-9]+ libavcodec[0-9]+ "
                                                          "libavutil[0-9]+ libswscale[0-9]+\\)$")));
}

// As where a file is damaged: there is nothing to install.
TEST_F(FilmModuleTest, WithALibraryThatIsThereButCannotBeLoadedDoesNotSayThatItIsMissing) {
  const std::string bytes = ReadFile(Module()).value();
  const std::string library = bytes.c_str() + bytes.find("libavformat.so.");
  const std::string damaged = "./" + std::string(library.size() - 2, 'd');  // a path: looked for nowhere else
  const std::string path = Changed(library, damaged);
  const fs::path before = fs::current_path();
  fs::current_path(root_);
  EXPECT_TRUE(WriteFileAtomically(damaged, "no library\n").ok());
  const Error error = LoadError(path);
  fs::current_path(before);
  EXPECT_EQ(error.code, ErrorCode::kUnsupported);
  EXPECT_THAT(error.message,
              AllOf(StartsWith(path + ": cannot be loaded (./ddd"), HasSubstr("install the program again")));
}

TEST_F(FilmModuleTest, ThatIsNoneIsRefused) {
  const auto is_refused = [](const std::string& path) {
    return AllOf(StartsWith(path + ": cannot be loaded ("), HasSubstr("); install the program again"));
  };
  const std::string none = root_ + "/none.so";
  EXPECT_EQ(LoadError(none).code, ErrorCode::kUnsupported);
  EXPECT_THAT(LoadError(none).message, is_refused(none));
  const std::string text = Written("no module\n");
  EXPECT_EQ(LoadError(text).code, ErrorCode::kUnsupported);
  EXPECT_THAT(LoadError(text).message, is_refused(text));
  const std::string foreign = Changed(kFilmModuleName, "cairn_fish_module");
  EXPECT_EQ(LoadError(foreign).code, ErrorCode::kUnsupported);
  EXPECT_THAT(LoadError(foreign).message, StartsWith(foreign + ": is no module of cairn"));
}

}  // namespace
}  // namespace cairn::pipeline
