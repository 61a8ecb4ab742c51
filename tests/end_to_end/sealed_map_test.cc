#include <sys/mount.h>
#include <sys/stat.h>

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/files/file.h"
#include "tests/end_to_end/program_run.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

int Code(ErrorCode code) { return static_cast<int>(code); }

// A map of format 1.0, and what the program makes of it.
class SealedMap : public testing::Test {
 protected:
  SealedMap() : folder_("sealed_map_test") {
    const ProgramRun run = RunShell("cairn migrate " GOLDEN_DIR "/map_1.0.cairn -o " + Path("map.cairn"));
    EXPECT_EQ(run.exit_code, 0) << run.err;
  }
  std::string Path(const std::string& name) const { return folder_ / name; }

  TemporaryFolder folder_;
};

TEST_F(SealedMap, IsSignedAndVerified) {
  EXPECT_EQ(RunShell("cairn verify " + Path("map.cairn")).exit_code, 0);
  ASSERT_EQ(RunShell("cairn keygen " + Path("key")).exit_code, 0);
  ASSERT_EQ(RunShell("cairn keygen " + Path("other")).exit_code, 0);
  const std::string required = " --public-key " + Path("key.pub");
  EXPECT_EQ(RunShell("cairn verify " + Path("map.cairn") + required).exit_code, Code(ErrorCode::kNotSigned));
  const ProgramRun sign =
      RunShell("cairn sign " + Path("map.cairn") + " --key " + Path("key") + " -o " + Path("signed.cairn"));
  ASSERT_EQ(sign.exit_code, 0) << sign.err;
  const ProgramRun verify = RunShell("cairn verify " + Path("signed.cairn") + required);
  EXPECT_EQ(verify.exit_code, 0) << verify.err;
  EXPECT_THAT(verify.out, HasSubstr("whole, of epoch 1, signed with key"));
  EXPECT_EQ(RunShell("cairn verify " + Path("signed.cairn") + " --public-key " + Path("other.pub")).exit_code,
            Code(ErrorCode::kWrongKey));
}

TEST_F(SealedMap, SignedReleasesAreCounted) {
  ASSERT_EQ(RunShell("cairn keygen " + Path("key")).exit_code, 0);
  const std::string sign = "cairn sign " + Path("map.cairn") + " --key " + Path("key") + " -o ";
  const ProgramRun first = RunShell(sign + Path("1.cairn"));
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_THAT(first.out, HasSubstr(", epoch 1, signed with key"));
  const ProgramRun second = RunShell(sign + Path("2.cairn") + " --after " + Path("1.cairn"));
  ASSERT_EQ(second.exit_code, 0) << second.err;
  EXPECT_THAT(second.out, HasSubstr(", epoch 2, signed with key"));
  const std::string verify = "cairn verify " + Path("2.cairn") + " --public-key " + Path("key.pub");
  EXPECT_THAT(RunShell(verify + " --min-epoch 2").out, HasSubstr("whole, of epoch 2, signed"));
  EXPECT_EQ(RunShell(verify + " --min-epoch 3").exit_code, Code(ErrorCode::kNotNewer));
  EXPECT_EQ(RunShell(verify + " --name elsewhere").exit_code, Code(ErrorCode::kOtherMap));
  EXPECT_THAT(RunShell("cairn inspect " + Path("2.cairn")).out, HasSubstr("epoch"));
  // Invalid arguments.
  for (const std::string& arguments :
       std::vector<std::string>{" --epoch 0", " --epoch -1", " --epoch 18446744073709551616", " --epoch one",
                                " --epoch 2 --after " + Path("1.cairn")}) {
    EXPECT_EQ(RunShell(sign + Path("no.cairn") + arguments).exit_code, 2) << arguments;
    EXPECT_FALSE(fs::exists(Path("no.cairn")));
  }
  EXPECT_EQ(RunShell(sign + Path("no.cairn") + " --after " + Path("map.cairn")).exit_code,
            Code(ErrorCode::kNotSigned));
  const std::string back = "cairn update delta " + Path("2.cairn") + " " + Path("1.cairn") + " --key " +
                           Path("key") + " -o " + Path("d");
  const ProgramRun refused = RunShell(back);
  EXPECT_EQ(refused.exit_code, Code(ErrorCode::kNotNewer));
  EXPECT_THAT(refused.err, HasSubstr("cairn sign --after " + Path("2.cairn")));
  ASSERT_EQ(RunShell(back + " --allow-older").exit_code, 0);
  const std::string apply =
      "cairn update apply " + Path("2.cairn") + " " + Path("d") + " -o " + Path("made.cairn");
  EXPECT_EQ(RunShell(apply).exit_code, Code(ErrorCode::kNotNewer));
  EXPECT_EQ(RunShell(apply + " --allow-older --min-epoch 2").exit_code, Code(ErrorCode::kNotNewer));
  EXPECT_EQ(RunShell(apply + " --allow-older").exit_code, 0);
}

