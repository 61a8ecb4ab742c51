#include "core/seal/accept_key_ring.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <filesystem>
#include <limits>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/seal/signature.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// People with keys, and rings of them in files.
class AcceptKeyRing : public testing::Test {
 protected:
  AcceptKeyRing() : folder_(testing::TempDir() + "/accept_key_ring") {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    for (const char* name : {"alice", "bob", "carol", "dave", "erin"}) people_[name] = MakeKeyPair();
  }
  std::string Path(const std::string& name) const { return folder_ + "/" + name; }

  // Writes a ring; returns its path.
  std::string Ring(const std::string& file, uint64_t version, int threshold,
                   const std::vector<std::string>& names) {
    KeyRing ring;
    ring.version = version;
    ring.threshold = threshold;
    for (const std::string& name : names) ring.keys.push_back({name, people_.at(name).public_key});
    const Result<std::string> text = EncodeKeyRing(ring);
    EXPECT_TRUE(text.ok()) << text.error().message;
    EXPECT_TRUE(WriteFileAtomically(Path(file), *text).ok());
    fs::remove(SignaturesPath(Path(file)));
    return Path(file);
  }

  void Sign(const std::string& path, const std::vector<std::string>& names) {
    for (const std::string& name : names) EXPECT_TRUE(SignKeyRing(path, people_.at(name).secret_key).ok());
  }

  // The code of accepting them one after the other, and nothing changes where that fails.
  ErrorCode Accept(const std::string& ring, const std::vector<std::string>& next) {
    const std::string before = ReadFile(ring).value();
    const Result<KeyRing> accepted = AcceptKeyRings(ring, next);
    if (accepted.ok()) {
      EXPECT_EQ(ReadFile(ring).value(), EncodeKeyRing(*accepted).value());
      return ErrorCode{};
    }
    message_ = accepted.error().message;
    EXPECT_EQ(ReadFile(ring).value(), before);
    return accepted.error().code;
  }

  std::string folder_;
  std::map<std::string, KeyPair> people_;
  std::string message_;
};

// Carol's key was stolen, and Dave comes in her place: two of the old ring and two of the new one sign.
TEST_F(AcceptKeyRing, StolenKeyIsReplaced) {
  const std::string robot = Ring("robot", 1, 2, {"alice", "bob", "carol"});
  const std::string next = Ring("next", 2, 2, {"alice", "bob", "dave"});
  Sign(next, {"bob", "alice"});
  EXPECT_EQ(Accept(robot, {next}), ErrorCode{});
  EXPECT_EQ(ReadFile(robot).value(), ReadFile(next).value());
  // Sent twice.
  EXPECT_EQ(Accept(robot, {next}), ErrorCode{});
}

// All combinations of signers: accepted where at least 2 of {alice, bob, carol} and 3 of {bob, dave, erin}
// are among them.
TEST_F(AcceptKeyRing, EnoughKeysOfBothRingsMustSign) {
  const std::string next = Ring("next", 2, 3, {"bob", "dave", "erin"});
  const std::vector<std::string> names = {"alice", "bob", "carol", "dave", "erin"};
  for (int chosen = 0; chosen < 32; ++chosen) {
    const std::string robot = Ring("robot", 1, 2, {"alice", "bob", "carol"});
    fs::remove(SignaturesPath(next));
    for (int i = 0; i < 5; ++i) {
      if ((chosen >> i & 1) != 0) Sign(next, {names[i]});
    }
    const int num_old = (chosen & 1) + (chosen >> 1 & 1) + (chosen >> 2 & 1);
    const int num_new = (chosen >> 1 & 1) + (chosen >> 3 & 1) + (chosen >> 4 & 1);
    const ErrorCode code = Accept(robot, {next});
    EXPECT_EQ(code == ErrorCode{}, num_old >= 2 && num_new >= 3) << chosen;
    if (num_old < 2) {
      EXPECT_EQ(code, num_old == 0 ? ErrorCode::kWrongKey : ErrorCode::kNotSigned) << chosen;
      EXPECT_THAT(message_, HasSubstr(fmt::format("{} of the 2 signatures that ring 1", num_old)));
    } else if (num_new < 3) {
      EXPECT_EQ(code, num_new == 0 ? ErrorCode::kWrongKey : ErrorCode::kNotSigned) << chosen;
      EXPECT_THAT(message_, HasSubstr(fmt::format("{} of the 3 signatures that ring 2", num_new)));
    }
  }
}

