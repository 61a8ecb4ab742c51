// Rings of keys through the program.
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
using testing::Not;

// A small map, not signed, keys of four people, and a ring of three of them.
class Keys : public testing::Test {
 protected:
  Keys() : folder_("keys_test") {
    Runs("cairn migrate " GOLDEN_DIR "/map_1.0.cairn -o unsigned");
    for (const char* name : {"alice", "bob", "carol", "dave"}) Runs(std::string("cairn keygen ") + name);
    Runs("cairn keys make alice=alice.pub bob=bob.pub carol=carol.pub --threshold 2 -o fleet.ring");
  }
  std::string Path(const std::string& name) const { return folder_ / name; }

  // In the folder.
  ProgramRun Run(const std::string& command) const {
    return RunShell("cd " + folder_.string() + " && " + command);
  }
  std::string Runs(const std::string& command) const {
    const ProgramRun run = Run(command);
    EXPECT_EQ(run.exit_code, 0) << command << ": " << run.err;
    return run.out;
  }
  // Fails with this code and these words.
  void Fails(const std::string& command, ErrorCode code, const std::string& words) const {
    const ProgramRun run = Run(command);
    EXPECT_EQ(run.exit_code, static_cast<int>(code)) << command << ": " << run.err;
    EXPECT_THAT(run.err, HasSubstr(words)) << command;
  }

  TemporaryFolder folder_;
};

TEST_F(Keys, TwoSignARelease) {
  Runs("cairn sign unsigned --key alice -o map");
  Fails("cairn verify map --public-key fleet.ring", ErrorCode::kNotSigned,
        "1 of the 2 signatures that ring 1 (alice, bob, carol) requires: by alice; not by bob, carol, of "
        "whom 1 more");
  EXPECT_THAT(Runs("cairn sign map --key bob --add"),
              HasSubstr("map.signatures: has the signature of map, map '"));
  EXPECT_THAT(Runs("cairn verify map --public-key fleet.ring"),
              HasSubstr("signed by alice, bob, of ring 1 (alice, bob, carol), which requires 2"));
  // On another machine, in a file that is sent back.
  Runs("rm map.signatures && cairn sign map --key carol --add -o carols && cat carols >> map.signatures");
  EXPECT_THAT(Runs("cairn verify map --public-key fleet.ring"),
              HasSubstr("signed by alice, carol, of ring 1"));
  // A public key is still one.
  EXPECT_THAT(Runs("cairn verify map --public-key alice.pub"), HasSubstr("of epoch 1, signed with key"));
  Fails("cairn sign map --key alice --add", ErrorCode::kInvalidArgument, "in its seal already");
  Fails("cairn sign unsigned --key bob --add", ErrorCode::kNotSigned, "sign it first with");
  Fails("cairn sign map --key bob", ErrorCode::kInvalidArgument,
        "-o: give the signed map to write, or --add");
  Fails("cairn sign map --key bob --add --epoch 3", ErrorCode::kInvalidArgument, "--add: signs map as it is");
}

TEST_F(Keys, FleetIsUpdatedByTwo) {
  Runs("cairn sign unsigned --key alice -o 1 && cairn sign 1 --key bob --add");
  Fails("cairn sign unsigned --key carol --after 1 -o 2", ErrorCode::kWrongKey, "is required");
  Runs("cairn sign unsigned --key carol --after 1 --public-key fleet.ring -o 2");
  Runs("cp 1 robot && cp 1.signatures robot.signatures");
  Runs("cairn update delta 1 2 --key carol -o one");
  Fails("cairn update apply robot one --in-place --public-key fleet.ring", ErrorCode::kNotSigned, "by carol");
  Runs("cairn sign 2 --key alice --add");
  EXPECT_THAT(Runs("cairn update delta 1 2 --key carol -o both"),
              HasSubstr("both.signatures: 1 more signatures of 2; send it with the delta"));
  Runs("cairn update apply 1 both -o beside --public-key fleet.ring");
  Runs("cairn verify beside --public-key fleet.ring");
  Runs("cairn update apply robot one --signatures both.signatures --in-place --public-key fleet.ring");
  EXPECT_THAT(Runs("cairn verify robot --public-key fleet.ring --min-epoch 2"),
              HasSubstr("of epoch 2, signed by alice, carol"));
  Runs("cairn update rollback robot --public-key fleet.ring");
  EXPECT_THAT(Runs("cairn verify robot --public-key fleet.ring"),
              HasSubstr("of epoch 1, signed by alice, bob"));
  Runs("cairn verify robot.previous --public-key fleet.ring");
}

