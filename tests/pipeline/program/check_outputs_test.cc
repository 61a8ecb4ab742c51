#include "pipeline/program/check_outputs.h"

#include <unistd.h>

#include <filesystem>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "tests/pipeline/program/run_words.h"

namespace cairn::pipeline {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// A stage that reads IN and A=PATH, takes over --reuse, and writes -o and --svg.
class OutputTest : public testing::Test {
 protected:
  OutputTest() : folder_(fmt::format("{}/output_{}", testing::TempDir(), getpid())) {
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "capture");
    for (const char* name : {"in.db", "other.db", "capture/images.txt", "capture/a.PNG", "capture/old.db"})
      EXPECT_TRUE(WriteFileAtomically(Path(name), name).ok());
  }
  ~OutputTest() override { fs::remove_all(folder_); }
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }
  Outcome Run(const std::vector<std::string>& words) const {
    std::string in, out, svg;
    std::vector<std::string> more, reuse;
    const Command stage = {.name = "stage",
                           .summary = "Does nothing",
                           .add_arguments =
                               [&](ArgumentParser& parser) {
                                 parser.Add("in", in, "");
                                 parser.Add("--more", more, "");
                                 parser.Add("--reuse", reuse, "");
                                 parser.Add("-o,--output", out, "");
                                 parser.Add("--svg", svg, "");
                               },
                           .run = Nothing,
                           .may_be_output = {"--reuse"}};
    return RunWords({stage}, words);
  }
  void ExpectRefused(const std::vector<std::string>& words) const {
    const Outcome outcome = Run(words);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.err, HasSubstr("cannot be the output"));
  }

  fs::path folder_;
};

// Which some commands read and write without being told.
TEST_F(OutputTest, SignaturesBesideInputsAndOutputsAreFilesOfTheirs) {
  ASSERT_TRUE(WriteFileAtomically(Path("in.db.signatures"), "").ok());
  ExpectRefused({"stage", Path("in.db"), "-o", Path("in.db.signatures")});
  ASSERT_TRUE(WriteFileAtomically(Path("key.signatures"), "").ok());
  const Outcome outcome = Run({"stage", Path("in.db"), "--more", Path("key.signatures"), "-o", Path("key")});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("key.signatures: is an input, and where the signatures of the output"));
}

TEST_F(OutputTest, InputIsRefusedUnderWhicheverNameAndArgument) {
  fs::create_symlink("in.db", Path("link.db"));
  ExpectRefused({"stage", Path("in.db"), "-o", Path("in.db")});
  ExpectRefused({"stage", Path("link.db"), "-o", Path("in.db")});
  ExpectRefused({"stage", Path("in.db"), "-o", Path("capture/../in.db")});
  ExpectRefused({"stage", Path("other.db"), "--more", "a=" + Path("in.db"), "--svg=" + Path("in.db")});
  ExpectRefused({"stage", Path("in.db"), "-o", Path("new.db"), "--report", Path("in.db")});
}

TEST_F(OutputTest, FilesOfACaptureAndFoldersOfInputsAreRefused) {
  ExpectRefused({"stage", Path("capture"), "-o", Path("capture/images.txt")});
  ExpectRefused({"stage", Path("capture"), "-o", Path("capture/a.PNG")});
  ExpectRefused({"stage", Path("capture"), "-o", Path("capture/")});
  ExpectRefused({"stage", Path("capture/old.db"), "-o", Path("capture")});
}

TEST_F(OutputTest, EarlierAndOtherFilesMayBeReplaced) {
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"stage", Path("in.db"), "--reuse", Path("other.db"), "-o", Path("other.db")},
        {"stage", Path("capture"), "-o", Path("capture/old.db")},
        {"stage", Path("capture"), "-o", Path("capture/new.txt")},
        {"stage", Path("in.db"), "--svg", folder_.string()},
        {"stage", Path("nothing.db"), "-o", Path("nothing.db")}}) {
    const Outcome outcome = Run(words);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  }
}

}  // namespace
}  // namespace cairn::pipeline