// Carol has stolen a key, or is the thief: alone she makes nothing that robots take.
TEST_F(AcceptKeyRing, OneKeyTakesOverNothing) {
  const std::string robot = Ring("robot", 1, 2, {"alice", "bob", "carol"});
  // A ring of her own; one with a lower threshold; one without the others; signed often.
  for (const auto& [threshold, names] : std::vector<std::pair<int, std::vector<std::string>>>{
           {1, {"carol"}}, {1, {"alice", "bob", "carol"}}}) {
    const std::string next = Ring("next", 2, threshold, names);
    Sign(next, {"carol", "carol"});
    EXPECT_EQ(Accept(robot, {next}), ErrorCode::kNotSigned);
    EXPECT_THAT(message_,
                HasSubstr("1 of the 2 signatures that ring 1 (alice, bob, carol), which the robot has, "
                          "requires: by carol"));
    // Other texts of the same signature, as a signature can be written in several ways.
    SignatureList list = ReadSignatures(SignaturesPath(next)).value();
    ASSERT_EQ(list.size(), 1U);
    list.push_back(list[0]);
    list.back().signature[63] |= 0x10;  // s + 2^252, which is not reduced
    ASSERT_TRUE(WriteFileAtomically(SignaturesPath(next), EncodeSignatures(list)).ok());
    EXPECT_EQ(Accept(robot, {next}), ErrorCode::kNotSigned);
  }
}

TEST_F(AcceptKeyRing, RevokedKeysCountNoLonger) {
  const std::string robot = Ring("robot", 1, 1, {"alice", "bob"});
  const std::string second = Ring("second", 2, 1, {"alice"});
  Sign(second, {"alice"});
  ASSERT_EQ(Accept(robot, {second}), ErrorCode{});
  const std::string third = Ring("third", 3, 1, {"bob"});
  Sign(third, {"bob"});
  EXPECT_EQ(Accept(robot, {third}), ErrorCode::kWrongKey);
}

TEST_F(AcceptKeyRing, OlderAndOtherRingsOfTheVersionAreRefused) {
  const std::vector<std::string> all = {"alice", "bob"};
  const std::string robot = Ring("robot", 3, 1, all);
  const std::string older = Ring("older", 2, 1, all), same = Ring("same", 3, 2, all);
  for (const std::string& path : {older, same}) Sign(path, all);
  EXPECT_EQ(Accept(robot, {older}), ErrorCode::kNotNewer);
  EXPECT_THAT(message_, HasSubstr("is earlier than " + robot));
  EXPECT_EQ(Accept(robot, {same}), ErrorCode::kNotNewer);
  EXPECT_THAT(message_, HasSubstr("a version has one ring"));
}

TEST_F(AcceptKeyRing, EachVersionIsTakenInTurn) {
  const std::string robot = Ring("robot", 1, 1, {"alice"});
  const std::string second = Ring("second", 2, 1, {"bob"}), third = Ring("third", 3, 1, {"carol"}),
                    fourth = Ring("fourth", 4, 1, {"alice", "dave"});
  Sign(second, {"alice", "bob"});
  Sign(third, {"bob", "carol", "alice"});
  Sign(fourth, {"carol", "dave"});
  // Alice has signed the third ring, too, but between them is the second.
  EXPECT_EQ(Accept(robot, {third}), ErrorCode::kNotNewer);
  EXPECT_THAT(message_, HasSubstr("is ring 3, but only the one after ring 1 follows it"));
  EXPECT_EQ(Accept(robot, {second, fourth}), ErrorCode::kNotNewer);
  EXPECT_EQ(Accept(robot, {third, second}), ErrorCode::kNotNewer);
  EXPECT_EQ(Accept(robot, {second, third, fourth}), ErrorCode{});
  EXPECT_EQ(ReadFile(robot).value(), ReadFile(fourth).value());
  // The same to a robot that has some of them already.
  fs::copy_file(third, robot, fs::copy_options::overwrite_existing);
  EXPECT_EQ(Accept(robot, {second, third, fourth}), ErrorCode{});
  EXPECT_EQ(ReadFile(robot).value(), ReadFile(fourth).value());
  EXPECT_EQ(Accept(robot, {second, third, fourth}), ErrorCode{});
  // One bad ring at the end, and none is taken.
  fs::copy_file(second, robot, fs::copy_options::overwrite_existing);
  Ring("fourth", 4, 1, {"dave"});
  EXPECT_EQ(Accept(robot, {third, fourth}), ErrorCode::kWrongKey);
}

