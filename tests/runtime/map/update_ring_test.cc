// Updates of a robot that trusts a ring of keys.
#include <sys/stat.h>

#include <filesystem>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/delta/map_delta.h"
#include "core/files/file.h"
#include "core/seal/map_seal.h"
#include "core/seal/signature.h"
#include "runtime/map/map.h"
#include "tests/runtime/map/update_map_fixture.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// The room in epochs 1 to 3, each signed by Alice in its seal and by Bob in a file of his, bobs.1 to bobs.3.
// The robot trusts a ring of Alice, Bob and Carol, two of whom must sign.
class UpdateRing : public UpdateMapTest {
 protected:
  static void SetUpTestSuite() {
    UpdateMapTest::SetUpTestSuite();
    people_ = new People();
    MapRows rows = *ReadMapRows(Path("new.cairn"));
    rows.name = "room";
    ASSERT_TRUE(WriteMapRows(rows, Path("newer.cairn")).ok());
    for (const auto& [from, epoch] : {std::pair("old.cairn", 1), {"newer.cairn", 2}, {"old.cairn", 3}}) {
      const std::string map = Path(fmt::format("ring.{}", epoch)), bobs = Path(fmt::format("bobs.{}", epoch));
      ASSERT_TRUE(SignMap(Path(from), people_->alice.secret_key, map, epoch).ok());
      fs::remove(bobs);
      ASSERT_TRUE(AddMapSignature(map, people_->bob.secret_key, bobs).ok());
    }
  }
  static void TearDownTestSuite() { delete people_; }

  UpdateRing() {
    ring_.version = 1;
    ring_.threshold = 2;
    ring_.keys = {{"alice", people_->alice.public_key},
                  {"bob", people_->bob.public_key},
                  {"carol", people_->carol.public_key}};
    robot_ = Path("ring_robot");
    for (const char* end : {"", ".previous", ".signatures", ".previous.signatures"}) fs::remove(robot_ + end);
    for (const char* name : {"ring.delta.signatures", "ring_made", "ring_made.signatures"})
      fs::remove(Path(name));
  }

  // A signed delta between two epochs.
  static std::string Delta(int from, int to, const KeyPair& signer = people_->alice) {
    const Result<MapDelta> delta = MakeMapDelta(Path(fmt::format("ring.{}", from)),
                                                Path(fmt::format("ring.{}", to)), signer.secret_key, true);
    EXPECT_TRUE(delta.ok()) << delta.error().message;
    EXPECT_TRUE(WriteFileAtomically(Path("ring.delta"), EncodeMapDelta(*delta)).ok());
    return Path("ring.delta");
  }

  // Puts an epoch and Bob's signatures of some in the robot's place.
  void Install(int epoch, const std::vector<int>& signatures) const {
    fs::copy_file(Path(fmt::format("ring.{}", epoch)), robot_, fs::copy_options::overwrite_existing);
    fs::remove(SignaturesPath(robot_));
    std::string text;
    for (const int of : signatures) text += ReadFile(Path(fmt::format("bobs.{}", of))).value();
    if (!text.empty()) ASSERT_TRUE(WriteFileAtomically(SignaturesPath(robot_), text).ok());
  }

  static void Send(int signatures_of) {
    fs::copy_file(Path(fmt::format("bobs.{}", signatures_of)), Path("ring.delta.signatures"),
                  fs::copy_options::overwrite_existing);
  }

  bool IsTrusted(const std::string& path) const { return Map::Open(path, {.public_key = ring_}).ok(); }

  ErrorCode Update(const std::string& delta, const std::function<void(UpdateOptions*)>& change = {}) {
    UpdateOptions options = {.public_key = ring_};
    if (change) change(&options);
    const Result<bool> updated = UpdateMap(robot_, delta, options);
    message_ = updated.ok() ? "" : updated.error().message;
    return updated.ok() ? ErrorCode{} : updated.error().code;
  }

