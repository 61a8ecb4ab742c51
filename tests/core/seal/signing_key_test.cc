#include "core/seal/signing_key.h"

#include <sys/stat.h>

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/files/file.h"
#include "core/seal/signature.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

// RFC 8032, section 7.1, test 1: the signature of no bytes.
constexpr const char* kSeed = "9d61b19deffd5a60ba844af492ec2cc44449c5697b326919703bac031cae7f60";
constexpr const char* kPublic = "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a";
constexpr const char* kSignature =
    "e5564300c360ac729086e2cc806e828a84877f1eb8e5d974d873e065224901555fb8821590a33bacc61e39701cf9b46bd25bf5f0"
    "595bbe24655141438e7a100b";

class SigningKeyTest : public testing::Test {
 protected:
  SigningKeyTest() : folder_(testing::TempDir() + "/signing_key") {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  std::string Path(const std::string& name) const { return folder_ + "/" + name; }

  // A key's file with this text.
  std::string Write(const std::string& text, mode_t mode = 0600) const {
    EXPECT_TRUE(WriteFileAtomically(Path("key"), text).ok());
    EXPECT_EQ(chmod(Path("key").c_str(), mode), 0);
    return Path("key");
  }

  std::string folder_;
};

TEST_F(SigningKeyTest, SignsAsTheStandardSays) {
  const Result<SecretKey> key = ReadSecretKey(Write(std::string(kSeed) + kPublic + "\n"));
  ASSERT_TRUE(key.ok()) << key.error().message;
  EXPECT_EQ(HexOf(*PublicKeyOf(*key)), kPublic);
  const Result<Signature> signature = SignBytes("", *key);
  ASSERT_TRUE(signature.ok());
  PublicKey first, second;  // the signature's halves
  std::copy_n(signature->begin(), 32, first.begin());
  std::copy_n(signature->begin() + 32, 32, second.begin());
  EXPECT_EQ(HexOf(first) + HexOf(second), kSignature);
  EXPECT_TRUE(CheckSignatureOf("", *PublicKeyOf(*key), *signature, "it", std::nullopt, "").ok());
  EXPECT_EQ(CheckSignatureOf("x", *PublicKeyOf(*key), *signature, "it", std::nullopt, "").error().code,
            ErrorCode::kWrongKey);
}

TEST_F(SigningKeyTest, KeyWithAnyByteDamagedSignsNothing) {
  const KeyPair keys = MakeKeyPair();
  EXPECT_EQ(*PublicKeyOf(keys.secret_key), keys.public_key);
  for (size_t i = 0; i < keys.secret_key.size(); ++i) {
    SecretKey damaged = keys.secret_key;
    damaged[i] ^= static_cast<uint8_t>(1 << i % 8);
    EXPECT_EQ(PublicKeyOf(damaged).error().code, ErrorCode::kCorrupt) << "byte " << i;
    EXPECT_EQ(SignBytes("text", damaged).error().code, ErrorCode::kCorrupt) << "byte " << i;
  }
}

TEST_F(SigningKeyTest, DamagedFileIsNamedWithTheRemedy) {
  std::string text = std::string(kSeed) + kPublic;
  text[2 * 40] = text[2 * 40] == '0' ? '1' : '0';
  const Result<SecretKey> key = ReadSecretKey(Write(text));
  ASSERT_FALSE(key.ok());
  EXPECT_EQ(key.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(key.error().message, HasSubstr(Path("key")));
  EXPECT_THAT(key.error().message, HasSubstr("restore it from a backup"));
}

TEST_F(SigningKeyTest, SecretKeyIsItsOwnersAlone) {
  const std::string text = std::string(kSeed) + kPublic;
  for (const mode_t mode : {0600U, 0400U, 0700U})
    EXPECT_TRUE(ReadSecretKey(Write(text, mode)).ok()) << fmt::format("{:o}", mode);
  for (const mode_t mode : {0640U, 0620U, 0610U, 0604U, 0602U, 0601U, 0644U}) {
    const Result<SecretKey> key = ReadSecretKey(Write(text, mode));
    ASSERT_FALSE(key.ok()) << fmt::format("{:o}", mode);
    EXPECT_EQ(key.error().code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(key.error().message, HasSubstr("`chmod 600 " + Path("key") + "`"));
  }
  EXPECT_TRUE(ReadPublicKey(Write(kPublic, 0644)).ok());
}

TEST_F(SigningKeyTest, PipesAndFoldersAreNoKeysAndAreNotWaitedFor) {
  ASSERT_EQ(mkfifo(Path("pipe").c_str(), 0600), 0);
  for (const std::string& path : {Path("pipe"), folder_}) {
    EXPECT_EQ(ReadSecretKey(path).error().code, ErrorCode::kInvalidArgument);
    EXPECT_EQ(ReadPublicKey(path).error().code, ErrorCode::kInvalidArgument);
  }
  EXPECT_EQ(ReadSecretKey(Path("none")).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(ReadPublicKey(Path("none")).error().code, ErrorCode::kNotFound);
}

TEST_F(SigningKeyTest, KeyThatIsNotThereIsNamed) {
  Write("a file");
  for (const char* name : {"none", "none/key", "key/inside"}) {
    const Result<PublicKey> key = ReadPublicKey(Path(name));
    EXPECT_EQ(key.error().code, ErrorCode::kNotFound) << name;
    EXPECT_THAT(key.error().message, HasSubstr(std::string(name) + ": no such file"));
  }
}

TEST_F(SigningKeyTest, OneKindOfKeyIsNotTakenForTheOtherNorShown) {
  const Result<PublicKey> as_public = ReadPublicKey(Write(std::string(kSeed) + kPublic));
  ASSERT_FALSE(as_public.ok());
  EXPECT_EQ(as_public.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(as_public.error().message, HasSubstr("is a secret key"));
  EXPECT_THAT(as_public.error().message, Not(HasSubstr("9d61")));
  const Result<SecretKey> as_secret = ReadSecretKey(Write(kPublic));
  ASSERT_FALSE(as_secret.ok());
  EXPECT_EQ(as_secret.error().code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(as_secret.error().message, HasSubstr("is a public key"));
}

TEST_F(SigningKeyTest, WhatIsNoKeyIsRefused) {
  const std::string secret = std::string(kSeed) + kPublic;
  for (const std::string& text :
       {std::string(), std::string("hello"), secret + "0", secret.substr(1), "g" + secret.substr(1),
        secret.substr(0, 127) + "g", secret + "\n" + secret, std::string(5000, '0')}) {
    EXPECT_EQ(ReadSecretKey(Write(text)).error().code, ErrorCode::kCorrupt) << text;
    EXPECT_EQ(ReadPublicKey(Write(text)).error().code, ErrorCode::kCorrupt) << text;
  }
  EXPECT_EQ(ReadPublicKey(Write("g" + std::string(kPublic).substr(1))).error().code, ErrorCode::kCorrupt);
  EXPECT_EQ(HexOf(*ReadPublicKey(Write(std::string(kPublic) + " \r\n\n"))), kPublic);
  EXPECT_THAT(ReadPublicKey(Write("\n")).error().message, HasSubstr("not a public key: 0 characters"));
}

TEST_F(SigningKeyTest, SignaturesOfOtherKeysThanTheRequiredOneAreNamed) {
  const KeyPair keys = MakeKeyPair(), others = MakeKeyPair();
  const Signature signature = *SignBytes("text", keys.secret_key);
  const auto check = [&](const PublicKey& key, const Signature& of,
                         const std::optional<PublicKey>& required) {
    return CheckSignatureOf("text", key, of, "it", required, "sign it");
  };
  EXPECT_TRUE(check(keys.public_key, signature, keys.public_key).ok());
  const Status other = check(keys.public_key, signature, others.public_key);
  EXPECT_EQ(other.error().code, ErrorCode::kWrongKey);
  EXPECT_THAT(other.error().message,
              HasSubstr(fmt::format("is signed with key {}, but {} is required", HexOf(keys.public_key),
                                    HexOf(others.public_key))));
  EXPECT_TRUE(check({}, {}, std::nullopt).ok());
  EXPECT_EQ(check({}, {}, keys.public_key).error().code, ErrorCode::kNotSigned);
  // Half of a signature is no lack of one.
  EXPECT_EQ(check(keys.public_key, {}, std::nullopt).error().code, ErrorCode::kWrongKey);
  EXPECT_EQ(check({}, signature, std::nullopt).error().code, ErrorCode::kWrongKey);
}

TEST_F(SigningKeyTest, PairsAreWrittenWholeAndNeverOver) {
  const KeyPair keys = MakeKeyPair();
  ASSERT_TRUE(WriteKeyPair(keys, Path("new")).ok());
  EXPECT_EQ(*ReadSecretKey(Path("new")), keys.secret_key);
  EXPECT_EQ(*ReadPublicKey(Path("new.pub")), keys.public_key);
  EXPECT_EQ(WriteKeyPair(MakeKeyPair(), Path("new")).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(*ReadSecretKey(Path("new")), keys.secret_key);
  fs::remove(Path("new"));
  EXPECT_EQ(WriteKeyPair(MakeKeyPair(), Path("new")).error().code, ErrorCode::kInvalidArgument);
  EXPECT_FALSE(fs::exists(Path("new")));
  // Where a link lies, nothing is written through it.
  fs::create_symlink(Path("elsewhere"), Path("link"));
  EXPECT_EQ(WriteKeyPair(MakeKeyPair(), Path("link")).error().code, ErrorCode::kInvalidArgument);
  EXPECT_FALSE(fs::exists(Path("elsewhere")));
  EXPECT_FALSE(fs::exists(Path("link.pub")));
}

}  // namespace
}  // namespace cairn
