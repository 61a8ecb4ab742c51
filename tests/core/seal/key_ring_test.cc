#include "core/seal/key_ring.h"

#include <sys/stat.h>

#include <filesystem>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/seal/signature.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

// Public keys of RFC 8032, section 7.1, tests 1 to 3.
constexpr const char* kAlice = "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a";
constexpr const char* kBob = "3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c";
constexpr const char* kCarol = "fc51cd8e6218a1a38da47ed00230f0580816ed13ba3303ac5deb911548908025";

std::string KeyLine(const std::string& key, const std::string& name) {
  return "key " + key + " " + name + "\n";
}

std::string GoodText() {
  return "cairn key ring 1\nversion 7\nthreshold 2 of 3\n" + KeyLine(kAlice, "alice") + KeyLine(kBob, "bob") +
         KeyLine(kCarol, "carol@workshop-2.example_x");
}

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

std::string Repeated(const std::string& text, int times) {
  std::string repeated;
  for (int i = 0; i < times; ++i) repeated += text;
  return repeated;
}

TEST(KeyRing, IsReadAsItIsWritten) {
  const KeyRing ring = DecodeKeyRing(GoodText(), "it").value();
  EXPECT_EQ(ring.version, 7U);
  EXPECT_EQ(ring.threshold, 2);
  ASSERT_EQ(ring.keys.size(), 3U);
  EXPECT_EQ(HexOf(ring.keys[1].public_key), kBob);
  EXPECT_EQ(ring.keys[2].name, "carol@workshop-2.example_x");
  EXPECT_EQ(ring.Description(), "ring 7 (alice, bob, carol@workshop-2.example_x)");
  EXPECT_EQ(ring.Find(ring.keys[1].public_key), &ring.keys[1]);
  EXPECT_EQ(ring.Find(PublicKey()), nullptr);
  EXPECT_EQ(EncodeKeyRing(ring).value(), GoodText());
  EXPECT_FALSE(ring.is_single_key());
}

TEST(KeyRing, CommentsStandBetweenLines) {
  const std::string text = Replaced(GoodText(), "version", "# from May on\n\n#\n# key of nobody\nversion");
  EXPECT_EQ(EncodeKeyRing(DecodeKeyRing(text + "\n# end\n", "it").value()).value(), GoodText());
}