  int EpochInPlace() const { return static_cast<int>(Map::Open(robot_).value()->head().epoch); }
  std::string SignaturesInPlace() const {
    const Result<std::string> text = ReadFile(SignaturesPath(robot_));
    return text.ok() ? *text : "";
  }
  static std::string Bobs(const std::vector<int>& epochs) {
    SignatureList list;
    for (const int epoch : epochs)
      list.push_back(ReadSignatures(Path(fmt::format("bobs.{}", epoch))).value()[0]);
    return EncodeSignatures(list);
  }

  struct People {
    KeyPair alice = MakeKeyPair(), bob = MakeKeyPair(), carol = MakeKeyPair(), stranger = MakeKeyPair();
  };
  static People* people_;
  KeyRing ring_;
  std::string robot_, message_;
};
UpdateRing::People* UpdateRing::people_ = nullptr;

TEST_F(UpdateRing, SignaturesComeWithTheDeltaAndStayWithBothMaps) {
  Install(1, {1});
  const std::string delta = Delta(1, 2);
  EXPECT_EQ(Update(delta), ErrorCode::kNotSigned);
  EXPECT_THAT(message_,
              HasSubstr("1 of the 2 signatures that ring 1 (alice, bob, carol) requires: by alice"));
  EXPECT_EQ(EpochInPlace(), 1);
  EXPECT_EQ(SignaturesInPlace(), Bobs({1}));
  Send(2);
  EXPECT_EQ(Update(delta), ErrorCode{});
  EXPECT_EQ(EpochInPlace(), 2);
  EXPECT_EQ(SignaturesInPlace(), Bobs({1, 2}));
  EXPECT_TRUE(IsTrusted(robot_));
  EXPECT_TRUE(IsTrusted(PreviousMapPath(robot_)));
  // The next update drops those of the map that is no longer there.
  const std::string next = Delta(2, 3);
  Send(3);
  EXPECT_EQ(Update(next), ErrorCode{});
  EXPECT_TRUE(IsTrusted(robot_));
  EXPECT_TRUE(IsTrusted(PreviousMapPath(robot_)));
  EXPECT_EQ(EpochInPlace(), 3);
  EXPECT_EQ(SignaturesInPlace(), Bobs({1, 2, 3}));  // until then epoch 1 was the one before
}

// Whoever has a delivery in his hands can sign the next map too, and send many such signatures along.
TEST_F(UpdateRing, SignaturesOfStrangersAreInNobodysWay) {
  Install(1, {1});
  Delta(1, 2);
  Send(2);
  SignatureList many = ReadSignatures(Path("ring.delta.signatures")).value();
  const Seal seal = ReadSeal(Path("ring.2")).value();
  const auto send_with_strangers = [&](size_t num) {
    while (many.size() < num) {
      const KeyPair key = MakeKeyPair();
      many.push_back({key.public_key, *SignBytes(SignedBytesOf(seal), key.secret_key)});
    }
    ASSERT_TRUE(WriteFileAtomically(Path("ring.delta.signatures"), EncodeSignatures(many)).ok());
  };
  // With Bob's of the first epoch, as many as there may be: all stay.
  send_with_strangers(kMaxSignatures - 1);
  EXPECT_EQ(Update(Path("ring.delta")), ErrorCode{}) << message_;
  EXPECT_EQ(ReadSignatures(SignaturesPath(robot_)).value().size(), kMaxSignatures);
  Install(1, {1});
  send_with_strangers(kMaxSignatures);
  EXPECT_EQ(Update(Path("ring.delta")), ErrorCode{})
      << message_;  // with Bob's of the first epoch, one too many
  EXPECT_EQ(SignaturesInPlace(), Bobs({1, 2}));
  const std::string next = Delta(2, 3);
  Send(3);
  EXPECT_EQ(Update(next), ErrorCode{}) << message_;
}