TEST_F(SealedMap, KeyThatOthersCanReadOrThatIsDamagedSignsNothing) {
  ASSERT_EQ(RunShell("cairn keygen " + Path("key")).exit_code, 0);
  const std::string sign =
      "cairn sign " + Path("map.cairn") + " --key " + Path("key") + " -o " + Path("signed.cairn");
  ASSERT_EQ(chmod(Path("key").c_str(), 0644), 0);
  const ProgramRun open = RunShell(sign);
  EXPECT_EQ(open.exit_code, Code(ErrorCode::kInvalidArgument));
  EXPECT_THAT(open.err, HasSubstr("chmod 600 " + Path("key")));
  ASSERT_EQ(chmod(Path("key").c_str(), 0600), 0);
  std::string text = *ReadFile(Path("key"));
  text[100] = text[100] == 'a' ? 'b' : 'a';
  ASSERT_TRUE(WriteFileAtomically(Path("key"), text).ok());
  const ProgramRun damaged = RunShell(sign);
  EXPECT_EQ(damaged.exit_code, Code(ErrorCode::kCorrupt));
  EXPECT_THAT(damaged.err, HasSubstr("restore it from a backup"));
  EXPECT_THAT(damaged.err, testing::Not(HasSubstr(text.substr(0, 16))));
  EXPECT_FALSE(fs::exists(Path("signed.cairn")));
}

TEST_F(SealedMap, FlippedBitIsFound) {
  std::string bytes = *ReadFile(Path("map.cairn"));
  bytes[bytes.size() / 2] ^= 4;
  ASSERT_TRUE(WriteFileAtomically(Path("flipped.cairn"), bytes).ok());
  const ProgramRun run = RunShell("cairn verify " + Path("flipped.cairn"));
  EXPECT_EQ(run.exit_code, Code(ErrorCode::kCorrupt));
  EXPECT_THAT(run.err, HasSubstr("flipped.cairn"));
}

TEST_F(SealedMap, OldFormatIsRefusedWithTheWayOut) {
  const ProgramRun run = RunShell("cairn inspect " GOLDEN_DIR "/map_1.0.cairn");
  EXPECT_EQ(run.exit_code, Code(ErrorCode::kTooOld));
  EXPECT_THAT(run.err, HasSubstr("cairn migrate"));
  EXPECT_EQ(RunShell("cairn inspect " + Path("map.cairn")).exit_code, 0);
}

TEST_F(SealedMap, InspectStatesTheFormatOfTheFile) {
  for (const std::string version : {"2.0", "2.1", "2.2", "2.3", "2.4", "2.5", "2.6", "2.7"}) {
    const ProgramRun run = RunShell("cairn inspect --json " GOLDEN_DIR "/map_" + version + ".cairn");
    EXPECT_THAT(run.out, HasSubstr("\"format\": \"" + version + "\"")) << run.err;
  }
}

TEST_F(SealedMap, EveryEarlierFormatIsMigratedToTodays) {
  for (const std::string version : {"1.0", "2.0", "2.1", "2.2", "2.3", "2.4", "2.5", "2.6", "2.7"}) {
    const std::string migrated = Path("migrated_" + version + ".cairn");
    const ProgramRun run = RunShell("cairn migrate " GOLDEN_DIR "/map_" + version + ".cairn -o " + migrated);
    ASSERT_EQ(run.exit_code, 0) << run.err;
    EXPECT_THAT(run.out, HasSubstr("as version 2.8, not signed"));
    EXPECT_EQ(RunShell("cairn verify " + migrated).exit_code, 0) << version;
    EXPECT_THAT(RunShell("cairn inspect --json " + migrated).out, HasSubstr("\"format\": \"2.8\""));
  }
}

TEST_F(SealedMap, FullDiskAndReadOnlyFolderLeaveTheOldMap) {
  const std::string disk = Path("disk");
  fs::create_directories(disk);
  if (mount("none", disk.c_str(), "tmpfs", 0, "size=8k") != 0)
    GTEST_SKIP() << "only root can mount a small tmpfs";
  ASSERT_TRUE(WriteFileAtomically(disk + "/out.cairn", "the map of yesterday").ok());
  const std::string migrate = "cairn migrate " GOLDEN_DIR "/map_1.0.cairn -o " + disk + "/out.cairn";
  const ProgramRun full = RunShell(migrate);
  EXPECT_EQ(full.exit_code, Code(ErrorCode::kDiskFull)) << full.err;
  EXPECT_EQ(*ReadFile(disk + "/out.cairn"), "the map of yesterday");
  ASSERT_EQ(RunShell("cairn keygen " + Path("key")).exit_code, 0);
  const ProgramRun sign =
      RunShell("cairn sign " + Path("map.cairn") + " --key " + Path("key") + " -o " + disk + "/out.cairn");
  EXPECT_EQ(sign.exit_code, Code(ErrorCode::kDiskFull)) << sign.err;
  EXPECT_EQ(*ReadFile(disk + "/out.cairn"), "the map of yesterday");
  EXPECT_EQ(mount("none", disk.c_str(), "tmpfs", MS_REMOUNT | MS_RDONLY, ""), 0);
  const ProgramRun read_only = RunShell(migrate);
  EXPECT_EQ(read_only.exit_code, Code(ErrorCode::kReadOnly)) << read_only.err;
  EXPECT_EQ(*ReadFile(disk + "/out.cairn"), "the map of yesterday");
  umount2(disk.c_str(), MNT_DETACH);
}

}  // namespace
}  // namespace cairn