// Each with the code and with words of its message.
TEST(KeyRing, WhatIsNoRingIsRefusedAndSaysWhy) {
  struct Case {
    std::string text;
    ErrorCode code;
    const char* words;
  };
  const std::string good = GoodText();
  const std::string secret = std::string(kAlice) + kBob;
  for (const Case& each : std::vector<Case>{
           {"", ErrorCode::kEmptyFile, "is empty"},
           {"\n", ErrorCode::kCorrupt, "line 1: expected 'cairn key ring 1'"},
           {"# first\n" + good, ErrorCode::kCorrupt, "line 1: expected 'cairn key ring 1'"},
           {"cairn key ring 1", ErrorCode::kCorrupt, "line 1: ends without a line feed"},
           {"cairn key ring 1\n", ErrorCode::kCorrupt, "has no line 'version'"},
           {"cairn key ring 2\n", ErrorCode::kUnsupported, "another format"},
           {"cairn key ring 11\n", ErrorCode::kUnsupported, "another format"},
           {"cairn key ring 1\nversion 7\n", ErrorCode::kCorrupt, "has no line 'threshold'"},
           {Replaced(good, "\n", "\r\n"), ErrorCode::kCorrupt, "line 1: ends with a carriage return"},
           {Replaced(good, "alice\n", "alice\r\n"), ErrorCode::kCorrupt,
            "line 4: ends with a carriage return"},
           {good.substr(0, good.size() - 1), ErrorCode::kCorrupt, "line 6: ends without a line feed"},
           {good + "# half a comment", ErrorCode::kCorrupt, "line 7: ends without a line feed"},
           {good.substr(0, good.rfind("key ")), ErrorCode::kCorrupt,
            "has 2 keys, but line 'threshold' says 3"},
           {good + KeyLine(kAlice, "dave"), ErrorCode::kCorrupt, "has 4 keys, but line 'threshold' says 3"},
           {Replaced(good, "version 7", "version 0"), ErrorCode::kCorrupt, "line 2: expected 'version N'"},
           {Replaced(good, "version 7", "version -7"), ErrorCode::kCorrupt, "line 2: expected 'version N'"},
           {Replaced(good, "version 7", "version +7"), ErrorCode::kCorrupt, "line 2: expected 'version N'"},
           {Replaced(good, "version 7", "version 07"), ErrorCode::kCorrupt, "line 2: expected 'version N'"},
           {Replaced(good, "version 7", "version NaN"), ErrorCode::kCorrupt, "line 2: expected 'version N'"},
           {Replaced(good, "version 7", "version 7.5"), ErrorCode::kCorrupt, "line 2: expected 'version N'"},
           {Replaced(good, "version 7", "version 7 "), ErrorCode::kCorrupt, "line 2: expected 'version N'"},
           {Replaced(good, "version 7", "version  7"), ErrorCode::kCorrupt, "line 2: expected 'version N'"},
           {Replaced(good, "version 7", "version"), ErrorCode::kCorrupt, "line 2: expected 'version N'"},
           {Replaced(good, "version 7", "version 18446744073709551616"), ErrorCode::kCorrupt, "line 2"},
           {Replaced(good, "version 7", "Version 7"), ErrorCode::kCorrupt, "line 2: expected 'version N'"},
           {Replaced(good, "version 7", "version 7\nversion 7"), ErrorCode::kCorrupt,
            "line 3: expected 'thresh"},
           {Replaced(good, "2 of 3", "0 of 3"), ErrorCode::kCorrupt, "line 3: expected 'threshold K of N'"},
           {Replaced(good, "2 of 3", "2 of 0"), ErrorCode::kCorrupt, "line 3: expected 'threshold K of N'"},
           {Replaced(good, "2 of 3", "NaN of 3"), ErrorCode::kCorrupt, "line 3: expected 'threshold K of N'"},
           {Replaced(good, "2 of 3", "2 from 3"), ErrorCode::kCorrupt, "line 3: expected 'threshold K of N'"},
           {Replaced(good, "2 of 3", "2"), ErrorCode::kCorrupt, "line 3: expected 'threshold K of N'"},
           {Replaced(good, "2 of 3", "2 of 3 "), ErrorCode::kCorrupt, "line 3: expected 'threshold K of N'"},
           {Replaced(good, "2 of 3", "4 of 3"), ErrorCode::kCorrupt, "larger than the number of keys"},
           {Replaced(good, "2 of 3", "2 of 65"), ErrorCode::kCorrupt, "at most 64 keys"},
           {Replaced(good, "threshold 2 of 3\n", ""), ErrorCode::kCorrupt,
            "line 3: expected 'threshold K of N'"},
           {Replaced(good, "\nkey ", "\nKey "), ErrorCode::kCorrupt,
            "line 4: expected 'key PUBLIC_KEY NAME'"},
           {Replaced(good, kAlice, std::string(kAlice) + "0"), ErrorCode::kCorrupt, "line 4: expected 'key"},
           {Replaced(good, kAlice, "g" + std::string(kAlice).substr(1)), ErrorCode::kCorrupt,
            "line 4: expected"},
           {Replaced(good, kAlice, "\"" + std::string(kAlice).substr(1)), ErrorCode::kCorrupt, "line 4"},
           {Replaced(good, kAlice, secret), ErrorCode::kInvalidArgument, "line 4: has a secret key"},
           {Replaced(good, kBob, kAlice), ErrorCode::kInvalidArgument,
            "is there twice, the second time as 'bob'"},
           {Replaced(good, "bob", "alice"), ErrorCode::kInvalidArgument, "two keys have the name 'alice'"},
           {Replaced(good, " bob", ""), ErrorCode::kInvalidArgument, "has no name"},
           {Replaced(good, " bob", " "), ErrorCode::kInvalidArgument, "has no name"},
           {Replaced(good, "bob", "bob builder"), ErrorCode::kInvalidArgument, "has no name"},
           {Replaced(good, "bob", "b\x1b[31mb"), ErrorCode::kInvalidArgument, "has no name"},
           {Replaced(good, "bob",
                     "b\xc3\xb6"
                     "b"),
            ErrorCode::kInvalidArgument, "has no name"},
           {Replaced(good, "bob", std::string("b\0b", 3)), ErrorCode::kInvalidArgument, "has no name"},
           {Replaced(good, "bob", std::string(65, 'b')), ErrorCode::kInvalidArgument, "has no name"},
           {good + Repeated("#\n", 9000), ErrorCode::kInvalidArgument, "is larger than 16384 bytes"},
       }) {
    const Result<KeyRing> ring = DecodeKeyRing(each.text, "it");
    ASSERT_FALSE(ring.ok()) << each.text;
    EXPECT_EQ(ring.error().code, each.code) << each.text << "\n" << ring.error().message;
    EXPECT_THAT(ring.error().message, testing::StartsWith("it: ")) << each.text;
    EXPECT_THAT(ring.error().message, HasSubstr(each.words)) << each.text;
    EXPECT_THAT(ring.error().message, Not(HasSubstr(secret.substr(0, 64) + secret.substr(64, 8))));
  }
  EXPECT_TRUE(DecodeKeyRing(Replaced(good, "bob", std::string(64, 'b')), "it").ok());
  EXPECT_TRUE(DecodeKeyRing(Replaced(good, "2 of 3", "3 of 3"), "it").ok());
  EXPECT_TRUE(DecodeKeyRing(Replaced(good, "2 of 3", "1 of 3"), "it").ok());
  EXPECT_TRUE(DecodeKeyRing(Replaced(good, "version 7", "version 18446744073709551615"), "it").ok());
}