TEST_F(UpdateRing, GoingBackIsOneExchange) {
  Install(1, {1});
  Delta(1, 2);
  Send(2);
  ASSERT_EQ(Update(Path("ring.delta")), ErrorCode{});
  const std::string signatures = SignaturesInPlace();
  for (const int epoch : {1, 2, 1}) {
    ASSERT_TRUE(RollBackMap(robot_, {.public_key = ring_}).ok());
    EXPECT_EQ(EpochInPlace(), epoch);
    EXPECT_TRUE(IsTrusted(robot_));
    EXPECT_TRUE(IsTrusted(PreviousMapPath(robot_)));
    EXPECT_EQ(SignaturesInPlace(), signatures);
  }
  EXPECT_EQ(RollBackMap(robot_, {.public_key = ring_, .min_epoch = 3}).error().code, ErrorCode::kNotNewer);
  // Without its second signature there is no way back.
  ASSERT_TRUE(WriteFileAtomically(SignaturesPath(robot_), Bobs({1})).ok());
  EXPECT_EQ(RollBackMap(robot_, {.public_key = ring_}).error().code, ErrorCode::kNotSigned);
  EXPECT_EQ(EpochInPlace(), 1);
}

TEST_F(UpdateRing, SignaturesMayComeInAnotherFile) {
  Install(1, {1});
  const std::string delta = Delta(1, 2);
  EXPECT_EQ(Update(delta, [](UpdateOptions* options) { options->signatures = Path("nowhere"); }),
            ErrorCode::kNotFound);
  EXPECT_EQ(Update(delta, [](UpdateOptions* options) { options->signatures = Path("bobs.1"); }),
            ErrorCode::kNotSigned);
  EXPECT_EQ(EpochInPlace(), 1);
  EXPECT_EQ(Update(delta, [](UpdateOptions* options) { options->signatures = Path("bobs.2"); }), ErrorCode{});
  EXPECT_TRUE(IsTrusted(robot_));
}

// All that somebody with one key can make: a map and a delta of his own, with old signatures of the others.
TEST_F(UpdateRing, OneStolenKeyMovesNoMap) {
  const KeyPair& stolen = people_->carol;
  ASSERT_TRUE(SignMap(Path("newer.cairn"), stolen.secret_key, Path("ring.9"), 9).ok());
  Install(1, {1});
  const std::string delta = Delta(1, 9, stolen);
  EXPECT_EQ(Update(delta), ErrorCode::kNotSigned);
  for (const int old : {1, 2, 3}) {
    Send(old);
    EXPECT_EQ(Update(delta), ErrorCode::kNotSigned) << old;
    EXPECT_THAT(message_,
                HasSubstr("1 of the 2 signatures that ring 1 (alice, bob, carol) requires: by carol"));
  }
  // His own signature, twice more.
  fs::remove(Path("carols"));
  ASSERT_TRUE(
      AddSignature(SignedBytesOf(ReadSeal(Path("ring.9")).value()), stolen.secret_key, Path("carols")).ok());
  const std::string line = ReadFile(Path("carols")).value();
  ASSERT_TRUE(WriteFileAtomically(Path("ring.delta.signatures"), line + line).ok());
  EXPECT_EQ(Update(delta), ErrorCode::kNotSigned);
  EXPECT_EQ(EpochInPlace(), 1);
  EXPECT_TRUE(IsTrusted(robot_));
  EXPECT_FALSE(fs::exists(PreviousMapPath(robot_)));
  // Nor where he puts it there himself: it is not opened, and counts for nothing when the next one comes.
  fs::copy_file(Path("ring.9"), robot_, fs::copy_options::overwrite_existing);
  EXPECT_FALSE(IsTrusted(robot_));
  const std::string repair = Delta(9, 2);
  Send(2);
  EXPECT_EQ(Update(repair), ErrorCode{});
  EXPECT_EQ(EpochInPlace(), 2);
  EXPECT_TRUE(IsTrusted(robot_));
  EXPECT_EQ(RollBackMap(robot_, {.public_key = ring_}).error().code, ErrorCode::kNotSigned);
}

TEST_F(UpdateRing, DeltaIsOfAKeyOfTheRing) {
  Install(1, {1});
  const std::string theirs = Delta(1, 2, people_->stranger);
  Send(2);
  EXPECT_EQ(Update(theirs), ErrorCode::kWrongKey);
  EXPECT_EQ(EpochInPlace(), 1);
  EXPECT_EQ(Update(Delta(1, 2, people_->carol)), ErrorCode{});
}

