#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <limits>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/blocks/map_rows.h"
#include "core/delta/map_delta.h"
#include "core/features/sift.h"
#include "core/files/file.h"
#include "core/seal/accept_key_ring.h"
#include "core/seal/map_seal.h"
#include "runtime/c_api/cairn.h"
#include "runtime/localize/localizer.h"
#include "tests/runtime/localize/poster_scene.h"

namespace cairn {
namespace {

using testing::HasSubstr;

class CApi : public testing::Test {
 protected:
  CApi() : path_(testing::TempDir() + "/c_api.cairn"), picture_(RenderPoster(scene_, PosterQueryPose())) {
    EXPECT_TRUE(WriteMapRows(MakePosterMap(scene_), path_).ok());
    EXPECT_EQ(cairn_map_open(path_.c_str(), nullptr, &map_), CAIRN_OK) << cairn_last_error();
  }
  ~CApi() override { EXPECT_EQ(cairn_map_close(map_), CAIRN_OK); }

  cairn_image Picture() const {
    cairn_image image = CAIRN_IMAGE_INIT;
    image.pixels = picture_.data;
    image.width = picture_.cols;
    image.height = picture_.rows;
    image.stride = picture_.step;
    return image;
  }
  cairn_localizer* NewLocalizer() const {
    cairn_localizer* localizer = nullptr;
    EXPECT_EQ(cairn_localizer_create(map_, &localizer), CAIRN_OK);
    return localizer;
  }

