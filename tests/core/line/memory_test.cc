#include "core/line/memory.h"

#include <unistd.h>

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/disk_space.h"
#include "core/files/file.h"

namespace cairn {
namespace {

using testing::HasSubstr;

TEST(Memory, DefaultIsMostOfTheMachineAtMost) {
  const int64_t machine_mib = int64_t{sysconf(_SC_PHYS_PAGES)} * sysconf(_SC_PAGESIZE) >> 20;
  EXPECT_GT(DefaultMemoryMib(), 0);
  EXPECT_LE(DefaultMemoryMib(), machine_mib * 4 / 5 + 1);
}

TEST(Memory, WorkThatDoesNotFitIsRefusedWithBothNumbers) {
  EXPECT_TRUE(CheckMemory("sorting", 100 << 20, 164).ok());
  const Status status = CheckMemory("sorting", 100 << 20, 163);
  ASSERT_FALSE(status.ok());
  EXPECT_THAT(status.error().message,
              HasSubstr("sorting takes about 164 MiB of memory, but --memory allows 163 MiB;"));
}

TEST(Memory, EstimateFollowsTheFile) {
  const std::string path = fmt::format("{}/memory_{}", testing::TempDir(), getpid());
  ASSERT_TRUE(WriteFileAtomically(path, std::string(1 << 20, 'x')).ok());
  EXPECT_TRUE(CheckMemoryForFile("reading", path, 2.0, 66).ok());
  const Status status = CheckMemoryForFile("reading", path, 2.0, 65);
  ASSERT_FALSE(status.ok());
  EXPECT_THAT(status.error().message, HasSubstr("reading of " + path + " takes about 66 MiB"));
  std::filesystem::remove(path);
  EXPECT_TRUE(CheckMemoryForFile("reading", path, 2.0, 1).ok());  // the reader reports that it is missing
}

TEST(DiskSpace, ShortageIsRefusedBeforeTheWorkWithTheWayAround) {
  EXPECT_TRUE(CheckDiskSpace("little", testing::TempDir(), 4096).ok());
  const Status status = CheckDiskSpace("the features of 9 images", testing::TempDir(), int64_t{1} << 60);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kDiskFull);
  EXPECT_THAT(status.error().message, HasSubstr("the features of 9 images takes about 1152921504607 MB"));
  EXPECT_THAT(status.error().message, HasSubstr("--no-space-check"));
}

}  // namespace
}  // namespace cairn