TEST_F(Keys, LostKeyIsReplacedAndCountsNoLonger) {
  Runs("cairn sign unsigned --key alice -o map && cairn sign map --key bob --add");
  Runs("cp fleet.ring robot.ring");
  EXPECT_THAT(
      Runs("cairn keys make alice=alice.pub carol=carol.pub dave=dave.pub --threshold 2 --after fleet.ring "
           "-o next.ring"),
      HasSubstr("next.ring: ring 2 (alice, carol, dave), 2 of whom must sign; robots with fleet.ring take it "
                "when 2 of that ring's keys and 2 of its own have signed it"));
  Fails("cairn keys accept robot.ring next.ring", ErrorCode::kWrongKey, "0 of the 2 signatures that ring 1");
  EXPECT_THAT(Runs("cairn keys sign next.ring --key alice"),
              HasSubstr("next.ring.signatures: has the signature of ring 2 (alice, carol, dave) by alice"));
  Fails("cairn keys accept robot.ring next.ring", ErrorCode::kNotSigned, "1 of the 2 signatures that ring 1");
  EXPECT_THAT(Runs("cairn keys sign next.ring --key bob"), HasSubstr("which it lacks"));
  Fails("cairn keys accept robot.ring next.ring", ErrorCode::kNotSigned, "1 of the 2 signatures that ring 2");
  Fails("cairn keys show next.ring --after fleet.ring", ErrorCode::kNotSigned,
        "1 of the 2 signatures that ring 2");
  Runs("cairn keys sign next.ring --key dave");
  const std::string shown = Runs("cairn keys show next.ring --after fleet.ring");
  EXPECT_THAT(shown, HasSubstr("ring 2: 2 of 3 keys must sign"));
  EXPECT_THAT(shown, HasSubstr(" alice, who has signed this ring\n"));
  EXPECT_THAT(shown, HasSubstr(" carol\n"));
  EXPECT_THAT(shown, HasSubstr("follows fleet.ring: robots that have that one take it"));
  EXPECT_THAT(Runs("cairn keys accept robot.ring next.ring"),
              HasSubstr("robot.ring: is ring 2 (alice, carol, dave), 2 of whom must sign"));
  Runs("cmp robot.ring next.ring && cairn keys accept robot.ring next.ring");
  Fails("cairn keys accept robot.ring fleet.ring", ErrorCode::kNotNewer, "a robot goes only forward");
  // Bob's signature counts no longer; the same map with Dave's is the same map.
  Fails("cairn verify map --public-key robot.ring", ErrorCode::kNotSigned, "by alice; not by carol, dave");
  Runs("cairn sign map --key dave --add && cairn verify map --public-key robot.ring");
  Runs("cairn verify map --public-key fleet.ring");
}

TEST_F(Keys, ThreeRingsAreTakenInTurn) {
  Runs("cairn keys make alice=alice.pub --threshold 1 -o 1");
  Runs("cairn keys make bob=bob.pub --threshold 1 --after 1 -o 2 && cairn keys sign 2 --key alice");
  Runs("cairn keys sign 2 --key bob");
  Runs("cairn keys make carol=carol.pub --threshold 1 --after 2 -o 3 && cairn keys sign 3 --key bob");
  Runs("cairn keys sign 3 --key carol && cairn keys sign 3 --key alice && cp 1 robot.ring");
  Fails("cairn keys accept robot.ring 3", ErrorCode::kNotNewer,
        "is ring 3, but only the one after ring 1 follows it");
  EXPECT_THAT(Runs("cairn keys accept robot.ring 2 3"), HasSubstr("robot.ring: is ring 3 (carol)"));
}

TEST_F(Keys, RingsThatCannotBeMeantAreNotMade) {
  const std::string make = "cairn keys make -o no.ring ";
  Fails(make + "alice=alice.pub --threshold 2", ErrorCode::kInvalidArgument, "a threshold of 2 of 1 keys");
  Fails(make + "alice=alice.pub --threshold 18446744073709551615", ErrorCode::kInvalidArgument, "of 1 keys");
  Fails(make + "alice=alice.pub --threshold 0", ErrorCode::kInvalidArgument, "expected a whole number");
  Fails(make + "alice=alice.pub --threshold NaN", ErrorCode::kInvalidArgument, "expected a whole number");
  Fails(make + "alice=alice.pub bob=alice.pub --threshold 2", ErrorCode::kInvalidArgument, "is there twice");
  Fails(make + "alice=alice.pub alice=bob.pub --threshold 2", ErrorCode::kInvalidArgument,
        "two keys have the name");
  Fails(make + "alice --threshold 1", ErrorCode::kInvalidArgument, "expected NAME=KEY.pub");
  Fails(make + "=alice.pub --threshold 1", ErrorCode::kInvalidArgument, "has no name");
  Fails(make + "alice=alice --threshold 1", ErrorCode::kInvalidArgument, "is a secret key");
  Fails(make + "alice=none --threshold 1", ErrorCode::kNotFound, "none: no such file");
  Fails(make + "alice=alice.pub --threshold 1 --after alice.pub", ErrorCode::kCorrupt, "alice.pub: line 1");
  EXPECT_FALSE(fs::exists(Path("no.ring")));
}