  PosterScene scene_ = MakePosterScene(1);
  std::string path_;
  cv::Mat picture_;
  cairn_map* map_ = nullptr;
};

TEST_F(CApi, GivesThePoseOfTheCxxApiBitForBit) {
  cairn_localizer* localizer = NewLocalizer();
  const cairn_image image = Picture();
  cairn_fix fix = CAIRN_FIX_INIT;
  ASSERT_EQ(cairn_localize(localizer, &image, nullptr, nullptr, &fix), CAIRN_OK) << cairn_last_error();
  const auto map = Map::Open(path_);
  const auto expected = Localizer(*map).Localize(picture_, *(*map)->CameraForSize(320, 240));
  ASSERT_TRUE(expected->has_fix());
  const Pose& pose = expected->cam_from_world;
  EXPECT_EQ(Eigen::Vector4d(fix.rotation_wxyz),
            Eigen::Vector4d(pose.rotation.w(), pose.rotation.x(), pose.rotation.y(), pose.rotation.z()));
  EXPECT_EQ(Eigen::Vector3d(fix.translation_m), pose.translation);
  EXPECT_EQ(Eigen::Vector3d(fix.center_m), pose.Center());
  EXPECT_EQ(Matrix6d(fix.covariance), expected->covariance.transpose());  // rows here, columns in Eigen
  EXPECT_EQ(fix.num_inliers, expected->num_inliers);
  EXPECT_EQ(fix.region, expected->region);
  EXPECT_EQ(cairn_localizer_destroy(localizer), CAIRN_OK);
}

// The image's own features give the image's fix; of a map of bits, bits do.
TEST_F(CApi, FeaturesGiveTheFixOfTheirImage) {
  cairn_localizer* localizer = NewLocalizer();
  const cairn_image image = Picture();
  cairn_fix expected = CAIRN_FIX_INIT, fix = CAIRN_FIX_INIT;
  ASSERT_EQ(cairn_localize(localizer, &image, nullptr, nullptr, &expected), CAIRN_OK);
  cairn_camera camera = CAIRN_CAMERA_INIT;
  ASSERT_EQ(cairn_map_camera_for_size(map_, 320, 240, &camera), CAIRN_OK);
  const Features features = *ExtractSift(picture_, {});
  const auto num = static_cast<int32_t>(features.keypoints.size());
  const float* keypoints = &features.keypoints.front().x;
  const auto localize = [&](int32_t is_float, int32_t num_columns, int32_t num_features) {
    return cairn_localize_features(localizer, keypoints, features.descriptors.data(), is_float, num_columns,
                                   num_features, &camera, nullptr, &fix);
  };
  ASSERT_EQ(localize(0, 128, num), CAIRN_OK) << cairn_last_error();
  ASSERT_EQ(fix.has_fix, 1);
  EXPECT_EQ(Eigen::Vector3d(fix.center_m), Eigen::Vector3d(expected.center_m));
  EXPECT_EQ(fix.num_inliers, expected.num_inliers);
  char kind[64];
  EXPECT_EQ(cairn_map_descriptors(map_, kind, sizeof(kind)), CAIRN_OK);
  EXPECT_STREQ(kind, "sift");
  EXPECT_EQ(cairn_map_descriptors(map_, kind, 3), CAIRN_OK);
  EXPECT_STREQ(kind, "si");

  EXPECT_EQ(localize(0, 128, 0), CAIRN_OK);
  EXPECT_EQ(fix.has_fix, 0);
  EXPECT_EQ(localize(0, 64, num), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("descriptors of 64 bytes, expected 128 of the kind 'sift'"));
  EXPECT_EQ(localize(1, 32, num), CAIRN_INVALID_ARGUMENT);
  EXPECT_THAT(cairn_last_error(), HasSubstr("floating-point values, expected bytes"));
  EXPECT_EQ(localize(0, 128, -1), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_localize_features(localizer, nullptr, features.descriptors.data(), 0, 128, num, &camera,
                                    nullptr, &fix),
            CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_localize_features(localizer, keypoints, features.descriptors.data(), 0, 128, num, nullptr,
                                    nullptr, &fix),
            CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_map_descriptors(map_, nullptr, 8), CAIRN_INVALID_ARGUMENT);
  const float bad[4] = {1, 2, std::numeric_limits<float>::quiet_NaN(), 0};
  EXPECT_EQ(
      cairn_localize_features(localizer, bad, features.descriptors.data(), 0, 128, 1, &camera, nullptr, &fix),
      CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_localizer_destroy(localizer), CAIRN_OK);
}

TEST_F(CApi, RigsAndGravityAreThoseOfTheCxxApi) {
  cairn_localizer* localizer = NewLocalizer();
  Pose beside;  // half a metre to the right, turned by ten degrees
  beside.rotation = Eigen::AngleAxisd(RadFromDeg(10), Eigen::Vector3d::UnitY());
  beside.translation = {-0.5, 0, 0.1};
  const cv::Mat second = RenderPoster(scene_, beside * PosterQueryPose());
  const cairn_image image = Picture();
  cairn_image other = image;
  other.pixels = second.data;
  cairn_rig_image left = CAIRN_RIG_IMAGE_INIT, right = CAIRN_RIG_IMAGE_INIT;
  left.image = &image;
  right.image = &other;
  const Eigen::Quaterniond& q = beside.rotation;
  const double wxyz[] = {q.w(), q.x(), q.y(), q.z()};
  std::copy_n(wxyz, 4, right.rotation_wxyz);
  std::copy_n(beside.translation.data(), 3, right.translation_m);
  const cairn_rig_image* rig[] = {&left, &right};

  const auto map = *Map::Open(path_);
  const Camera camera = *map->CameraForSize(320, 240);
  const SensedUp up{{0.01, -2, 0.02}, 1.5};
  cairn_fix fix = CAIRN_FIX_INIT;
  const auto expect_same = [&](const Localization& expected) {
    EXPECT_EQ(fix.has_fix, expected.has_fix()) << fix.message;
    EXPECT_EQ(fix.reason, static_cast<int>(expected.reason));
    if (expected.has_fix()) {
      EXPECT_EQ(Eigen::Vector3d(fix.translation_m), expected.cam_from_world.translation);
      EXPECT_EQ(Matrix6d(fix.covariance), expected.covariance.transpose());
    }
  };
  for (const bool with_up : {false, true}) {
    SCOPED_TRACE(with_up);
    if (with_up) {
      ASSERT_EQ(cairn_localizer_sense_up(localizer, 0.01, -2, 0.02, 1.5), CAIRN_OK) << cairn_last_error();
    }
    ASSERT_EQ(cairn_localize_rig(localizer, rig, 2, nullptr, &fix), CAIRN_OK) << cairn_last_error();
    const Localization expected =
        *Localizer(map).LocalizeRig({{picture_, camera, Pose()}, {second, camera, beside}}, std::nullopt,
                                    with_up ? std::optional(up) : std::nullopt);
    ASSERT_TRUE(expected.has_fix()) << expected.message;
    EXPECT_LT(CenterErrorM(expected.cam_from_world, PosterQueryPose()), 0.05);
    expect_same(expected);
  }
  // Of one image; and only of the next.
  ASSERT_EQ(cairn_localizer_sense_up(localizer, 0.01, -2, 0.02, 1.5), CAIRN_OK);
  ASSERT_EQ(cairn_localize(localizer, &image, nullptr, nullptr, &fix), CAIRN_OK);
  expect_same(*Localizer(map).Localize(picture_, camera, std::nullopt, up));
  ASSERT_EQ(cairn_localizer_sense_up(localizer, 1, -1, 0, 1), CAIRN_OK);
  ASSERT_EQ(cairn_localize(localizer, &image, nullptr, nullptr, &fix), CAIRN_OK);
  EXPECT_EQ(fix.has_fix, 0);
  ASSERT_EQ(cairn_localize(localizer, &image, nullptr, nullptr, &fix), CAIRN_OK);
  EXPECT_EQ(fix.has_fix, 1);
  // Of an image that cannot be tried, too.
  ASSERT_EQ(cairn_localizer_sense_up(localizer, 1, -1, 0, 1), CAIRN_OK);
  cairn_image narrow = image;
  narrow.width = 300;
  EXPECT_NE(cairn_localize(localizer, &narrow, nullptr, nullptr, &fix), CAIRN_OK);
  ASSERT_EQ(cairn_localize(localizer, &image, nullptr, nullptr, &fix), CAIRN_OK);
  EXPECT_EQ(fix.has_fix, 1);
  EXPECT_STREQ(cairn_reason_name(CAIRN_OVER_BUDGET), "over_budget");
  EXPECT_STREQ(cairn_reason_name(CAIRN_OVER_BUDGET + 1), "unknown");

  const auto expect_misuse = [&](int32_t code, const char* words) {
    EXPECT_EQ(code, CAIRN_INVALID_ARGUMENT);
    EXPECT_THAT(cairn_last_error(), HasSubstr(words));
    EXPECT_EQ(fix.has_fix, 0);
  };
  expect_misuse(cairn_localize_rig(localizer, nullptr, 2, nullptr, &fix), "images is NULL");
  expect_misuse(cairn_localize_rig(localizer, rig, 0, nullptr, &fix), "num_images is 0");
  expect_misuse(cairn_localize_rig(localizer, rig, 65, nullptr, &fix), "num_images is 65");
  const cairn_rig_image* holes[] = {&left, nullptr};
  expect_misuse(cairn_localize_rig(localizer, holes, 2, nullptr, &fix), "images is NULL");
  right.rotation_wxyz[0] = 7;
  expect_misuse(cairn_localize_rig(localizer, rig, 2, nullptr, &fix), "is no pose");
  right.image = nullptr;
  expect_misuse(cairn_localize_rig(localizer, rig, 2, nullptr, &fix), "image is NULL");
  right.size = 8;
  expect_misuse(cairn_localize_rig(localizer, rig, 2, nullptr, &fix), "images->size is 8");
  expect_misuse(cairn_localizer_sense_up(localizer, 0, 0, 0, 1), "no direction");
  expect_misuse(cairn_localizer_sense_up(localizer, 0, -1, 0, std::nan("")), "sigma of nan degrees");
  EXPECT_EQ(cairn_localize_rig(nullptr, rig, 2, nullptr, &fix), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_localizer_destroy(localizer), CAIRN_OK);
}

TEST_F(CApi, LocalizerUsedByTwoThreadsAtOnceIsBusyAndStaysWhole) {
  cairn_localizer* localizer = NewLocalizer();
  const cairn_image image = Picture();
  std::atomic<int> num_fixes = 0, num_busy = 0, num_other = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      for (int repeat = 0; repeat < 10; ++repeat) {
        cairn_fix fix = CAIRN_FIX_INIT;
        const int32_t code = cairn_localize(localizer, &image, nullptr, nullptr, &fix);
        if (code == CAIRN_OK && fix.has_fix) {
          ++num_fixes;
        } else if (code == CAIRN_BUSY &&
                   std::string(cairn_last_error()).find("one per thread") != std::string::npos) {
          ++num_busy;
        } else {
          ++num_other;
        }
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_GT(num_fixes, 0);
  EXPECT_GT(num_busy, 0);
  EXPECT_EQ(num_other, 0);
  EXPECT_EQ(cairn_localizer_destroy(localizer), CAIRN_OK);
}

TEST_F(CApi, LocalizerDestroyedWhileInUseEndsItsCall) {
  const cairn_image image = Picture();
  for (int i = 0; i < 5; ++i) {
    cairn_localizer* localizer = NewLocalizer();
    int32_t code = -1;
    std::thread thread([&] {
      cairn_fix fix = CAIRN_FIX_INIT;
      code = cairn_localize(localizer, &image, nullptr, nullptr, &fix);
    });
    std::this_thread::sleep_for(std::chrono::milliseconds(2 * i));
    EXPECT_EQ(cairn_localizer_destroy(localizer), CAIRN_OK);
    thread.join();
    EXPECT_THAT(code, testing::AnyOf(CAIRN_OK, CAIRN_INVALID_ARGUMENT));
  }
}

TEST_F(CApi, ErrorsAreOfTheThreadThatMadeThem) {
  EXPECT_EQ(cairn_map_describe(nullptr, nullptr), CAIRN_INVALID_ARGUMENT);
  std::thread([] { EXPECT_STREQ(cairn_last_error(), ""); }).join();
  EXPECT_THAT(cairn_last_error(), HasSubstr("cairn_map_describe: map is NULL"));
}

TEST_F(CApi, DamagedMapGivesTheCodeOfItsDamage) {
  const std::string bad = testing::TempDir() + "/bad.cairn";
  cairn_map* map = nullptr;
  ASSERT_TRUE(WriteFileAtomically(bad, "").ok());
  EXPECT_EQ(cairn_map_open(bad.c_str(), nullptr, &map), CAIRN_EMPTY_FILE);
  ASSERT_TRUE(WriteFileAtomically(bad, "no map at all, but a text").ok());
  EXPECT_EQ(cairn_map_open(bad.c_str(), nullptr, &map), CAIRN_NOT_SQLITE);
  const std::string whole = *ReadFile(path_);
  ASSERT_TRUE(WriteFileAtomically(bad, whole.substr(0, whole.size() / 2)).ok());
  EXPECT_EQ(cairn_map_open(bad.c_str(), nullptr, &map), CAIRN_TRUNCATED);
  EXPECT_THAT(cairn_last_error(), HasSubstr("bad.cairn"));
  EXPECT_EQ(map, nullptr);
}

TEST_F(CApi, MapIsUpdatedByADeltaAndRolledBack) {
  const std::string map = testing::TempDir() + "/c_api_update.cairn",
                    delta = testing::TempDir() + "/c_api.delta";
  MapRows rows = MakePosterMap(scene_);
  rows.name = "changed";
  const std::string changed = testing::TempDir() + "/c_api_changed.cairn";
  ASSERT_TRUE(WriteMapRows(rows, changed).ok());
  ASSERT_TRUE(WriteFileAtomically(map, *ReadFile(path_)).ok());
  const auto made = MakeMapDelta(path_, changed, std::nullopt);
  ASSERT_TRUE(made.ok()) << made.error().message;
  ASSERT_TRUE(WriteFileAtomically(delta, EncodeMapDelta(*made)).ok());

  int32_t was_updated = -1;
  ASSERT_EQ(cairn_map_update(map.c_str(), delta.c_str(), nullptr, &was_updated), CAIRN_OK)
      << cairn_last_error();
  EXPECT_EQ(was_updated, 1);
  EXPECT_EQ(*ReadFile(map), *ReadFile(changed));
  ASSERT_EQ(cairn_map_update(map.c_str(), delta.c_str(), nullptr, &was_updated), CAIRN_OK);
  EXPECT_EQ(was_updated, 0);
  ASSERT_EQ(cairn_map_roll_back(map.c_str(), nullptr), CAIRN_OK) << cairn_last_error();
  EXPECT_EQ(*ReadFile(map), *ReadFile(path_));

  const std::vector<uint8_t> key(32, 7);
  cairn_map_options options = CAIRN_MAP_OPTIONS_INIT;
  options.public_key = key.data();
  EXPECT_EQ(cairn_map_update(map.c_str(), delta.c_str(), &options, nullptr), CAIRN_NOT_SIGNED);
  EXPECT_EQ(*ReadFile(map), *ReadFile(path_));
  EXPECT_EQ(cairn_map_update(nullptr, delta.c_str(), nullptr, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_map_update(map.c_str(), nullptr, nullptr, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_map_roll_back(nullptr, nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_map_roll_back("nowhere.cairn", nullptr), CAIRN_NOT_FOUND);
}

// The poster's map signed in epochs 2 and 3.
TEST_F(CApi, UpdatesGoForwardAndOpeningAsksForNameAndEpoch) {
  const std::string folder = testing::TempDir(), map = folder + "/c_api_epoch.cairn";
  const std::string second = folder + "/c_api_2.cairn", third = folder + "/c_api_3.cairn";
  const KeyPair keys = MakeKeyPair();
  ASSERT_TRUE(SignMap(path_, keys.secret_key, second, 2).ok());
  ASSERT_TRUE(SignMap(path_, keys.secret_key, third, 3).ok());
  const auto made = MakeMapDelta(third, second, keys.secret_key, /*allow_older=*/true);
  ASSERT_TRUE(made.ok()) << made.error().message;
  const std::string delta = folder + "/c_api_epoch.delta";
  ASSERT_TRUE(WriteFileAtomically(delta, EncodeMapDelta(*made)).ok());
  ASSERT_TRUE(WriteFileAtomically(map, *ReadFile(third)).ok());

  cairn_map_options options = CAIRN_MAP_OPTIONS_INIT;
  options.public_key = keys.public_key.data();
  options.name = "poster";
  options.min_epoch = 3;
  cairn_map* open = nullptr;
  ASSERT_EQ(cairn_map_open(map.c_str(), &options, &open), CAIRN_OK) << cairn_last_error();
  cairn_map_description description = CAIRN_MAP_DESCRIPTION_INIT;
  ASSERT_EQ(cairn_map_describe(open, &description), CAIRN_OK);
  EXPECT_EQ(description.epoch, 3U);
  EXPECT_EQ(cairn_map_close(open), CAIRN_OK);
  options.min_epoch = 4;
  EXPECT_EQ(cairn_map_open(map.c_str(), &options, &open), CAIRN_NOT_NEWER);
  options.min_epoch = 0;
  options.name = "wall";
  EXPECT_EQ(cairn_map_open(map.c_str(), &options, &open), CAIRN_OTHER_MAP);
  EXPECT_EQ(cairn_map_update(map.c_str(), delta.c_str(), &options, nullptr), CAIRN_OTHER_MAP);
  options.name = nullptr;
  EXPECT_EQ(cairn_map_update(map.c_str(), delta.c_str(), &options, nullptr), CAIRN_NOT_NEWER);
  options.allow_older = 2;
  EXPECT_EQ(cairn_map_update(map.c_str(), delta.c_str(), &options, nullptr), CAIRN_INVALID_ARGUMENT);
  options.allow_older = 1;
  options.min_epoch = 3;
  EXPECT_EQ(cairn_map_update(map.c_str(), delta.c_str(), &options, nullptr), CAIRN_NOT_NEWER);
  options.min_epoch = 2;
  EXPECT_EQ(cairn_map_update(map.c_str(), delta.c_str(), &options, nullptr), CAIRN_OK) << cairn_last_error();
  options.min_epoch = 4;
  EXPECT_EQ(cairn_map_roll_back(map.c_str(), &options), CAIRN_NOT_NEWER);
  options.min_epoch = 3;
  EXPECT_EQ(cairn_map_roll_back(map.c_str(), &options), CAIRN_OK) << cairn_last_error();
  EXPECT_EQ(*ReadFile(map), *ReadFile(third));
}

// The poster's map in epochs 1 and 2, each signed by two; then the first one's key leaves the ring.
TEST_F(CApi, RingOfKeysIsTrustedAndReplaced) {
  const std::string folder = testing::TempDir(), map = folder + "/c_ring.cairn",
                    delta = folder + "/c_ring.delta";
  const std::string second = folder + "/c_ring_2.cairn", ring = folder + "/c_ring",
                    next = folder + "/c_ring_next";
  const KeyPair alice = MakeKeyPair(), bob = MakeKeyPair(), carol = MakeKeyPair();
  for (const std::string& path : {map, second, delta, next}) std::filesystem::remove(SignaturesPath(path));
  ASSERT_TRUE(SignMap(path_, alice.secret_key, map, 1).ok());
  ASSERT_TRUE(SignMap(path_, alice.secret_key, second, 2).ok());
  KeyRing keys;
  keys.version = 1;
  keys.threshold = 2;
  keys.keys = {{"alice", alice.public_key}, {"bob", bob.public_key}};
  ASSERT_TRUE(WriteFileAtomically(ring, EncodeKeyRing(keys).value()).ok());

  cairn_map_options options = CAIRN_MAP_OPTIONS_INIT;
  options.key_ring = ring.c_str();
  cairn_map* open = nullptr;
  EXPECT_EQ(cairn_map_open(map.c_str(), &options, &open), CAIRN_NOT_SIGNED);
  EXPECT_NE(std::strstr(cairn_last_error(), "1 of the 2 signatures"), nullptr) << cairn_last_error();
  ASSERT_TRUE(AddMapSignature(map, bob.secret_key, SignaturesPath(map)).ok());
  ASSERT_EQ(cairn_map_open(map.c_str(), &options, &open), CAIRN_OK) << cairn_last_error();
  EXPECT_EQ(cairn_map_close(open), CAIRN_OK);
  options.public_key = alice.public_key.data();
  EXPECT_EQ(cairn_map_open(map.c_str(), &options, &open), CAIRN_INVALID_ARGUMENT);
  options.public_key = nullptr;
  options.key_ring = "nowhere.ring";
  EXPECT_EQ(cairn_map_open(map.c_str(), &options, &open), CAIRN_NOT_FOUND);
  options.key_ring = ring.c_str();

  const auto made = MakeMapDelta(map, second, alice.secret_key);
  ASSERT_TRUE(made.ok()) << made.error().message;
  ASSERT_TRUE(WriteFileAtomically(delta, EncodeMapDelta(*made)).ok());
  EXPECT_EQ(cairn_map_update(map.c_str(), delta.c_str(), &options, nullptr), CAIRN_NOT_SIGNED);
  const std::string bobs = folder + "/c_ring.bobs";
  std::filesystem::remove(bobs);
  ASSERT_TRUE(AddMapSignature(second, bob.secret_key, bobs).ok());
  options.signatures = bobs.c_str();
  ASSERT_EQ(cairn_map_update(map.c_str(), delta.c_str(), &options, nullptr), CAIRN_OK) << cairn_last_error();
  EXPECT_EQ(*ReadFile(map), *ReadFile(second));
  EXPECT_EQ(cairn_map_roll_back(map.c_str(), &options), CAIRN_OK) << cairn_last_error();
  EXPECT_EQ(cairn_map_roll_back(map.c_str(), &options), CAIRN_OK) << cairn_last_error();

  keys.version = 2;
  keys.keys[0] = {"carol", carol.public_key};
  ASSERT_TRUE(WriteFileAtomically(next, EncodeKeyRing(keys).value()).ok());
  uint64_t version = 0;
  EXPECT_EQ(cairn_key_ring_accept(ring.c_str(), next.c_str(), &version), CAIRN_WRONG_KEY);
  for (const KeyPair* key : {&alice, &bob}) ASSERT_TRUE(SignKeyRing(next, key->secret_key).ok());
  EXPECT_EQ(cairn_key_ring_accept(ring.c_str(), next.c_str(), &version), CAIRN_NOT_SIGNED);
  EXPECT_EQ(version, 0U);
  ASSERT_TRUE(SignKeyRing(next, carol.secret_key).ok());
  EXPECT_EQ(cairn_key_ring_accept(ring.c_str(), next.c_str(), &version), CAIRN_OK) << cairn_last_error();
  EXPECT_EQ(version, 2U);
  EXPECT_EQ(cairn_key_ring_accept(ring.c_str(), next.c_str(), nullptr), CAIRN_OK);  // sent twice
  EXPECT_EQ(cairn_map_open(map.c_str(), &options, &open), CAIRN_NOT_SIGNED);
  EXPECT_EQ(cairn_key_ring_accept(nullptr, next.c_str(), nullptr), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_key_ring_accept(ring.c_str(), nullptr, nullptr), CAIRN_INVALID_ARGUMENT);
}

// A program built with the first release knows neither name and epochs nor that there is more of a struct.
TEST_F(CApi, ShorterStructsOfEarlierReleasesAreEnough) {
  cairn_map_options options;
  std::memset(&options, 0xff, sizeof(options));  // what lies behind it is not looked at
  options.size = offsetof(cairn_map_options, name);
  options.memory_budget_bytes = 0;
  options.public_key = nullptr;
  cairn_map* open = nullptr;
  ASSERT_EQ(cairn_map_open(path_.c_str(), &options, &open), CAIRN_OK) << cairn_last_error();
  options.size = offsetof(cairn_map_options, name) - 1;
  cairn_map* none = nullptr;
  EXPECT_EQ(cairn_map_open(path_.c_str(), &options, &none), CAIRN_INVALID_ARGUMENT);
  cairn_map_description description;
  std::memset(&description, 0xff, sizeof(description));
  description.size = offsetof(cairn_map_description, epoch);
  ASSERT_EQ(cairn_map_describe(open, &description), CAIRN_OK) << cairn_last_error();
  EXPECT_STREQ(description.name, "poster");
  EXPECT_EQ(description.epoch, UINT64_MAX);  // nor written
  description.size = sizeof(description);
  ASSERT_EQ(cairn_map_describe(open, &description), CAIRN_OK) << cairn_last_error();
  EXPECT_EQ(description.scale_sigma_ratio, 0);  // its poses were stated
  EXPECT_EQ(description.scale_centre_m[2], 0);
  description.size = offsetof(cairn_map_description, epoch) - 1;
  EXPECT_EQ(cairn_map_describe(open, &description), CAIRN_INVALID_ARGUMENT);
  EXPECT_EQ(cairn_map_close(open), CAIRN_OK);
}

}  // namespace
}  // namespace cairn