TEST_F(UpdateRing, OlderMapsAreNotTakenWhoeverHasSignedThem) {
  Install(3, {3, 2, 1});
  const std::string delta = Delta(3, 2);
  Send(2);
  EXPECT_EQ(Update(delta), ErrorCode::kNotNewer);
  EXPECT_EQ(EpochInPlace(), 3);
  EXPECT_EQ(Update(delta, [](UpdateOptions* options) { options->allow_older = true; }), ErrorCode{});
  EXPECT_EQ(EpochInPlace(), 2);
}

// The signatures of a release without which its map is not trusted, taken from a robot's folder, or others
// put there.
TEST_F(UpdateRing, ExchangedSignaturesLoseTheMapAndAreMadeGoodByTheNextUpdate) {
  for (const std::string& text : {Bobs({2}), std::string("garbage"), std::string()}) {
    Install(1, {1});
    ASSERT_TRUE(WriteFileAtomically(SignaturesPath(robot_), text).ok());
    EXPECT_FALSE(IsTrusted(robot_));
    const std::string delta = Delta(1, 2);
    Send(2);
    EXPECT_EQ(Update(delta), ErrorCode{}) << text;
    EXPECT_TRUE(IsTrusted(robot_));
    EXPECT_EQ(SignaturesInPlace(), Bobs({2}));
  }
}

TEST_F(UpdateRing, SignaturesThatCannotBeReadStopTheUpdate) {
  Install(1, {1});
  const std::string delta = Delta(1, 2);
  ASSERT_TRUE(WriteFileAtomically(Path("ring.delta.signatures"), Bobs({2}).substr(0, 150)).ok());
  EXPECT_EQ(Update(delta), ErrorCode::kCorrupt);
  fs::remove(Path("ring.delta.signatures"));
  ASSERT_EQ(mkfifo(Path("ring.delta.signatures").c_str(), 0600), 0);
  EXPECT_EQ(Update(delta), ErrorCode::kInvalidArgument);
  fs::remove(Path("ring.delta.signatures"));
  EXPECT_EQ(EpochInPlace(), 1);
  EXPECT_TRUE(IsTrusted(robot_));
}

// A key more has signed the map that a robot has.
TEST_F(UpdateRing, SignaturesOfTheMapInPlaceAreTakenToo) {
  Install(1, {1});
  const std::string delta = Delta(1, 2);
  Send(2);
  ASSERT_TRUE(*UpdateMap(robot_, delta, {.public_key = ring_}));
  fs::remove(Path("carols"));
  ASSERT_TRUE(AddMapSignature(robot_, people_->carol.secret_key, Path("carols")).ok());
  const std::string before = SignaturesInPlace();
  EXPECT_FALSE(*UpdateMap(robot_, delta, {.public_key = ring_}));
  EXPECT_EQ(SignaturesInPlace(), before);
  EXPECT_FALSE(*UpdateMap(robot_, delta, {.public_key = ring_, .signatures = Path("carols")}));
  KeyRing without_bob = ring_;
  without_bob.keys.erase(without_bob.keys.begin() + 1);
  EXPECT_TRUE(Map::Open(robot_, {.public_key = without_bob}).ok());
  EXPECT_TRUE(IsTrusted(PreviousMapPath(robot_)));
}

// A map that a key has signed which the ring no longer has.
TEST_F(UpdateRing, RevokedKeysMapsAreNeitherOpenedNorTakenNorGoneBackTo) {
  Install(1, {1});
  const std::string delta = Delta(1, 2);
  Send(2);
  ASSERT_EQ(Update(delta), ErrorCode{});
  ring_.keys[1] = {"dave", MakeKeyPair().public_key};  // in Bob's place
  EXPECT_FALSE(IsTrusted(robot_));
  EXPECT_EQ(RollBackMap(robot_, {.public_key = ring_}).error().code, ErrorCode::kNotSigned);
  EXPECT_EQ(Update(delta), ErrorCode::kNotSigned);
  Install(1, {1});
  EXPECT_EQ(Update(delta), ErrorCode::kNotSigned);
  EXPECT_EQ(EpochInPlace(), 1);
}