// Whatever is given as a key or a ring.
TEST_F(Keys, WhatIsNeitherKeyNorRingIsRefused) {
  Runs(
      "cairn sign unsigned --key alice -o map && mkfifo pipe && mkdir dir && : > empty && cp fleet.ring "
      "open.ring");
  Runs("chmod 666 open.ring && sed 's/$/\\r/' fleet.ring > crlf.ring && head -c 100 fleet.ring > cut.ring");
  Runs("head -c -1 fleet.ring > last.ring && yes \"$(tail -n 1 fleet.ring)\" | head -n 1000000 > many");
  Runs(
      "cat fleet.ring many > many.ring && sed \"s/^key [0-9a-f]*/key $(cat alice)/\" fleet.ring > "
      "secret.ring");
  const std::string verify = "timeout 20 cairn verify map --public-key ";
  Fails(verify + "pipe", ErrorCode::kInvalidArgument, "pipe: not a regular file");
  Fails(verify + "dir", ErrorCode::kInvalidArgument, "dir: not a regular file");
  Fails(verify + "empty", ErrorCode::kCorrupt, "empty: not a public key");
  Fails(verify + "none", ErrorCode::kNotFound, "none: no such file");
  Fails(verify + "open.ring", ErrorCode::kInvalidArgument, "`chmod o-w open.ring`");
  Fails(verify + "crlf.ring", ErrorCode::kCorrupt, "crlf.ring: ");
  Fails(verify + "cut.ring", ErrorCode::kCorrupt, "the file was cut off");
  Fails(verify + "last.ring", ErrorCode::kCorrupt, "ends without a line feed");
  Fails(verify + "many.ring", ErrorCode::kInvalidArgument, "is larger than 16384 bytes");
  Fails(verify + "secret.ring", ErrorCode::kInvalidArgument, "line 4: has a secret key");
  EXPECT_THAT(Run(verify + "secret.ring").err, Not(HasSubstr(ReadFile(Path("alice")).value().substr(0, 16))));
  Fails(verify + "alice", ErrorCode::kInvalidArgument, "is a secret key");
  // And what lies beside the map.
  Runs("yes \"$(cat alice.pub) $(cat alice)\" | head -n 100000 > map.signatures");
  Fails(verify + "fleet.ring", ErrorCode::kInvalidArgument, "map.signatures: is larger than 65536 bytes");
  Runs("rm map.signatures && mkfifo map.signatures");
  Fails(verify + "fleet.ring", ErrorCode::kInvalidArgument, "map.signatures: not a regular file");
  Runs("cairn verify map --public-key alice.pub");  // which does not need them
}

// A robot has no clock that can be trusted: in any year it does the same.
TEST_F(Keys, ClockChangesNothing) {
  Runs("cairn sign unsigned --key alice -o 1 && cairn sign 1 --key bob --add");
  Runs("cairn sign unsigned --key alice --after 1 -o 2 && cairn sign 2 --key carol --add");
  Runs("cairn update delta 1 2 --key bob -o d");
  Runs("cairn keys make alice=alice.pub dave=dave.pub --threshold 2 --after fleet.ring -o next.ring");
  Runs("for key in alice bob dave; do cairn keys sign next.ring --key $key; done");
  std::string told[3];
  const char* const years[] = {"0", "4102444800", ""};  // 1970, 2100, now
  for (int i = 0; i < 3; ++i) {
    const std::string clock =
        *years[i] == '\0' ? ""
                          : std::string("LD_PRELOAD='" CAIRN_CLOCK_LIBRARY "' CLOCK_S=") + years[i] + " ";
    if (!clock.empty()) EXPECT_THAT(Runs(clock + "date +%s"), HasSubstr(years[i]));
    Runs("rm -f robot* && cp 1 robot && cp 1.signatures robot.signatures && cp fleet.ring robot.ring");
    told[i] = Runs(clock + "cairn update apply robot d --in-place --public-key robot.ring");
    told[i] += Runs(clock + "cairn verify robot --public-key robot.ring");
    told[i] += Runs(clock + "cairn keys accept robot.ring next.ring");
    const ProgramRun after = Run(clock + "cairn verify robot --public-key robot.ring");
    EXPECT_EQ(after.exit_code, static_cast<int>(ErrorCode::kNotSigned));
    told[i] += Runs("cat robot.signatures robot.ring");
    Runs("cmp robot 2");
  }
  EXPECT_EQ(told[0], told[2]);
  EXPECT_EQ(told[1], told[2]);
}

TEST_F(Keys, AtlasIsSignedByTwo) {
  Runs("cp unsigned a.cairn && cairn atlas a.cairn --key alice -o site.atlas");
  Fails("cairn verify site.atlas --public-key fleet.ring", ErrorCode::kNotSigned, "1 of the 2 signatures");
  Fails("cairn sign site.atlas --key alice --add", ErrorCode::kInvalidArgument, "has the signature of key");
  Runs("cairn sign site.atlas --key bob --add");
  EXPECT_THAT(Runs("cairn verify site.atlas --public-key fleet.ring"),
              HasSubstr("signed by alice, bob, of ring 1"));
}

}  // namespace
}  // namespace cairn
