#include "stages/emit_map/survey_files.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/line/memory.h"

namespace cairn::emit_map {
namespace {

// Of an empty file that is so large; what the program itself takes is left out.
int64_t NeededMib(int64_t file_mib, bool by_trial) {
  const std::string path = testing::TempDir() + "/survey_files_test.db";
  EXPECT_TRUE(WriteFileAtomically(path, "").ok());
  std::filesystem::resize_file(path, static_cast<uintmax_t>(file_mib) << 20);
  SurveyFiles files;
  files.classes_path = path;
  const auto fits = [&](int64_t memory_mib) {
    return CheckMemoryForSurvey("a trial", files, by_trial, memory_mib + (kProgramBytes >> 20)).ok();
  };
  int64_t low = 0, high = int64_t{1} << 20;
  while (low < high) {
    const int64_t middle = (low + high) / 2;
    (fits(middle) ? high : low) = fits(middle) ? middle : middle + 1;
  }
  std::filesystem::remove(path);
  return low;
}

TEST(CheckMemoryForSurvey, IsTwiceTheClassesAndMoreForTrials) {
  EXPECT_EQ(NeededMib(100, false), 200);
  EXPECT_EQ(NeededMib(100, true), 550 + 700);
  // A GiB of sights are kept at most.
  EXPECT_EQ(NeededMib(1000, true), 5500 + 1024);
  EXPECT_EQ(NeededMib(1000, false), 2000);
}

}  // namespace
}  // namespace cairn::emit_map