TEST_F(UpdateRing, WrittenBesideHasItsSignaturesBesideIt) {
  const std::string delta = Delta(1, 2), made = Path("ring_made");
  EXPECT_EQ(ApplyDelta(Path("ring.1"), delta, made, {.public_key = ring_}).error().code,
            ErrorCode::kNotSigned);
  EXPECT_FALSE(fs::exists(made));
  EXPECT_FALSE(fs::exists(SignaturesPath(made)));
  Send(2);
  ASSERT_TRUE(ApplyDelta(Path("ring.1"), delta, made, {.public_key = ring_}).ok());
  EXPECT_EQ(ReadFile(made).value(), ReadFile(Path("ring.2")).value());
  EXPECT_EQ(ReadFile(SignaturesPath(made)).value(), Bobs({2}));
  EXPECT_TRUE(IsTrusted(made));
}

TEST_F(UpdateRing, WithoutMoreSignaturesThereIsNoFileOfThem) {
  ring_.threshold = 1;
  Install(1, {});
  EXPECT_EQ(Update(Delta(1, 2)), ErrorCode{});
  EXPECT_FALSE(fs::exists(SignaturesPath(robot_)));
  EXPECT_TRUE(IsTrusted(robot_));
  ASSERT_TRUE(RollBackMap(robot_, {.public_key = ring_}).ok());
  EXPECT_FALSE(fs::exists(SignaturesPath(robot_)));
}

TEST_F(UpdateRing, WhoReadsTheMapReadsItsSignatures) {
  Install(1, {});
  ASSERT_EQ(chmod(robot_.c_str(), 0640), 0);
  if (geteuid() == 0) {
    ASSERT_EQ(chown(robot_.c_str(), 1234, 4321), 0);
  }
  const std::string delta = Delta(1, 2);
  Send(2);
  const mode_t mask = umask(077);
  const ErrorCode code = Update(delta);
  umask(mask);
  ASSERT_EQ(code, ErrorCode{}) << message_;
  struct stat map = {}, signatures = {};
  ASSERT_EQ(stat(robot_.c_str(), &map), 0);
  ASSERT_EQ(stat(SignaturesPath(robot_).c_str(), &signatures), 0);
  EXPECT_EQ(signatures.st_mode, map.st_mode);
  EXPECT_EQ(signatures.st_uid, map.st_uid);
  EXPECT_EQ(signatures.st_gid, map.st_gid);
}

TEST_F(UpdateRing, LinkLeadsToTheMapAndItsSignatures) {
  Install(1, {1});
  const std::string delta = Delta(1, 2);
  Send(2);
  const fs::path folder = Path("ring_links");
  fs::remove_all(folder);
  fs::create_directories(folder);
  fs::create_symlink(robot_, folder / "map");
  ASSERT_TRUE(*UpdateMap(folder / "map", delta, {.public_key = ring_}));
  EXPECT_EQ(SignaturesInPlace(), Bobs({1, 2}));
  EXPECT_TRUE(IsTrusted(folder / "map"));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 1);
}

// Times of files are nobody's business.
TEST_F(UpdateRing, DatesOfFilesChangeNothing) {
  const auto write_time = [&](const std::string& path, int years) {
    fs::last_write_time(path, fs::file_time_type::clock::now() + std::chrono::hours(24 * 365 * years));
  };
  std::string results[2];
  for (const int past : {0, 1}) {
    Install(1, {1});
    const std::string delta = Delta(1, 2);
    Send(2);
    write_time(robot_, past == 1 ? -40 : 40);
    write_time(delta, past == 1 ? 40 : -40);
    write_time(SignaturesPath(robot_), past == 1 ? 10 : -10);
    ASSERT_EQ(Update(delta), ErrorCode{});
    results[past] = ReadFile(robot_).value() + SignaturesInPlace();
  }
  EXPECT_EQ(results[0], results[1]);
}

TEST_F(UpdateRing, WhatKilledUpdatesLeftOfSignaturesIsRemoved) {
  Install(1, {1});
  ASSERT_TRUE(WriteFileAtomically(SignaturesPath(robot_) + ".tmp-99999", "half").ok());
  const std::string delta = Delta(1, 2);
  Send(2);
  ASSERT_EQ(Update(delta), ErrorCode{});
  EXPECT_FALSE(fs::exists(SignaturesPath(robot_) + ".tmp-99999"));
}

}  // namespace
}  // namespace cairn