// Of the alphabet of names, each character and its neighbours.
TEST(KeyRing, NamesAreOfLettersDigitsAndFourMarks) {
  for (int c = 1; c < 256; ++c) {
    if (c == '\n' || c == '\r') continue;
    const char letter = static_cast<char>(c);
    const bool allowed = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                         std::string_view("._-@").find(letter) != std::string_view::npos;
    EXPECT_EQ(DecodeKeyRing(Replaced(GoodText(), "bob", std::string(1, letter)), "it").ok(), allowed) << c;
  }
}

TEST(KeyRing, EveryCutIsFound) {
  for (size_t length = 0; length < GoodText().size(); ++length)
    EXPECT_FALSE(DecodeKeyRing(GoodText().substr(0, length), "it").ok()) << length;
}

// A key and the same key plus the point of order 2 would be one secret that counts twice, and the neutral
// element has no secret at all.
TEST(KeyRing, KeysThatAreNobodysAreRefused) {
  for (const std::string& key :
       {"01" + std::string(62, '0'), std::string(64, '0'), "ec" + std::string(60, 'f') + "7f",
        std::string("16a567fe7d4ef5482ab4012c369bf8c5f11e8d0c2559dcda50fde59708f8aee5")}) {
    const Result<KeyRing> ring = DecodeKeyRing(Replaced(GoodText(), kBob, key), "it");
    ASSERT_FALSE(ring.ok()) << key;
    EXPECT_THAT(ring.error().message,
                HasSubstr("line 5: its key is not a point of the curve's main subgroup"));
  }
}

TEST(KeyRing, CommentsAreLinesOfTheFile) {
  std::string text = Replaced(GoodText(), kBob, "01" + std::string(62, '0'));
  text.insert(text.find('\n') + 1, "# of the office\n\n# and of the workshop\n");
  const Result<KeyRing> ring = DecodeKeyRing(text, "it");
  ASSERT_FALSE(ring.ok());
  EXPECT_THAT(ring.error().message, HasSubstr("line 8: its key"));
}