TEST_F(AcceptKeyRing, SignaturesOfAnotherRingOrAMapDoNotCount) {
  const std::string robot = Ring("robot", 1, 1, {"alice"});
  const std::string next = Ring("next", 2, 1, {"alice", "bob"}),
                    other = Ring("other", 2, 1, {"alice", "carol"});
  Sign(other, {"alice"});
  fs::copy_file(SignaturesPath(other), SignaturesPath(next));
  EXPECT_EQ(Accept(robot, {next}), ErrorCode::kWrongKey);
  // A comment is signed as all else is.
  fs::remove(SignaturesPath(next));
  Sign(next, {"alice"});
  ASSERT_TRUE(WriteFileAtomically(next, ReadFile(next).value() + "# a comment\n").ok());
  EXPECT_EQ(Accept(robot, {next}), ErrorCode::kWrongKey);
}

TEST_F(AcceptKeyRing, DamagedSignaturesAreNamed) {
  const std::string robot = Ring("robot", 1, 1, {"alice"}), next = Ring("next", 2, 1, {"alice"});
  Sign(next, {"alice"});
  std::string text = ReadFile(SignaturesPath(next)).value();
  ASSERT_TRUE(WriteFileAtomically(SignaturesPath(next), text.substr(0, 100)).ok());
  EXPECT_EQ(Accept(robot, {next}), ErrorCode::kCorrupt);
  EXPECT_THAT(message_, HasSubstr("next.signatures: line 1"));
  for (size_t bit = 0; bit < 64 * 8; bit += 37) {
    SignatureList list = DecodeSignatures(text, "it").value();
    list[0].signature[bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
    ASSERT_TRUE(WriteFileAtomically(SignaturesPath(next), EncodeSignatures(list)).ok());
    EXPECT_EQ(Accept(robot, {next}), ErrorCode::kWrongKey) << bit;
  }
}

TEST_F(AcceptKeyRing, PublicKeyAloneHasNoNextRing) {
  ASSERT_TRUE(WriteFileAtomically(Path("robot"), HexOf(people_["alice"].public_key) + "\n").ok());
  const std::string next = Ring("next", 1, 1, {"alice"});
  Sign(next, {"alice"});
  EXPECT_EQ(AcceptKeyRings(Path("robot"), {next}).error().code, ErrorCode::kCorrupt);
  EXPECT_EQ(AcceptKeyRings(next, {}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(AcceptKeyRings(next, {next}).error().code, ErrorCode::kInvalidArgument);
  const KeyRingFile file = ReadKeyRing(next).value();
  EXPECT_EQ(
      CheckNextKeyRing(people_["alice"].public_key, file, ReadSignatures(SignaturesPath(next)).value(), "it")
          .error()
          .code,
      ErrorCode::kInvalidArgument);
}

TEST_F(AcceptKeyRing, NothingFollowsTheLastVersion) {
  constexpr uint64_t kLast = std::numeric_limits<uint64_t>::max();
  const std::string robot = Ring("robot", kLast - 1, 1, {"alice"}), last = Ring("last", kLast, 1, {"alice"});
  Sign(last, {"alice"});
  EXPECT_EQ(Accept(robot, {last}), ErrorCode{});
  const std::string first = Ring("first", 1, 1, {"alice"});
  Sign(first, {"alice"});
  EXPECT_EQ(Accept(robot, {first}), ErrorCode::kNotNewer);
}

TEST_F(AcceptKeyRing, LinkLeadsToTheRingAndStays) {
  const std::string robot = Ring("robot", 1, 1, {"alice"}), next = Ring("next", 2, 1, {"alice"});
  Sign(next, {"alice"});
  fs::create_symlink(robot, Path("link"));
  ASSERT_TRUE(AcceptKeyRings(Path("link"), {next}).ok());
  EXPECT_TRUE(fs::is_symlink(Path("link")));
  EXPECT_EQ(ReadFile(robot).value(), ReadFile(next).value());
}

// Two at once could put the earlier ring in the later one's place.
TEST_F(AcceptKeyRing, OneAtATime) {
  const std::string robot = Ring("robot", 1, 1, {"alice"}), next = Ring("next", 2, 1, {"alice"});
  Sign(next, {"alice"});
  const int folder = open(folder_.c_str(), O_RDONLY | O_DIRECTORY);
  ASSERT_EQ(flock(folder, LOCK_EX | LOCK_NB), 0);
  EXPECT_EQ(Accept(robot, {next}), ErrorCode::kBusy);
  close(folder);
  EXPECT_EQ(Accept(robot, {next}), ErrorCode{});
}

}  // namespace
}  // namespace cairn