TEST(KeyRing, SixtyFourKeysAreTheMost) {
  const auto text = [](int num_keys) {
    std::string all = fmt::format("cairn key ring 1\nversion 1\nthreshold {} of {}\n", num_keys, num_keys);
    for (int i = 0; i < num_keys; ++i)
      all += KeyLine(HexOf(MakeKeyPair().public_key), fmt::format("{:064}", i));  // names of the largest size
    return all;
  };
  EXPECT_LT(text(64).size(), KeyRing::kMaxNumBytes);
  EXPECT_EQ(DecodeKeyRing(text(64), "it").value().keys.size(), 64U);
  EXPECT_FALSE(DecodeKeyRing(text(65), "it").ok());
}

TEST(KeyRing, MayBeAsLargeAsItsBoundAndNotLarger) {
  const std::string ring = GoodText();
  const std::string comment = "#" + std::string(KeyRing::kMaxNumBytes - ring.size() - 2, '-') + "\n";
  const std::string largest = ring + comment;
  ASSERT_EQ(largest.size(), KeyRing::kMaxNumBytes);
  EXPECT_TRUE(DecodeKeyRing(largest, "it").ok());
  const Result<KeyRing> larger = DecodeKeyRing(largest + "#", "it");
  ASSERT_FALSE(larger.ok());
  EXPECT_THAT(larger.error().message, HasSubstr("is larger than 16384 bytes"));
}

TEST(KeyRing, RingsThatCannotBeMeantAreNotWrittenNorTrusted) {
  const KeyPair one = MakeKeyPair(), two = MakeKeyPair();
  const Signature signature = SignBytes("text", one.secret_key).value();
  KeyRing good;
  good.version = 1;
  good.keys = {{"one", one.public_key}, {"two", two.public_key}};
  const auto refused = [&](const std::function<void(KeyRing*)>& change) {
    KeyRing ring = good;
    change(&ring);
    EXPECT_FALSE(EncodeKeyRing(ring).ok());
    const Status status = CheckSignatureOf("text", one.public_key, signature, "it", ring, "sign it");
    return !status.ok() && status.error().code == ErrorCode::kInvalidArgument;
  };
  EXPECT_TRUE(CheckSignatureOf("text", one.public_key, signature, "it", good, "sign it").ok());
  EXPECT_TRUE(refused([](KeyRing* ring) { ring->threshold = 0; }));
  EXPECT_TRUE(refused([](KeyRing* ring) { ring->threshold = -1; }));
  EXPECT_TRUE(refused([](KeyRing* ring) { ring->threshold = 3; }));
  EXPECT_TRUE(refused([](KeyRing* ring) { ring->keys.clear(); }));
  EXPECT_TRUE(refused([](KeyRing* ring) { ring->keys[1].public_key = ring->keys[0].public_key; }));
  EXPECT_TRUE(refused([](KeyRing* ring) { ring->keys[1].name = "one"; }));
  EXPECT_TRUE(refused([](KeyRing* ring) { ring->version = 0; }));
  EXPECT_TRUE(refused([](KeyRing* ring) { *ring = KeyRing(); }));
  // A public key alone is a ring that has no text.
  EXPECT_EQ(EncodeKeyRing(one.public_key).error().code, ErrorCode::kInvalidArgument);
  EXPECT_TRUE(CheckSignatureOf("text", one.public_key, signature, "it", KeyRing(one.public_key), "").ok());
}

class KeyRingFileTest : public testing::Test {
 protected:
  KeyRingFileTest() : folder_(testing::TempDir() + "/key_ring") {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  std::string Path(const std::string& name) const { return folder_ + "/" + name; }
  std::string Write(const std::string& text, mode_t mode = 0644) const {
    EXPECT_TRUE(WriteFileAtomically(Path("file"), text).ok());
    EXPECT_EQ(chmod(Path("file").c_str(), mode), 0);
    return Path("file");
  }

  std::string folder_;
};

TEST_F(KeyRingFileTest, ContentsSayWhetherItIsARingOrAKey) {
  const KeyRing ring = ReadTrustedKeys(Write(GoodText())).value();
  EXPECT_EQ(ring.version, 7U);
  EXPECT_EQ(ring.threshold, 2);
  EXPECT_EQ(ReadKeyRing(Path("file")).value().text, GoodText());
  const KeyRing key = ReadTrustedKeys(Write(std::string(kBob) + "\n")).value();
  EXPECT_TRUE(key.is_single_key());
  EXPECT_EQ(key.threshold, 1);
  ASSERT_EQ(key.keys.size(), 1U);
  EXPECT_EQ(HexOf(key.keys[0].public_key), kBob);
  EXPECT_EQ(ReadKeyRing(Path("file")).error().code, ErrorCode::kCorrupt);
}

TEST_F(KeyRingFileTest, WhatIsNeitherIsNamed) {
  const auto fault = [&](const std::string& text) {
    const Result<KeyRing> ring = ReadTrustedKeys(Write(text));
    return ring.ok() ? Error{} : ring.error();
  };
  EXPECT_EQ(fault("").code, ErrorCode::kCorrupt);
  EXPECT_EQ(fault("hello\n").code, ErrorCode::kCorrupt);
  const Error secret = fault(std::string(kAlice) + kBob);
  EXPECT_EQ(secret.code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(secret.message, HasSubstr("is a secret key"));
  // A million keys: 16 KiB of them are read.
  std::string many = "cairn key ring 1\nversion 1\nthreshold 1 of 1000000\n";
  many += Repeated(KeyLine(kAlice, "a"), 1000000);
  EXPECT_THAT(fault(many).message, HasSubstr("is larger than 16384 bytes"));
}

TEST_F(KeyRingFileTest, FileThatEverybodyMayWriteSaysNobodyWhomToTrust) {
  for (const std::string& text : {GoodText(), std::string(kBob)}) {
    for (const mode_t mode : {0602U, 0606U, 0646U, 0666U}) {
      const Result<KeyRing> ring = ReadTrustedKeys(Write(text, mode));
      ASSERT_FALSE(ring.ok()) << fmt::format("{:o}", mode);
      EXPECT_EQ(ring.error().code, ErrorCode::kInvalidArgument);
      EXPECT_THAT(ring.error().message, HasSubstr("`chmod o-w " + Path("file") + "`"));
    }
    for (const mode_t mode : {0600U, 0644U, 0664U, 0400U, 0755U})
      EXPECT_TRUE(ReadTrustedKeys(Write(text, mode)).ok()) << fmt::format("{:o}", mode);
  }
}

TEST_F(KeyRingFileTest, FoldersAndPipesAreNoRingsAndAreNotWaitedFor) {
  ASSERT_EQ(mkfifo(Path("pipe").c_str(), 0600), 0);
  for (const std::string& path : {Path("pipe"), folder_}) {
    EXPECT_EQ(ReadTrustedKeys(path).error().code, ErrorCode::kInvalidArgument);
    EXPECT_EQ(ReadKeyRing(path).error().code, ErrorCode::kInvalidArgument);
    EXPECT_EQ(ReadSignatures(path).error().code, ErrorCode::kInvalidArgument);
    EXPECT_EQ(ReadSignaturesIfThere(path).error().code, ErrorCode::kInvalidArgument);
  }
  EXPECT_EQ(ReadTrustedKeys(Path("none")).error().code, ErrorCode::kNotFound);
}

// Signatures of "text" by four people, the first three of whom are in the ring, 2 of whom must sign.
class SignersTest : public testing::Test {
 protected:
  SignersTest() {
    const char* const names[] = {"alice", "bob", "carol"};
    for (int i = 0; i < 4; ++i) {
      people_.push_back(MakeKeyPair());
      signatures_.push_back({people_[i].public_key, SignBytes("text", people_[i].secret_key).value()});
    }
    for (int i = 0; i < 3; ++i) ring_.keys.push_back({names[i], people_[i].public_key});
    ring_.version = 5;
    ring_.threshold = 2;
  }

  // With the first signature in the file itself, and these beside it.
  Status Check(const SignatureList& others, int first = 0) const {
    return CheckSignatureOf("text", signatures_[first].public_key, signatures_[first].signature, "it", ring_,
                            "ask them", others);
  }

  std::vector<KeyPair> people_;
  SignatureList signatures_;
  KeyRing ring_;
};

TEST_F(SignersTest, AreCountedOnceEach) {
  EXPECT_THAT(SignersOf("text", signatures_, ring_), ElementsAre("alice", "bob", "carol"));
  EXPECT_THAT(SignersOf("text", {signatures_[2], signatures_[0]}, ring_), ElementsAre("alice", "carol"));
  EXPECT_THAT(SignersOf("text", {signatures_[1], signatures_[1], signatures_[1]}, ring_), ElementsAre("bob"));
  EXPECT_THAT(SignersOf("text", {signatures_[3]}, ring_), IsEmpty());
  EXPECT_THAT(SignersOf("other text", signatures_, ring_), IsEmpty());
  EXPECT_THAT(SignersOf("text", {}, ring_), IsEmpty());
  // One's signature under another's key.
  EXPECT_THAT(SignersOf("text", {{people_[0].public_key, signatures_[1].signature}}, ring_), IsEmpty());
  // A false signature of hers does not hide the true one.
  EXPECT_THAT(SignersOf("text", {{people_[0].public_key, signatures_[1].signature}, signatures_[0]}, ring_),
              ElementsAre("alice"));
}

TEST_F(SignersTest, AsManyAsTheRingWantsAreEnough) {
  EXPECT_TRUE(Check({signatures_[1]}).ok());
  EXPECT_TRUE(Check({signatures_[2]}).ok());
  EXPECT_TRUE(Check({signatures_[1], signatures_[2], signatures_[3]}).ok());
  // The one in the file need not be of the ring.
  EXPECT_TRUE(Check({signatures_[1], signatures_[2]}, 3).ok());
  ring_.threshold = 3;
  EXPECT_FALSE(Check({signatures_[1]}).ok());
  EXPECT_TRUE(Check({signatures_[1], signatures_[2]}).ok());
  ring_.threshold = 1;
  EXPECT_TRUE(Check({}).ok());
  EXPECT_TRUE(Check({signatures_[2]}, 3).ok());
}

TEST_F(SignersTest, TooFewAreNamedWithThoseWhoAreMissing) {
  for (const SignatureList& others : std::vector<SignatureList>{
           {},
           {signatures_[0], signatures_[0]},                        // herself, twice more
           {signatures_[3]},                                        // a stranger
           {{people_[1].public_key, signatures_[0].signature}}}) {  // hers under his key
    const Status status = Check(others);
    ASSERT_FALSE(status.ok());
    EXPECT_EQ(status.error().code, ErrorCode::kNotSigned);
    EXPECT_THAT(
        status.error().message,
        HasSubstr("it: 1 of the 2 signatures that ring 5 (alice, bob, carol) requires: by alice; not by bob, "
                  "carol, of whom 1 more must sign, with `cairn sign --add`"));
  }
  ring_.threshold = 3;
  EXPECT_THAT(
      Check({signatures_[2]}).error().message,
      HasSubstr(
          "2 of the 3 signatures that ring 5 (alice, bob, carol) requires: by alice, carol; not by bob, "
          "of whom 1 more must sign"));
}

TEST_F(SignersTest, NoneIsAnotherErrorThanTooFew) {
  const Status stranger = Check({}, 3);
  EXPECT_EQ(stranger.error().code, ErrorCode::kWrongKey);
  EXPECT_THAT(stranger.error().message,
              HasSubstr("but 2 of the 3 keys of ring 5 (alice, bob, carol) are required"));
  EXPECT_THAT(stranger.error().message, HasSubstr(HexOf(people_[3].public_key)));
  const Status none = CheckSignatureOf("text", {}, {}, "it", ring_, "ask them", signatures_);
  EXPECT_EQ(none.error().code, ErrorCode::kNotSigned);
  EXPECT_THAT(none.error().message,
              HasSubstr("a signature of ring 5 (alice, bob, carol) is required; ask them"));
}

// What the file itself says is not made good by others.
TEST_F(SignersTest, FalseSignatureInTheFileIsRefused) {
  const Status status = CheckSignatureOf("text", people_[0].public_key, signatures_[1].signature, "it", ring_,
                                         "", SignatureList{signatures_[1], signatures_[2]});
  EXPECT_EQ(status.error().code, ErrorCode::kWrongKey);
  EXPECT_THAT(status.error().message, HasSubstr("its signature is not valid"));
}

TEST_F(SignersTest, PublicKeyAloneIsTheRingOfIt) {
  const auto check = [&](int required, const SignatureList& others) {
    return CheckSignatureOf("text", signatures_[0].public_key, signatures_[0].signature, "it",
                            KeyRing(people_[required].public_key), "", others);
  };
  EXPECT_TRUE(check(0, {}).ok());
  EXPECT_TRUE(check(3, {signatures_[3]}).ok());  // who has signed since
  EXPECT_EQ(check(3, {signatures_[1]}).error().code, ErrorCode::kWrongKey);
  EXPECT_THAT(check(3, {}).error().message,
              HasSubstr(fmt::format("is signed with key {}, but {} is required", HexOf(people_[0].public_key),
                                    HexOf(people_[3].public_key))));
}

TEST_F(SignersTest, OneKeyIsEnoughWhereAnyIs) {
  EXPECT_EQ(AnyKeyOf(ring_)->threshold, 1);
  EXPECT_EQ(AnyKeyOf(ring_)->keys.size(), 3U);
  EXPECT_FALSE(AnyKeyOf(std::nullopt).has_value());
  ring_.threshold = 0;
  EXPECT_EQ(AnyKeyOf(ring_)->threshold, 0);  // still not allowed
}

class SignatureListTest : public SignersTest {
 protected:
  SignatureListTest() : path_(testing::TempDir() + "/it.signatures") { fs::remove(path_); }

  Error FaultOf(const std::string& text) const {
    const Result<SignatureList> list = DecodeSignatures(text, "it");
    return list.ok() ? Error{} : list.error();
  }

  std::string path_;
};

TEST_F(SignatureListTest, FilesAreJoinedInAnyOrder) {
  const std::string one = EncodeSignatures({signatures_[0]}), two = EncodeSignatures({signatures_[1]});
  EXPECT_EQ(one.size(), 64U + 1 + 128 + 1);
  const SignatureList both = DecodeSignatures(one + two, "it").value();
  EXPECT_EQ(both.size(), 2U);
  EXPECT_EQ(DecodeSignatures(two + "# of Tuesday\n\n" + one + two, "it").value(), both);
  EXPECT_EQ(EncodeSignatures({signatures_[1], signatures_[0], signatures_[1]}), EncodeSignatures(both));
  EXPECT_EQ(DecodeSignatures("", "it").value(), SignatureList());
}

TEST_F(SignatureListTest, OrderOfSigningDoesNotChangeTheFile) {
  std::string files[2];
  for (const int order : {0, 1}) {
    fs::remove(path_);
    for (const int i : order == 0 ? std::vector<int>{0, 1, 2} : std::vector<int>{2, 0, 1, 0})
      ASSERT_TRUE(AddSignature("text", people_[i].secret_key, path_).ok());
    files[order] = ReadFile(path_).value();
  }
  EXPECT_EQ(files[0], files[1]);
  EXPECT_THAT(SignersOf("text", ReadSignatures(path_).value(), ring_), ElementsAre("alice", "bob", "carol"));
}

TEST_F(SignatureListTest, LinesThatAreNoSignaturesAreRefused) {
  const std::string line = EncodeSignatures({signatures_[0]});
  for (const std::string& text :
       {line.substr(0, 100) + "\n", line.substr(1), line.substr(0, line.size() - 2) + "\n",
        "x" + line.substr(1), line.substr(0, 64) + "x" + line.substr(65),
        line.substr(0, line.size() - 2) + "x\n", line.substr(0, line.size() - 1) + " \n",
        std::string("NaN\n"), " " + line, line + "signature\n"}) {
    EXPECT_EQ(FaultOf(text).code, ErrorCode::kCorrupt) << text;
    EXPECT_THAT(FaultOf(text).message,
                HasSubstr("expected a public key and a signature, 64 and 128 hexadecimal"));
  }
  EXPECT_THAT(FaultOf(line + "signature\n").message, HasSubstr("it: line 2: 9 characters"));
  EXPECT_THAT(FaultOf(line.substr(0, line.size() - 1)).message,
              HasSubstr("line 1: ends without a line feed"));
  EXPECT_THAT(FaultOf(line.substr(0, line.size() - 1) + "\r\n").message, HasSubstr("carriage return"));
  const Error secret = FaultOf(line.substr(65));  // 128 digits
  EXPECT_EQ(secret.code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(secret.message, HasSubstr("may be a secret key"));
  EXPECT_THAT(secret.message, Not(HasSubstr(line.substr(65, 16))));
}

TEST_F(SignatureListTest, EveryCutIsFoundOrLosesWholeLines) {
  const std::string text = EncodeSignatures({signatures_[0], signatures_[1]});
  for (size_t length = 0; length < text.size(); ++length) {
    const Result<SignatureList> cut = DecodeSignatures(text.substr(0, length), "it");
    EXPECT_EQ(cut.ok(), length == 0 || length == text.size() / 2) << length;
  }
}

TEST_F(SignatureListTest, MoreThanTheBoundsAreRefusedBeforeTheyAreRead) {
  KeySignature any = signatures_[0];
  SignatureList many;
  for (size_t i = 0; i <= kMaxSignatures; ++i) {
    any.signature[0] = static_cast<uint8_t>(i);
    any.signature[1] = static_cast<uint8_t>(i >> 8);
    many.push_back(any);
  }
  EXPECT_THAT(FaultOf(EncodeSignatures(many)).message, HasSubstr("has more than 256 signatures"));
  many.pop_back();
  EXPECT_EQ(DecodeSignatures(EncodeSignatures(many), "it").value().size(), 256U);
  ASSERT_TRUE(WriteFileAtomically(path_, EncodeSignatures(many)).ok());
  EXPECT_EQ(AddSignature("text", people_[1].secret_key, path_).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(ReadFile(path_).value(), EncodeSignatures(many));
  // A million lines.
  ASSERT_TRUE(WriteFileAtomically(path_, Repeated("\n", 1000000)).ok());
  EXPECT_THAT(ReadSignatures(path_).error().message, HasSubstr("is larger than 65536 bytes"));
}

TEST_F(SignatureListTest, ValidOnesAreChosen) {
  const SignatureList mixed = {
      signatures_[0], {people_[1].public_key, signatures_[0].signature}, signatures_[3]};
  EXPECT_EQ(ValidSignatures("text", mixed), (SignatureList{signatures_[0], signatures_[3]}));
  EXPECT_EQ(ValidSignatures("other text", mixed), SignatureList());
}

TEST_F(SignatureListTest, AMapAndTheOneBeforeItHaveOneFile) {
  EXPECT_EQ(SignaturesPath("maps/kitchen.cairn"), "maps/kitchen.cairn.signatures");
  EXPECT_EQ(SignaturesPath("maps/kitchen.cairn.previous"), "maps/kitchen.cairn.signatures");
  EXPECT_EQ(SignaturesPath("d"), "d.signatures");
}

TEST_F(SignatureListTest, FileIsReadOnlyWhereTheOwnSignatureIsNotEnough) {
  const std::string file = testing::TempDir() + "/it";
  const auto check = [&](const KeyRing& ring) {
    return CheckSignatureOf("text", signatures_[0].public_key, signatures_[0].signature, file, ring, "");
  };
  ASSERT_TRUE(WriteFileAtomically(path_, "no signature\n").ok());
  EXPECT_EQ(check(ring_).error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(check(ring_).error().message, HasSubstr("it.signatures: line 1"));
  ring_.threshold = 1;
  EXPECT_TRUE(check(ring_).ok());
  ring_.threshold = 2;
  ASSERT_TRUE(WriteFileAtomically(path_, EncodeSignatures({signatures_[1]})).ok());
  EXPECT_TRUE(check(ring_).ok());
  fs::remove(path_);
  EXPECT_EQ(check(ring_).error().code, ErrorCode::kNotSigned);
}

}  // namespace
}  // namespace cairn
